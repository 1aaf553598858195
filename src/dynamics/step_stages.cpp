/// The stages of a step in time: their solves, what supports do in them, the error of the step.
#include "tendril/dynamics/time_loop.hpp"

#include "tendril/layout/same_vertices.hpp"
#include "tendril/solver/hints.hpp"

#include <algorithm>

namespace tendril {

/// Solves the stages of a step one after the other; the potential's iterate is the end of the step then.
PetscErrorCode TimeLoop::solveStages(const State &start, State *next, Attempt *now) {
  PetscFunctionBeginUser;
  IncrementalPotential &potential = solver_.potential();
  const bool dissipates = potential.scene().strainsDissipate();
  const double h = now->h;
  stages_.clear();
  actions_.clear();
  StageRule rule; // of the last stage, which the potential has until the step ends; and what it refers to
  std::vector<double> behind;
  for (bool more = true; more;) {
    rule = integrator_->stage(start, h, stages_);
    Step stage = now->step;
    stage.dt = rule.dt;
    stage.rule = &rule;
    if (rule.fraction != 1) stage.time = start.time + rule.fraction * h;
    behind.clear();
    if (dissipates && rule.tangent_rates) behind = strainsBehind(solver_, start, stage);
    if (!behind.empty()) rule.damping_past = {{-1, behind.data()}};
    actions_.emplace_back(2 * moving_.size());
    StageRates &rates = stages_.emplace_back();
    const bool is_end = integrator_->endsAtStage() && int(stages_.size()) >= integrator_->stages(start);
    solver_.on_block = [&](RodSet rods) {
      potential.stageRates(rods, rates);
      noteActions(rods);
      if (!is_end) return;
      finish(start, h, rods, next);
      now->commit(potential, rods, next);
    };
    solver_.on_again = [now] { now->forget(); };
    NewtonReport one;
    PetscCall(solver_.solve(start, stage, &one));
    solver_.on_block = nullptr;
    solver_.on_again = nullptr;
    const int iterations = one.iterations;
    NewtonReport &report = now->report;
    one.iterations += report.iterations; // stages follow each other; blocks of rods do not
    report.include(one);
    report.converged = one.converged;
    report.reason = one.reason;
    report.negative_pivots = one.negative_pivots;
    if (!one.converged) PetscFunctionReturn(0);
    more = integrator_->goesOn(start, stages_, iterations);
    if (dissipates && (more || !integrator_->endsAtStage()))
      rates.strains = strainsOf(potential.scene(), potential.elements(), potential.iterate());
  }
  if (integrator_->endsAtStage()) PetscFunctionReturn(0);
  const bool possible = potential.moveOn(now->step.time, integrator_->end(start, h, stages_));
  if (solver_.team().any(!possible)) {
    now->report.converged = false;
    const std::string near = possible ? "" : nearObstacle(potential, potential.all());
    now->report.reason = "the end of the step, beyond its last stage, is not a possible configuration" +
                         solver_.team().textOfFirst(near.empty() ? HUGE_VAL : solver_.team().rank(), near);
    PetscFunctionReturn(0);
  }
  for (const NewtonSolver &block : solver_.blocks()) {
    finish(start, h, block.rods(), next);
    now->commit(potential, block.rods(), next);
  }
  PetscFunctionReturn(0);
}

/// Velocities and memory of some rods at the end of the step; vertices that supports move have the velocities of these.
void TimeLoop::finish(const State &start, double h, RodSet rods, State *next) {
  const IncrementalPotential &potential = solver_.potential();
  const Piece piece(potential.elements(), rods);
  integrator_->velocity(start, h, stages_).assignTo(piece, *next);
  const std::vector<Combination> memory = integrator_->remembers(start, h, stages_);
  next->memory.resize(memory.size());
  for (std::size_t n = 0; n < memory.size(); ++n) {
    next->memory[n].vertex.resize(start.velocity.size());
    next->memory[n].edge.resize(start.twist_rate.size());
    next->memory[n].body.resize(start.body_rate.size());
    memory[n].assignTo(piece, next->memory[n]);
  }
  for (int r = rods.begin; r < rods.end && !moving_.empty(); ++r)
    for (const int k : moving_of_[r]) {
      const Support *support = moving_[k].support;
      if (!support || !support->holdsPosition()) continue;
      forSameVertices(potential.elements(), r, support->vertex, [&](int rod, int vertex) {
        const int v = potential.elements().rods[rod].first_vertex + vertex;
        next->velocity[v] = support->motion.velocityAt(potential.step().time);
        for (Rates &rates : next->memory) rates.vertex[v].setZero();
      });
    }
}

/// What the moving holders of some rods do at the stage just solved.
void TimeLoop::noteActions(RodSet rods) {
  for (int r = rods.begin; r < rods.end && !moving_.empty(); ++r)
    for (const int k : moving_of_[r]) {
      const std::array<Vec3, 2> action = solver_.potential().actionOf(moving_[k]);
      std::copy(action.begin(), action.end(), actions_.back().begin() + 2 * k);
    }
}

/// Of the step just solved, without what the inertia of held vertices takes. Weights of what is not remembered are
/// those of the last stage.
void TimeLoop::addDynamicWork(const State &start, double h, WorkSums &work) const {
  const IncrementalPotential &potential = solver_.potential();
  const Scene &scene = potential.scene();
  addWorkOfLoads(scene, potential.elements(), potential.start(), potential.iterate(), 1, 1, work.loads);
  if (moving_.empty()) return;
  const std::vector<double> weights = integrator_->forceWeights(start, h, actions_.size());
  const std::size_t n = actions_.back().size(),
                    remembered = start.support_actions.size() % n == 0 ? start.support_actions.size() : 0;
  auto mean = [&](std::size_t k) {
    Vec3 sum = Vec3::Zero();
    for (std::size_t j = 0; j < weights.size(); ++j) {
      const std::size_t past = (j - actions_.size()) * n + k;
      sum += weights[j] * (j < actions_.size() ? actions_[j][k]
                           : past < remembered ? start.support_actions[past]
                                               : actions_.back()[k]);
    }
    return sum;
  };
  for (std::size_t k = 0; k < moving_.size(); ++k)
    (moving_[k].collider ? work.obstacles : work.supports)
        .add(workOf(moving_[k], {mean(2 * k), mean(2 * k + 1)}, potential.elements(), potential.start(),
                    potential.iterate(), start.time, potential.step().time));
}

/// Kinetic energy of the vertices that moving supports hold [J].
void TimeLoop::addHeldEnergy(const State &state, ExactSum &sum) const {
  const IncrementalPotential &potential = solver_.potential();
  for (const Holder &h : moving_) {
    const RodRange &rod = potential.elements().rods[h.rod];
    if (h.support && h.support->holdsPosition())
      sum.add(0.5 * massWithSame(potential.elements(), h.rod, h.support->vertex) *
              state.velocity[rod.first_vertex + h.support->vertex].squaredNorm());
  }
}

/// What the state at the end of the step remembers of strains, actions and the length of the step.
void TimeLoop::remember(const State &start, double h, State *next) const {
  const IncrementalPotential &potential = solver_.potential();
  const bool keeps = integrator_->remembersStrains() > 0 && potential.scene().strainsDissipate();
  if (keeps) {
    std::vector<double> before = strainsOf(potential.scene(), potential.elements(), potential.start());
    if (!integrator_->endsAtStage()) // as far beyond the middle
      std::transform(before.begin(), before.end(), stages_.back().strains.begin(), before.begin(),
                     [](double first, double middle) { return 2 * middle - first; });
    if (integrator_->remembersStrains() > 1)
      before.insert(before.end(), start.strains.begin(),
                    start.strains.begin() + std::min(before.size(), start.strains.size()));
    next->strains = std::move(before);
  } else
    next->strains = start.strains;
  next->support_actions.clear();
  if (integrator_->remembersActions() > 0 && !moving_.empty()) {
    std::vector<Vec3> &kept = next->support_actions;
    kept = actions_.back();
    kept.insert(kept.end(), start.support_actions.begin(), start.support_actions.end());
    kept.resize(std::min(kept.size(), integrator_->remembersActions() * actions_.back().size()));
  }
  next->last_dt = next->memory.empty() ? start.last_dt : h;
  next->dt_before = next->memory.empty() ? start.dt_before : start.last_dt;
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
    for (const JoinedBody &b : potential.elements().bodies({int(r), int(r) + 1})) {
      const BodyRate off = error.ofBody(b.body), &way = stages_.back().displacement.body[b.body];
      const MassProperties &all = potential.elements().bodyMass(b.body);
      const double square = all.inertia.trace() / all.mass;
      wrong += off.translation.squaredNorm() + square * off.spin.squaredNorm();
      moved += way.translation.squaredNorm() + square * way.spin.squaredNorm();
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
