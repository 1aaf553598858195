#include "tendril/energy/derived.hpp"

#include "tendril/energy/edge.hpp"
#include "tendril/energy/tendon.hpp"
#include "tendril/energy/term.hpp"
#include "tendril/layout/same_vertices.hpp"

#include <algorithm>
#include <map>

namespace tendril {
namespace {

/// Where a cell lies: its vertex and edges in scene order, whether it is the half cell of the edge before or behind it,
/// and whether a rod ends there.
struct CellPlace {
  enum Kind { full, before, behind } kind;
  int vertex, edge0, edge1;
  bool at_end;
};

CellPlace placeOf(const RodRange &rod, const LooseCell &cell, const CellOf<double> &constants) {
  auto wrapped = [&](int slot) { return (slot - rod.first_slot) % rod.vertices; };
  const int i = wrapped(cell.vertex);
  const CellPlace::Kind kind = constants.free[0] == 0   ? CellPlace::behind
                               : constants.free[1] == 0 ? CellPlace::before
                                                        : CellPlace::full;
  return {kind, rod.first_vertex + i, rod.first_edge + (i + rod.vertices - 1) % rod.vertices, rod.first_edge + i,
          !rod.closed && (i == 0 || i == rod.edges)};
}

/// Calls visit(frames, constants, Lbar, place, measure) for the cells of every rod.
template <class Visit> void eachCell(const Elements &elements, const Configuration &c, Visit visit) {
  for (int r = 0; r < int(elements.rods.size()); ++r)
    forCells(elements, r, [&]<class T>(const LooseCell &cells, int count) {
      for (int l = 0; l < count; ++l) {
        const LooseCell cell{cells.slot + l, cells.frame0 + l, cells.frame1 + l, cells.vertex + l};
        const CellOf<double> constants = cellOf<double>(elements.cells(), c, cell.slot);
        const double length = elements.cellLength()[cell.slot];
        if (length == 0) continue; // a clamp inside a rod: its half cells are loose
        visit(std::array{c.frameAt(cell.frame0), c.frameAt(cell.frame1)}, constants, length,
              placeOf(elements.rods[r], cell, constants), elements.measure[r]);
      }
    });
}

} // namespace

RodStrains rodStrains(const Scene &scene, const Elements &elements, const State &state, double motion_time,
                      double load_factor) {
  const Configuration c = configurationOf(state, scene, elements, motion_time);
  const std::size_t nv = state.position.size();
  RodStrains out{std::vector<Eigen::Vector2d>(nv, Eigen::Vector2d::Zero()), std::vector<double>(nv, 0.0),
                 std::vector<double>(nv, 0.0)};
  std::vector<double> length(nv, 0.0);
  for (std::size_t i = 0; i < state.director.size(); ++i) {
    const int slot = elements.edge_slot[i];
    const double strain = c[Configuration::strain][slot], half = 0.5 * elements.restLength()[slot];
    for (const int v : {elements.vertex0[i], elements.vertex1[i]}) {
      out.strain_energy_density[v] += 0.5 * elements.axialStiffness()[slot] * strain * strain * half;
      length[v] += half;
    }
  }
  eachCell(elements, c,
           [&](const std::array<Frame, 2> &f, const CellOf<double> &k, double cell_length, const CellPlace &place,
               Measure measure) {
             const std::array<double, 3> s = measure == Measure::tan ? cellStrain<Measure::tan>(f[0], f[1], k)
                                                                     : cellStrain<Measure::angle>(f[0], f[1], k);
             for (int a = 0; a < 3; ++a)
               out.strain_energy_density[place.vertex] +=
                   0.5 * k.stiffness[a] * (s[a] - k.rest[a]) * (s[a] - k.rest[a]);
             const bool bends =
                 k.stiffness[0] != 0 || k.stiffness[1] != 0; // half cells that hold the twist only do not
             if (place.kind != CellPlace::full && !place.at_end && (place.kind == CellPlace::before || !bends)) return;
             if (bends) out.curvature[place.vertex] = Eigen::Vector2d(s[0], s[1]) / cell_length;
             out.twist[place.vertex] = s[2] / cell_length;
           });
  for (std::size_t r = 0; r < elements.rods.size(); ++r)
    for (const EndCouple &end : elements.end_couples[r]) {
      const std::array<double, 3> e = endEnergy(elements, c, end, load_factor);
      const RodRange &rod = elements.rods[r];
      out.strain_energy_density[rod.first_vertex + (end.last ? rod.edges : 0)] += e[0] + e[1] + e[2];
    }
  for (std::size_t v = 0; v < nv; ++v) out.strain_energy_density[v] /= length[v];
  return out;
}

/// Forces of springs and tendons on vertices of rods, by their slots [N].
static std::map<int, Vec3> forcesThatDraw(const Scene &scene, const Elements &elements, const State &state,
                                          const Configuration &c, const std::vector<ConstraintReading> &springs,
                                          bool dynamic) {
  std::map<int, Vec3> sum;
  if (std::none_of(scene.supports.begin(), scene.supports.end(), [](const Support &s) { return s.holdsPosition(); }))
    return sum;
  auto add = [&](int slot, const Vec3 &force) { sum.try_emplace(slot, Vec3::Zero()).first->second += force; };
  for (std::size_t k = 0; k < scene.constraints.size(); ++k) {
    const Constraint &spring = scene.constraints[k];
    if (!spring.isPin()) continue;
    add(elements.rods[spring.rod].slot(spring.at), springs[k].force);
    if (spring.isTie()) add(elements.rods[spring.to_rod].slot(spring.to_vertex), -springs[k].force);
  }
  for (int k = 0; k < int(scene.tendons.size()); ++k) {
    const TendonPath path(scene, elements, k);
    const TendonReading of = readTendon(scene, elements, k, state, c, dynamic);
    const Eigen::VectorXd pull = -of.factor() * path.derivatives(c, false, of.tensions()).gradient;
    Eigen::Index first = 0;
    for (const Carrier &carrier : path.carriers()) {
      for (std::size_t v = 0; v < 2 && !carrier.isBody(); ++v)
        add(carrier.slot[v], pull.segment<3>(first + 3 * Eigen::Index(v)));
      first += Carrier::variables;
    }
  }
  return sum;
}

/// Forces in edges by their stretch.
static void setStretchForces(const Scene &scene, const Elements &elements, const State &state, const Configuration &c,
                             RodActions &out) {
  out.force.resize(state.director.size());
  for (std::size_t r = 0; r < elements.rods.size(); ++r) {
    const RodRange &rod = elements.rods[r];
    for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) {
      const int slot = elements.edge_slot[i];
      // The axial force of the state is more exact than that of the strain, but holds dissipation while the edge moves.
      const bool damped = scene.rods[r].material.stiffness_damping_coefficient != 0 &&
                          state.velocity[elements.vertex0[i]] != state.velocity[elements.vertex1[i]];
      const double axial =
          damped ? elements.axialStiffness()[slot] * c[Configuration::strain][slot] : state.axial_force[i];
      const Frame f = c.frameAt(slot);
      out.force[i] =
          stretchGradient(f, axial, strainSlope(elements.energy[r], f.length, elements.inverseRestLength()[slot]));
    }
  }
}

/// A couple acts by a pair of forces on the ends of its edge, which is not a force in the rod.
static void takeCouplesAway(const Scene &scene, const Elements &elements, const Configuration &c, double load_factor,
                            RodActions &out) {
  for (const EdgeMoment &m : scene.moments) {
    const int i = elements.rods[m.rod].first_edge + m.edge;
    const Frame f = c.frameAt(elements.edge_slot[i]);
    out.force[i] -= load_factor / f.length * m.moment.cross(f.tangent);
  }
  for (std::size_t r = 0; r < elements.rods.size(); ++r)
    for (const EndCouple &end : elements.end_couples[r]) { // what its half edge pulls is one
      const Frame f = c.frameAt(end.edge);
      out.force[elements.rods[r].first_edge + end.edge - elements.rods[r].first_slot] +=
          endPull(elements, f, end, load_factor).force * f.tangent;
    }
  for (std::size_t k = 0; k < scene.constraints.size(); ++k) {
    const Constraint &constraint = scene.constraints[k];
    if (constraint.isPin()) continue;
    const int i = elements.rods[constraint.rod].first_edge + constraint.at;
    const Frame f = c.frameAt(elements.edge_slot[i]);
    out.force[i] -= out.constraint[k].moment.cross(f.tangent) / f.length;
  }
}

/// Forces in edges and moments at vertices by bending and twist.
static void addCellActions(const Elements &elements, const Configuration &c, RodActions &out) {
  eachCell(
      elements, c,
      [&](const std::array<Frame, 2> &f, const CellOf<double> &k, double, const CellPlace &place, Measure measure) {
        const std::array<double, cell_size> d = measure == Measure::tan ? cellGradient<Measure::tan>(f[0], f[1], k)
                                                                        : cellGradient<Measure::angle>(f[0], f[1], k);
        const Vec3 by_edge0 = -Eigen::Map<const Vec3>(&d[0]), by_edge1 = Eigen::Map<const Vec3>(&d[8]);
        if (place.kind != CellPlace::behind) out.force[place.edge0] += by_edge0;
        if (place.kind != CellPlace::before) out.force[place.edge1] += by_edge1;
        if (place.kind != CellPlace::before || place.at_end) out.moment[place.vertex] += cellMoment(f[0], f[1], k, d);
      });
}

/// What rods do to the bodies that they are tied to.
static void addAttachments(const Scene &scene, const Elements &elements, const Configuration &c, RodActions &out) {
  for (const Attachment &a : scene.attachments) {
    const Rod &rod = scene.rods[a.rod];
    const RodRange &range = elements.rods[a.rod];
    Vec3 force = Vec3::Zero(), moment = force;
    if (const int after = rod.edgeAfter(a.vertex); after >= 0) force += out.force[range.first_edge + after];
    if (const int before = rod.edgeBefore(a.vertex); before >= 0) force -= out.force[range.first_edge + before];
    for (const JoinedEdge &j : elements.joinedEdges({a.rod, a.rod + 1}))
      if (j.of_body && j.vertex == a.vertex) moment -= momentOn(elements, elements.cells(), c, a.rod, j.frame);
    out.attachment.push_back(force);
    out.attachment_moment.push_back(moment);
  }
}

/// Weight, forces of the scene and centrifugal force on a vertex.
static Vec3 loadsOn(const Scene &scene, const Elements &elements, const State &state, const Configuration &c, int rod,
                    int vertex) {
  const int v = elements.rods[rod].first_vertex + vertex;
  const double mass = elements.mass()[elements.vertex_slot[v]];
  Vec3 loads = scene.rotation.matrix() * (state.position[v] - scene.rotation.centre) * mass;
  if (scene.rods[rod].gravity) loads += mass * scene.gravity;
  for (const int f : elements.forcesOf(rod))
    if (scene.forces[f].vertex == vertex) loads += scene.forces[f].force;
  for (const PlacedFollower &f : elements.followers({rod, rod + 1}))
    if (f.vertex == elements.vertex_slot[v]) loads += f.along(c.frameAt(f.edge));
  return loads;
}

RodActions rodActions(const Scene &scene, const Elements &elements, const State &state, double motion_time,
                      double load_factor, bool dynamic) {
  const Configuration c = configurationOf(state, scene, elements, motion_time);
  RodActions out;
  out.moment.assign(state.position.size(), Vec3::Zero());
  out.reaction.assign(scene.supports.size(), Vec3::Zero());
  out.reaction_moment = out.reaction;
  setStretchForces(scene, elements, state, c, out);
  for (std::size_t k = 0; k < scene.constraints.size(); ++k)
    out.constraint.push_back(readConstraint(scene, elements, int(k), state, c, dynamic));
  for (std::size_t k = 0; k < scene.joints.size(); ++k)
    out.joint.push_back(readJoint(scene, elements, int(k), state, c, dynamic));
  takeCouplesAway(scene, elements, c, load_factor, out);
  addCellActions(elements, c, out);
  addAttachments(scene, elements, c, out);
  const std::map<int, Vec3> drawing = forcesThatDraw(scene, elements, state, c, out.constraint, dynamic);
  for (std::size_t k = 0; k < scene.supports.size(); ++k) {
    const Support &support = scene.supports[k];
    if (const int frame = elements.support_slot[k]; frame >= 0)
      out.reaction_moment[k] = momentOn(elements, elements.cells(), c, support.rod, frame);
    if (!support.holdsPosition()) continue;
    Vec3 &reaction = out.reaction[k];
    forSameVertices(elements, support.rod, support.vertex, [&](int r, int vertex) {
      const Rod &rod = scene.rods[r];
      const RodRange &range = elements.rods[r];
      const int v = range.first_vertex + vertex, before = rod.edgeBefore(vertex), after = rod.edgeAfter(vertex);
      const double mass = elements.mass()[elements.vertex_slot[v]];
      const Vec3 loads = loadsOn(scene, elements, state, c, r, vertex);
      reaction += mass * rod.material.mass_damping_coefficient * state.velocity[v] - load_factor * loads;
      if (const auto drawn = drawing.find(elements.vertex_slot[v]); drawn != drawing.end()) reaction -= drawn->second;
      if (before >= 0) reaction += out.force[range.first_edge + before];
      if (after >= 0) reaction -= out.force[range.first_edge + after];
    });
  }
  return out;
}

} // namespace tendril
