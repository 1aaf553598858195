#include "tendril/dynamics/time_loop.hpp"

#include "tendril/solver/activity.hpp"

#include <algorithm>
#include <petsctime.h>
#include <sstream>

namespace tendril {

Step TimeLoop::stepOf(const LoopSettings &settings, const State &state, double dt) {
  Step step;
  step.dt = settings.dynamic ? dt : 0;
  step.time = state.time + dt;
  if (std::abs(step.time - settings.t_end) < 1e-9 * settings.dt)
    step.time = settings.t_end; // no sliver of a step from rounding
  step.load_factor = settings.dynamic ? 1 : step.time;
  step.mixed = settings.mixed;
  step.hessian = settings.hessian;
  return step;
}

/// Newton may come to an unstable equilibrium, or pass it and only meet indefinite Hessians.
static bool mayPassCritical(const NewtonReport &report) {
  return report.first_negative_pivots > 0 || report.shifts > 0;
}

/// Whether to look behind a critical point for more. It costs some solves of the step.
bool TimeLoop::isThorough() const {
  return settings_.bifurcation != Bifurcation::locate || solver_.potential().elements().edges() <= most_searched_edges;
}

/// Stability may be lost within the step: finds where, as often as the way that the run takes loses it, and moves
/// `start` there when the run is to end or to go on along another branch.
PetscErrorCode TimeLoop::locate(State &start, const Step &step, bool *moved) {
  constexpr double growth =
      8; // of the parts of a step behind a critical point: the shape changes by the root of the way there
  PetscFunctionBeginUser;
  State from = start, ahead;
  Step part = step;
  double reach = located_ > 0 ? growth * (start.time - located_) : step.time - start.time;
  auto settle = [&](const State &at, double factor, NewtonReport *report) { // the way that the run takes
    PetscFunctionBeginUser;
    part.time = part.load_factor = factor;
    PetscCall(solver_.solve(at, part, report));
    ahead = at;
    if (report->converged) solver_.potential().commit(ahead);
    PetscFunctionReturn(0);
  };
  for (bool more = true; more; more = part.time < step.time) {
    NewtonReport report;
    report.shifts = 1; // of the whole step that is known
    const double end = std::min(step.time, from.time + reach);
    if (from.time > start.time || end < step.time) {
      PetscCall(settle(from, end, &report));
      if (!report.converged) break;
    }
    CriticalPoint point;
    bool found = false;
    if (mayPassCritical(report)) PetscCall(locateNext(from, part, &point, &found));
    reach = growth * (end - from.time);
    if (found) {
      point.state->step = start.step;
      located_ = point.load_factor;
      if (on_critical) PetscCall(on_critical(point));
      bool leaves = false;
      Planes mode;
      if (settings_.bifurcation == Bifurcation::switch_branch)
        PetscCall(criticalMode(solver_, point, step, &mode, &leaves));
      if (leaves) mode_ = std::move(mode);
      *moved = settings_.bifurcation == Bifurcation::stop || leaves;
      if (*moved) start = *point.state;
      if (*moved || !point.lost || !isThorough()) break;
      PetscCall(settle(*point.lost, point.lost->time, &report));
      if (!report.converged) break;
      reach = growth * (part.time - point.load_factor);
    }
    from = ahead;
  }
  PetscFunctionReturn(0);
}

/// Where stability is lost first between an equilibrium and the end of the step.
PetscErrorCode TimeLoop::locateNext(const State &start, const Step &step, CriticalPoint *point, bool *found) {
  PetscFunctionBeginUser;
  const double width = step.time - start.time;
  const SharpTolerance sharp(solver_);
  auto follow = [&](const BranchPoint &from, double factor, BranchPoint *to) -> PetscErrorCode {
    PetscFunctionBeginUser;
    *to = from;
    to->parameter = factor;
    to->found = false;
    if (factor <= 0) PetscFunctionReturn(0); // without loads a rod may be in any position
    Step there = step;
    there.time = there.load_factor = factor;
    NewtonReport report;
    PetscCall(solver_.solve(from.state, there, &report, Seek::equilibrium));
    to->found = report.converged && SharpTolerance::isMet(report.residual);
    if (!to->found) PetscFunctionReturn(0);
    PetscCall(countUnstable(solver_, &to->unstable));
    solver_.potential().commit(to->state);
    // Before a limit point a rod moves by the root of the interval; beyond it, Newton jumps.
    to->found = to->unstable >= 0 &&
                distanceBetween(from.state, to->state) <= std::sqrt(std::abs(factor - from.parameter) / width);
    PetscFunctionReturn(0);
  };
  BranchPoint low;
  low.parameter = start.time;
  low.state = start;
  PetscCall(locateCritical(solver_, step, follow, low, step.time, std::abs(step.time), point, found));
  PetscFunctionReturn(0);
}

/// Displacements along the critical mode from which Newton begins a step: as long, and to the side, as lowers the
/// energy most.
Guess TimeLoop::alongMode(const State &start, const Step &step) {
  IncrementalPotential &potential = solver_.potential();
  solver_.begin(start, step);
  Configuration trial = potential.iterate();
  double best = HUGE_VAL, best_scale = 0;
  for (double scale = 1e-6; scale < 2; scale *= 2)
    for (const double s : {scale, -scale}) {
      const double energy = potential.tryMove(*mode_, s, trial) ? potential.energy(trial) : HUGE_VAL;
      if (!(energy < best) || best - energy < 1e-12 * std::abs(energy)) continue; // the first of two that are alike
      best = energy;
      best_scale = s;
    }
  Guess guess{potential.dofs().makePlanes(), {}};
  if (!potential.tryMove(*mode_, best_scale, trial)) return guess;
  potential.accept(trial);
  potential.coordinates(guess.unknowns);
  return guess;
}

/// Solves the stages of a step one after the other; the potential's iterate is the end of the step then. The state is
/// not touched.
PetscErrorCode TimeLoop::solveStages(const State &start, const Step &step, NewtonReport *report) {
  PetscFunctionBeginUser;
  IncrementalPotential &potential = solver_.potential();
  const bool dissipates = potential.scene().stiffnessDissipates();
  stages_.clear();
  actions_.clear();
  solver_.on_block = [&](RodSet rods) { noteActions(start, rods); };
  for (bool more = true; more;) {
    StageRule rule = integrator_->stage(start, step.dt, stages_);
    Step stage = step;
    stage.dt = rule.dt;
    stage.rule = integrator_->leavesChords() ? nullptr : &rule;
    if (rule.fraction != 1) stage.time = start.time + rule.fraction * step.dt;
    std::vector<double> behind;
    if (dissipates && rule.tangent_rates) behind = strainsBehind(solver_, start, stage);
    if (!behind.empty()) rule.damping_past = {{-1, behind.data()}};
    NewtonReport one;
    actions_.emplace_back(2 * moving_.size());
    PetscCall(solver_.solve(start, stage, &one));
    const int iterations = one.iterations;
    one.iterations += report->iterations; // stages follow each other; blocks of rods do not
    report->include(one);
    report->converged = one.converged;
    report->reason = one.reason;
    report->negative_pivots = one.negative_pivots;
    if (!one.converged) PetscFunctionReturn(0);
    stages_.push_back(potential.stageRates(rule));
    more = integrator_->goesOn(start, stages_, iterations);
    if (dissipates && (more || !integrator_->endsAtStage()))
      stages_.back().strains = strainsOf(potential.elements(), potential.iterate());
  }
  if (!integrator_->endsAtStage() && !potential.moveOn(step.time, integrator_->end(start, step.dt, stages_))) {
    report->converged = false;
    report->reason = "the end of the step, beyond its last stage, is not a possible configuration";
  }
  PetscFunctionReturn(0);
}

/// What the moving supports of some rods do at the stage just solved.
void TimeLoop::noteActions(const State &start, RodSet rods) {
  for (std::size_t k = 0; k < moving_.size(); ++k) {
    const int rod = solver_.potential().scene().supports[moving_[k]].rod;
    if (rod < rods.begin || rod >= rods.end) continue;
    const std::array<Vec3, 2> action = solver_.potential().supportAction(start, moving_[k]);
    std::copy(action.begin(), action.end(), actions_.back().begin() + 2 * k);
  }
}

/// Of the step just solved, without what the inertia of held vertices takes. Weights of what is not remembered are
/// those of the last stage.
Work TimeLoop::dynamicWork(const State &start, double h) const {
  const IncrementalPotential &potential = solver_.potential();
  const Scene &scene = potential.scene();
  Work work{workOfLoads(scene, potential.elements(), potential.start(), potential.iterate(), 1, 1), 0};
  if (moving_.empty()) return work;
  const std::vector<double> weights = integrator_->forceWeights(start, h, actions_.size());
  const std::size_t n = actions_.back().size();
  SupportActions mean(n, Vec3::Zero());
  for (std::size_t j = 0; j < weights.size(); ++j)
    for (std::size_t k = 0; k < n; ++k) {
      const std::size_t past = (j - actions_.size()) * n + k;
      mean[k] += weights[j] * (j < actions_.size()                   ? actions_[j][k]
                               : past < start.support_actions.size() ? start.support_actions[past]
                                                                     : actions_.back()[k]);
    }
  work.supports = workOfSupports(scene, potential.elements(), potential.start(), potential.iterate(), start.time,
                                 potential.step().time, mean);
  return work;
}

/// Kinetic energy of the vertices that moving supports hold [J].
double TimeLoop::movedKinetic(const State &state) const {
  const IncrementalPotential &potential = solver_.potential();
  double sum = 0;
  for (const int s : moving_) {
    const Support &support = potential.scene().supports[s];
    const RodRange &rod = potential.elements().rods[support.rod];
    if (support.holdsPosition())
      sum += 0.5 * potential.elements().mass()[rod.slot(support.vertex)] *
             state.velocity[rod.first_vertex + support.vertex].squaredNorm();
  }
  return sum;
}

/// Velocities and memory of the state; held vertices have those of their supports.
void TimeLoop::finishStages(State &state, double h) {
  const IncrementalPotential &potential = solver_.potential();
  const Scene &scene = potential.scene();
  const bool keeps = integrator_->remembersStrains() > 0 && scene.stiffnessDissipates();
  if (keeps) {
    std::vector<double> before = strainsOf(potential.elements(), potential.start());
    if (integrator_->remembersStrains() > 1)
      before.insert(before.end(), state.strains.begin(),
                    state.strains.begin() + std::min(before.size(), state.strains.size()));
    state.strains = std::move(before);
  }
  if (keeps && !integrator_->endsAtStage()) // as far beyond the middle
    std::transform(state.strains.begin(), state.strains.end(), stages_.back().strains.begin(), state.strains.begin(),
                   [](double start, double middle) { return 2 * middle - start; });
  if (integrator_->remembersActions() > 0 && !moving_.empty()) {
    std::vector<Vec3> &kept = state.support_actions;
    kept.insert(kept.begin(), actions_.back().begin(), actions_.back().end());
    kept.resize(std::min(kept.size(), integrator_->remembersActions() * actions_.back().size()));
  }
  integrator_->finish(state, h, stages_);
  if (!state.memory.empty()) state.dt_before = std::exchange(state.last_dt, h);
  if (integrator_->leavesChords()) return; // of held vertices, too
  for (const Support &support : scene.supports) {
    if (!support.holdsPosition()) continue;
    const int v = potential.elements().rods[support.rod].first_vertex + support.vertex;
    state.velocity[v] = support.motion.velocityAt(potential.step().time);
    for (Rates &rates : state.memory) rates.vertex[v].setZero();
  }
}

TimeLoop::StepError TimeLoop::stepError(const State &start, double h) const {
  StepError worst;
  const Combination error = integrator_->error(start, h, stages_);
  worst.known = !error.empty();
  const IncrementalPotential &potential = solver_.potential();
  for (std::size_t r = 0; worst.known && r < potential.elements().rods.size(); ++r) {
    const RodRange &rod = potential.elements().rods[r];
    double wrong = 0, moved = 0, turned_wrong = 0, turned = 0;
    for (int v = rod.first_vertex; v < rod.first_vertex + rod.vertices; ++v) {
      if (potential.elements().freedom()[potential.elements().vertex_slot[v]] == 0) continue;
      wrong += error.atVertex(v).squaredNorm();
      moved += potential.iterate().displacementAt(potential.elements().vertex_slot[v], potential.start()).squaredNorm();
    }
    for (int e = rod.first_edge; rod.twist && e < rod.first_edge + rod.edges; ++e) {
      turned_wrong += std::pow(error.atEdge(e), 2);
      turned += std::pow(stages_.back().displacement.edge[e], 2);
    }
    const double length = std::max(potential.length(int(r)), 1e-300);
    auto norm = [&](double positions, double twists) {
      return std::sqrt(positions / (length * length * rod.vertices) + twists / rod.edges);
    };
    worst.error = std::max(worst.error, norm(wrong, turned_wrong));
    worst.moved = std::max(worst.moved, norm(moved, turned));
  }
  return worst;
}

/// Length of the next step [s]: no sliver is left before a time at which a step has to end.
double TimeLoop::nextStep(double time, double *landing) const {
  *landing = settings_.t_end;
  const bool fixed = settings_.adapt == Adaptation::none;
  const double interval = settings_.output_interval;
  if (interval > 0) *landing = std::min(settings_.t_end, interval * (1 + std::floor(time / interval * (1 + 1e-12))));
  const double left = *landing - time, parts = std::max(1.0, std::ceil(left / control.dt * (1 - 1e-9))),
               h = left / parts;
  if (!fixed) return h;
  if (interval == 0) return std::min(control.dt, left);
  return std::abs(h - control.dt) < 1e-9 * control.dt ? control.dt : h; // dt itself where it divides the interval
}

/// Proportional-integral control of the step (Gustafsson, Lundh and Soederlind 1988): sets the next one, and tells
/// whether this one is good enough.
bool TimeLoop::adapt(double h, double dt_min, const StepError &error) {
  if (!error.known) return true;
  const double power = 1.0 / (integrator_->order() + 1);
  const double ratio = std::max(error.error / (settings_.dt_atol + settings_.dt_rtol * error.moved), 1e-10);
  const bool accept = ratio <= 1 || h <= dt_min * (1 + 1e-9);
  double factor = std::clamp(0.9 * std::pow(ratio, -power), 0.1, 0.9);
  if (ratio <= 1)
    factor = std::clamp(0.9 * std::pow(ratio, -0.7 * power) *
                            std::pow(control.error > 0 ? control.error : ratio, 0.4 * power),
                        0.5, 2.0);
  double next = factor * h;
  if (accept && factor >= 1)
    next = std::max(next, control.dt); // a step cut short to land says nothing against the length asked for
  if (settings_.dt_max > 0) next = std::min(next, settings_.dt_max);
  control.dt = std::max(next, dt_min);
  if (accept) control.error = ratio;
  return accept;
}

PetscErrorCode TimeLoop::run(State &state, const Observer &observe, bool *finished) {
  PetscFunctionBeginUser;
  IncrementalPotential &potential = solver_.potential();
  const double longest = settings_.dt_max > 0 ? std::min(settings_.dt, settings_.dt_max) : settings_.dt;
  const double dt_min = settings_.dt_min > 0 ? settings_.dt_min : longest / 1024;
  const bool adapts = settings_.dynamic && settings_.adapt == Adaptation::error;
  if (control.dt == 0) control.dt = longest;
  double &dt = control.dt;
  int &good = control.good;
  bool &stable = control.stable;
  int rejected = 0, in_vain = 0; // steps since the last one accepted, and their iterations
  PetscLogDouble begin, now;
  PetscCall(PetscTime(&begin));
  // A run that begins has no step behind it, whatever the loop has run before.
  const bool goes_on = !std::isnan(control.energy) && (settings_.dynamic || state.time > 0);
  if (!goes_on)
    control.energy =
        energyBudget(potential.scene(), potential.elements(), state, settings_.dynamic ? 1 : state.time).total();
  moving_ = movingSupports(potential.scene());
  Work work; // since the last row
  *finished = false;
  const bool plain = !settings_.dynamic || (integrator_->leavesChords() && !adapts && !settings_.estimate_error);
  State next = state; // what the blocks that have converged come to; the state itself stays as it is until all have
  EnergyBudget energy;
  while (state.time < settings_.t_end) {
    if (settings_.dynamic && state.memory.empty())
      PetscCall(integrator_->begin(solver_, dt, state)); // at the start, and where the state was written
    double landing;
    const double h = nextStep(state.time, &landing);
    Step step = stepOf(settings_, state, h);
    if (std::abs(step.time - landing) < 1e-9 * h) step.time = landing;
    const Doing here([&](std::ostream &out) {
      out << (settings_.dynamic ? "step at time " : "load step at factor ") << state.time << " of " << settings_.t_end
          << (settings_.dynamic ? ", dt " : ", increment ") << h;
      if (rejected > 0) out << ", after " << rejected << " that failed";
    });
    NewtonReport report;
    energy = {};
    auto addEnergy = [&](const State &end, int r) {
      energy += energyBudget(potential.scene(), potential.elements(), end, potential.iterate(),
                             settings_.dynamic ? 1 : step.time, r);
    };
    StepError error;
    if (plain) { // each block is committed while it is in the cache
      solver_.on_block = [&](RodSet rods) {
        potential.commit(next, rods);
        if (settings_.dynamic) noteActions(state, rods);
        for (int r = rods.begin; r < rods.end; ++r) addEnergy(next, r);
      };
      actions_.assign(1, SupportActions(2 * moving_.size()));
      std::optional<Guess> guess;
      if (mode_) guess = alongMode(state, step);
      PetscCall(solver_.solve(state, step, &report, Seek::minimum, guess ? &*guess : nullptr));
      solver_.on_block = nullptr;
    } else {
      PetscCall(solveStages(state, step, &report));
      solver_.on_block = nullptr;
      if (report.converged && (adapts || settings_.estimate_error)) error = stepError(state, h);
      if (report.converged && adapts && !adapt(h, dt_min, error)) { // the state was not touched
        ++rejected;
        in_vain += report.iterations;
        continue;
      }
    }
    // Couples have no potential: the inertia of the symmetric part says nothing about stability.
    const bool detects =
        !settings_.dynamic && settings_.bifurcation != Bifurcation::off && potential.scene().moments.empty();
    const bool passed =
        report.first_negative_pivots > 0 || (settings_.bifurcation != Bifurcation::locate && mayPassCritical(report));
    if (detects && stable && passed && located_ <= state.time) {
      bool moved = false;
      const State before = state;
      PetscCall(locate(state, step, &moved));
      *finished = moved && settings_.bifurcation == Bifurcation::stop;
      if (*finished) PetscFunctionReturn(0);
      if (moved) {
        work += staticWork(potential.scene(), potential.elements(), before, state);
        next = state;
        stable = false;
        continue;
      }
    }
    if (report.converged) mode_.reset();
    if (report.converged && settings_.dynamic) {
      work = dynamicWork(state, h);
      work.supports -= movedKinetic(state);
    }
    if (report.converged && plain) {
      next.time = step.time;
      next.step = state.step + 1;
      if (!settings_.dynamic)
        work +=
            staticWork(potential.scene(), potential.elements(), state, next, potential.start(), potential.iterate());
      std::swap(state, next);
    } else if (report.converged) {
      finishStages(state, h);
      potential.commitConfiguration(state);
      for (int r = 0; r < potential.all().end; ++r) addEnergy(state, r);
      control.error_sum += error.error;
    }
    if (!report.converged) { // the state was not touched
      ++rejected;
      in_vain += report.iterations;
      good = 0;
      dt = 0.5 * h;
      // A short last step may be halved as often, unless it was said how short steps may be.
      const double shortest = settings_.dt_min > 0 ? dt_min : std::min(dt_min, (settings_.t_end - state.time) / 1024);
      if (!report.lost && dt >= shortest * (1 - 1e-9)) continue;
      std::ostringstream message;
      message << (settings_.dynamic ? "step at time " : "load step at factor ") << state.time << " failed with "
              << (settings_.dynamic ? "dt " : "increment ") << h << ": " << report.reason << " (" << report.iterations
              << (report.iterations == 1 ? " iteration)" : " iterations)");
      failure_ = message.str();
      PetscFunctionReturn(0);
    }
    stable = report.negative_pivots == 0;
    if (!settings_.dynamic && report.iterations <= 4 && report.escapes == 0) // load steps grow where they are easy
      dt = std::min(2 * dt, 4 * settings_.dt);
    else if (!adapts && dt < settings_.dt && ++good >= 4) {
      dt = std::min(2 * dt, settings_.dt);
      good = 0;
    }
    if (settings_.dynamic) work.supports += movedKinetic(state);
    Diagnostics row;
    row.time = state.time;
    row.dt = h;
    row.energy = energy;
    row.work = std::exchange(work, {});
    row.dissipated = control.energy + row.work.total() - row.energy.total();
    control.energy = row.energy.total();
    row.newton_iterations = report.iterations;
    row.line_search_trials = report.trials;
    row.negative_pivots = report.negative_pivots;
    row.rejected_steps = std::exchange(rejected, 0);
    row.rejected_iterations = std::exchange(in_vain, 0);
    PetscCall(PetscTime(&now));
    row.wall_seconds = now - begin;
    row.error_estimate = control.error_sum;
    control.rounding_sum = settings_.dynamic ? control.rounding_sum + report.rounding_error : report.rounding_error;
    row.rounding_error = control.rounding_sum;
    PetscCall(observe(state, row));
    if (stops && state.time < settings_.t_end && stops()) PetscFunctionReturn(0);
  }
  *finished = true;
  PetscFunctionReturn(0);
}

} // namespace tendril
