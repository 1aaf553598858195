#pragma once
/// \file beams.hpp
/// Straight rods of the classical law.

#include "support/rods.hpp"

namespace tendril::test {

inline Rod beam(const Vec3 &from, const Vec3 &to, int edges, const std::string &name, double axial_stiffness = 1e4) {
  Rod rod = inextensibleRod(lineShape(from, to, edges).points, Measure::angle);
  rod.name = name;
  rod.energy = Energy::classical;
  rod.material.axial_stiffness = axial_stiffness;
  return rod;
}

} // namespace tendril::test
