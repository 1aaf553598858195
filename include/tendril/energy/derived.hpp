#pragma once
/// \file derived.hpp
/// Strains and internal forces and moments of a state, for output: nothing here takes part in a step. docs/theory.md
/// derives the balances.

#include "tendril/energy/constraint.hpp"
#include "tendril/energy/joint.hpp"

namespace tendril {

/// Strains at the vertices, as the energy measures them: per reference length, the natural ones not taken off. Zero
/// where nothing bends or twists (free and pinned ends, cables).
struct RodStrains {
  std::vector<Eigen::Vector2d>
      curvature;             ///< (nv) about the first and second director, mean of the adjacent edges' [1/m]
  std::vector<double> twist; ///< (nv) [rad/m]
  std::vector<double> strain_energy_density; ///< (nv) of a vertex' cells, end couple and half of its edges, over half
                                             ///< their reference lengths [J/m]
};
/// Prescribed motions are at `motion_time`.
/// \param load_factor on the couples of the scene
RodStrains rodStrains(const Scene &scene, const Elements &elements, const State &state, double motion_time,
                      double load_factor);

/// What the part of a rod towards higher numbers does to the part towards lower ones, in the world frame; elastic,
/// without dissipation.
struct RodActions {
  std::vector<Vec3> force;  ///< (ne) [N]; tension points along the tangent
  std::vector<Vec3> moment; ///< (nv) about the vertex [N m]; zero at free and pinned ends; beside a support inside a
                            ///< rod, on the side of higher numbers
  /// (ns) What each support does to its rod; zero where it holds no position [N]. With the weight and the loads on its
  /// vertex and dissipation by mass; prescribed motions have no acceleration but at their kinks.
  std::vector<Vec3> reaction;
  /// (ns) The moment that goes with it, about its vertex: of clamps and of `fix_twist`; zero for pins [N m].
  std::vector<Vec3> reaction_moment;
  std::vector<ConstraintReading> constraint; ///< (nc)
  std::vector<JointReading> joint;           ///< (nj)
  /// (na) What rods do to bodies where they are tied exactly, the moment about the vertex [N], [N m].
  std::vector<Vec3> attachment, attachment_moment;
};
/// With forces F and couples C, at an equilibrium and whatever the edge length: force(i) = force(i+1) + F(i+1) and
/// moment(i) = moment(i+1) + e(i) x force(i) + C(i).
/// \param load_factor on the loads of the scene \param dynamic whether dampers of constraints act
RodActions rodActions(const Scene &scene, const Elements &elements, const State &state, double motion_time,
                      double load_factor, bool dynamic = true);

} // namespace tendril
