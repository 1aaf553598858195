#include "tendril/dynamics/integrator.hpp"

#include "tendril/model/scene.hpp"

#include <map>
#include <optional>

namespace tendril {
namespace {

/// All methods. A new one needs its line here and nothing else.
struct Entry {
  const char *name, *meaning;
  std::unique_ptr<Integrator> (*make)(const IntegratorSettings &);
};
constexpr Entry entries[] = {
    {"euler", "backward Euler, first order, most dissipative", makeEuler},
    {"bdf2", "second order, L-stable, keeps its order on stiff rods", makeBdf2},
    {"bdf3", "third order, for motion that stiffness damps: what is not damped may grow", makeBdf3},
    {"sdirk2", "second order, L-stable, two solves a step, first order on stiff rods", makeSdirk2},
    {"sdirk23", "third order, A-stable, two solves a step", makeSdirk23},
    {"sdirk33", "third order, L-stable, three solves a step", makeSdirk33},
    {"midpoint", "second order, keeps the energy within a band, damps nothing", makeMidpoint},
    {"generalized_alpha", "second order, damps high frequencies by -rho_inf", makeGeneralizedAlpha},
    {"symplectic2", "as midpoint, of two stages: half its step at twice its cost", makeSymplectic2},
    {"energy_momentum", "midpoint that keeps the energy of stiff rods, too, two to five solves a step",
     makeEnergyMomentum},
};

} // namespace

/// Strains a moment before the start, by the velocities there; nothing where that is impossible.
static std::optional<std::vector<double>> strainsBefore(StepSolver &solver, double moment, const State &state) {
  IncrementalPotential &potential = solver.potential();
  const Elements &elements = potential.elements();
  Planes back = potential.dofs().makePlanes();
  for (const RodRange &rod : elements.rods) {
    for (int i = 0; i < rod.vertices; ++i)
      back.setVector(0, rod.slot(i), -moment * elements.freedom()[rod.slot(i)] * state.velocity[rod.first_vertex + i]);
    for (int i = 0; rod.twist && i < rod.edges; ++i)
      back[3][rod.slot(i)] = -moment * state.twist_rate[rod.first_edge + i];
    potential.dofs().copyBehindRing(rod, back);
  }
  potential.setBodies(potential.all(), back,
                      [&](const JoinedBody &b) { return BodyRate().add(-moment, state.body_rate[b.body]); });
  potential.turnFrames(potential.all(), back);
  Configuration earlier;
  bool possible = true;
  for (int r = 0; r < potential.all().end; ++r)
    possible = potential.tryMove(back, 1, r, RetractionKind::additive, earlier) && possible;
  if (!solver.team().all(possible)) return std::nullopt;
  setTargets(potential.scene(), elements, state.time - moment, earlier);
  return strainsOf(potential.scene(), elements, earlier);
}

/// Of vertices and edges by the forces on each alone.
static void accelerateRods(IncrementalPotential &potential, const State &state, Rates *a) {
  const Elements &elements = potential.elements();
  for (int r = 0; r < int(elements.rods.size()); ++r) {
    const RodRange &rod = elements.rods[r];
    const Planes &force = potential.gradient(r).equilibrium;
    const double damping = potential.scene().rods[r].material.mass_damping_coefficient;
    for (int i = 0; i < rod.vertices; ++i) {
      const int s = rod.slot(i), v = rod.first_vertex + i;
      if (elements.freedom()[s] != 0 && elements.mass()[s] > 0)
        a->vertex[v] = -force.vector(0, s) / elements.mass()[s] - damping * state.velocity[v];
      if (rod.flat >= 0) a->vertex[v][rod.flat] = 0; // rounding, which would grow
    }
    for (int i = 0; rod.twist && i < rod.edges; ++i) {
      const int s = rod.slot(i), e = rod.first_edge + i;
      if (elements.twistMass()[s] > 0)
        a->edge[e] = -force[3][s] / elements.twistMass()[s] - damping * state.twist_rate[e];
    }
  }
}

/// Of vertices in junctions, by the forces on all of them.
static void accelerateJunctions(IncrementalPotential &potential, const State &state, Rates *a) {
  const Elements &elements = potential.elements();
  std::map<int, double> mass; // of junctions, by the slots of their first members, which have all forces
  const auto joined = elements.joinedVertices(potential.all());
  for (const JoinedVertex &j : joined)
    if (!j.isOnBody()) mass[j.first_slot] += elements.mass()[j.slot];
  for (const JoinedVertex &j : joined) {
    const double whole = elements.freedom()[j.slot] * mass[j.first_slot],
                 damping = potential.scene().rods[j.rod].material.mass_damping_coefficient;
    const int v = elements.rods[j.rod].first_vertex + j.vertex;
    if (whole > 0)
      a->vertex[v] =
          -potential.gradient(j.rod).equilibrium.vector(0, j.first_slot) / whole - damping * state.velocity[v];
  }
}

/// Of bodies, and of the vertices that are tied to them.
static void accelerateBodies(IncrementalPotential &potential, const State &state, Rates *a) {
  const Elements &elements = potential.elements();
  for (const JoinedBody &b : elements.bodies(potential.all())) {
    const Planes &force = potential.gradient(b.rod).equilibrium;
    const MassProperties &all = elements.bodyMass(b.body);
    const Mat3 turned = rotationOf(state, b.group);
    const BodyRate &rate = state.body_rate[b.body];
    BodyRate &of_body = a->body[b.body];
    of_body.translation = -force.vector(0, b.position) / all.mass;
    of_body.momentum = -force.vector(0, b.rotation);
    of_body.spin =
        turned * elements.spinOf(b.body, turned.transpose() * (of_body.momentum - rate.spin.cross(rate.momentum)));
  }
  for (const JoinedVertex &j : elements.joinedVertices(potential.all())) {
    if (!j.isOnBody() || !j.isVertex()) continue;
    const int body = j.body;
    const Vec3 arm = potential.dofs().arm(j), &spin = state.body_rate[body].spin;
    a->vertex[elements.rods[j.rod].first_vertex + j.vertex] =
        a->body[body].translation + a->body[body].spin.cross(arm) + spin.cross(spin.cross(arm));
  }
}

/// (F - dU/dq)/m - alpha v where nothing is held. Strains have the rates that velocities give them.
Rates startAcceleration(StepSolver &solver, double h, const State &state) {
  IncrementalPotential &potential = solver.potential();
  StageRule rest; // at the start: neither velocities nor accelerations
  rest.dt = rest.damping_dt = h;
  Step step;
  step.dt = h;
  step.time = state.time;
  step.rule = &rest;
  solver.begin(state, step);
  std::optional<std::vector<double>> before;
  if (potential.scene().strainsDissipate()) {
    const double moment = 1e-3 * h; // long enough for the strains to change by more than their rounding
    before = strainsBefore(solver, moment, state);
    if (before) {
      rest.damping_dt = moment;
      rest.damping_past = {{-1, before->data()}};
      solver.begin(state, step);
    }
  }
  Rates a{std::vector<Vec3>(state.velocity.size(), Vec3::Zero()), std::vector<double>(state.twist_rate.size(), 0.0),
          std::vector<BodyRate>(state.body_rate.size())};
  accelerateRods(potential, state, &a);
  accelerateJunctions(potential, state, &a);
  accelerateBodies(potential, state, &a);
  return a;
}

std::vector<double> strainsBehind(StepSolver &solver, const State &start, const Step &stage) {
  IncrementalPotential &potential = solver.potential();
  const Elements &elements = potential.elements();
  const StageRule &rule = *stage.rule;
  const double moment = 1e-3; // of damping_dt: long enough for the strains to change by more than their rounding, and
                              // its square is nothing
  Planes moved = potential.dofs().makePlanes();
  Configuration there;
  auto at = [&](double later) { // supports, too
    Step then = stage;
    then.time += later;
    solver.begin(start, then);
    const double along = 1 + later / rule.dt;
    for (const RodRange &rod : elements.rods) {
      for (int i = 0; i < rod.vertices; ++i) {
        const int v = rod.first_vertex + i;
        moved.setVector(0, rod.slot(i),
                        elements.freedom()[rod.slot(i)] *
                            (along * rule.guess.atVertex(v) + later * rule.velocity.atVertex(v)));
      }
      for (int i = 0; rod.twist && i < rod.edges; ++i) {
        const int e = rod.first_edge + i;
        moved[3][rod.slot(i)] = along * rule.guess.atEdge(e) + later * rule.velocity.atEdge(e);
      }
      potential.dofs().copyBehindRing(rod, moved);
    }
    potential.setBodies(potential.all(), moved, [&](const JoinedBody &b) {
      return BodyRate().add(along, rule.guess.ofBody(b.body)).add(later, rule.velocity.ofBody(b.body));
    });
    potential.remainingMotion(potential.all(), moved);
    potential.turnFrames(potential.all(), moved);
    for (int r = 0; r < potential.all().end; ++r)
      if (!potential.tryMove(moved, 1, r, RetractionKind::additive, there)) return std::vector<double>();
    return strainsOf(potential.scene(), elements, there);
  };
  std::vector<double> behind = at(0);
  const std::vector<double> before = at(-moment * rule.damping_dt), after = at(moment * rule.damping_dt);
  if (solver.team().any(behind.empty() || before.empty() || after.empty())) return {};
  // Differences of the stages' strains instead where both are far apart: there the solution is far from the guess.
  constexpr double far = 0.05; // [rad]
  const std::vector<double> first = strainsOf(potential.scene(), elements, potential.start());
  for (std::size_t k = 0; k < behind.size(); ++k) {
    double difference = first[k];
    for (const StageRule::PastStrains &past : rule.damping_past)
      difference += past.weight * (first[k] - past.strains[k]);
    behind[k] -= (after[k] - before[k]) / (2 * moment);
    if (!(std::abs(behind[k] - difference) < far)) behind[k] = difference;
  }
  return behind;
}

std::vector<std::string> integratorNames() {
  std::vector<std::string> names;
  for (const Entry &e : entries) names.emplace_back(e.name);
  return names;
}

std::string integratorMeanings() {
  std::string text;
  for (const Entry &e : entries) text += std::string(text.empty() ? "" : "; ") + e.name + " (" + e.meaning + ")";
  return text;
}

std::unique_ptr<Integrator> makeIntegrator(const IntegratorSettings &settings) {
  for (const Entry &e : entries)
    if (settings.name == e.name) return e.make(settings);
  throw SceneError("there is no integrator '" + settings.name + "'; choose from " + integratorMeanings());
}

} // namespace tendril
