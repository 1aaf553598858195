#pragma once
/// \file material.hpp
/// Stiffness, inertia and dissipation of a rod, per unit reference length.

#include <array>
#include <optional>

namespace tendril {

/// Shape of a homogeneous section. `size` is (radius, -), (semi-axis along the first director, along the second), or
/// (width along the first director, height along the second) [m].
enum class SectionShape { circle, ellipse, rectangle };
struct Section {
  SectionShape shape;
  std::array<double, 2> size;
  /// Half of the extent along the first and the second director [m].
  std::array<double, 2> halfAxes() const;
  bool operator==(const Section &) const = default;
};

/// Parameters of a rod and their defaults, SI units.
struct Material {
  double linear_density = 1e-1;                         ///< [kg/m]
  double linear_rotational_inertia = 1e-6;              ///< about the rod's axis [kg m]
  double axial_stiffness = 1e2;                         ///< [N]
  double torsional_stiffness = 5e-4;                    ///< [N m^2]
  std::array<double, 2> flexural_stiffness{5e-4, 5e-4}; ///< about the first and the second director [N m^2]
  double mass_damping_coefficient = 0;                  ///< [1/s]
  double stiffness_damping_coefficient = 0;             ///< [s]
  std::optional<Section> section =
      std::nullopt; ///< none where only stiffness is given; for pictures, the mechanics do not use it

  /// A cable: bending and twist cost nothing and the rod carries no twist unknowns.
  bool isCable() const { return flexural_stiffness[0] == 0 && flexural_stiffness[1] == 0; }
  bool operator==(const Material &) const = default;
};

/// Geometric constants of a section: area [m^2], second moments about the first and second director, torsion constant
/// [m^4].
struct SectionConstants {
  double area;
  std::array<double, 2> second_moment;
  double torsion;
  double polarMoment() const { return second_moment[0] + second_moment[1]; }
};

/// Torsion constants: circle and ellipse in closed form; the rectangle by the Fourier series of Saint-Venant's problem
/// (Timoshenko and Goodier, Theory of Elasticity, 3rd ed., section 109).
SectionConstants sectionConstants(const Section &section);

/// Rod of homogeneous isotropic material. \param young [Pa] \param shear [Pa] \param density [kg/m^3]
Material homogeneousMaterial(const Section &section, double young, double shear, double density);

} // namespace tendril
