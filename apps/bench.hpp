#pragma once
/// \file bench.hpp
/// What the benchmarks and the test of the speed share: a scene of any size, and LAPACK's band solver as the yardstick
/// of a machine.

#include "tendril/dynamics/simulation.hpp"
#include "tendril/model/builders.hpp"

#include <petscblaslapack.h>

#include <algorithm>
#include <chrono>

// PETSc links LAPACK but does not declare these.
extern "C" {
void dpbtrf_(const char *uplo, const PetscBLASInt *n, const PetscBLASInt *kd, double *ab, const PetscBLASInt *ldab,
             PetscBLASInt *info);
void dpbtrs_(const char *uplo, const PetscBLASInt *n, const PetscBLASInt *kd, const PetscBLASInt *nrhs,
             const double *ab, const PetscBLASInt *ldab, double *b, const PetscBLASInt *ldb, PetscBLASInt *info);
}

namespace tendril::bench {

class Stopwatch {
public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count(); }

private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

/// Straight cantilevers side by side, of the rubber of data/scenes/cantilever.yaml. Their edges are 1 cm long whatever
/// their number, so that an edge is as stiff in a long rod as in a short one.
inline Scene cantilevers(int rods, int edges) {
  constexpr double edge_length = 0.01, spacing = 0.05, young = 1e7, poisson = 0.5; // [m], [m], [Pa]
  Scene scene;
  for (int r = 0; r < rods; ++r) {
    Rod rod;
    rod.name = "rod" + std::to_string(r);
    rod.position = lineShape(Vec3(0, 0, r * spacing), Vec3(edges * edge_length, 0, r * spacing), edges).points;
    rod.material =
        homogeneousMaterial({SectionShape::circle, {0.005, 0.005}}, young, young / (2 * (1 + poisson)), 1200);
    setBishopDirectors(rod);
    scene.supports.push_back({Support::Kind::clamp, r, 0, {}, frameAtVertex(rod, 0)});
    scene.rods.push_back(std::move(rod));
  }
  return scene;
}

/// A symmetric positive definite band as wide as that of a rod's Hessian (4 unknowns per edge, each coupled to the next
/// 10), factored and solved by LAPACK: what the linear algebra of a Newton iteration costs at least, in general
/// software on this machine.
class LapackBand {
public:
  explicit LapackBand(int edges) : n_(4 * edges), matrix_(std::size_t(n_) * width, -0.09), right_(n_) {
    for (std::size_t j = 0; j < std::size_t(n_); ++j) matrix_[j * width] = 2;
  }
  /// Seconds for dpbtrf and dpbtrs with one right-hand side; the copies that they work in are made before. Negative
  /// when LAPACK fails.
  double factorAndSolve() {
    const PetscBLASInt kd = width - 1, ld = width, one = 1;
    PetscBLASInt bad_factor, bad_solve;
    factor_ = matrix_;
    std::fill(right_.begin(), right_.end(), 1.0);
    const Stopwatch watch;
    dpbtrf_("L", &n_, &kd, factor_.data(), &ld, &bad_factor);
    dpbtrs_("L", &n_, &kd, &one, factor_.data(), &ld, right_.data(), &n_, &bad_solve);
    const double seconds = watch.seconds();
    return bad_factor == 0 && bad_solve == 0 ? seconds : -1;
  }

private:
  static constexpr int width = 11; ///< diagonal and half-bandwidth
  PetscBLASInt n_;
  std::vector<double> matrix_, factor_, right_;
};

/// What one run through the time loop did.
struct StepsTaken {
  int steps = 0, newton_iterations = 0, rejected = 0;
  double seconds = 0;
};

/// Runs the time loop from the simulation's state, which stays as it is. A step that fails is PETSc's error.
inline PetscErrorCode takeSteps(Simulation &simulation, const LoopSettings &settings, StepsTaken *taken) {
  PetscFunctionBeginUser;
  State state = simulation.state;
  TimeLoop loop(simulation.solver, settings);
  bool finished;
  *taken = {};
  const Stopwatch watch;
  PetscCall(loop.run(
      state,
      [&](const State &, const Diagnostics &row) {
        ++taken->steps;
        taken->newton_iterations += row.newton_iterations + row.rejected_iterations;
        taken->rejected += row.rejected_steps;
        return PetscErrorCode(0);
      },
      &finished));
  taken->seconds = watch.seconds();
  PetscCheck(finished, PETSC_COMM_SELF, PETSC_ERR_NOT_CONVERGED, "%s", loop.failure().c_str());
  PetscFunctionReturn(0);
}

} // namespace tendril::bench
