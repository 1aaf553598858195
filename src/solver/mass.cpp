#include "tendril/solver/mass.hpp"

#include "tendril/solver/newton.hpp"

#include "tendril/solver/activity.hpp"

namespace tendril {

/// Inertia of a body about its centre of mass, by axes fixed in space [kg m^2].
static Mat3 inertiaAt(const IncrementalPotential &potential, const JoinedBody &b) {
  const Mat3 turned = potential.iterate().rotationAt(b.rotation);
  return turned * potential.elements().bodyMass(b.body).inertia * turned.transpose();
}

void addMass(const IncrementalPotential &potential, RodSet islands, double factor, EdgeBlocks &out) {
  const Elements &e = potential.elements();
  for (int r = islands.begin; r < islands.end; ++r) {
    const RodRange &rod = e.rods[r];
    const BlockPlanes blocks(out, rod);
    for (int a = 0; a < 3; ++a)
      for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) blocks.vertex(a, a)[s] += factor * e.mass()[s];
    for (int s = rod.first_slot; s < rod.edgeEnd() && rod.twist; ++s) blocks.own(3, 3)[s] += factor * e.twistMass()[s];
    for (const JoinedBody &b : e.bodies({r, r + 1})) {
      const Mat3 inertia = inertiaAt(potential, b);
      for (int i = 0; i < 3; ++i) {
        blocks.vertex(i, i)[b.position] += factor * e.bodyMass(b.body).mass;
        for (int j = i; j < 3; ++j) blocks.vertex(i, j)[b.rotation] += factor * inertia(i, j);
      }
    }
  }
}

void multiplyMass(const IncrementalPotential &potential, RodSet islands, const Planes &x, Planes &out) {
  const Elements &e = potential.elements();
  const DofMap &dofs = potential.dofs();
  for (int r = islands.begin; r < islands.end; ++r) {
    const RodRange &rod = e.rods[r];
    for (int a = 0; a < slot_size; ++a) {
      const double *const mass = a < 3 ? e.mass() : e.twistMass();
      for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) out[a][s] = mass[s] * x[a][s];
      std::fill(out[a] + rod.vertexEnd(), out[a] + rod.vertexEnd() + 2, 0.0);
    }
    dofs.forBeside({r, r + 1}, [&](int s) { out.setVector(0, s, Vec3::Zero()); });
    for (const JoinedBody &b : e.bodies({r, r + 1})) {
      out.setVector(0, b.position, e.bodyMass(b.body).mass * x.vector(0, b.position));
      out.setVector(0, b.rotation, inertiaAt(potential, b) * x.vector(0, b.rotation));
    }
  }
  dofs.foldJoined(islands, out);
}

constexpr double little_spin = 1e-12; // of the torsional stiffness of a rod: below what free motions are told by

int massRank(const IncrementalPotential &potential, RodSet islands) {
  const Elements &e = potential.elements();
  const DofMap &dofs = potential.dofs();
  int rank = 0;
  for (int r = islands.begin; r < islands.end; ++r) {
    const RodRange &rod = e.rods[r];
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) {
      for (int a = 0; a < 3; ++a) rank += dofs.unknown(s, a) >= 0 && e.mass()[s] > 0; // planar rods have two
      if (dofs.unknown(s, 3) >= 0 && e.twistMass()[s] > 0) ++rank;
    }
    rank += 6 * int(e.bodies({r, r + 1}).size());
  }
  return rank;
}

void NewtonSolver::multiplyMetric(Metric metric, RodSet island, const Planes &x, Planes &y) const {
  if (metric == Metric::mass) return multiplyMass(*potential_, island, x, y);
  const DofMap &dofs = potential_->dofs();
  for (int r = island.begin; r < island.end; ++r) {
    const RodRange &rod = dofs.rods()[r];
    for (int a = 0; a < slot_size; ++a) std::fill(y[a] + rod.first_slot, y[a] + rod.vertexEnd() + 2, 0.0);
    dofs.forBeside({r, r + 1}, [&](int s) { y.setVector(0, s, Vec3::Zero()); });
    addMetric(work_->metric, system_.edge_metric, rod, dofs.joins(r), 1, x, y);
    dofs.fold(rod, y);
  }
  dofs.foldJoined(island, y);
}

PetscErrorCode NewtonSolver::factorWith(Metric metric, RodSet island, double factor, int *negative) {
  bool regular;
  PetscFunctionBeginUser;
  watch().beat();
  focus();
  fill(work_->active, false);
  fill(work_->active, island, true);
  fill(work_->shift, metric == Metric::shift ? factor : 0.0);
  potential_->assemble(island, HessianKind::exact);
  PetscCall(makeMatrix());
  EdgeBlocks blocks = potential_->blocks();
  if (metric == Metric::mass) {
    addMass(*potential_, island, factor, blocks);
    // A spin that costs nothing and has no inertia has no frequency: a little stiffness at one edge tells where it is.
    for (int r = island.begin; r < island.end && potential_->elements().bodies(island).empty(); ++r) {
      const RodRange &rod = potential_->elements().rods[r];
      const Material &m = potential_->scene().rods[r].material;
      if (rod.twist && m.linear_rotational_inertia == 0)
        blocks.entry(rod, EdgeBlocks::own(3, 3))[0] += little_spin * m.torsional_stiffness / potential_->length(r);
    }
  }
  system_.blocks = &blocks;
  PetscCall(refactor());
  system_.blocks = &potential_->blocks();
  PetscCall(readInertia(&regular));
  *negative = regular && report_.zero_pivots == 0 ? report_.negative_pivots : -1;
  PetscFunctionReturn(0);
}

} // namespace tendril
