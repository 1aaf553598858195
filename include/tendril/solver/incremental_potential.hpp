#pragma once
/// \file incremental_potential.hpp
/// The function one implicit step minimises, on the configuration manifold: the terms of the scene, the iterate, and
/// the moves between iterates. Rods that nothing joins are independent of each other: everything is done rod by rod.

#include "tendril/coupling/couplings.hpp"
#include "tendril/energy/linkage.hpp"
#include "tendril/energy/work.hpp"
#include "tendril/layout/team.hpp"
#include "tendril/solver/residual.hpp"
#include "tendril/state/commit.hpp"
#include "tendril/state/retraction.hpp"
#include "tendril/state/support_motion.hpp"

#include <algorithm>
#include <limits>

namespace tendril {

/// What makes a step long enough and not too long: an energy that falls enough (Armijo 1966); its slope, too, to a part
/// of what it was (strong Wolfe conditions, Nocedal and Wright 2006, 3.7); or a residual that falls, whatever the
/// energy does.
enum class LineSearchKind { energy, wolfe, residual };

/// How the minimum is looked for.
struct SolveSettings {
  RetractionKind retraction = RetractionKind::length; ///< of moves that do not name another
  /// Where rounding keeps Newton from its tolerance: what is left counts as nothing below this part of what a step
  /// moves.
  double rounding_tolerance = 1e-3;
  LineSearchKind line_search = LineSearchKind::energy;
  int quasi_newton = 1; ///< iterations that share a factorisation
};

class IncrementalPotential {
public:
  SolveSettings settings;

  IncrementalPotential(const Scene &scene, DofMap &dofs, const Elements &elements, bool dynamic);

  /// Starts a step; then every rod has to be started before anything else is asked of it: its iterate is the start
  /// state with supports' frames (not yet their positions) moved to the end of the step.
  void beginStep(const State &start, const Step &step);
  void beginRod(const State &start, int rod);
  /// Whether rods and bodies touch each other. Then findTouching has to find what may touch in a step before it begins
  /// with its rods, which makes islands of them.
  bool touches() const { return touches_; }
  void findTouching(const State &start, double room);
  /// Boxes in which some rods and their bodies may touch others in the step for which that was found.
  std::vector<Box> roomsOf(RodSet rods) const;
  /// See Term::nearlyTouch, at the iterate.
  bool nearlyTouch(const TouchingPair &pair) const;
  /// See Term::timesBounded.
  int timesBounded(RodSet rods) const {
    int times = 0;
    for (const auto &term : terms_) times += term->timesBounded(rods);
    return times;
  }
  /// See SupportMotion.
  const std::string &beyondBarrier() const { return supports_.beyondBarrier(); }
  /// Changes the load factor (in statics also the time) of the step under way; the iterate stays.
  void setLoadFactor(double factor);
  const Configuration &iterate() const { return iterate_; }
  const Step &step() const { return step_; }
  const Scene &scene() const { return scene_; }
  const Elements &elements() const { return elements_; }
  const DofMap &dofs() const { return dofs_; }
  DofMap &dofs() { return dofs_; }
  RodSet all() const { return dofs_.all(); }

  /// Increments that held vertices of some rods still have to make to reach their prescribed positions; zero elsewhere.
  /// True when there are any.
  bool remainingMotion(RodSet rods, Planes &increment) const {
    const bool any = supports_.remaining(iterate_, step_.time, rods, increment);
    dofs_.copyJoined(rods, increment);
    return any;
  }

  /// Energy of a rod [J]; +inf where the configuration is impossible. Rounding blurs it by `noise`: differences below
  /// decide nothing [J].
  struct RodEnergy {
    double value = std::numeric_limits<double>::infinity(), noise = 0;
    double size = 0;                 ///< sum of the energies of all terms without their signs [J]
    double reach = 0, steepness = 1; ///< largest coordinate [m]; how much stiffer than at rest the steepest cell is
    double free = 1;                 ///< of a trial: part of the straight way to it on which no obstacle is
    /// Adds that of another rod of an island.
    void include(const RodEnergy &other) {
      value += other.value;
      noise += other.noise;
      size += other.size;
      reach = std::max(reach, other.reach);
      steepness = std::max(steepness, other.steepness);
      free = std::min(free, other.free);
    }
  };
  RodEnergy rodEnergy(const Configuration &configuration, int rod) const;
  /// What a state of some rods stores, term by term. \param configuration that of the state
  EnergyBudget energyBudget(const State &state, const Configuration &configuration, double load_factor,
                            RodSet rods) const;
  /// Smallest distance between surfaces of some rods and obstacles at the iterate [m].
  double smallestGap(RodSet rods) const;
  double energy(const Configuration &configuration, RodSet rods) const;
  /// See Term::violation.
  double violation(const Configuration &configuration, int rod) const {
    double sum = 0;
    for (const auto &term : terms_) sum += term->violation(configuration, rod);
    return sum;
  }
  double energy(const Configuration &configuration) const { return energy(configuration, all()); }
  /// Room for the derivatives of some rods; those of others are forgotten. Derivatives of other rods need room for all.
  void focus(RodSet rods);
  /// Gradient, equilibrium residual and Hessian blocks at the iterates of some rods, computed once per iterate.
  const Derivatives &derivatives(RodSet rods);
  /// The same without the Hessian where it is not known yet.
  const Derivatives &gradient(int rod);
  /// See Term::renew.
  double renew(int rod);
  /// Adds the gradient of the loads on a rod.
  void addLoads(int rod, Derivatives &out) const;
  /// Of all rods, with room for them.
  const Derivatives &derivatives() {
    focus(all());
    return derivatives(all());
  }
  /// Derivatives of whole islands with another Hessian than the step's; they stay until one of their rods moves.
  void assemble(RodSet islands, HessianKind hessian);
  /// Whether any term of the scene couples the coordinates of one vertex.
  bool couplesPositions() const { return couples_positions_; }
  /// Whether any couples positions with edges.
  bool joinsPositions() const { return joins_positions_; }
  /// The same of a whole scene of which this rank has a part: its matrices are of one form on all ranks.
  void agree(const Team &team) {
    couples_positions_ = team.any(couples_positions_);
    joins_positions_ = team.any(joins_positions_);
  }
  const EdgeBlocks &blocks() const { return derivatives_.blocks; }

  /// In statics joints of trees take the forces that carry what they place, at the iterate: as in reduced coordinates,
  /// energies then fall along what they leave free alone, and their curvature is that of the forces.
  void carryTrees(RodSet island);
  /// Trial configuration R(iterate, scale x increment) of one rod, with its axial forces; obstacles that move go the
  /// same part of their way. False when it is impossible, or when something is in the way.
  /// \param free receives the part of the straight way from the iterate on which nothing is
  bool tryMove(const Planes &increment, double scale, int rod, RetractionKind kind, Configuration &trial,
               double *free = nullptr);
  bool tryMove(const Planes &increment, double scale, int rod, Configuration &trial, double *free = nullptr) {
    return tryMove(increment, scale, rod, settings.retraction, trial, free);
  }
  /// The same for all rods of an island.
  bool tryMove(const Planes &increment, double scale, RodSet island, RetractionKind kind, Configuration &trial,
               double *free = nullptr);
  /// Adds what their way to those does to the gradient, to first order.
  void addObstacleMotion(int rod, Planes &out) const {
    for (const auto &term : terms_) term->addObstacleMotion(iterate_, nextObstacleTime(rod), rod, out);
  }
  /// By how much a small motion changes the forces that obstacles press on a rod with, over those forces or the loads,
  /// to first order; 0 where nothing touches.
  double changeOfPressure(int rod, const Planes &increment) const;
  /// Up to when they can go in one move.
  double nextObstacleTime(int rod) const { return scene_.collidersEvenUntil(iterate_.obstacleTime(rod), step_.time); }
  /// Whether obstacles have not reached their places at the end of the step.
  bool obstaclesRemain(int rod) const { return obstacles_move_ && iterate_.obstacleTime(rod) != step_.time; }
  /// Whether they go on with the moves of a rod, or wait for it.
  bool obstaclesGo(int rod) const { return obstaclesRemain(rod) && !obstacles_held_[rod]; }
  void holdObstacles(int rod, bool held) { obstacles_held_[rod] = held; }
  /// Axial forces of a trial, those that the linearised strains of an increment ask for.
  void setTrialForces(const Planes &increment, double scale, int rod, RetractionKind kind, Configuration &trial) const;
  /// The same of terms that have forces of their own (Term::setTrialForces); until then they are those of the iterate.
  void setTermForces(const Planes &increment, double scale, int rod, Configuration &trial) const {
    for (const auto &term : terms_) term->setTrialForces(iterate_, increment, scale, rod, trial);
  }
  /// Adds the forces of edges that a trial has made longer than an increment does to first order.
  /// \return by how much at most, over their lengths
  double addExcess(const Planes &increment, double scale, const Configuration &trial, int rod, Planes &force) const;
  /// Spins of the frames of junctions that follow the edges beside them: the mean of what an increment turns these by.
  void turnFrames(RodSet islands, Planes &increment) const;
  /// Motions of the bodies of some islands, and of what follows them, into an increment: displacements and rotation
  /// vectors from the iterate.
  template <class Motion> void setBodies(RodSet islands, Planes &increment, Motion motion) const {
    for (const JoinedBody &b : elements_.bodies(islands)) {
      const BodyRate moved = motion(b);
      increment.setVector(0, b.position, moved.translation);
      increment.setVector(0, b.rotation, moved.spin);
    }
    if (!elements_.bodies(islands).empty()) dofs_.copyJoined(islands, increment);
  }
  /// Whether energies of two iterates can be compared: the work of couples, and of the spin of bodies, is counted from
  /// the last one.
  bool hasPotential() const { return !scene_.hasCouples() && scene_.bodies.empty(); }
  bool isDynamic() const { return dynamic_; }
  /// See Term::circulation.
  Vec3 circulation(const JoinedBody &body) const {
    Vec3 sum = Vec3::Zero();
    for (const auto &term : terms_) sum += term->circulation(body, iterate_);
    return sum;
  }
  /// The same for all rods.
  bool tryMove(const Planes &increment, double scale, Configuration &trial);
  /// Makes the trial of one rod, or of all, the iterate.
  void accept(const Configuration &trial, int rod);
  void accept(const Configuration &trial);
  /// Axial forces of a rod's iterate from its strains.
  void resetAxialForces(int rod);
  /// Axial forces of a rod's iterate, over slots, where they are unknowns [N].
  void setAxialForces(int rod, const double *force);

  /// Moves to where the unknowns are `x` (displacements and spins since the step began) by the additive retraction.
  /// \param trial room for configurations of these rods
  /// \param supports whether supports that move go to the end of their motion, too
  /// \return whether the configuration there is possible; where it is not, some rods may have moved
  [[nodiscard]] bool moveTo(const Planes &x, RodSet rods, Configuration &trial, bool supports);
  /// Displacements and spins of the iterate since the step began.
  void coordinates(Planes &x, RodSet rods) const;
  void coordinates(Planes &x) const { coordinates(x, all()); }

  /// \param energy that of the iterate
  Residual residual(int rod, const RodEnergy &energy) {
    Residual residual = residualOf(elements_, scene_.rods[rod].material, step_, axial_, iterate_,
                                   gradient(rod).equilibrium, scales_[rod], energy.reach, energy.steepness, rod);
    for (const JoinedBody &b : elements_.bodies({rod, rod + 1}))
      includeBody(elements_, b, step_, start_, iterate_, gradient(rod).equilibrium, scales_[rod].force,
                  bodyLoad(scene_, elements_, b.body), &residual);
    double blurred = 0;
    for (const auto &term : terms_) {
      residual.compatibility = std::max(residual.compatibility, term->mismatch(iterate_, rod));
      blurred += term->forceNoise(iterate_, rod) / scales_[rod].force;
    }
    residual.force_floor = std::max(residual.force_floor, blurred);
    residual.moment_floor = std::max(residual.moment_floor, blurred);
    return residual;
  }
  /// The largest of each over all rods.
  Residual residual();
  /// What forces of a rod are measured by [N], and moments by that times its length: its loads, or where it `hasLoad`
  /// not, what deforms it.
  double forceScale(int rod) const { return scales_[rod].force; }
  bool hasLoad(int rod) const { return scales_[rod].load > 0; }
  const AxialLaw &axial() const { return axial_; }

  /// Displacements of the iterate of some rods since the step began, and the rates that follow from them by its rule.
  void stageRates(RodSet rods, StageRates &out) const {
    tendril::stageRates(elements_, start_, twistReference(), iterate_, *step_.rule, rods, out);
  }
  /// Force [N] and moment [N m] of a support or constraint on its rod at the iterate, without the inertia of a held
  /// vertex itself.
  std::array<Vec3, 2> actionOf(const Holder &holder);
  const Configuration &start() const { return start_; }
  double length(int rod) const { return scales_[rod].length; }              ///< at rest [m]
  double shortestEdge(int rod) const { return scales_[rod].shortest_edge; } ///< at rest [m]
  double longestEdge(int rod) const { return scales_[rod].longest_edge; }   ///< at rest [m]
  /// From the last stage of a step to its end at `time`: positions, spins and directors to where the guess of a rule
  /// leads (supports to their places), axial forces come from the strains. False when that leads to an impossible
  /// configuration.
  bool moveOn(double time, const StageRule &end);

  /// State of some rods after the step: positions, directors made orthonormal, axial forces.
  void commitConfiguration(State &state, RodSet rods) const {
    tendril::commitConfiguration(elements_, iterate_, rods, state);
    settleBodies(elements_, rods, state);
    for (const auto &term : terms_)
      for (int r = rods.begin; r < rods.end; ++r) term->commit(state, iterate_, r);
  }
  /// Of all, with the time; in steps in time the velocities are those of the stage.
  void commit(State &state) const;
  RodSet islandOf(int rod) const { return dofs_.islandOf(rod); }

private:
  const Scene &scene_;
  DofMap &dofs_;
  const Elements &elements_;
  Retraction retraction_;
  Linkage linkage_;
  Planes linked_; ///< increments of one rod, as the linkage corrects them
  AxialLaw axial_;
  std::vector<std::unique_ptr<Term>> terms_;
  Step step_;
  StageRule euler_; ///< where a step has no rule of its own
  double start_time_ = 0;
  SupportMotion supports_;
  Configuration start_, iterate_;
  Configuration reference_; ///< frames from which stages measure twist
  const Configuration &twistReference() const { return step_.twist_reference ? *step_.twist_reference : start_; }
  Derivatives derivatives_{0};
  RodSet focus_{0, 0};
  int workspace_slots_ = 0; ///< slots
  enum class Known : char { nothing, gradient, all };
  std::vector<Known> known_; ///< per island, at its first rod: what derivatives_ holds of the iterate
  Known &known(int rod) { return known_[dofs_.islandOf(rod).begin]; }
  std::vector<RodScale> scales_;

  bool dynamic_, couples_positions_, joins_positions_, touches_;
  bool obstacles_move_;
  std::vector<char> obstacles_held_; ///< per rod

  void placeRod(const State &start, int rod);
  void assembleRod(int rod, HessianKind hessian);
  void takeArms(int rod);
  void moveObstacles(int rod);
  double freeFraction(const Configuration &from, const Configuration &to, int rod) const;
  double reachOf(const Configuration &configuration, const RodRange &rod) const;
  double steepnessOf(const Configuration &configuration, int rod) const;
};

} // namespace tendril
