/// Energies under couples at an end, of which half an edge has no cell.
#include "tendril/accuracy/accuracy.hpp"
#include "tendril/energy/derived.hpp"
#include "tendril/io/scene_reader.hpp"

#include "support/rods.hpp"

namespace tendril::test {
namespace {

constexpr double order_tolerance = 0.1; // asked of every boundary: 2.0 +- 0.1

Scene underCouple(int edges, Measure measure, const Vec3 &moment, std::array<double, 2> flexural = {1, 1}) {
  Scene scene = clampedScene(straightRod(edges, measure));
  scene.rods[0].material.flexural_stiffness = flexural;
  scene.moments = {{0, edges - 1, 0, moment}};
  return scene;
}

struct Measured {
  EnergyBudget energy, error;
};

/// Energies at full load with so many edges, and their estimated errors.
Measured measured(int edges, Measure measure, const Vec3 &moment) {
  constexpr int steps = 2;
  const Scene coarse = underCouple(edges, measure, moment), fine = underCouple(2 * edges, measure, moment);
  Simulation run, again;
  Answer answer, finer;
  EXPECT_EQ(solveStatics(run, coarse, statics(steps), &answer), 0);
  EXPECT_EQ(solveStatics(again, fine, statics(steps), &finer), 0);
  EXPECT_TRUE(answer.found && finer.found) << answer.failure << finer.failure;
  return {answer.energy, richardson(coarse, answer, finer).energy_error};
}

/// A couple across a straight rod bends it to a circle, with M^2 L/(2 EI) in it.
TEST(EndCouple, StoresTheEnergyOfACircle) {
  const double moment = 2, exact = 0.5 * moment * moment;
  const Measured round = measured(16, Measure::angle, {0, 0, moment});
  EXPECT_NEAR(round.energy.bend, exact, 1e-5 * exact); // angles are exact; the solver's 1e-6 of the load
  std::array<double, 3> error{};
  for (int k = 0; k < 3; ++k) {
    const int n = 16 << k;
    const Measured m = measured(n, Measure::tan, {0, 0, moment});
    error[k] = m.energy.bend - exact;
    EXPECT_NEAR(m.error.bend, error[k], 0.1 * std::abs(error[k])) << n; // asked for; measured 4 % at most
  }
  EXPECT_NEAR(order(error[0], error[1]), 2, order_tolerance);
  EXPECT_NEAR(order(error[1], error[2]), 2, order_tolerance);
}

/// A couple at an angle to the rod winds it to a helix, and twists it; unequal stiffness makes it no helix.
TEST(EndCouple, StoresEnergiesOfSecondOrder) {
  const struct {
    Vec3 moment;
    std::array<double, 2> flexural;
  } cases[] = {{{0.6, 0, 1.0392}, {1, 1}}, {{0.5, 0.2, 0.8}, {1, 3}}};
  for (const auto &c : cases)
    for (const Measure measure : {Measure::angle, Measure::tan}) {
      std::array<double, 5> e{};
      for (int k = 0; k < 5; ++k) {
        Simulation run;
        Answer answer;
        EXPECT_PETSC(solveStatics(run, underCouple(16 << k, measure, c.moment, c.flexural), statics(2), &answer));
        ASSERT_TRUE(answer.found) << answer.failure;
        e[k] = answer.energy.bend + answer.energy.twist;
      }
      EXPECT_NEAR(order(e[1] - e[0], e[2] - e[1]), 2, order_tolerance);
      EXPECT_NEAR(order(e[2] - e[1], e[3] - e[2]), 2, order_tolerance);
      const double exact = e[4] + (e[4] - e[3]) / 3;
      for (int k = 0; k < 3; ++k)
        EXPECT_NEAR((e[k] - e[k + 1]) * 4 / 3, e[k] - exact, 0.1 * std::abs(e[k] - exact)) << k; // asked for
    }
}

/// Loads that grow from nothing do the work that is stored: the couple's is that of its edge, and of the half edge
/// beyond.
TEST(EndCouple, DoesTheWorkThatIsStored) {
  const int edges = 16, steps = 400;
  const Vec3 moment(0, 0, 2);
  Simulation run;
  const Scene scene = underCouple(edges, Measure::angle, moment);
  EXPECT_PETSC(run.setUp(scene, statics(steps)));
  TimeLoop loop(run.solver, statics(steps));
  double work = 0, turned = 0, factor = 0, stored = 0;
  bool finished = false;
  EXPECT_PETSC(loop.run(
      run.state,
      [&](const State &state, const Diagnostics &row) {
        const Vec3 last = state.position[edges] - state.position[edges - 1];
        const double half = 0.5 / edges * row.time * moment.z(); // the curvature beyond the middle of the edge is M/EI
        const double now = std::atan2(last.y(), last.x()) + half;
        work += 0.5 * (row.time + factor) * moment.z() * (now - turned);
        turned = now;
        factor = row.time;
        stored = row.energy.bend;
        return PetscErrorCode(0);
      },
      &finished));
  ASSERT_TRUE(finished);
  EXPECT_NEAR(work, stored, 1e-5 * stored); // the law is linear, so trapezes are exact; the solver's 1e-6 of the load
}

/// The law `seed` shortens what bends: under a couple M all of a rod has one stretch s, the end edges, too, with EA s
/// (s^2 - 1)/2 + M^2/(B s^3) + M k/s^2 = 0 where it is curved by k at rest. The energies, and what the couple does, are
/// exact then.
TEST(EndCouple, StretchesTheEndAsAllOfARodOfSeed) {
  const double moment = 1.5, axial = 100; // at most 2.7 can be borne
  for (const bool last : {true, false})
    for (const double curved : {0.0, 1.5})
      for (const int edges : {4, 16}) {
        Rod rod = straightRod(edges, Measure::angle);
        for (int v = 1; v <= edges; ++v) {
          const double angle = curved * (v - 0.5) / edges;
          rod.position[std::size_t(v)] =
              rod.position[std::size_t(v - 1)] + Vec3(std::cos(angle), std::sin(angle), 0) / edges;
        }
        if (!last) std::reverse(rod.position.begin(), rod.position.end());
        setBishopDirectors(rod);
        Scene scene = clampedScene(rod);
        scene.rods[0].material.axial_stiffness = axial;
        scene.supports = {hold(scene, 0, last ? 0 : edges, Support::Kind::clamp)};
        scene.supports[0].frame.tangent = Vec3(last ? 1 : -1, 0, 0);
        scene.supports[0].frame.director = Vec3::UnitZ();
        scene.moments = {{0, last ? edges - 1 : 0, 0, Vec3(0, 0, moment)}};
        Simulation run;
        double work = 0;
        runAndWatch(run, scene, statics(40), [&](const Diagnostics &row) { work += row.work.total(); });
        double s = 1; // by Newton
        for (int k = 0; k < 20; ++k) {
          const double f = axial * s * (s * s - 1) / 2 + moment * moment / (s * s * s) + moment * curved / (s * s),
                       d = axial * (3 * s * s - 1) / 2 - 3 * moment * moment / std::pow(s, 4) -
                           2 * moment * curved / (s * s * s);
          s -= f / d;
        }
        for (int e = 0; e < edges; ++e) {
          const double length = (run.state.position[std::size_t(e + 1)] - run.state.position[std::size_t(e)]).norm();
          EXPECT_NEAR(length * edges, s, 1e-5) << edges << " " << e << " " << curved << last; // -snes_rtol 1e-6
        }
        const EnergyBudget budget = energyBudget(run.scene, *run.elements, run.state, 1);
        EXPECT_NEAR(budget.bend, 0.5 * moment * moment / (s * s), 1e-4) << edges << " " << curved << last;
        EXPECT_NEAR(budget.stretch, axial * (s * s - 1) * (s * s - 1) / 8, 1e-4) << edges << " " << curved << last;
        EXPECT_NEAR(work, budget.total(), 1e-3 * work) << edges << " " << curved << last; // trapezes of 40 steps
      }
}

TEST(EndCouple, IsInTheDensityOfTheEnergy) {
  const int edges = 8;
  const Vec3 moment(0.6, 0.3, 1);
  Simulation run;
  runTo(run, underCouple(edges, Measure::angle, moment), statics(2));
  const RodStrains strains = rodStrains(run.scene, *run.elements, run.state, 1, 1);
  double sum = 0;
  for (int v = 0; v <= edges; ++v) sum += strains.strain_energy_density[v] * (v == 0 || v == edges ? 0.5 : 1) / edges;
  const EnergyBudget budget = energyBudget(run.scene, *run.elements, run.state, 1);
  EXPECT_NEAR(sum, budget.stretch + budget.bend + budget.twist, 1e-12 * sum); // the same numbers added up
  EXPECT_NEAR(strains.strain_energy_density[edges], strains.strain_energy_density[edges - 1],
              1e-2); // of one along the rod but for its twist
}

/// Where the end is held, cells reach it.
TEST(EndCouple, BesideASupportOfTheTwistHasNoHalfOfItsOwn) {
  Scene scene = underCouple(8, Measure::angle, {0, 0, 1});
  for (const std::size_t halves : {1, 0}) {
    Simulation run;
    EXPECT_PETSC(run.setUp(scene, statics()));
    EXPECT_EQ(run.elements->end_couples[0].size(), halves);
    scene.supports.push_back(hold(scene, 0, 8, Support::Kind::fix_twist));
  }
}

TEST(EndCouple, EdgesChosenForItsEnergyMeetTheTolerance) {
  SceneFile file = readScene(std::string(TENDRIL_SOURCE_DIR) + "/data/scenes/verify/roll_up.yaml");
  file.scene.rods[0].measure = Measure::tan;
  const double exact = 2 * pi * pi, tolerance = 1e-3;
  Choice choice;
  EXPECT_PETSC(chooseEdges(file.scene, file.drawings, statics(4), {tolerance, Quantity::energy}, &choice));
  Simulation run;
  runTo(run, remesh(file.scene, file.drawings, choice.edges), statics(4));
  const double error = std::abs(energyBudget(run.scene, *run.elements, run.state, 1).bend - exact) / exact;
  EXPECT_LT(error, tolerance);
  EXPECT_GT(error, tolerance / 2) << "too many edges: " << choice.edges[0];
}

} // namespace
} // namespace tendril::test
