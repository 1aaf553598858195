/// Any linear solver gives the same run: `banded` reads the band itself, the others get a matrix of PETSc's.
#include "support/rods.hpp"

namespace tendril::test {
namespace {

/// While it lives, an option of PETSc is set.
class OptionSet {
public:
  OptionSet(const char *name, const char *value) : name_(name) { (void)PetscOptionsSetValue(nullptr, name, value); }
  ~OptionSet() { (void)PetscOptionsClearValue(nullptr, name_); }
  OptionSet(const OptionSet &) = delete;

private:
  const char *name_;
};

/// A cantilever and a ring that falls beside it, under weight.
Scene chainAndRing() {
  Scene scene;
  scene.gravity = Vec3(0, 1, -9.8);
  Rod bar = straightRod(20, Measure::tan);
  bar.material = homogeneousMaterial({SectionShape::circle, {0.005, 0.005}}, 1e7, 4e6, 1200);
  Rod ring = bar;
  ring.name = "ring";
  const Polyline shape = ringShape(Vec3(0, 2, 0), Vec3(0, 0.3, 1).normalized(), 0.3, 16);
  ring.position = shape.points;
  ring.closed = shape.closed;
  setBishopDirectors(ring);
  scene.rods = {bar, ring};
  scene.supports = {hold(scene, 0, 0, Support::Kind::clamp), hold(scene, 1, 5, Support::Kind::pin)};
  return scene;
}

TEST(LinearSolvers, GiveTheSameRun) {
  auto run = [](int *iterations) {
    Simulation sim;
    runTo(sim, chainAndRing(), dynamics(0.02, 0.1), iterations);
    return sim.state;
  };
  int banded_iterations = 0;
  const State banded = run(&banded_iterations);
  for (const char *type : {"petsc", "mumps"}) {
    const OptionSet option("-pc_factor_mat_solver_type", type);
    int iterations = 0;
    const State other = run(&iterations);
    EXPECT_EQ(iterations, banded_iterations) << type;
    for (std::size_t v = 0; v < banded.position.size(); ++v)
      EXPECT_LT((other.position[v] - banded.position[v]).norm(), 1e-9) << type << ", vertex " << v; // rounding of solves, of displacements of 0.1
  }
}

} // namespace
} // namespace tendril::test
