#include "tendril/solver/incremental_potential.hpp"

#include "tendril/energy/edge.hpp"

#include <algorithm>
#include <map>
#include <utility>

namespace tendril {
namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();

/// Rounding of an edge relative to its length: that of the edge itself, and that of the second word of positions.
double edgeError(double reach, double edge) { return epsilon * (1 + epsilon * reach / edge); }

/// Loads on each rod [N]: its weight, and the forces and couples on what is free to move.
std::vector<double> loads(const Scene &scene, const std::vector<double> &length) {
  std::vector<double> load;
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const Rod &rod = scene.rods[r];
    double s = rod.gravity ? rod.material.linear_density * length[r] * scene.gravity.norm() : 0;
    s += rod.material.linear_density * length[r] * length[r] * scene.rotation.angular_velocity.squaredNorm();
    auto held = [&](int vertex) {
      return std::any_of(scene.supports.begin(), scene.supports.end(), [&](const Support &support) {
        return support.rod == int(r) && support.vertex == vertex && support.holdsPosition();
      });
    };
    std::map<int, Vec3> force; // per vertex: forces that cancel are none
    for (const NodalForce &f : scene.forces)
      if (f.rod == int(r)) force.try_emplace(f.vertex, Vec3::Zero()).first->second += f.force;
    for (const auto &[vertex, f] : force)
      if (!held(vertex)) s += f.norm();
    for (const EdgeMoment &c : scene.moments)
      if (c.rod == int(r)) s += (std::abs(c.torque) + c.moment.norm()) / length[r];
    load.push_back(s);
  }
  return load;
}

} // namespace

using C = Configuration;

IncrementalPotential::IncrementalPotential(const Scene &scene, DofMap &dofs, const Elements &elements, bool dynamic)
    : scene_(scene), dofs_(dofs), elements_(elements), retraction_(elements), axial_(scene, elements),
      terms_(makeTerms(scene, elements, axial_, dynamic)), start_(elements.slots),
      known_(elements.rods.size(), Known::nothing) {
  for (std::size_t r = 0; r < elements.rods.size(); ++r) {
    const RodRange &rod = elements.rods[r];
    double sum = 0, shortest = HUGE_VAL, longest = 0, bending = 0, cell = HUGE_VAL;
    for (int s = rod.first_slot; s < rod.edgeEnd(); ++s) {
      sum += elements.restLength()[s];
      shortest = std::min(shortest, elements.restLength()[s]);
      longest = std::max(longest, elements.restLength()[s]);
    }
    for (int n = elements.rod_cells[r]; n < elements.rod_cells[r + 1]; ++n) {
      cell = std::min(cell, elements.cellLength()[elements.cell_slot[n]]);
      for (int k = 0; k < 3; ++k) bending += elements.cells()[cell_stiffness + k][elements.cell_slot[n]];
    }
    length_.push_back(sum);
    shortest_.push_back(shortest);
    longest_.push_back(longest);
    bending_.push_back(bending);
    shortest_cell_.push_back(cell);
  }
  load_ = loads(scene, length_);
  force_scale_.resize(load_.size());
}

void IncrementalPotential::beginStep(const State &start, const Step &step) {
  start_time_ = start.time;
  step_ = step;
  setSupports(scene_, elements_, start.time, start_);
  if (iterate_.empty()) iterate_ = start_;
  if (step.rule && reference_.empty()) reference_ = start_;
  step_.twist_reference = step.rule ? &reference_ : nullptr;
  turnSupports(start_, start_time_);
  retraction_.setInverseTimeSquared(step.isStatic() ? 0 : 1 / (step.dt * step.dt));
}

void IncrementalPotential::beginRod(const State &start, int r) {
  setRod(start, elements_, r, start_);
  iterate_.copyRod(elements_, r, start_);
  if (step_.rule) carryFrames(*step_.rule, elements_, r, start_, reference_);
  axial_.beginStep(start_, step_, r);
  for (auto &term : terms_) term->beginStep(start, start_, step_, r);
  followSupports(r);
  force_scale_[r] = forceScale(start, r);
  known_[r] = Known::nothing;
}

void IncrementalPotential::setLoadFactor(double factor) {
  step_.load_factor = step_.time = factor;
  for (auto &term : terms_) term->setLoadFactor(factor);
  std::fill(known_.begin(), known_.end(), Known::nothing);
}

/// The force that measures a rod's residual: its loads. A rod without any is measured by the force that deforms it,
/// the smallest of EI/L^2, GJ/L^2 and 1e-4 EA, or, where that is smaller, by the force that would stop it within the
/// step.
double IncrementalPotential::forceScale(const State &start, int r) const {
  if (load_[r] > 0) return load_[r];
  const Material &m = scene_.rods[r].material;
  const RodRange &rod = elements_.rods[r];
  double softest = 1e-4 * m.axial_stiffness * length_[r] * length_[r];
  if (!m.isCable())
    for (const double k : {m.flexural_stiffness[0], m.flexural_stiffness[1], m.torsional_stiffness})
      if (k > 0) softest = std::min(softest, k);
  const double scale = softest / (length_[r] * length_[r]);
  if (step_.isStatic()) return scale;
  double momentum = 0;
  for (int i = 0; i < rod.vertices; ++i)
    momentum += elements_.mass()[rod.slot(i)] * start.velocity[rod.first_vertex + i].norm();
  return momentum > 0 ? std::min(scale, momentum / step_.dt) : scale;
}

/// Supports' frames to the time of the step.
void IncrementalPotential::turnSupports(const Configuration &from, double from_time) {
  beyond_barrier_ = false;
  turned_.clear();
  for (std::size_t s = 0; s < scene_.supports.size(); ++s) {
    const int slot = elements_.support_slot[s];
    const Motion &motion = scene_.supports[s].motion;
    if (slot < 0 || !motion.moves()) continue;
    Turned turned{scene_.supports[s].rod, slot, 0.0, from.frameAt(slot)};
    // In parts of less than half a radian, so that whole turns within the step are counted.
    const int parts = 1 + int(2 * (motion.rotationVectorAt(step_.time) - motion.rotationVectorAt(from_time)).norm());
    for (int k = 1; k <= parts; ++k) {
      const double time = k == parts ? step_.time : from_time + (step_.time - from_time) * k / parts;
      const Frame now = supportFrame(scene_.supports[s], time);
      turned.angle += halfAngleBetween(turned.end, now).angle();
      turned.end = now;
    }
    turned_.push_back(turned);
  }
}

/// Turned frames of a rod's supports; whole turns of its twist angles follow.
void IncrementalPotential::followSupports(int r) {
  bool any = false;
  for (const Turned &turned : turned_) {
    if (turned.rod != r) continue;
    iterate_.setFrame(turned.slot, turned.end);
    any = true;
  }
  if (!any) return;
  auto turning = [&](int frame) {
    for (const Turned &turned : turned_)
      if (turned.slot == frame) return turned.angle;
    return 0.0;
  };
  forCells(elements_, r, [&]<class T>(const LooseCell &cells, int count) {
    for (int l = 0; l < count; ++l) {
      const LooseCell cell{cells.slot + l, cells.frame0 + l, cells.frame1 + l, cells.vertex + l};
      double &twist = iterate_[C::twist][cell.slot], &turns = iterate_[C::turns][cell.slot];
      const double expected = twist + turning(cell.frame1) - turning(cell.frame0);
      const double principal = halfAngleBetween(iterate_.frameAt(cell.frame0), iterate_.frameAt(cell.frame1)).angle();
      turns = 2 * pi * std::round((expected - principal) / (2 * pi));
      twist = principal + turns;
      beyond_barrier_ = beyond_barrier_ || (elements_.measure[r] == Measure::tan && turns != 0);
    }
  });
}

bool IncrementalPotential::remainingMotion(RodSet rods, Planes &increment) const {
  bool any = false;
  for (const Support &s : scene_.supports) {
    if (s.rod < rods.begin || s.rod >= rods.end || !s.holdsPosition() || !s.motion.moves()) continue;
    const RodRange &rod = elements_.rods[s.rod];
    const int slot = rod.slot(s.vertex);
    const Vec3 target = scene_.rods[s.rod].position[s.vertex] + s.motion.displacementAt(step_.time);
    Vec3 d = (target - iterate_.positionAt(slot)) - iterate_.values().vector(C::position_low, slot);
    if (d.norm() <= 4 * epsilon * target.norm()) d.setZero();
    any = any || !d.isZero(0);
    increment.setVector(0, slot, d);
    dofs_.copyBehindRing(rod, increment);
  }
  return any;
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
  const double reach = reachOf(c, rod), steepness = steepnessOf(c, r), blur = edgeError(reach, shortest_[r]);
  Pack stretching(0.0);
  for (int i = rod.first_slot; i < rod.edgeEnd(); i += lanes) {
    const Pack stiffness = read<Pack>(axial_.stiffness() + i);
    const Pack force = stiffness * abs(read<Pack>(c[C::strain] + i) - read<Pack>(axial_.rest() + i));
    stretching += (force + stiffness * Pack(blur)) * (Pack(blur) * read<Pack>(elements_.restLength() + i));
  }
  // Edge, length, tangent and binormal each round.
  const double delta = 4 * blur, bending = bending_[r] * steepness;
  RodEnergy result{0, reduce(stretching), 0, reach, steepness};
  for (const auto &term : terms_) {
    const double energy = term->energy(c, r);
    result.value += energy;
    result.size += std::abs(energy);
    result.noise +=
        64 * epsilon * std::abs(energy) + delta * (std::sqrt(2 * std::abs(energy) * bending) + bending * delta);
  }
  if (!std::isfinite(result.value)) result = {};
  return result;
}

double IncrementalPotential::energy(const Configuration &configuration, RodSet rods) const {
  double sum = 0;
  for (int r = rods.begin; r < rods.end; ++r) sum += rodEnergy(configuration, r).value;
  return sum;
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
  dofs_.fold(rod, d.gradient);
  dofs_.fold(rod, d.equilibrium);
  if (hessian != HessianKind::none) d.blocks.fold(rod);
  known_[r] = hessian == HessianKind::none ? Known::gradient : Known::all;
}

void IncrementalPotential::focus(RodSet rods) {
  if (rods.begin == focus_.begin && rods.end == focus_.end) return;
  std::fill(known_.begin() + focus_.begin, known_.begin() + focus_.end, Known::nothing);
  focus_ = rods;
  if (dofs_.slots(rods) > room_) {
    room_ = dofs_.slots(rods);
    derivatives_ = Derivatives(room_);
  }
  derivatives_.setOrigin(elements_.rods[rods.begin].first_slot);
}

const Derivatives &IncrementalPotential::derivatives(RodSet rods) {
  for (int r = rods.begin; r < rods.end; ++r)
    if (known_[r] != Known::all) assembleRod(r, step_.hessian);
  return derivatives_;
}

void IncrementalPotential::addLoads(int r, Derivatives &out) const {
  for (const auto &term : terms_)
    if (term->isLoad()) term->addDerivatives(iterate_, r, out, HessianKind::none);
  dofs_.fold(elements_.rods[r], out.equilibrium);
}

const Derivatives &IncrementalPotential::gradient(int r) {
  if (known_[r] == Known::nothing) assembleRod(r, HessianKind::none);
  return derivatives_;
}

void IncrementalPotential::resetAxialForces(int r) {
  const RodRange &rod = elements_.rods[r];
  for (int i = rod.first_slot; i < rod.edgeEnd(); ++i)
    iterate_[C::axial_force][i] = axial_.stiffness()[i] * (iterate_[C::strain][i] - axial_.rest()[i]);
  known_[r] = Known::nothing;
}

void IncrementalPotential::setAxialForces(int r, const double *force) {
  if (!step_.mixed) return;
  const RodRange &rod = elements_.rods[r];
  std::copy(force + rod.first_slot, force + rod.edgeEnd(), iterate_[C::axial_force] + rod.first_slot);
  iterate_.closeRing(rod);
  known_[r] = Known::nothing;
}

bool IncrementalPotential::tryMove(const Planes &increment, double scale, int r, RetractionKind kind,
                                   Configuration &trial) {
  if (trial.empty()) trial = iterate_;
  trial.copyEnds(elements_, r, iterate_);
  if (!retraction_.apply(iterate_, increment, scale, r, kind, trial)) return false;
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
  return true;
}

bool IncrementalPotential::tryMove(const Planes &increment, double scale, Configuration &trial) {
  for (int r = 0; r < all().end; ++r)
    if (!tryMove(increment, scale, r, trial)) return false;
  return true;
}

void IncrementalPotential::accept(const Configuration &trial, int r) {
  iterate_.copyRod(elements_, r, trial);
  for (auto &term : terms_) term->moveIterate(iterate_, r);
  known_[r] = Known::nothing;
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
  }
}

void IncrementalPotential::moveTo(const Planes &x, RodSet rods, bool supports) {
  Planes now = dofs_.makePlanes(), increment = now;
  if (supports) remainingMotion(rods, increment);
  coordinates(now, rods);
  Configuration trial;
  for (int r = rods.begin; r < rods.end; ++r) {
    const RodRange &rod = elements_.rods[r];
    bool moves = false;
    for (int s = rod.first_slot; s < rod.vertexEnd(); ++s)
      for (int a = 0; a < slot_size; ++a) {
        if (dofs_.unknown(s, a) >= 0) increment[a][s] = x[a][s] - now[a][s];
        moves = moves || increment[a][s] != 0;
      }
    dofs_.copyBehindRing(rod, increment);
    if (moves && tryMove(increment, 1.0, r, RetractionKind::additive, trial)) accept(trial, r);
  }
}

IncrementalPotential::Residual IncrementalPotential::residual(int r, const RodEnergy &energy) {
  using std::abs;
  const RodRange &rod = elements_.rods[r];
  const Material &m = scene_.rods[r].material;
  const Planes &out_of_balance = gradient(r).equilibrium;
  Pack forces(0.0), moments(0.0), tension(0.0), error(0.0);
  for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes) {
    forces += read<Pack>(elements_.freedom() + s) * readVector<Pack>(out_of_balance, 0, s).squaredNorm();
    const Pack g = read<Pack>(out_of_balance[3] + s);
    moments += g * g;
  }
  for (int s = rod.first_slot; s < rod.edgeEnd(); s += lanes) {
    const Pack::mask_type live = firstLanes(rod.edgeEnd() - s);
    const Pack force = read<Pack>(iterate_[C::axial_force] + s),
               strain = read<Pack>(iterate_[C::strain] + s) - read<Pack>(axial_.rest() + s);
    tension = max(tension, select(live, Pack(abs(force)), Pack(0.0)));
    error = max(error, select(live, Pack(abs(strain - force / read<Pack>(axial_.stiffness() + s))), Pack(0.0)));
  }
  const double force = reduce(forces), moment = reduce(moments);
  // Edges carry errors of epsilon in their strains and directions, which the stiffnesses turn into forces and moments.
  const double strain_noise = edgeError(energy.reach, shortest_[r]), count = std::sqrt(double(rod.vertices));
  const double bending = energy.steepness *
                         std::max({m.flexural_stiffness[0], m.flexural_stiffness[1], m.torsional_stiffness}) /
                         shortest_[r];
  const double scale = force_scale_[r], stretching = step_.mixed ? hmax(tension) : hmax(tension) + m.axial_stiffness;
  Residual result;
  result.force = std::sqrt(force) / scale;
  result.moment = std::sqrt(moment) / (scale * length_[r]);
  result.compatibility = step_.mixed ? hmax(error) : 0;
  // Inertia turns an error of position or twist into a force or a moment, which counts in short steps.
  const double inertia = step_.isStatic() ? 0 : longest_[r] / (step_.dt * step_.dt),
               heavy = m.linear_density * shortest_[r] * inertia, spinning = m.linear_rotational_inertia * inertia;
  result.force_floor =
      4 * count * strain_noise * (stretching + heavy + (m.isCable() ? 0 : bending / shortest_[r])) / scale;
  if (!m.isCable()) result.moment_floor = 4 * count * strain_noise * (bending + spinning) / (scale * length_[r]);
  result.compatibility_floor = 16 * strain_noise;
  return result;
}

void IncrementalPotential::Residual::include(const Residual &other) {
  for (double Residual::*part : {&Residual::force, &Residual::moment, &Residual::compatibility, &Residual::force_floor,
                                 &Residual::moment_floor, &Residual::compatibility_floor})
    if (other.*part > this->*part || std::isnan(other.*part)) this->*part = other.*part;
}

IncrementalPotential::Residual IncrementalPotential::residual() {
  Residual worst;
  for (int r = 0; r < all().end; ++r) worst.include(residual(r, rodEnergy(iterate_, r)));
  return worst;
}

[[gnu::flatten]] StageRates IncrementalPotential::stageRates(const StageRule &rule) const {
  StageRates rates;
  for (Rates *part : {&rates.displacement, &rates.velocity, &rates.acceleration}) {
    part->vertex.resize(elements_.vertices());
    part->edge.resize(elements_.edges());
  }
  const double rate = 1 / step_.dt;
  for (const RodRange &rod : elements_.rods) {
    for (int i = 0; i < rod.vertices; ++i) {
      const int v = rod.first_vertex + i;
      const Vec3 d = iterate_.displacementAt(rod.slot(i), start_), velocity = d * rate + rule.velocity.atVertex(v);
      rates.displacement.vertex[v] = d;
      rates.velocity.vertex[v] = velocity;
      rates.acceleration.vertex[v] = (rule.mass * velocity + rule.acceleration.atVertex(v)) * rate;
    }
    for (int i = 0; i < rod.edges; i += lanes) {
      const Pack spun = spinOver(twistReference(), iterate_, rod.slot(i));
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

std::array<Vec3, 2> IncrementalPotential::supportAction(const State &start, int s) {
  const Support &support = scene_.supports[s];
  std::array<Vec3, 2> action{Vec3::Zero(), Vec3::Zero()};
  if (support.holdsPosition()) {
    const int slot = elements_.rods[support.rod].slot(support.vertex),
              v = elements_.rods[support.rod].first_vertex + support.vertex;
    const Vec3 moved = iterate_.displacementAt(slot, start_);
    Vec3 velocity = moved / step_.dt, acceleration = (velocity - start.velocity[v]) / step_.dt;
    if (const StageRule *rule = step_.rule) {
      velocity += rule->velocity.atVertex(v);
      acceleration = (rule->mass * velocity + rule->acceleration.atVertex(v)) / step_.dt;
    }
    // What methods remember of held vertices is nothing, which does not matter to them: the velocity that dissipates is
    // that of the way.
    const Vec3 astray = moved / (step_.time - start_time_) - velocity;
    const double alpha = scene_.rods[support.rod].material.mass_damping_coefficient;
    action[0] =
        gradient(support.rod).equilibrium.vector(0, slot) + elements_.mass()[slot] * (alpha * astray - acceleration);
  }
  if (const int frame = elements_.support_slot[s]; frame >= 0)
    for (const auto &term : terms_) action[1] += term->momentOn(iterate_, support.rod, frame);
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
  turnSupports(iterate_, middle);
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
  remainingMotion(all(), increment);
  for (int r = 0; r < all().end; ++r) {
    followSupports(r);
    if (!tryMove(increment, 1, r, RetractionKind::additive, trial)) return false;
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
      dofs_.copyBehindRing(rod, increment);
      if (!tryMove(increment, 1, r, RetractionKind::additive, trial)) return false;
      accept(trial, r);
    }
    for (int s = rod.first_slot; s < rod.edgeEnd(); ++s)
      iterate_[C::axial_force][s] = elements_.axialStiffness()[s] * iterate_[C::strain][s];
  }
  return !beyond_barrier_;
}

void IncrementalPotential::commit(State &state, RodSet rods) const {
  for (int r = rods.begin; r < rods.end && !step_.isStatic(); ++r) {
    const RodRange &rod = elements_.rods[r];
    const double rate = 1 / step_.dt;
    for (int a = 0; a < 3; ++a) { // plane by plane
      const double *now = iterate_[C::Plane(C::position + a)] + rod.first_slot,
                   *before = start_[C::Plane(C::position + a)] + rod.first_slot;
      const double *low = iterate_[C::Plane(C::position_low + a)] + rod.first_slot,
                   *low_before = start_[C::Plane(C::position_low + a)] + rod.first_slot;
      for (int i = 0; i < rod.vertices; ++i)
        state.velocity[rod.first_vertex + i][a] = ((now[i] - before[i]) + (low[i] - low_before[i])) * rate;
    }
    for (int i = 0; i < rod.edges; i += lanes) {
      const Pack spun = spinOver(start_, iterate_, rod.slot(i)) * Pack(rate);
      for (int l = 0; l < std::min(lanes, rod.edges - i); ++l) state.twist_rate[rod.first_edge + i + l] = spun[l];
    }
  }
  commitConfiguration(state, rods);
}

[[gnu::flatten]] void IncrementalPotential::commitConfiguration(State &state, RodSet rods) const {
  for (int r = rods.begin; r < rods.end; ++r) {
    const RodRange &rod = elements_.rods[r];
    for (int n = elements_.rod_cells[r]; n < elements_.rod_cells[r + 1]; ++n)
      state.turns[n] = iterate_[C::turns][elements_.cell_slot[n]];
    for (int a = 0; a < 3; ++a) { // plane by plane
      const double *high = iterate_[C::Plane(C::position + a)] + rod.first_slot,
                   *low = iterate_[C::Plane(C::position_low + a)] + rod.first_slot;
      for (int i = 0; i < rod.vertices; ++i) {
        state.position[rod.first_vertex + i][a] = high[i];
        state.position_low[rod.first_vertex + i][a] = low[i];
      }
    }
    for (int i = 0; i < rod.edges; i += lanes) {
      const int slot = rod.slot(i), live = std::min(lanes, rod.edges - i);
      const FrameOf<Pack> f = iterate_.frames<Pack>(slot);
      const Vector3<Pack> d = orthonormalised<Pack>(f.director, f.tangent);
      for (int l = 0; l < live; ++l) {
        const int e = rod.first_edge + i + l;
        state.director[e] = Vec3(d[0][l], d[1][l], d[2][l]);
        state.axial_force[e] = iterate_[C::axial_force][slot + l];
      }
    }
  }
}

} // namespace tendril
