#include "tendril/state/commit.hpp"

namespace tendril {

using C = Configuration;

void commitChords(const Elements &elements, const Configuration &start, const Configuration &iterate, double dt,
                  RodSet rods, State &state) {
  for (int r = rods.begin; r < rods.end; ++r) {
    const RodRange &rod = elements.rods[r];
    const double rate = 1 / dt;
    for (int a = 0; a < 3; ++a) { // plane by plane
      const double *now = iterate[C::Plane(C::position + a)] + rod.first_slot,
                   *before = start[C::Plane(C::position + a)] + rod.first_slot;
      const double *low = iterate[C::Plane(C::position_low + a)] + rod.first_slot,
                   *low_before = start[C::Plane(C::position_low + a)] + rod.first_slot;
      for (int i = 0; i < rod.vertices; ++i)
        state.velocity[rod.first_vertex + i][a] = ((now[i] - before[i]) + (low[i] - low_before[i])) * rate;
    }
    for (int i = 0; i < rod.edges; i += lanes) {
      const Pack spun = spinOver(start, iterate, rod.slot(i)) * Pack(rate);
      for (int l = 0; l < std::min(lanes, rod.edges - i); ++l) state.twist_rate[rod.first_edge + i + l] = spun[l];
    }
  }
}

[[gnu::flatten]] void commitConfiguration(const Elements &elements, const Configuration &iterate, RodSet rods,
                                          State &state) {
  for (int r = rods.begin; r < rods.end; ++r) {
    const RodRange &rod = elements.rods[r];
    for (int n = elements.rod_cells[r]; n < elements.rod_cells[r + 1]; ++n)
      state.turns[n] = iterate[C::turns][elements.cell_slot[n]];
    for (int a = 0; a < 3; ++a) { // plane by plane
      const double *high = iterate[C::Plane(C::position + a)] + rod.first_slot,
                   *low = iterate[C::Plane(C::position_low + a)] + rod.first_slot;
      for (int i = 0; i < rod.vertices; ++i) {
        state.position[rod.first_vertex + i][a] = high[i];
        state.position_low[rod.first_vertex + i][a] = low[i];
      }
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
  }
}

[[gnu::flatten]] StageRates stageRates(const Elements &elements, const Configuration &start,
                                       const Configuration &twist_reference, const Configuration &iterate, double dt,
                                       const StageRule &rule) {
  StageRates rates;
  for (Rates *part : {&rates.displacement, &rates.velocity, &rates.acceleration}) {
    part->vertex.resize(elements.vertices());
    part->edge.resize(elements.edges());
  }
  const double rate = 1 / dt;
  for (const RodRange &rod : elements.rods) {
    for (int i = 0; i < rod.vertices; ++i) {
      const int v = rod.first_vertex + i;
      const Vec3 d = iterate.displacementAt(rod.slot(i), start), velocity = d * rate + rule.velocity.atVertex(v);
      rates.displacement.vertex[v] = d;
      rates.velocity.vertex[v] = velocity;
      rates.acceleration.vertex[v] = (rule.mass * velocity + rule.acceleration.atVertex(v)) * rate;
    }
    for (int i = 0; i < rod.edges; i += lanes) {
      const Pack spun = spinOver(twist_reference, iterate, rod.slot(i));
      for (int l = 0; l < std::min(lanes, rod.edges - i); ++l) {
        const int e = rod.first_edge + i + l;
        const double d = spun[l], velocity = d * rate + rule.velocity.atEdge(e);
        rates.displacement.edge[e] = d;
        rates.velocity.edge[e] = velocity;
        rates.acceleration.edge[e] = (rule.mass * velocity + rule.acceleration.atEdge(e)) * rate;
      }
    }
  }
  return rates;
}

} // namespace tendril
