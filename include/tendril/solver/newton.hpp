#pragma once
/// \file newton.hpp
/// One implicit step by SNES: Newton with the exact Hessian, its inertia read at every factorisation, and the line
/// search `retraction`.

#include "tendril/layout/team.hpp"
#include "tendril/solver/banded.hpp"
#include "tendril/solver/circulatory.hpp"
#include "tendril/solver/imbalance.hpp"
#include "tendril/solver/incremental_potential.hpp"
#include "tendril/solver/secants.hpp"

#include <optional>
#include <string>

namespace tendril {

/// What a solve did.
struct NewtonReport {
  bool converged = false;
  int iterations = 0;               ///< linear solves with a new Hessian
  std::int64_t edge_iterations = 0; ///< edges of the rods that took part, summed over the iterations
  int trials = 0;                   ///< energies of rods evaluated by the line search
  int shifts = 0;                   ///< factorisations repeated with a shifted diagonal
  int negative_pivots = 0;          ///< of the last Hessian, unshifted
  int zero_pivots = 0;              ///< motions that cost no energy
  int first_negative_pivots = 0;    ///< at the equilibrium found first, before any escape (statics)
  int escapes = 0;                  ///< saddles left along a direction of negative curvature (statics)
  Residual residual;
  /// Where rounding kept Newton from its tolerance, and in statics always: what is left to the answer, over rod lengths
  /// (root mean square), of the worst rod.
  double rounding_error = 0;
  bool lost = false;           ///< in rounding: the failure of the step
  bool bounded = false;        ///< rods left the room in which contact between them is known: the failure of the step
  bool meets = false;          ///< what different ranks have may touch: nothing has been solved
  std::vector<double> history; ///< force residual, relative to the load scale, at every iterate
  std::string reason;          ///< in words
  /// Whether Newton may have come to an unstable equilibrium, or passed it and only met indefinite Hessians.
  bool mayPassCritical() const { return first_negative_pivots > 0 || shifts > 0; }
  /// Adds the report of another block of rods.
  void include(const NewtonReport &block);
  /// Enters what becomes of it over all ranks, where all their blocks have converged.
  void tally(Tally &tally);
  /// Counts what an earlier try at the same step took.
  void addWork(const NewtonReport &before);
};

/// The largest of the residuals, in units of what it should fall to: `rtol` of its scale.
double excess(const Residual &residual, double rtol);
/// Whether all residuals that are too large are at the level that rounding leaves, by an estimate. That says nothing
/// about the answer: it is no verdict.
bool isAtNoise(const Residual &residual, double rtol);

/// Which equilibria are answers in statics: minima, or any, reached by Newton's own full steps, for following a branch.
enum class Seek { minimum, equilibrium };

/// Of the Hessian's eigenvalues, in units of the softest bending: where a branch is followed, keeps solves regular
/// where a motion costs nothing, a turn about an axis, say.
constexpr double regular_lift = 1e-7;

/// Edges of the largest scene that statics spend more solves on than its answer takes: on a long way down from a
/// saddle, or to list all critical loads.
constexpr int most_searched_edges = 20000;

/// What eigenvalues of the Hessian are taken by: the mass matrix (mass.hpp), which may be singular; or what indefinite
/// Hessians are shifted by (BandedSystem), which is definite.
enum class Metric { mass, shift };

/// Where Newton begins instead of at the start of a step.
struct Guess {
  Planes unknowns;    ///< displacements and spins since the start
  Planes axial_force; ///< of edges [N], one plane, where supports are at the end of their motion, too; else empty
};

/// How Newton stands with a rod whose residual does not fall any more.
struct Standstill {
  bool known = false;     ///< whether the last increment is Newton's own: no shift, no supports on the way
  bool partial = false;   ///< whether it leaves out motions without stiffness, of zero pivots
  double energy = 0;      ///< gradient times that increment [J]
  double best = HUGE_VAL; ///< smallest excess so far
  int iterations = 0;     ///< since it fell by half
  bool tiny = false;      ///< whether the last increment is a full but tiny step of a shifted Hessian, ...
  int creeping = 0;       ///< ... and how many of them did not make it fall by half: so Newton creeps towards a saddle
};

/// What a solve keeps of rods and slots, for all solvers of a scene: each works on its own rods only.
struct NewtonWork {
  /// Room for blocks of up to so many slots.
  NewtonWork(const IncrementalPotential &potential, int slots);
  /// Moves the work arrays to the rods from this slot on.
  void setOrigin(int first_slot);
  std::vector<char> active;              ///< rods that have not converged yet
  std::vector<double> shift, last_shift; ///< of the diagonal of indefinite Hessians, now and when it was last needed
  std::vector<int> negative, zero;       ///< pivots
  std::vector<char> indefinite;          ///< rods whose Hessian gives no way down as it is
  std::vector<IncrementalPotential::RodEnergy> tried;  ///< at the trial
  std::vector<IncrementalPotential::RodEnergy> energy; ///< at the iterate, ...
  std::vector<char> energy_known;                      ///< ... where it has been computed
  std::vector<Residual> residual;
  std::vector<char> moving; ///< rods whose supports have not reached their places
  std::vector<Standstill> standstill;
  std::vector<double>
      left; ///< of the answer, over the rod's length: what Newton would still move it by; 0 where the tolerance was met
  std::vector<double> load_reach,
      load_energy; ///< what the loads would move, and the energy of that [J]; not a number where not known
  Planes increment, coordinates; ///< work arrays, ...
  Planes corrected, response;    ///< ... where junctions are
  Configuration trial, kept;     ///< `kept`: the iterate while another is tried in its place
  Planes motion, metric;
  std::vector<double> edge_metric; ///< per slot
  BandedWorkspace workspace;
};

/// Solves for some rods that nothing joins to others. Rods that junctions join are an island: they have one length of
/// each step, one shift, one count of negative pivots and one verdict; what is kept of rods is the same for all of them
/// then.
class NewtonSolver {
public:
  /// Creates SNES and its parts and reads -snes_*, -ksp_*, -pc_*, -mat_* options.
  PetscErrorCode setUp(IncrementalPotential &potential, NewtonWork &work, RodSet rods);
  /// Takes note of what may touch in the step.
  void takeTouching();
  bool touches() const { return touches_; }
  /// Minimises the potential of the step, which has begun. The potential's iterate is the answer when `report` says
  /// converged. \param guess where to begin instead of at the start state \param patience iterations after which it
  /// fails; 0: as many as -snes_max_it
  PetscErrorCode solve(const State &start, NewtonReport *report, Seek seek, const Guess *guess, int patience = 0);
  /// Sets up the linear solver with the matrix assembled last, for the mistakes in its options to come to light.
  PetscErrorCode setUpLinear();
  /// Factors the Hessian at the iterate and counts negative pivots; -1 when it cannot be factored.
  /// \param lift of its eigenvalues, in units of the softest bending of each rod
  PetscErrorCode inertiaAtIterate(int *negative, double lift = 0);
  /// The unstable motion at the iterate by whose loss the count of unstable motions falls to `stable`, if it takes a
  /// higher lift than `lift`, which then is that lift. The edge that turns most turns by one radian. \see
  /// inertiaAtIterate
  PetscErrorCode criticalMode(int stable, double *lift, Planes *mode);
  /// Rods that nothing joins to others.
  const std::vector<RodSet> &islands() const { return islands_; }
  /// Factors the Hessian at the iterate plus a multiple of the metric of one island, in place of all: solveLinear gives
  /// other rods zero. \param factor of the metric [1/s^2] \param negative receives the number of eigenvalues of the
  /// pair below -factor, -1 where one is there to rounding, or the matrix cannot be factored
  PetscErrorCode factorWith(Metric metric, RodSet island, double factor, int *negative);
  /// y = metric x of an island. \param x with copies, as DofMap::scatter leaves it
  void multiplyMetric(Metric metric, RodSet island, const Planes &x, Planes &y) const;
  /// The square of about the frequency of the slowest bending wave of an island's rods [1/s^2].
  double slowestBending(RodSet island) const { return firstShift(island); }
  /// Solves with the matrix factored last.
  PetscErrorCode solveLinear(const Planes &right, Planes &solution);

  SNES snes() const { return snes_; }
  bool isBanded() const { return banded_; }
  RodSet rods() const { return rods_; }

  // What SNES calls.
  PetscErrorCode evaluate(Vec x, Vec f);
  PetscErrorCode assemble(Mat jacobian);
  PetscErrorCode direct(Vec x, Vec f, Vec y);
  PetscErrorCode lineSearch(SNESLineSearch search);
  PetscErrorCode testConvergence(PetscInt iteration, SNESConvergedReason *reason);

private:
  IncrementalPotential *potential_ = nullptr;
  RodSet rods_{0, 0};
  std::vector<RodSet> islands_; ///< all or any of the rods
  OwnedSNES snes_;
  NewtonWork *work_ = nullptr;
  BandedSystem system_;
  OwnedMat jacobian_;
  DofMap::Pattern pattern_; ///< of a matrix of PETSc's own
  bool banded_ = true;
  bool touches_ = false;     ///< whether edges may touch in the step, ...
  bool fresh_pairs_ = false; ///< ... and they are not yet those that the matrix knows
  OwnedMat band_;    ///< where the solver that was chosen has no inertia of each rod: the same matrix once more, ...
  OwnedKSP inertia_; ///< ... factored by `banded`, which tells what is a minimum, and how far an iterate is from it
  OwnedVec x_, f_, right_, solution_;
  std::optional<Circulatory> circulatory_; ///< where couples act
  Vec iterate_vec_ = nullptr;              ///< vector that holds the coordinates of the potential's iterate, ...
  PetscObjectState iterate_state_ = 0;     ///< ... and its state when they were written
  NewtonReport report_;
  Seek seek_ = Seek::minimum;
  bool follows_ = false;            ///< whether the solve is for an equilibrium of any kind
  int patience_ = 0, spent_ = 0;    ///< iterations that the solve may take, 0: no bound; and those before SNES began
  double sharpness_ = 1, rtol_ = 0; ///< of -snes_rtol, and what is asked for now
  Secants secants_;                 ///< since the Hessian was factored
  std::vector<double> lengths_;     ///< of the last step, per rod
  int age_ = 0;                     ///< iterations that the factorisation has served
  bool fresh_ = true, renew_ = false;
  double likely_ = 0;          ///< residual from which the next iterate is likely an answer
  std::string lost_;           ///< why the last solve was lost in rounding
  bool limit_reached_ = false; ///< whether the last solve ended for -snes_max_it
  bool creeps_ = false;        ///< whether the last solve ended for creeping towards a saddle
  bool descends_ = false;      ///< whether creeping goes on, for what ends it

  /// What a solve has come to.
  struct Outcome {
    std::string failure, beyond; ///< why it failed; the limit of a law that is passed
    int rounds = 0;              ///< of a tolerance made sharper
    bool settled = false;        ///< what is left is little
  };
  PetscErrorCode createSnes();
  void begin(const State &start, Seek seek, const Guess *guess, int patience);
  PetscErrorCode settle(Seek along, Outcome *now);
  PetscErrorCode settleNeutral(bool first, bool creeps, Seek seek, Outcome *now);
  PetscErrorCode settleMinimum(Seek seek, Outcome *now);
  PetscErrorCode newton(std::string *failure);
  PetscErrorCode newtonAndRenew(std::string *failure);
  PetscErrorCode moveTo(Vec x, bool *possible);
  PetscErrorCode writeIterate(Vec x);
  KSP factored() const;
  PetscErrorCode readInertia(bool *regular);
  PetscErrorCode solveAgain(Vec f, Vec y);
  PetscErrorCode makeMatrix();
  PetscErrorCode refill();
  PetscErrorCode refactor();
  PetscErrorCode makeDescent(Vec f, Vec y, bool regular);
  void multiplyHessian(RodSet island, const Planes &x, Planes &y);
  PetscErrorCode findIndefinite(Vec y, bool regular, bool *any);
  PetscErrorCode shiftUntilPositive(bool regular);
  double firstShift(int rod) const;
  double firstShift(RodSet island) const;
  PetscErrorCode includeMotion(Vec y);
  PetscErrorCode includeCirculation(bool *regular);
  bool circulates(RodSet island) const;
  /// What a line search goes by.
  struct Descent {
    double slope = 0;                       ///< of the energy, by the length [J]
    IncrementalPotential::RodEnergy before; ///< at the iterate
    bool free = false;                      ///< whether the energy may rise
    bool circulates = false;                ///< for couples or follower forces: then forces must not get much larger
  };
  enum class Length { good, too_long, too_short };
  IncrementalPotential::RodEnergy tryLength(RodSet island, double length);
  bool tryCorrected(RodSet island, double length, double *free);
  Length judgeLength(RodSet island, double length, const Descent &descent,
                     const IncrementalPotential::RodEnergy &there);
  bool findLength(RodSet island, const Descent &descent, double *lambda, IncrementalPotential::RodEnergy *there);
  bool standStill(RodSet island, double *lambda);
  void goBeyond(RodSet island, const Descent &descent, double *lambda, IncrementalPotential::RodEnergy *there);
  bool search(RodSet island, double *lambda);
  bool residualFalls(RodSet island, double length, double most = 1);
  bool sharesFactor() const;
  enum class Verdict { answer, going, saddle, lost }; ///< the worse the later
  Verdict judge(int rod, double rtol);
  Verdict judge(RodSet island, double rtol);
  double sizeOf(int rod, const Planes &increment) const;
  double movedBy(int rod) const;
  bool isLittle(int rod, double *size);
  double hessianNoise(int rod, const Planes &v) const;
  bool isNeutral(int rod);
  bool isBalanced(int rod, double rtol) const;
  PetscErrorCode findLoadReach();
  PetscErrorCode verify(bool *little);
  Asked asked() const { return {rtol_, sharpness_}; }
  std::string farthest();
  std::string unstableRod() const;
  std::string roundingMessage(int rod, double size) const;
  void beginMode(int start);
  void weigh(const Planes &motion, Planes &weighed) const;
  double normaliseMode();
  double turningOf(int rod) const;
  class ModeSearch;
  PetscErrorCode findBucklingModes(std::vector<char> *found, std::vector<char> *neutral);
  PetscErrorCode escapeSaddle(bool *left, bool *neutral);
  void predict();
  const IncrementalPotential::RodEnergy &energyAtIterate(int rod);
  void forgetEnergies() { fill(work_->energy_known, false); }
  /// Moves what is shared with other blocks here.
  void focus();
  template <class Value, class Same> void fill(std::vector<Value> &values, Same value) { fill(values, rods_, value); }
  template <class Value, class Same> static void fill(std::vector<Value> &values, RodSet rods, Same value) {
    std::fill(values.begin() + rods.begin, values.begin() + rods.end, value);
  }
};

/// Registers the line search type `retraction` and the factorisation `banded`; call after PetscInitialize.
PetscErrorCode registerSolvers();

} // namespace tendril
