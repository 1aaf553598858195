#include "tendril/solver/incremental_potential.hpp"

#include "tendril/energy/edge.hpp"
#include "tendril/layout/same_vertices.hpp"

#include <algorithm>
#include <map>
#include <utility>

namespace tendril {
using C = Configuration;

constexpr double epsilon = std::numeric_limits<double>::epsilon();

IncrementalPotential::IncrementalPotential(const Scene &scene, DofMap &dofs, const Elements &elements, bool dynamic)
    : scene_(scene), dofs_(dofs), elements_(elements), retraction_(elements), axial_(scene, elements),
      terms_(makeTerms(scene, elements, axial_, dynamic)), supports_(scene, dofs, elements), start_(elements.slots),
      known_(elements.rods.size(), Known::nothing), scales_(rodScales(scene, elements)),
      obstacles_move_(scene.collidersMove()), obstacles_held_(scene.rods.size(), false) {}

void IncrementalPotential::beginStep(const State &start, const Step &step) {
  start_time_ = start.time;
  step_ = step;
  setSupports(scene_, elements_, start.time, start_);
  if (iterate_.empty()) iterate_ = start_;
  if (!step.isStatic() && !step.rule) {
    euler_ = backwardEuler(start, step.dt);
    step_.rule = &euler_;
  }
  const bool carries = step_.rule && step_.rule->carries_frames;
  if (carries && reference_.empty()) reference_ = start_;
  step_.twist_reference = carries ? &reference_ : nullptr;
  supports_.turn(start_, start_time_, step_.time);
  retraction_.setInverseTimeSquared(step.isStatic() ? 0 : 1 / (step.dt * step.dt));
}

void IncrementalPotential::beginRod(const State &start, int r) {
  setRod(start, elements_, r, start_);
  iterate_.copyRod(elements_, r, start_);
  if (step_.twist_reference) carryFrames(*step_.rule, elements_, r, start_, reference_);
  axial_.beginStep(start_, step_, r);
  for (auto &term : terms_) term->beginStep(start, start_, step_, r);
  if (obstacles_move_) moveObstacles(r);
  supports_.follow(r, iterate_);
  scales_[r].force = tendril::forceScale(scene_, elements_, step_, start, scales_[r], r);
  known(r) = Known::nothing;
}

void IncrementalPotential::setLoadFactor(double factor) {
  step_.load_factor = step_.time = factor;
  for (auto &term : terms_) term->setLoadFactor(factor);
  std::fill(known_.begin(), known_.end(), Known::nothing);
}

/// Largest coordinate of a rod's vertices [m].
double IncrementalPotential::reachOf(const Configuration &c, const RodRange &rod) const {
  using std::abs;
  Pack reach(0.0);
  for (int a = 0; a < 3; ++a)
    for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes)
      reach = max(reach, abs(read<Pack>(c[C::Plane(C::position + a)] + s)));
  return hmax(reach);
}

/// How much stiffer than at rest the steepest cell of a rod is: near 180 degrees of fold or twist the measure `tan`
/// grows without bound, with the square of its slope 1/cos^2 of half the angle, and so does what rounding leaves in
/// forces.
double IncrementalPotential::steepnessOf(const Configuration &c, int r) const {
  if (elements_.measure[r] != Measure::tan) return 1;
  double flattest = 1;
  forCells(elements_, r, [&]<class T>(const LooseCell &cell, int count) {
    const auto [f0, f1] = cellFrames<T>(c, cell, count);
    const T turning = T(0.5) * (T(1.0) + f0.tangent.dot(f1.tangent)); // cos^2 of half
    T twist = cosine(T(read<T>(c[C::twist] + cell.slot)));
    if constexpr (std::is_same_v<T, Pack>) {
      twist = select(firstLanes(count), twist, Pack(1.0));
      flattest = std::min(flattest, hmin(min(turning, T(Pack(0.5) * (Pack(1.0) + twist)))));
    } else
      flattest = std::min({flattest, turning, 0.5 * (1 + twist)});
  });
  return 1 / std::max(flattest * flattest, epsilon);
}

/// Edges carry an error of delta = epsilon in their length and direction: each costs (force + stiffness delta) delta of
/// energy per length. On top of it comes the rounding of the sums.
IncrementalPotential::RodEnergy IncrementalPotential::rodEnergy(const Configuration &c, int r) const {
  using std::abs;
  const RodRange &rod = elements_.rods[r];
  const double reach = reachOf(c, rod), steepness = steepnessOf(c, r),
               blur = edgeError(reach, scales_[r].shortest_edge);
  Pack stretching(0.0);
  for (int i = rod.first_slot; i < rod.edgeEnd(); i += lanes) {
    const Pack stiffness = read<Pack>(axial_.stiffness() + i);
    const Pack force = stiffness * abs(read<Pack>(c[C::strain] + i) - read<Pack>(axial_.rest() + i));
    stretching += (force + stiffness * Pack(blur)) * (Pack(blur) * read<Pack>(elements_.restLength() + i));
  }
  // Edge, length, tangent and binormal each round.
  const double delta = 4 * blur, bending = scales_[r].bending * steepness;
  RodEnergy result{0, reduce(stretching), 0, reach, steepness};
  for (const auto &term : terms_) {
    const double energy = term->energy(c, r);
    result.value += energy;
    result.size += std::abs(energy);
    result.noise += 64 * epsilon * std::abs(energy);
    if (term->roundsAsStrains()) result.noise += delta * (std::sqrt(2 * std::abs(energy) * bending) + bending * delta);
    result.noise += term->noise(c, r, blur);
  }
  if (!std::isfinite(result.value)) result = {};
  return result;
}

EnergyBudget IncrementalPotential::energyBudget(const State &state, const Configuration &c, double load_factor,
                                                RodSet rods) const {
  EnergyBudget budget;
  for (int r = rods.begin; r < rods.end; ++r) {
    EnergyBudget of_rod;
    for (const auto &term : terms_) term->addEnergies(state, c, load_factor, r, of_rod);
    budget += of_rod;
  }
  return budget;
}

double IncrementalPotential::smallestGap(RodSet rods) const {
  double gap = HUGE_VAL;
  for (int r = rods.begin; r < rods.end; ++r)
    for (const auto &term : terms_) gap = std::min(gap, term->smallestGap(iterate_, r));
  return gap;
}

double IncrementalPotential::changeOfPressure(int r, const Planes &increment) const {
  double force = scales_[r].force, change = 0;
  for (const auto &term : terms_) {
    const auto [pressing, changing] = term->pressure(iterate_, increment, r);
    force = std::max(force, pressing);
    change += changing;
  }
  return change / force;
}

double IncrementalPotential::energy(const Configuration &configuration, RodSet rods) const {
  double sum = 0;
  for (int r = rods.begin; r < rods.end; ++r) sum += rodEnergy(configuration, r).value;
  return sum;
}

void IncrementalPotential::assemble(RodSet islands, HessianKind hessian) {
  for (int r = islands.begin; r < islands.end; ++r) {
    assembleRod(r, hessian);
    known(r) = hessian == HessianKind::none ? Known::gradient : Known::all;
  }
  dofs_.foldJoined(islands, derivatives_.gradient);
  dofs_.foldJoined(islands, derivatives_.equilibrium);
}

void IncrementalPotential::assembleRod(int r, HessianKind hessian) {
  if (r < focus_.begin || r >= focus_.end) focus(all());
  const RodRange &rod = elements_.rods[r];
  Derivatives &d = derivatives_;
  for (int a = 0; a < slot_size; ++a)
    for (Planes *p : {&d.gradient, &d.equilibrium})
      std::fill((*p)[a] + rod.first_slot - 1, (*p)[a] + rod.first_slot + rod.slots - 1, 0.0);
  if (hessian != HessianKind::none) d.blocks.clear(rod);
  for (const auto &term : terms_) term->addDerivatives(iterate_, r, d, hessian);
  for (int a = 0; a < slot_size; ++a)
    for (int s = rod.first_slot; s < rod.vertexEnd() + 2; s += lanes)
      addTo(d.gradient[a] + s, read<Pack>(d.equilibrium[a] + s));
  for (const JoinedEdge &j : elements_.joinedEdges({r, r + 1}))
    d.gradient.setVector(0, j.frame, d.equilibrium.vector(0, j.frame));
  dofs_.fold(rod, d.gradient);
  dofs_.fold(rod, d.equilibrium);
  if (hessian != HessianKind::none) d.blocks.fold(rod);
}

void IncrementalPotential::focus(RodSet rods) {
  if (rods.begin == focus_.begin && rods.end == focus_.end) return;
  std::fill(known_.begin() + focus_.begin, known_.begin() + focus_.end, Known::nothing);
  focus_ = rods;
  if (dofs_.slots(rods) > workspace_slots_) {
    workspace_slots_ = dofs_.slots(rods);
    derivatives_ = Derivatives(workspace_slots_, joinsPositions());
  }
  derivatives_.setOrigin(elements_.rods[rods.begin].first_slot);
}

const Derivatives &IncrementalPotential::derivatives(RodSet rods) {
  for (int r = rods.begin; r < rods.end; ++r)
    if (known(r) != Known::all) assemble(dofs_.islandOf(r), step_.hessian);
  return derivatives_;
}

double IncrementalPotential::renew(int r) {
  double change = 0;
  for (auto &term : terms_) change = std::max(change, term->renew(iterate_, r));
  if (change > 0) known(r) = Known::nothing;
  return change;
}

void IncrementalPotential::addLoads(int r, Derivatives &out) const {
  for (const auto &term : terms_)
    if (term->isLoad()) term->addDerivatives(iterate_, r, out, HessianKind::none);
  dofs_.fold(elements_.rods[r], out.equilibrium);
}

const Derivatives &IncrementalPotential::gradient(int r) {
  if (known(r) == Known::nothing) assemble(dofs_.islandOf(r), HessianKind::none);
  return derivatives_;
}

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

bool IncrementalPotential::tryMove(const Planes &increment, double scale, int r, RetractionKind kind,
                                   Configuration &trial, double *free) {
  if (trial.empty()) trial = iterate_;
  trial.copyEnds(elements_, r, iterate_);
  if (obstaclesGo(r)) {
    const double now = iterate_.obstacleTime(r), part = std::clamp(scale, 0.0, 1.0);
    const double next = nextObstacleTime(r);
    trial.setObstacleTime(r, part == 1 ? next : now + part * (next - now));
  }
  if (!elements_.joinedVertices({r, r + 1}).empty()) kind = RetractionKind::additive;
  if (!retraction_.apply(iterate_, increment, scale, r, kind, trial)) return false;
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
  return most;
}

void IncrementalPotential::turnFrames(RodSet islands, Planes &increment) const {
  std::map<int, std::pair<Vec3, int>> spins; // by group
  for (const JoinedEdge &j : elements_.joinedEdges(islands)) {
    const int s = elements_.rods[j.rod].slot(j.edge);
    const Frame f = iterate_.frameAt(s);
    auto &[sum, count] = spins.try_emplace(j.group, Vec3::Zero(), 0).first->second;
    sum += f.tangent.cross(increment.vector(0, s + 1) - increment.vector(0, s)) / f.length +
           f.tangent * increment[3][s];
    ++count;
  }
  for (const JoinedEdge &j : elements_.joinedEdges(islands)) {
    const auto &[sum, count] = spins.at(j.group);
    increment.setVector(0, j.frame, sum / count);
  }
}

bool IncrementalPotential::tryMove(const Planes &increment, double scale, Configuration &trial) {
  for (int r = 0; r < all().end; r = islandOf(r).end)
    if (!tryMove(increment, scale, islandOf(r), settings.retraction, trial)) return false;
  return true;
}

void IncrementalPotential::accept(const Configuration &trial, int r) {
  iterate_.copyRod(elements_, r, trial);
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
  }
}

bool IncrementalPotential::moveTo(const Planes &x, RodSet rods, bool supports) {
  Planes now = dofs_.makePlanes(), increment = now;
  if (supports) remainingMotion(rods, increment);
  coordinates(now, rods);
  Configuration trial;
  for (int r = rods.begin; r < rods.end; ++r) {
    const RodRange &rod = elements_.rods[r];
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
      for (int a = 0; a < slot_size; ++a)
        if (dofs_.unknown(s, a) >= 0) increment[a][s] = x[a][s] - now[a][s];
    for (const JoinedEdge &j : elements_.joinedEdges({r, r + 1}))
      if (j.isFirst()) increment.setVector(0, j.frame, x.vector(0, j.frame) - now.vector(0, j.frame));
    dofs_.copyBehindRing(rod, increment);
  }
  dofs_.copyJoined(rods, increment);
  for (int r = rods.begin; r < rods.end; ++r) {
    if (dofs_.dot(dofs_.islandOf(r), increment, increment) == 0) continue;
    if (!tryMove(increment, 1.0, r, RetractionKind::additive, trial)) return false;
    accept(trial, r);
  }
  return true;
}

Residual IncrementalPotential::residual() {
  Residual worst;
  for (int r = 0; r < all().end; ++r) worst.include(residual(r, rodEnergy(iterate_, r)));
  return worst;
}

void IncrementalPotential::commit(State &state) const {
  if (step_.rule) {
    StageRates rates;
    stageRates(all(), rates);
    state.velocity = std::move(rates.velocity.vertex);
    state.twist_rate = std::move(rates.velocity.edge);
  }
  commitConfiguration(state, all());
  state.time = step_.time;
  ++state.step;
}

std::array<Vec3, 2> IncrementalPotential::actionOf(const Holder &holder) {
  std::array<Vec3, 2> action{Vec3::Zero(), Vec3::Zero()};
  const int slot = holder.support      ? elements_.support_slot[holder.index]
                   : holder.constraint ? elements_.constraint_slot[holder.index]
                                       : -1;
  for (const auto &term : terms_) {
    if (slot < 0 && !holder.collider) break;
    const std::array<Vec3, 2> of_term = holder.collider ? term->actionOfObstacle(holder.index, iterate_, holder.rod)
                                                        : term->actionFrom(slot, iterate_, holder.rod);
    for (int k : {0, 1}) action[k] += of_term[k];
  }
  if (holder.support && holder.support->holdsPosition()) {
    const Support &support = *holder.support;
    const int slot = elements_.rods[support.rod].slot(support.vertex),
              v = elements_.rods[support.rod].first_vertex + support.vertex;
    const Vec3 moved = iterate_.displacementAt(slot, start_);
    const Vec3 velocity = moved / step_.dt + step_.rule->velocity.atVertex(v),
               acceleration = (step_.rule->mass * velocity + step_.rule->acceleration.atVertex(v)) / step_.dt;
    // What methods remember of held vertices is nothing, which does not matter to them: the velocity that dissipates is
    // that of the way.
    const Vec3 astray = moved / (step_.time - start_time_) - velocity;
    action[0] = gradient(support.rod).equilibrium.vector(0, slot); // of all that is one point with it
    forSameVertices(elements_, support.rod, support.vertex, [&](int r, int vertex) {
      const double alpha = scene_.rods[r].material.mass_damping_coefficient;
      action[0] += elements_.mass()[elements_.rods[r].slot(vertex)] * (alpha * astray - acceleration);
    });
  }
  return action;
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
    if (step_.rule->fraction == 0.5) increment.setVector(0, j.frame, iterate_.positionAt(j.frame)); // as far again
  remainingMotion(all(), increment);
  for (int r = 0; r < all().end; ++r) {
    supports_.follow(r, iterate_);
    if (!tryMove(increment, 1, r, RetractionKind::additive, trial)) return false;
    if (!elements_.constraintsOf(r).empty() && !std::isfinite(rodEnergy(trial, r).value)) return false;
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
      for (const JoinedEdge &j : elements_.joinedEdges({r, r + 1})) increment.setVector(0, j.frame, Vec3::Zero());
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
