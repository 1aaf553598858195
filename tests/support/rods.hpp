#pragma once
/// Scenes and runs for the tests.
#include "tendril/dynamics/simulation.hpp"
#include "tendril/model/builders.hpp"

#include <fstream>
#include <gtest/gtest.h>
#include <sstream>

namespace tendril::test {

/// Fails the test when PETSc reports an error.
#define EXPECT_PETSC(call) ASSERT_EQ((call), PetscErrorCode(0))

/// Rod through points with unit bending stiffness, GJ = 2/3, and EA so large that it does not stretch (EA/EI = 1e10 for
/// length 1).
inline Rod inextensibleRod(const std::vector<Vec3> &points, Measure measure = Measure::tan) {
  Rod rod;
  rod.name = "rod";
  rod.position = points;
  rod.measure = measure;
  rod.material = {1, 1e-6, 1e10, 2.0 / 3, {1, 1}, 0, 0};
  setBishopDirectors(rod);
  return rod;
}

inline Rod straightRod(int edges, Measure measure = Measure::tan, double length = 1) {
  return inextensibleRod(lineShape(Vec3::Zero(), Vec3(length, 0, 0), edges).points, measure);
}

inline Support hold(const Scene &scene, int rod, int vertex, Support::Kind kind) {
  return {kind, rod, vertex, {}, frameAtVertex(scene.rods[rod], vertex)};
}

inline Constraint constraintOn(int rod, int at, Constraint::Kind kind, double stiffness) {
  Constraint c{};
  c.kind = kind;
  c.rod = rod;
  c.at = at;
  c.name = "constraint";
  c.stiffness = stiffness;
  return c;
}
/// \param off from the vertex as drawn
inline Constraint pinTo(const Scene &scene, int rod, int vertex, const Vec3 &off, double stiffness) {
  Constraint c = constraintOn(rod, vertex, Constraint::Kind::pin, stiffness);
  c.point = scene.rods[rod].position[vertex] + off;
  return c;
}
inline Constraint turnTo(int rod, int edge, const Frame &frame, double stiffness) {
  Constraint c = constraintOn(rod, edge, Constraint::Kind::rotation, stiffness);
  c.frame = frame;
  return c;
}

/// Scene of one rod, without gravity, clamped at its first vertex.
inline Scene clampedScene(Rod rod) {
  Scene scene;
  scene.gravity = Vec3::Zero();
  scene.rods = {std::move(rod)};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp)};
  return scene;
}

inline LoopSettings statics(int load_steps = 1) {
  LoopSettings s;
  s.dynamic = false;
  s.dt = 1.0 / load_steps;
  s.t_end = 1;
  return s;
}

inline LoopSettings dynamics(double dt, double t_end) {
  LoopSettings s;
  s.dt = dt;
  s.t_end = t_end;
  return s;
}

/// Runs a scene to its end and calls visit(row of diagnostics) after each step; the test fails when a step does.
template <class Visit> void runAndWatch(Simulation &sim, Scene scene, const LoopSettings &settings, Visit visit) {
  EXPECT_PETSC(sim.setUp(std::move(scene), settings));
  TimeLoop loop(sim.solver, settings);
  bool finished = false;
  EXPECT_PETSC(loop.run(
      sim.state,
      [&](const State &, const Diagnostics &row) {
        visit(row);
        return PetscErrorCode(0);
      },
      &finished));
  EXPECT_TRUE(finished) << loop.failure();
}
inline void runTo(Simulation &sim, Scene scene, const LoopSettings &settings, int *iterations = nullptr) {
  runAndWatch(sim, std::move(scene), settings, [&](const Diagnostics &row) {
    if (iterations) *iterations += row.newton_iterations;
  });
}

/// Row of data/reference/<file> whose first column is `key`, by column names.
inline std::map<std::string, double> referenceRow(const std::string &file, double key) {
  std::ifstream in(std::string(TENDRIL_SOURCE_DIR) + "/data/reference/" + file);
  EXPECT_TRUE(in) << file;
  std::vector<std::string> names;
  std::map<std::string, double> row;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream cells(line);
    std::string cell;
    std::vector<std::string> values;
    while (std::getline(cells, cell, ',')) values.push_back(cell);
    if (names.empty())
      names = values;
    else if (std::abs(std::stod(values[0]) - key) < 1e-9 * std::abs(key))
      for (std::size_t k = 0; k < values.size(); ++k) row[names[k]] = std::stod(values[k]);
  }
  EXPECT_FALSE(row.empty()) << file << " has no row " << key;
  return row;
}

/// Observed order of errors at doubled resolutions.
inline double order(double coarse, double fine) { return std::log2(coarse / fine); }

} // namespace tendril::test
