#include "tendril/solver/newton.hpp"

namespace tendril {
namespace {

/// Diagonal by which an indefinite Hessian is shifted: the mass of each position, and for twists a moment of the same
/// mass over the edge's length, so that both see curvature on the scale of an edge alike. Independent of units and of
/// the time step.
Planes shiftMetric(const Elements &e, const DofMap &dofs, bool dynamic) {
  Planes metric = dofs.makePlanes();
  const double *mass = e.mass(), *length = e.restLength();
  for (const RodRange &rod : e.rods) {
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) metric.setVector(0, s, Vec3::Constant(mass[s]));
    if (rod.twist)
      for (int i = 0; i < rod.edges; ++i)
        metric[3][rod.slot(i)] =
            0.5 * (mass[rod.slot(i)] + mass[rod.slot((i + 1) % rod.vertices)]) * std::pow(length[rod.slot(i)], 2);
  }
  for (const JoinedEdge &j : e.joinedEdges(dofs.all())) // as the twist of the edge
    metric.setVector(0, j.frame, Vec3::Constant(metric[3][e.rods[j.rod].slot(j.edge)]));
  // In statics what is tied to a body sees curvature as its neighbours do, however heavy the body is.
  std::vector<int> ties(e.bodyCount(), 0);
  for (const JoinedVertex &j : e.joinedVertices(dofs.all())) {
    if (dynamic || !j.isOnBody() || !j.isVertex()) continue;
    const RodRange &rod = e.rods[j.rod];
    const double beside = mass[rod.slot(j.vertex > 0 ? j.vertex - 1 : rod.closed ? rod.vertices - 1 : 1)];
    metric.setVector(0, j.slot, Vec3::Constant(0.5 * beside));
    const JoinedBody &b = e.body(j.body);
    const double arm = e.armAsDrawn(j).norm() + length[rod.slot(std::min(j.vertex, rod.edges - 1))];
    metric.setVector(0, b.rotation, metric.vector(0, b.rotation) + Vec3::Constant(0.5 * beside * arm * arm));
    ++ties[j.body];
  }
  for (const JoinedBody &b : e.bodies(dofs.all())) {
    const MassProperties &all = e.bodyMass(b.body);
    if (ties[b.body] > 0) continue;
    metric.setVector(0, b.position, Vec3::Constant(all.mass));
    metric.setVector(0, b.rotation, Vec3::Constant(all.inertia.trace() / 3));
  }
  return metric;
}

/// Beside the mass, a tension in all edges, of which the slowest wave of a string as long as the rod has the frequency
/// that the mass alone gives it: a shift of the mass alone moves what is held and what hangs on it by the same, however
/// short the edge between, and lets waves as short as edges buckle first.
std::vector<double> edgeMetric(const IncrementalPotential &potential) {
  const Elements &e = potential.elements();
  std::vector<double> metric(e.slots + lanes, 0.0);
  for (int r = 0; r < int(e.rods.size()); ++r) {
    const RodRange &rod = e.rods[r];
    int held = 0; // a rod that hangs on one place needs none: nothing presses its edges
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) held += e.freedom()[s] == 0;
    for (int i = 0; i < rod.edges && held > 1; ++i) {
      const double mass = 0.5 * (e.mass()[rod.slot(i)] + e.mass()[rod.slot((i + 1) % rod.vertices)]);
      metric[rod.slot(i)] = mass * std::pow(potential.length(r) * e.inverseRestLength()[rod.slot(i)] / pi, 2);
    }
  }
  return metric;
}

} // namespace

NewtonWork::NewtonWork(const IncrementalPotential &potential, int slots)
    : active(potential.all().end, true), shift(active.size(), 0), last_shift(shift), negative(active.size(), 0),
      zero(negative), indefinite(active.size(), false), tried(active.size()), energy(active.size()),
      energy_known(active.size(), false), residual(active.size()), moving(active.size(), false),
      standstill(active.size()), left(active.size(), 0), load_reach(active.size(), 0), load_energy(active.size(), 0),
      increment(slot_size, slots), coordinates(increment), trial(slots), motion(potential.dofs().makePlanes()),
      metric(shiftMetric(potential.elements(), potential.dofs(), potential.isDynamic())),
      edge_metric(edgeMetric(potential)) {}

void NewtonWork::setOrigin(int first_slot) {
  increment.setOrigin(first_slot);
  coordinates.setOrigin(first_slot);
  trial.setOrigin(first_slot);
  if (!kept.empty()) kept.setOrigin(first_slot);
}

} // namespace tendril
