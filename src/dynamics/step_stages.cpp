/// The stages of a step in time: their solves, what supports do in them, the error of the step.
#include "tendril/dynamics/time_loop.hpp"

#include <algorithm>

namespace tendril {

/// Solves the stages of a step one after the other; the potential's iterate is the end of the step then. The state is
/// not touched.
PetscErrorCode TimeLoop::solveStages(const State &start, const Step &step, NewtonReport *report) {
  PetscFunctionBeginUser;
  IncrementalPotential &potential = solver_.potential();
  const bool dissipates = potential.scene().strainsDissipate();
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
      stages_.back().strains = strainsOf(potential.scene(), potential.elements(), potential.iterate());
  }
  if (!integrator_->endsAtStage() && !potential.moveOn(step.time, integrator_->end(start, step.dt, stages_))) {
    report->converged = false;
    report->reason = "the end of the step, beyond its last stage, is not a possible configuration";
  }
  PetscFunctionReturn(0);
}

/// What moving supports and constraints of some rods do at the stage just solved.
void TimeLoop::noteActions(const State &start, RodSet rods) {
  for (std::size_t k = 0; k < moving_.size(); ++k) {
    if (moving_[k].rod < rods.begin || moving_[k].rod >= rods.end) continue;
    const std::array<Vec3, 2> action = solver_.potential().actionOf(moving_[k], start);
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
  HolderActions mean(n, Vec3::Zero());
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
  for (const Holder &h : moving_) {
    const RodRange &rod = potential.elements().rods[h.rod];
    if (h.support && h.support->holdsPosition())
      sum += 0.5 * potential.elements().mass()[rod.slot(h.support->vertex)] *
             state.velocity[rod.first_vertex + h.support->vertex].squaredNorm();
  }
  return sum;
}

/// Velocities and memory of the state; held vertices have those of their supports.
void TimeLoop::finishStages(State &state, double h) {
  const IncrementalPotential &potential = solver_.potential();
  const Scene &scene = potential.scene();
  const bool keeps = integrator_->remembersStrains() > 0 && scene.strainsDissipate();
  if (keeps) {
    std::vector<double> before = strainsOf(potential.scene(), potential.elements(), potential.start());
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

} // namespace tendril
