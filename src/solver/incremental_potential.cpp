#include "tendril/solver/incremental_potential.hpp"

#include "tendril/energy/edge.hpp"
#include "tendril/layout/same_vertices.hpp"
#include "tendril/state/spin_stage.hpp"

#include <algorithm>
#include <utility>

namespace tendril {
using C = Configuration;

IncrementalPotential::IncrementalPotential(const Scene &scene, DofMap &dofs, const Elements &elements, bool dynamic)
    : scene_(scene), dofs_(dofs), elements_(elements), retraction_(elements), linkage_(scene, elements),
      axial_(scene, elements), terms_(makeTerms(scene, elements, axial_, dynamic)), supports_(scene, dofs, elements),
      start_(elements.slots), known_(elements.rods.size(), Known::nothing), scales_(rodScales(scene, elements)),
      dynamic_(dynamic), couples_positions_(std::any_of(terms_.begin(), terms_.end(),
                                                        [](const auto &term) { return term->couplesPositions(); })),
      joins_positions_(
          std::any_of(terms_.begin(), terms_.end(), [](const auto &term) { return term->joinsPositions(); })),
      touches_(scene.touchesMoving() || !scene.tendons.empty()), obstacles_move_(scene.collidersMove()),
      obstacles_held_(scene.rods.size(), false) {}

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

void IncrementalPotential::placeRod(const State &start, int r) {
  setRod(start, elements_, r, start_);
  iterate_.copyRod(elements_, r, start_);
  takeArms(r);
}

void IncrementalPotential::beginRod(const State &start, int r) {
  placeRod(start, r);
  if (step_.twist_reference) carryFrames(*step_.rule, elements_, r, start_, reference_);
  axial_.beginStep(start_, step_, r);
  for (auto &term : terms_) term->beginStep(start, start_, step_, r);
  if (obstacles_move_) moveObstacles(r);
  supports_.follow(r, iterate_);
  scales_[r].force = tendril::forceScale(scene_, elements_, step_, start, scales_[r], r);
  known(r) = Known::nothing;
}

void IncrementalPotential::findTouching(const State &start, double room) {
  for (int r = 0; r < all().end; ++r) {
    placeRod(start, r);
    supports_.follow(r, iterate_);
  }
  Planes way = dofs_.makePlanes();
  remainingMotion(all(), way);
  for (int v = 0; v < elements_.vertices() && step_.rule; ++v)
    if (const int s = elements_.vertex_slot[v]; elements_.freedom()[s] != 0)
      way.setVector(0, s, step_.rule->guess.atVertex(v));
  if (step_.rule) setBodies(all(), way, [&](const JoinedBody &b) { return step_.rule->guess.ofBody(b.body); });
  std::vector<TouchingPair> pairs;
  for (auto &term : terms_) term->findTouching(start, start_, way, step_, room, pairs);
  dofs_.setTouching(std::move(pairs));
  derivatives_.blocks.setTouching(dofs_.touching().items.size());
  std::fill(known_.begin(), known_.end(), Known::nothing);
}

std::vector<Box> IncrementalPotential::roomsOf(RodSet rods) const {
  std::vector<Box> rooms;
  for (int r = rods.begin; r < rods.end; ++r)
    for (const auto &term : terms_) term->addRooms(r, rooms);
  return rooms;
}

bool IncrementalPotential::nearlyTouch(const TouchingPair &pair) const {
  return std::any_of(terms_.begin(), terms_.end(),
                     [&](const std::unique_ptr<Term> &term) { return term->nearlyTouch(pair, iterate_); });
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
  for (const TouchingPair &p : dofs_.touching(islands))
    if (hessian != HessianKind::none)
      std::fill_n(derivatives_.blocks.touching(p.number), EdgeBlocks::touching_size, 0.0);
  for (const auto &term : terms_) term->addBetween(iterate_, islands, derivatives_, hessian);
  for (const JoinedVertex &j : elements_.joinedVertices(islands)) { // forces turn with the arms that they act at
    if (!j.isOnBody() || hessian == HessianKind::none) continue;
    const JoinedBody &body = elements_.body(j.body);
    const Mat3 more = curvatureOfArm(derivatives_.equilibrium.vector(0, j.slot), dofs_.arm(j));
    const RodRange &rod = elements_.rods[body.rod];
    for (int a = 0; a < 3; ++a)
      for (int b = a; b < 3; ++b)
        derivatives_.blocks.entry(rod, EdgeBlocks::vertex(a, b))[body.rotation - rod.first_slot] += more(a, b);
  }
  dofs_.foldJoined(islands, derivatives_.gradient);
  dofs_.foldJoined(islands, derivatives_.equilibrium);
}

void IncrementalPotential::takeArms(int r) {
  for (const JoinedVertex &j : elements_.joinedVertices({r, r + 1}))
    if (j.isOnBody()) dofs_.setArm(j, iterate_.rotationAt(j.frame) * elements_.armAsDrawn(j));
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
  dofs_.forBeside({r, r + 1},
                  [&](int s) { d.gradient.setVector(0, s, d.gradient.vector(0, s) + d.equilibrium.vector(0, s)); });
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
    derivatives_.blocks.setTouching(dofs_.touching().items.size());
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
    state.body_rate = std::move(rates.velocity.body);
  }
  commitConfiguration(state, all());
  state.time = step_.time;
  ++state.step;
}

std::array<Vec3, 2> IncrementalPotential::actionOf(const Holder &holder) {
  std::array<Vec3, 2> action{Vec3::Zero(), Vec3::Zero()};
  const int slot = holder.support      ? elements_.support_slot[holder.index]
                   : holder.constraint ? elements_.constraint_slot[holder.index]
                   : holder.joint      ? elements_.pairOf(holder.index).parent(holder.drives)
                   : holder.tendon     ? elements_.tendon_slot[holder.index] + holder.place
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

} // namespace tendril
