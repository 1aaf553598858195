#pragma once
/// \file time_loop.hpp
/// Steps through time (dynamics) or load (statics), rejecting what does not converge.

#include "tendril/dynamics/bifurcation.hpp"
#include "tendril/dynamics/diagnostics.hpp"
#include "tendril/dynamics/integrator.hpp"
#include "tendril/solver/step_solver.hpp"

#include <cmath>
#include <functional>

namespace tendril {

/// Statics: steps of the load factor, or of the arc length of the path of equilibria (ArcLength).
enum class Continuation { load, arclength };
/// What to do where stability changes along a path: nothing; locate the critical load and go on; end the run there; or
/// go on from there along the branch that leaves in the direction of the critical mode.
enum class Bifurcation { off, locate, stop, switch_branch };

/// Dynamics: steps as given, or as long as the error of a step allows.
enum class Adaptation { none, error };

struct LoopSettings {
  bool dynamic = true;
  IntegratorSettings integrator;
  Adaptation adapt = Adaptation::none;
  double dt_rtol = 1e-3, dt_atol = 1e-6;   ///< error of a step over rod lengths: at most atol + rtol x what it moved
  double dt_max = 0;                       ///< of adapted steps; 0: no bound [s]
  double output_interval = 0;              ///< steps end at its multiples; 0: anywhere [s]
  bool estimate_error = false;             ///< also of steps that are not adapted
  double dt = 1e-2, dt_min = 0, t_end = 1; ///< in statics time is the load factor and ends at 1
  Continuation continuation = Continuation::load;
  Bifurcation bifurcation = Bifurcation::locate; ///< statics
  int arclength_steps = 200;                     ///< most steps along the path
  bool mixed = true;
  HessianKind hessian = HessianKind::exact;
  SolveSettings solve;
};

/// How a loop is stepping: with the state, all that goes on from step to step.
struct StepControl {
  double dt = 0;           ///< of the next step [s, or load factor]; 0: that of the settings
  int good = 0;            ///< steps since the last rejection
  bool stable = true;      ///< statics: the last state was a minimum
  double error = 0;        ///< adapted steps: of the last one, over what is allowed; 0 where unknown
  double error_sum = 0;    ///< of all steps, over rod lengths
  double rounding_sum = 0; ///< of all steps, over rod lengths
  double energy =
      NAN; ///< at the end of the last step, from which the next one dissipates; NAN where there was none [J]

  /// That of the leading rank to all.
  void share(const Team &team);
};

/// Takes steps and tells the observer of each one accepted.
class TimeLoop {
public:
  using Observer = std::function<PetscErrorCode(const State &, const Diagnostics &)>;
  StepControl control;
  CriticalObserver on_critical; ///< told of each critical point, before the step beyond it
  /// Called where what different ranks have may touch in the next step, to have it on one: the state and the solver are
  /// those of what this rank has then, or `stays` is false where that is nothing.
  std::function<PetscErrorCode(bool *stays)> unite;
  /// Asked with the state that a step would lead to, and whether it has met an unstable equilibrium, whether the scene
  /// must be modelled with more unknowns: the state and the solver are those of more unknowns then, and the step is
  /// taken anew; or why the run must not go on, as failure().
  std::function<PetscErrorCode(const State &next, bool unstable, bool *widened, std::string *failure)> widen;
  std::function<bool()>
      stops; ///< asked in each step whether to end after it: `finished` is false then, and failure() is empty
  TimeLoop(StepSolver &solver, const LoopSettings &settings)
      : solver_(solver), settings_(settings), integrator_(makeIntegrator(settings.integrator)) {}

  /// Advances `state` to the end. `finished` is false when dt_min was reached; `state` is then the last one accepted,
  /// bit for bit.
  PetscErrorCode run(State &state, const Observer &observe, bool *finished);
  /// The step of length `dt` [s, or load factor] that follows a state.
  static Step stepOf(const LoopSettings &settings, const State &state, double dt);
  const std::string &failure() const { return failure_; }

private:
  StepSolver &solver_;
  LoopSettings settings_;
  std::string failure_;
  std::unique_ptr<Integrator> integrator_;
  Integrator::Stages stages_;               ///< of the step under way
  double located_ = -1;                     ///< last critical load factor
  std::optional<Planes> mode_;              ///< critical mode along which the next step begins
  std::vector<Holder> moving_;              ///< supports, constraints and obstacles
  std::vector<std::vector<int>> moving_of_; ///< per rod; empty where nothing moves
  std::vector<HolderActions> actions_;      ///< of those, at each stage of the step under way

  /// Error of the step under way, and what it moved: the largest of any rod, root mean square over its length [turns in
  /// rad].
  struct StepError {
    double error = 0, moved = 0;
    bool known = false;
  };
  /// A step that is tried.
  struct Attempt {
    Step step;
    double h = 0; ///< its length [s, or load factor]
    NewtonReport report;
    EnergySums energy;
    WorkSums work;
    ExactSum held_before, held_after; ///< kinetic energy of vertices that moving supports hold [J]
    ExactSum carried;                 ///< see Diagnostics
    double gap = HUGE_VAL;            ///< smallest between surfaces in contact [m]
    StepError error;
    bool first = false;      ///< no step was taken before: the energy of the start is this loop's
    bool begins = false;     ///< the method has no memory but what it began with
    bool too_coarse = false; ///< for the error asked for
    bool stops = false;      ///< whether the run is asked to end
    void commit(const IncrementalPotential &potential, RodSet rods, State *next);
    void forget() { ///< what was committed
      energy = {};
      gap = HUGE_VAL;
    }
  };
  void prepare(const State &state);
  Attempt attemptFrom(const State &state) const;
  PetscErrorCode attempt(const State &state, State *next, Attempt *now);
  PetscErrorCode remodel(State &state, State *next, const Attempt &now, bool *anew, bool *ends);
  bool mayPassCritical(const State &state, const NewtonReport &report) const;
  void measure(const State &state, const State &next, Attempt *now);
  void accept(State &state, State &next, Attempt *now, Work *work);
  bool shorten(const State &state, double h, const NewtonReport &report);
  void lengthen(const NewtonReport &report);
  Diagnostics rowOf(const State &state, const Attempt &now, const Work &work);
  double longest() const;
  double shortest() const;
  bool adapts() const { return settings_.dynamic && settings_.adapt == Adaptation::error; }
  PetscErrorCode solveStages(const State &start, State *next, Attempt *now);
  StepError stepError(const State &start, double h) const;
  void noteActions(RodSet rods);
  void finish(const State &start, double h, RodSet rods, State *next);
  void addDynamicWork(const State &start, double h, WorkSums &work) const;
  void addHeldEnergy(const State &state, ExactSum &sum) const;
  void remember(const State &start, double h, State *next) const;
  double nextStep(double time, double *landing) const;
  bool adapt(double h, double dt_min, const StepError &error);
  PetscErrorCode locate(State &start, const Step &step, bool *moved);
  PetscErrorCode goToCritical(State &state, const Step &step, Work *work, bool *moved, bool *finished);
  bool isThorough() const;
  PetscErrorCode locateNext(const State &start, const Step &step, CriticalPoint *point, bool *found);
  Guess alongMode(const State &start, const Step &step);
};

} // namespace tendril
