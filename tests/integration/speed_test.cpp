/// A guard against slow code: the time of a Newton iteration, in units of what LAPACK needs for the same band on the
/// same machine at the same moment.
#include "support/rods.hpp"

#include "bench.hpp"

namespace tendril::test {
namespace {

/// Largest ratio of one whole Newton iteration (derivatives, factorisation, line search, everything around) to LAPACK's
/// dpbtrf and dpbtrs: twice the 1.4 that was measured with Debian's reference BLAS (docs/performance.md), so that only
/// a real loss of speed trips it. Another BLAS has another ratio.
constexpr double most_newton_per_lapack = 2 * 1.4;

TEST(Speed, OfANewtonIterationStaysNearThatOfItsLinearAlgebra) {
#if !defined(NDEBUG) || defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "says nothing in a debug or sanitizer build";
#endif
  constexpr int edges = 400,
                repeats =
                    100; // of one step and of LAPACK in turn, short enough that on a busy machine some are left alone
  const LoopSettings settings = dynamics(5e-3, 5e-3);
  Simulation simulation;
  EXPECT_PETSC(simulation.setUp(bench::cantilevers(1, edges), settings));
  bench::LapackBand band(edges);
  double newton = HUGE_VAL, lapack = HUGE_VAL;
  for (int k = 0; k < repeats; ++k) {
    bench::StepsTaken taken;
    EXPECT_PETSC(bench::takeSteps(simulation, settings, &taken));
    ASSERT_GT(taken.newton_iterations, 0);
    newton = std::min(newton, taken.seconds / taken.newton_iterations);
    const double seconds = band.factorAndSolve();
    ASSERT_GT(seconds, 0);
    lapack = std::min(lapack, seconds);
  }
  RecordProperty("newton_per_lapack", std::to_string(newton / lapack));
  EXPECT_LT(newton / lapack, most_newton_per_lapack)
      << 1e6 * newton / edges << " us per edge and iteration; LAPACK " << 1e6 * lapack / edges << " us";
}

/// A step of many rods costs what is in it: supports that move are found by rod. Measured 1.15 at 4000, as at 2500 and
/// 20 000 rods; 3.2 and 70 when every rod looked through all supports.
TEST(Speed, OfManyRodsIsThatOfEach) {
#if !defined(NDEBUG) || defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "says nothing in a debug or sanitizer build";
#endif
  constexpr int rods = 4000, repeats = 8; // in turn, so that a busy machine slows both
  const LoopSettings settings = dynamics(5e-3, 5e-3);
  Simulation held, moving;
  Scene scene = bench::cantilevers(rods, 8);
  EXPECT_PETSC(held.setUp(scene, settings));
  for (Support &support : scene.supports) support.motion.velocity = Vec3(0.01, 0, 0);
  EXPECT_PETSC(moving.setUp(scene, settings));
  double seconds[2] = {HUGE_VAL, HUGE_VAL};
  for (int k = 0; k < 2 * repeats; ++k) {
    bench::StepsTaken taken;
    EXPECT_PETSC(bench::takeSteps(k % 2 ? moving : held, settings, &taken));
    seconds[k % 2] = std::min(seconds[k % 2], taken.seconds / taken.newton_iterations);
  }
  RecordProperty("moving_per_held", std::to_string(seconds[1] / seconds[0]));
  EXPECT_LT(seconds[1] / seconds[0], 2);
}

} // namespace
} // namespace tendril::test
