#pragma once
/// \file constraint.hpp
/// Kernels of constraints by springs and dampers (see Constraint): energies of a distance and of an angle of rotation,
/// with their derivatives. Numbers in brackets are of docs/theory.md, 16.

#include "tendril/geometry/rotation.hpp"
#include "tendril/state/stage.hpp"

namespace tendril {

/// Energy (16.1) [J] of a distance g [m] or an angle g [rad], its derivative, the second one, and the first over g.
struct RadialLaw {
  double value, slope, curvature, slope_over_g;
};
RadialLaw radialLaw(const Constraint &constraint, double g);

/// Derivatives by a displacement, or by a rotation vector d of a frame R -> Exp(d) R, with spatial components.
struct VectorDerivatives {
  Vec3 gradient = Vec3::Zero();
  Mat3 hessian = Mat3::Zero();
};
/// Of the energy of a distance, by its vector: (16.2).
VectorDerivatives distanceDerivatives(const Constraint &constraint, const Vec3 &g);
/// Of the energy of an angle of rotation |g| < pi, g its rotation vector. With n = g/|g| the gradient is slope n, the
/// Hessian curvature n n' + slope/2 cot(|g|/2) (1 - n n'), exactly (16.3).
/// \param convex without what of the curvature is negative
VectorDerivatives rotationDerivatives(const Constraint &constraint, const Vec3 &g, bool convex = false);
/// Of weight/4 |R - A|^2, R a rotation, A any matrix: with M = R A', weight/2 times tr M - (M + M')/2 (16.7).
VectorDerivatives chordDerivatives(double weight, const Mat3 &r, const Mat3 &a);

/// Gradient and Hessian over the variables of an edge: its vector and its twist.
struct EdgeDerivatives {
  Eigen::Vector4d gradient;
  Eigen::Matrix4d hessian;
};
/// From those by its spin to (16.5): de and dtheta turn the frame by t x de/l + t dtheta and, of second order, by
/// dtheta P de/(2 l) - (t.de) (t x de)/l^2, P = 1 - t t' (16.4).
/// \param curved whether the terms of second order count
EdgeDerivatives overEdge(const Frame &frame, const VectorDerivatives &by_spin, bool curved);

/// From the target, the other vertex of a tie, to what is drawn there: distance of the vertex, or rotation vector to
/// the frame of the edge.
Vec3 deviation(const Elements &elements, const Constraint &constraint, int slot, const Configuration &c);
/// What the damper of a constraint acts on (16.6): the distance over the rod's length, in the first column, or the
/// rotation from the target, in its frame. From where the target was without its motion, if the damper stands still.
/// \param length of the rod at rest [m]
Mat3 dampedStrain(const Elements &elements, const Constraint &constraint, int slot, double length,
                  const Configuration &c);

/// What a constraint does at a state, in dynamics with its damper, by the velocities there.
struct ConstraintReading {
  Vec3 distance = Vec3::Zero(), rotation = Vec3::Zero(); ///< from the target [m], [rad]
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();      ///< on the rod [N], [N m]
};
/// \param index of the constraint
/// \param c of the state
ConstraintReading readConstraint(const Scene &scene, const Elements &elements, int index, const State &state,
                                 const Configuration &c, bool dynamic);

} // namespace tendril
