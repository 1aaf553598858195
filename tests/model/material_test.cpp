/// Constants of sections against closed forms and tabulated torsion constants.
#include "tendril/model/material.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

namespace tendril::test {
namespace {

using std::numbers::pi;
constexpr double few_operations = 4e-16; // relative, of a handful of operations

TEST(Section, CircleAndEllipseInClosedForm) {
  const double r = 0.003;
  const SectionConstants c = sectionConstants({SectionShape::circle, {r, 0}});
  EXPECT_NEAR(c.area, pi * r * r, few_operations * c.area);
  EXPECT_NEAR(c.second_moment[0], pi * std::pow(r, 4) / 4, few_operations * c.second_moment[0]);
  EXPECT_NEAR(c.torsion, pi * std::pow(r, 4) / 2, few_operations * c.torsion);
  EXPECT_NEAR(c.torsion, c.polarMoment(), few_operations * c.torsion); // a circle does not warp

  const SectionConstants round = sectionConstants({SectionShape::ellipse, {r, r}});
  EXPECT_NEAR(round.torsion, c.torsion, few_operations * c.torsion);
  // Semi-axes 2 and 1: I1 = pi a b^3/4 about the first director (the long axis), I2 = pi a^3 b/4, J = pi a^3 b^3/(a^2 +
  // b^2).
  const SectionConstants e = sectionConstants({SectionShape::ellipse, {2, 1}});
  EXPECT_NEAR(e.area, 2 * pi, few_operations * e.area);
  EXPECT_NEAR(e.second_moment[0], pi / 2, few_operations);
  EXPECT_NEAR(e.second_moment[1], 2 * pi, few_operations * 8);
  EXPECT_NEAR(e.torsion, 8 * pi / 5, few_operations * 8);
}

TEST(Section, RectangleTorsionMatchesTables) {
  const SectionConstants square = sectionConstants({SectionShape::rectangle, {1, 1}});
  EXPECT_NEAR(square.torsion, 0.1406, 5e-5); // Timoshenko and Goodier, section 109: four digits
  // Independent sum of the series to convergence: the 30 terms of the code leave less than 1e-8.
  const SectionConstants strip = sectionConstants({SectionShape::rectangle, {1.1, 0.32}});
  EXPECT_NEAR(strip.torsion, 0.00981214338578546, 1e-8 * strip.torsion);
  EXPECT_EQ(strip.torsion, sectionConstants({SectionShape::rectangle, {0.32, 1.1}}).torsion);
  EXPECT_NEAR(strip.second_moment[0], 1.1 * std::pow(0.32, 3) / 12, few_operations);
  EXPECT_NEAR(strip.second_moment[1], 0.32 * std::pow(1.1, 3) / 12, few_operations);
}

TEST(Section, ThinStripHasAThirdOfWidthTimesThicknessCubed) {
  for (const double ratio : {1e2, 1e4}) {
    const double t = 1 / ratio, j = sectionConstants({SectionShape::rectangle, {1, t}}).torsion;
    EXPECT_NEAR(j / (t * t * t / 3), 1 - 0.6302 * t, 1e-4 * t); // 192/pi^5 sum 1/n^5 = 0.63025
  }
}

TEST(Material, HomogeneousRodHasModulusTimesSection) {
  // The wire of data/scenes/helix.yaml.
  const Material m = homogeneousMaterial({SectionShape::circle, {0.01, 0}}, 1e9, 1e9, 1e3);
  EXPECT_NEAR(m.axial_stiffness, 3.1416e5, 1); // published to five digits
  EXPECT_NEAR(m.flexural_stiffness[0], 7.854, 1e-4);
  EXPECT_NEAR(m.torsional_stiffness, 15.708, 1e-3);
  EXPECT_NEAR(m.linear_density, 0.31416, 1e-5);
  EXPECT_NEAR(m.linear_rotational_inertia, 1.5708e-5, 1e-9);
  EXPECT_EQ(m.flexural_stiffness[0], m.flexural_stiffness[1]);
}

TEST(Material, OnlyARodWithoutAnyBendingIsACable) {
  Material m;
  EXPECT_FALSE(m.isCable());
  m.flexural_stiffness = {0, 1};
  EXPECT_FALSE(m.isCable());
  m.flexural_stiffness = {0, 0};
  EXPECT_TRUE(m.isCable());
}

/// The inertia of twist is that of the section's area about its middle, not its torsion constant: they differ but for
/// circles.
TEST(Material, RotationalInertiaIsThatOfTheSecondMoments) {
  const Material flat = homogeneousMaterial({SectionShape::rectangle, {0.03, 0.002}}, 1e9, 4e8, 1100);
  EXPECT_NEAR(flat.linear_rotational_inertia, 1100 * 0.03 * 0.002 * (0.03 * 0.03 + 0.002 * 0.002) / 12,
              1e-12 * flat.linear_density);
}

TEST(Section, HalfAxesLieAlongTheDirectors) {
  EXPECT_EQ((Section{SectionShape::circle, {0.1, 0}}.halfAxes()), (std::array{0.1, 0.1}));
  EXPECT_EQ((Section{SectionShape::ellipse, {0.2, 0.1}}.halfAxes()), (std::array{0.2, 0.1}));
  EXPECT_EQ((Section{SectionShape::rectangle, {0.2, 0.1}}.halfAxes()), (std::array{0.1, 0.05}));
  EXPECT_FALSE(Material{}.section);
}

} // namespace
} // namespace tendril::test
