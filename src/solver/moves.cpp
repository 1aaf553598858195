/// Moves of the incremental potential's iterate: trials, and from the last stage of a step to its end.
#include "tendril/energy/edge.hpp"
#include "tendril/geometry/rotation.hpp"
#include "tendril/solver/incremental_potential.hpp"

#include <Eigen/Dense>
#include <algorithm>

#include <map>

namespace tendril {
using C = Configuration;

void IncrementalPotential::resetAxialForces(int r) {
  const RodRange &rod = elements_.rods[r];
  for (int i = rod.first_slot; i < rod.edgeEnd(); ++i)
    iterate_[C::axial_force][i] = axial_.stiffness()[i] * (iterate_[C::strain][i] - axial_.rest()[i]);
  known(r) = Known::nothing;
}

void IncrementalPotential::setAxialForces(int r, const double *force) {
  if (!step_.mixed) return;
  const RodRange &rod = elements_.rods[r];
  std::copy(force + rod.first_slot, force + rod.edgeEnd(), iterate_[C::axial_force] + rod.first_slot);
  iterate_.closeRing(rod);
  known(r) = Known::nothing;
}

void IncrementalPotential::carryTrees(RodSet island) {
  bool any = false;
  for (int r = island.begin; r < island.end && step_.isStatic(); ++r) {
    if (linkage_.trees(r).empty()) continue;
    const Planes &out_of_balance = gradient(r).equilibrium;
    for (const auto &term : terms_) any = term->carry(r, out_of_balance, iterate_) || any;
  }
  if (any) known(island.begin) = Known::nothing;
}

bool IncrementalPotential::tryMove(const Planes &increment, double scale, int r, RetractionKind kind,
                                   Configuration &trial, double *free) {
  if (trial.empty()) trial = iterate_;
  trial.copyEnds(elements_, r, iterate_);
  if (obstaclesGo(r)) {
    const double now = iterate_.obstacleTime(r), part = std::clamp(scale, 0.0, 1.0);
    const double next = nextObstacleTime(r);
    trial.setObstacleTime(r, part == 1 ? next : now + part * (next - now));
  }
  if (dofs_.isCoupled(dofs_.islandOf(r))) kind = RetractionKind::additive;
  const bool linked = linkage_.moves(r);
  if (linked) {
    // At rest nothing but what holds a mechanism limits its turns: where that is little, a linear step turns it many
    // times.
    constexpr double far = 1;
    if (!(linkage_.correct(iterate_, increment, scale, r, linked_) < far) && step_.isStatic()) return false;
    dofs_.copyBehindRing(elements_.rods[r], linked_);
  }
  if (!retraction_.apply(iterate_, linked ? linked_ : increment, linked ? 1 : scale, r, kind, trial)) return false;
  setTrialForces(increment, scale, r, kind, trial);
  const double fraction = freeFraction(iterate_, trial, r);
  if (free) *free = fraction;
  return fraction == 1;
}

bool IncrementalPotential::tryMove(const Planes &increment, double scale, RodSet island, RetractionKind kind,
                                   Configuration &trial, double *free) {
  double least = 1;
  bool possible = true;
  for (int r = island.begin; r < island.end && possible; ++r) {
    double of_rod = 1;
    possible = tryMove(increment, scale, r, kind, trial, &of_rod) || of_rod < 1;
    least = std::min(least, of_rod);
  }
  if (free) *free = least;
  return possible && least == 1;
}

void IncrementalPotential::setTrialForces(const Planes &increment, double scale, int r, RetractionKind kind,
                                          Configuration &trial) const {
  const RodRange &rod = elements_.rods[r];
  const Energy energy = elements_.energy[r];
  for (int i = rod.first_slot; i < rod.edgeEnd(); i += lanes) {
    const Pack stiffness = read<Pack>(axial_.stiffness() + i), rest = read<Pack>(axial_.rest() + i);
    if (!step_.mixed) {
      write(trial[C::axial_force] + i, Pack(stiffness * (read<Pack>(trial[C::strain] + i) - rest)));
      continue;
    }
    // dS = k (B d + c): the force the linearised strain asks for.
    const Pack inverse = read<Pack>(elements_.inverseRestLength() + i),
               force = read<Pack>(iterate_[C::axial_force] + i);
    const Vector3<Pack> de = readVector<Pack>(increment, 0, i + 1) - readVector<Pack>(increment, 0, i),
                        t = readVector<Pack>(iterate_.values(), C::tangent, i);
    const Pack length = read<Pack>(iterate_[C::length] + i);
    Pack change = length * t.dot(de);
    if (kind == RetractionKind::continued) change -= Pack(0.5) * de.squaredNorm();
    if (kind == RetractionKind::kept) { // as is the force
      write(trial[C::axial_force] + i, force);
      continue;
    }
    const Pack strain =
        read<Pack>(iterate_[C::strain] + i) + change * inverse * strainSlope<Pack>(energy, length, inverse);
    write(trial[C::axial_force] + i, Pack(force + Pack(scale) * (stiffness * (strain - rest) - force)));
  }
}

double IncrementalPotential::addExcess(const Planes &increment, double scale, const Configuration &trial, int r,
                                       Planes &force) const {
  const RodRange &rod = elements_.rods[r];
  double most = 0;
  for (int i = rod.first_slot; i < rod.edgeEnd(); ++i) {
    const Frame before = iterate_.frameAt(i), now = trial.frameAt(i);
    const Vec3 de = increment.vector(0, i + 1) - increment.vector(0, i);
    const double inverse = elements_.inverseRestLength()[i],
                 excess = now.length - (before.length + scale * before.tangent.dot(de)),
                 slope = before.length * inverse * strainSlope(elements_.energy[r], before.length, inverse);
    const Vec3 pull = axial_.stiffness()[i] / inverse * slope * slope * excess * before.tangent;
    force.setVector(0, i, force.vector(0, i) - pull);
    force.setVector(0, i + 1, force.vector(0, i + 1) + pull);
    most = std::max(most, std::abs(excess) * inverse);
  }
  for (const Tie &t : elements_.ties({r, r + 1})) { // points of bodies go on circles
    if (!t.isToBody()) continue;
    const Vec3 linear = iterate_.displacements<double>(t.slot, iterate_, t.copy) +
                        scale * (increment.vector(0, t.slot) - increment.vector(0, t.copy)),
               excess = trial.displacements<double>(t.slot, trial, t.copy) - linear,
               pull = scene_.constraints[t.constraint].stiffness * excess;
    force.setVector(0, t.slot, force.vector(0, t.slot) + pull);
    force.setVector(0, t.copy, force.vector(0, t.copy) - pull);
    most = std::max(most, excess.norm() / scales_[r].shortest_edge);
  }
  for (const auto &term : terms_) most = std::max(most, term->addExcess(iterate_, increment, scale, trial, r, force));
  return most;
}

/// A frame without mass turns so that the moments of its half cells stay in balance: by the mean of the spins of its
/// edges, each with the stiffness of its half cell.
void IncrementalPotential::turnFrames(RodSet islands, Planes &increment) const {
  std::map<int, std::pair<Mat3, Vec3>> of_group;
  for (const JoinedEdge &j : elements_.joinedEdges(islands)) {
    if (j.of_body) continue;
    const int s = elements_.rods[j.rod].slot(j.edge);
    const Frame f = iterate_.frameAt(s);
    Mat3 axes;
    axes << f.director, f.secondDirector(), f.tangent;
    Vec3 stiffness;
    for (int k = 0; k < 3; ++k) stiffness[k] = elements_.cells()[cell_stiffness + k][j.cell];
    stiffness.array() += 1e-6 * stiffness.sum(); // about an axis that none bears
    const Mat3 of_edge = axes * stiffness.asDiagonal() * axes.transpose();
    const Vec3 spin =
        f.tangent.cross(increment.vector(0, s + 1) - increment.vector(0, s)) / f.length + f.tangent * increment[3][s];
    auto &[sum, moment] = of_group.try_emplace(j.group, Mat3::Zero(), Vec3::Zero()).first->second;
    sum += of_edge;
    moment += of_edge * spin;
  }
  for (const JoinedEdge &j : elements_.joinedEdges(islands)) {
    if (j.of_body) continue;
    const auto &[sum, moment] = of_group.at(j.group);
    increment.setVector(0, j.frame, sum.ldlt().solve(moment));
  }
}

bool IncrementalPotential::tryMove(const Planes &increment, double scale, Configuration &trial) {
  for (int r = 0; r < all().end; r = islandOf(r).end)
    if (!tryMove(increment, scale, islandOf(r), settings.retraction, trial)) return false;
  return true;
}

void IncrementalPotential::accept(const Configuration &trial, int r) {
  iterate_.copyRod(elements_, r, trial);
  takeArms(r);
  for (auto &term : terms_) term->moveIterate(iterate_, r);
  known(r) = Known::nothing;
}

void IncrementalPotential::accept(const Configuration &trial) {
  for (int r = 0; r < all().end; ++r) accept(trial, r);
}

void IncrementalPotential::coordinates(Planes &x, RodSet rods) const {
  if (x.size() == 0) x = dofs_.makePlanes();
  for (int r = rods.begin; r < rods.end; ++r) {
    const RodRange &rod = elements_.rods[r];
    for (int a = 0; a < 3; ++a) {
      const double *now = iterate_[C::Plane(C::position + a)], *before = start_[C::Plane(C::position + a)];
      const double *low = iterate_[C::Plane(C::position_low + a)], *low_before = start_[C::Plane(C::position_low + a)];
      for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) x[a][s] = (now[s] - before[s]) + (low[s] - low_before[s]);
    }
    if (rod.twist)
      std::copy(iterate_[C::spin] + rod.first_slot, iterate_[C::spin] + rod.edgeEnd(), x[3] + rod.first_slot);
    for (const JoinedEdge &j : elements_.joinedEdges({r, r + 1})) x.setVector(0, j.frame, iterate_.positionAt(j.frame));
    for (const JoinedBody &b : elements_.bodies({r, r + 1})) {
      x.setVector(0, b.position, iterate_.displacementAt(b.position, start_));
      x.setVector(0, b.rotation, iterate_.positionAt(b.rotation));
    }
  }
}

bool IncrementalPotential::moveTo(const Planes &x, RodSet rods, Configuration &trial, bool supports) {
  Planes now = dofs_.makePlanes(rods), increment = now;
  if (supports) remainingMotion(rods, increment);
  coordinates(now, rods);
  for (int r = rods.begin; r < rods.end; ++r) {
    const RodRange &rod = elements_.rods[r];
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
      for (int a = 0; a < slot_size; ++a)
        if (dofs_.unknown(s, a) >= 0) increment[a][s] = x[a][s] - now[a][s];
    for (const JoinedEdge &j : elements_.joinedEdges({r, r + 1}))
      if (j.isFirst()) increment.setVector(0, j.frame, x.vector(0, j.frame) - now.vector(0, j.frame));
    for (const JoinedBody &b : elements_.bodies({r, r + 1}))
      for (const int s : {b.position, b.rotation}) increment.setVector(0, s, x.vector(0, s) - now.vector(0, s));
    dofs_.copyBehindRing(rod, increment);
  }
  dofs_.copyJoined(rods, increment);
  for (int begin = rods.begin; begin < rods.end; begin = dofs_.islandOf(begin).end) {
    const RodSet island = dofs_.islandOf(begin);
    if (dofs_.dot(island, increment, increment) == 0) continue;
    if (!tryMove(increment, 1.0, island, RetractionKind::additive, trial)) return false;
    for (int r = island.begin; r < island.end; ++r) accept(trial, r);
  }
  return true;
}

/// From the middle of a step an edge at the start, in the middle and at the end lies in one plane, so that the minimal
/// rotations of the two halves make up that of the whole step: its spin over the step is twice that over its half, with
/// no holonomy between. Where the guess goes along a curve, the spin is measured from the frames carried along it, by a
/// second move.
bool IncrementalPotential::moveOn(double time, const StageRule &end) {
  Planes increment = dofs_.makePlanes();
  Configuration trial;
  const double middle = step_.time;
  step_.time = time;
  supports_.turn(iterate_, middle, step_.time);
  for (int r = 0; r < all().end; ++r) {
    const RodRange &rod = elements_.rods[r];
    for (int i = 0; i < rod.vertices; ++i)
      increment.setVector(0, rod.slot(i),
                          end.guess.atVertex(rod.first_vertex + i) - iterate_.displacementAt(rod.slot(i), start_));
    for (int i = 0; rod.twist && i < rod.edges; i += lanes) {
      const Pack spun = spinOver(twistReference(), iterate_, rod.slot(i));
      for (int l = 0; l < std::min(lanes, rod.edges - i); ++l)
        increment[3][rod.slot(i + l)] = end.guess.atEdge(rod.first_edge + i + l) - spun[l];
    }
    dofs_.copyBehindRing(rod, increment);
  }
  turnFrames(all(), increment);
  for (const JoinedEdge &j : elements_.joinedEdges(all()))
    if (step_.rule->fraction == 0.5 && !j.of_body)
      increment.setVector(0, j.frame, iterate_.positionAt(j.frame)); // as far again
  setBodies(all(), increment, [&](const JoinedBody &b) {
    BodyRate moved = end.guess.ofBody(b.body).add(-1, {iterate_.displacementAt(b.position, start_)});
    const Mat3 turned = rotationBy(moved.spin) * start_.rotationAt(b.rotation);
    moved.spin = rotationBetween(iterate_.frameAt(b.rotation), {turned.col(0), turned.col(1), 1});
    return moved;
  });
  remainingMotion(all(), increment);
  for (int r = 0; r < all().end; ++r) {
    supports_.follow(r, iterate_);
    if (!tryMove(increment, 1, r, RetractionKind::additive, trial)) return false;
    if (!(elements_.constraintsOf(r).empty() && elements_.tendonsOf(r).empty()) &&
        !std::isfinite(rodEnergy(trial, r).value))
      return false;
    accept(trial, r);
    const RodRange &rod = elements_.rods[r];
    if (rod.twist && !end.halfway.empty()) {
      carryFrames(end, elements_, r, start_, reference_);
      for (int i = 0; i < rod.vertices; ++i) increment.setVector(0, rod.slot(i), Vec3::Zero());
      for (int i = 0; i < rod.edges; i += lanes) {
        const Pack spun = spinOver(reference_, iterate_, rod.slot(i));
        for (int l = 0; l < std::min(lanes, rod.edges - i); ++l)
          increment[3][rod.slot(i + l)] = end.guess.atEdge(rod.first_edge + i + l) - spun[l];
      }
      dofs_.forBeside({r, r + 1}, [&](int s) { increment.setVector(0, s, Vec3::Zero()); });
      dofs_.copyBehindRing(rod, increment);
      if (!tryMove(increment, 1, r, RetractionKind::additive, trial)) return false;
      accept(trial, r);
    }
    for (int s = rod.first_slot; s < rod.edgeEnd(); ++s)
      iterate_[C::axial_force][s] = elements_.axialStiffness()[s] * iterate_[C::strain][s];
  }
  return supports_.beyondBarrier().empty();
}

} // namespace tendril
