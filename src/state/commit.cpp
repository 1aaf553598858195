#include "tendril/state/commit.hpp"

#include "tendril/geometry/rotation.hpp"
#include "tendril/state/spin_stage.hpp"

namespace tendril {

using C = Configuration;

namespace {

/// Directors of a rod in space whose twists are no unknowns: it is twisted nowhere, so they go from edge to edge by the
/// minimal rotation, and by the twist at rest. They begin at the end that holds them, or at the first edge, whose own
/// has gone with it.
void spreadDirectors(const Elements &elements, const C &c, int r, State &state) {
  const RodRange &rod = elements.rods[r];
  const bool first = elements.cell_begin[r] == rod.slot(0), last = elements.cell_end[r] > rod.slot(rod.edges);
  auto angle = [&](int slot) {
    const double strain = elements.cells()[cell_rest + 2][slot];
    return elements.measure[r] == Measure::tan ? 2 * std::atan(strain / 2) : strain;
  };
  auto tangent = [&](int i) { return c.frameAt(rod.slot(i)).tangent; };
  auto director = [&](int i) -> Vec3 & { return state.director[rod.first_edge + i]; };
  if (!first && last) {
    Vec3 d = c.frameAt(rod.slot(rod.edges)).director;
    for (int i = rod.edges - 1; i >= 0; --i) {
      d = rotateAbout<double>(d, tangent(i + 1), -angle(rod.slot(i + 1)));
      d = director(i) = orthonormalised(transport<double>(d, tangent(i + 1), tangent(i)), tangent(i));
    }
    return;
  }
  Vec3 d = first ? c.frameAt(rod.slot(-1)).director : director(0);
  for (int i = first ? 0 : 1; i < rod.edges; ++i) {
    d = rotateAbout<double>(transport<double>(d, tangent(i - 1), tangent(i)), tangent(i), angle(rod.slot(i)));
    d = director(i) = orthonormalised(d, tangent(i));
  }
}

} // namespace

[[gnu::flatten]] void commitConfiguration(const Elements &elements, const Configuration &iterate, RodSet rods,
                                          State &state) {
  for (int r = rods.begin; r < rods.end; ++r) {
    const RodRange &rod = elements.rods[r];
    for (int n = elements.rod_cells[r]; n < elements.rod_cells[r + 1]; ++n)
      state.winding[n] = iterate[C::winding][elements.cell_slot[n]];
    for (int a = 0; a < 3; ++a) { // plane by plane
      const double *high = iterate[C::Plane(C::position + a)] + rod.first_slot,
                   *low = iterate[C::Plane(C::position_low + a)] + rod.first_slot;
      for (int i = 0; i < rod.vertices; ++i) {
        state.position[rod.first_vertex + i][a] = high[i];
        state.position_low[rod.first_vertex + i][a] = low[i];
      }
    }
    for (const JoinedEdge &j : elements.joinedEdges({r, r + 1})) {
      if (!j.isFirst()) continue;
      const Mat3 turned = matrixOf(iterate.frameAt(j.frame)) * matrixOf(elements.frameAsDrawn(j)).transpose();
      const Vec3 x = turned.col(0).normalized();
      state.junction_axes[j.group] = {x, orthonormalised(Vec3(turned.col(1)), x)};
    }
    for (const JoinedBody &b : elements.bodies({r, r + 1})) {
      const Frame f = iterate.frameAt(b.rotation);
      state.junction_axes[b.group] = {f.tangent, orthonormalised(f.director, f.tangent)};
      state.body_position[b.body] = iterate.positionAt(b.position);
      state.body_position_low[b.body] = iterate.values().vector(C::position_low, b.position);
    }
    for (int i = 0; i < rod.edges; i += lanes) {
      const int slot = rod.slot(i), live = std::min(lanes, rod.edges - i);
      const FrameOf<Pack> f = iterate.frames<Pack>(slot);
      const Vector3<Pack> d = orthonormalised<Pack>(f.director, f.tangent);
      for (int l = 0; l < live; ++l) {
        const int e = rod.first_edge + i + l;
        state.director[e] = Vec3(d[0][l], d[1][l], d[2][l]);
        state.axial_force[e] = iterate[C::axial_force][slot + l];
      }
    }
    if (rod.isReduced() && rod.flat < 0) spreadDirectors(elements, iterate, r, state);
  }
}

[[gnu::flatten]] void stageRates(const Elements &elements, const Configuration &start,
                                 const Configuration &twist_reference, const Configuration &iterate,
                                 const StageRule &rule, RodSet rods, StageRates &out) {
  const double rate = 1 / rule.dt;
  for (Rates *part : {&out.displacement, &out.velocity, &out.acceleration}) {
    if (part == &out.acceleration && !rule.wants_accelerations) continue;
    part->vertex.resize(elements.vertices());
    part->edge.resize(elements.edges());
    part->body.resize(elements.bodyCount());
  }
  for (int r = rods.begin; r < rods.end; ++r) {
    const RodRange &rod = elements.rods[r];
    for (int a = 0; a < 3; ++a) { // plane by plane
      const double *now = iterate[C::Plane(C::position + a)] + rod.first_slot,
                   *before = start[C::Plane(C::position + a)] + rod.first_slot;
      const double *low = iterate[C::Plane(C::position_low + a)] + rod.first_slot,
                   *low_before = start[C::Plane(C::position_low + a)] + rod.first_slot;
      for (int i = 0; i < rod.vertices; ++i) {
        const double d = (now[i] - before[i]) + (low[i] - low_before[i]);
        out.displacement.vertex[rod.first_vertex + i][a] = d;
        out.velocity.vertex[rod.first_vertex + i][a] = d * rate;
      }
    }
    for (int i = 0; i < rod.edges; i += lanes) {
      const Pack d = rod.isReduced() ? Pack(0.0) : spinOver(twist_reference, iterate, rod.slot(i));
      for (int l = 0; l < std::min(lanes, rod.edges - i); ++l) {
        out.displacement.edge[rod.first_edge + i + l] = d[l];
        out.velocity.edge[rod.first_edge + i + l] = d[l] * rate;
      }
    }
  }
  const Piece piece(elements, rods);
  for (const JoinedBody &b : piece.bodies) {
    BodyRate &moved = out.displacement.body[b.body];
    moved = {iterate.displacementAt(b.position, start), turnOf(b, start, iterate), Vec3::Zero()};
    out.velocity.body[b.body] = BodyRate().add(rate, moved);
  }
  rule.velocity.addTo(1, piece, out.velocity);
  for (const JoinedBody &b : piece.bodies)
    out.velocity.body[b.body].momentum =
        spinStage(elements.bodyMass(b.body).inertia, start.rotationAt(b.rotation), rule, b.body)
            .momentum(out.displacement.body[b.body].spin);
  if (!rule.wants_accelerations) return;
  Combination().add(rule.mass * rate, out.velocity).assignTo(piece, out.acceleration);
  rule.acceleration.addTo(rate, piece, out.acceleration);
}

void settleBodies(const Elements &elements, RodSet islands, State &state) {
  for (const JoinedBody &b : elements.bodies(islands)) {
    BodyRate &rate = state.body_rate[b.body];
    const Mat3 turned = rotationOf(state, b.group);
    rate.spin = turned * elements.spinOf(b.body, turned.transpose() * rate.momentum);
  }
  for (const JoinedVertex &j : elements.joinedVertices(islands)) {
    if (!j.isOnBody() || !j.isVertex()) continue;
    const JoinedBody &b = elements.body(j.body);
    const Vec3 arm = rotationOf(state, b.group) * elements.armAsDrawn(j);
    const int v = elements.rods[j.rod].first_vertex + j.vertex;
    Vec3 &high = state.position[v], &low = state.position_low[v];
    high = state.body_position[b.body];
    low = state.body_position_low[b.body];
    for (int a = 0; a < 3; ++a) addTwoWords(high[a], low[a], arm[a]);
    state.velocity[v] = state.body_rate[b.body].translation + state.body_rate[b.body].spin.cross(arm);
  }
}

} // namespace tendril
