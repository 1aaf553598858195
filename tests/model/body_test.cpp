/// Mass properties of solids.
#include "tendril/model/body.hpp"

#include <gtest/gtest.h>

namespace tendril::test {
namespace {

void expectSame(const MassProperties &a, const MassProperties &b, double tolerance) {
  EXPECT_NEAR(a.mass, b.mass, tolerance * b.mass);
  EXPECT_LT((a.centre - b.centre).norm(), tolerance);
  EXPECT_LT((a.inertia - b.inertia).norm(), tolerance * b.inertia.norm());
}

TriangleMesh boxMesh(const Vec3 &size, const Vec3 &middle) {
  TriangleMesh mesh;
  for (int k = 0; k < 8; ++k)
    mesh.vertices.push_back(middle + 0.5 * size.cwiseProduct(Vec3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1)));
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

TEST(Body, AMeshOfABoxIsABox) {
  const Vec3 size(0.3, 0.2, 0.5), middle(10, -3, 2);
  expectSame(meshMass(boxMesh(size, middle), 800), boxMass(size, 800).moved(Mat3::Identity(), middle), 1e-13);
}

TEST(Body, HalvesMakeAWhole) {
  const Vec3 half(0.15, 0.2, 0.5);
  MassProperties two = boxMass(half, 900).moved(Mat3::Identity(), {-0.075, 0, 0});
  two.add(boxMass(half, 900).moved(Mat3::Identity(), {0.075, 0, 0}));
  expectSame(two, boxMass({0.3, 0.2, 0.5}, 900), 1e-14);
}

/// By slices of discs: about the axis m r^2/2, across m r^2/4 and Steiner's part.
TEST(Body, ACapsuleIsTheSumOfItsSlices) {
  const double radius = 0.1, length = 0.3, density = 700;
  const int slices = 20000;
  MassProperties sum;
  const double reach = 0.5 * length + radius, thick = 2 * reach / slices;
  for (int k = 0; k < slices; ++k) {
    const double z = -reach + (k + 0.5) * thick, beyond = std::max(0.0, std::abs(z) - 0.5 * length),
                 square = radius * radius - beyond * beyond, mass = density * pi * square * thick;
    sum.add({mass, Vec3(0, 0, z), Vec3(mass * square / 4, mass * square / 4, mass * square / 2).asDiagonal()});
  }
  expectSame(capsuleMass(radius, length, density), sum, 1e-7); // of second order in the slices
  expectSame(capsuleMass(radius, 0, density), sphereMass(radius, density), 1e-14);
}

TEST(Body, FlawsOfAnInertiaAreTold) {
  EXPECT_EQ(flawOf(Vec3(1, 2, 3).asDiagonal()), "");
  EXPECT_NE(flawOf(Vec3(1, 2, 3.1).asDiagonal()), "");
  EXPECT_NE(flawOf(Vec3(-1, 2, 2).asDiagonal()), "");
  EXPECT_NE(flawOf(Vec3(0, 1, 1).asDiagonal()), "");
}

} // namespace
} // namespace tendril::test
