#include "tendril/model/material.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tendril {
namespace {

double rectangleTorsion(double width, double height) {
  using std::numbers::pi;
  const double a = std::max(width, height), b = std::min(width, height);
  double sum = 0;
  for (int n = 1; n < 60; n += 2)
    sum += std::tanh(n * pi * a / (2 * b)) / std::pow(n, 5); // the rest is below 1e-9 of the sum
  return a * b * b * b / 3 * (1 - 192 * b / (std::pow(pi, 5) * a) * sum);
}

} // namespace

std::array<double, 2> Section::halfAxes() const {
  switch (shape) {
  case SectionShape::circle:
    return {size[0], size[0]};
  case SectionShape::ellipse:
    return size;
  case SectionShape::rectangle:
    return {size[0] / 2, size[1] / 2};
  }
  return {};
}

SectionConstants sectionConstants(const Section &section) {
  using std::numbers::pi;
  const auto [p, q] = section.size;
  switch (section.shape) {
  case SectionShape::circle: {
    const double i = pi * p * p * p * p / 4;
    return {pi * p * p, {i, i}, 2 * i};
  }
  case SectionShape::ellipse:
    return {pi * p * q, {pi * p * q * q * q / 4, pi * q * p * p * p / 4}, pi * p * p * p * q * q * q / (p * p + q * q)};
  case SectionShape::rectangle:
    return {p * q, {p * q * q * q / 12, q * p * p * p / 12}, rectangleTorsion(p, q)};
  }
  return {};
}

Material homogeneousMaterial(const Section &section, double young, double shear, double density) {
  const SectionConstants c = sectionConstants(section);
  Material m;
  m.section = section;
  m.linear_density = density * c.area;
  m.linear_rotational_inertia = density * c.polarMoment();
  m.axial_stiffness = young * c.area;
  m.torsional_stiffness = shear * c.torsion;
  m.flexural_stiffness = {young * c.second_moment[0], young * c.second_moment[1]};
  return m;
}

} // namespace tendril
