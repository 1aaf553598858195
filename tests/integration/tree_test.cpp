/// Trees of joints against the same discrete rule in joint coordinates.
#include "support/mechanisms.hpp"
#include "support/option_set.hpp"

namespace tendril::test {
namespace {

constexpr double length = 0.4, inertia = 0.004; ///< of each link [m], [kg m^2]
constexpr std::array<double, 2> masses{0.5, 0.3};

/// Centres of both links, and their derivatives by the angles of both against the world.
struct Pose {
  std::array<Eigen::Vector2d, 2> centre;
  std::array<Eigen::Matrix2d, 2> by;
  explicit Pose(const Eigen::Vector2d &angle) {
    const Eigen::Vector2d a(std::cos(angle[0]), std::sin(angle[0])), b(std::cos(angle[1]), std::sin(angle[1])),
        across_a(-a[1], a[0]), across_b(-b[1], b[0]);
    centre = {0.5 * length * a, length * a + 0.5 * length * b};
    by[0] << 0.5 * length * across_a, Eigen::Vector2d::Zero();
    by[1] << length * across_a, 0.5 * length * across_b;
  }
};

/// Backward Euler of d'Alembert's principle: what the momenta of both links gain beyond gravity does no work along the
/// joints, as they are at the end of the step.
class InJointCoordinates {
public:
  Eigen::Vector2d angle = Eigen::Vector2d::Zero();
  void step(double h) {
    const Pose start(angle);
    const Eigen::Vector2d before = angle;
    auto balance = [&](const Eigen::Vector2d &q) {
      const Pose end(q);
      Eigen::Vector2d sum = inertia * ((q - before) / h - rate_);
      for (std::size_t k = 0; k < 2; ++k)
        sum += masses[k] * end.by[k].transpose() *
               ((end.centre[k] - start.centre[k]) / h - velocity_[k] + h * Eigen::Vector2d(0, earth));
      return sum;
    };
    angle += h * rate_;
    for (int round = 0; round < 20; ++round) {
      Eigen::Matrix2d slope;
      for (int k = 0; k < 2; ++k) {
        const Eigen::Vector2d off = 1e-6 * Eigen::Vector2d::Unit(k);
        slope.col(k) = (balance(angle + off) - balance(angle - off)) / 2e-6;
      }
      angle -= slope.partialPivLu().solve(balance(angle));
    }
    const Pose end(angle);
    rate_ = (angle - before) / h;
    for (std::size_t k = 0; k < 2; ++k) velocity_[k] = (end.centre[k] - start.centre[k]) / h;
  }

private:
  Eigen::Vector2d rate_ = Eigen::Vector2d::Zero();
  std::array<Eigen::Vector2d, 2> velocity_{Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
};

/// Both links in hinges; with a further joint that keeps the second in its plane, which says nothing new and closes a
/// loop: then what holds is the augmented Lagrangian there, and the tree's path elsewhere.
Scene doublePendulum(bool loop) {
  Scene scene;
  scene.gravity = {0, -earth, 0};
  for (int k = 0; k < 2; ++k) {
    Body link;
    link.name = "link" + std::to_string(k);
    link.own = {masses[std::size_t(k)], Vec3((0.5 + k) * length, 0, 0), Vec3(0.001, 0.0035, inertia).asDiagonal()};
    link.position = link.own.centre;
    scene.bodies.push_back(link);
    Joint hinge{};
    hinge.name = "hinge" + std::to_string(k);
    hinge.type = Joint::Type::hinge;
    hinge.child = k;
    hinge.parent = k - 1;
    hinge.point = {k * length, 0, 0};
    hinge.axes = Mat3::Identity();
    scene.joints.push_back(hinge);
  }
  if (loop) {
    Joint plane = scene.joints[1];
    plane.name = "plane";
    plane.type = Joint::Type::planar;
    plane.parent = -1;
    scene.joints.push_back(plane);
  }
  return carried(scene);
}

TEST(Trees, GoAsJointCoordinatesDo) {
  const OptionSet fine("-snes_rtol", "1e-12");
  for (const bool loop : {false, true}) {
    InJointCoordinates reduced;
    Simulation run;
    double most = 0;
    runAndWatch(run, doublePendulum(loop), dynamics(0.005, 1), [&](const Diagnostics &) {
      reduced.step(0.005);
      const double first = angleOf(run, 0);
      most = std::max({most, std::abs(first - reduced.angle[0]), std::abs(first + angleOf(run, 1) - reduced.angle[1])});
    });
    EXPECT_LT(reduced.angle[0], -1);
    EXPECT_LT(most, 1e-10) << loop;
  }
}

} // namespace
} // namespace tendril::test
