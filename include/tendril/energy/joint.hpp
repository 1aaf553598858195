#pragma once
/// \file joint.hpp
/// Kernels of joints between bodies (see Joint): what they hold as equations in the poses of both, with exact
/// derivatives, and the laws over these. Numbers in brackets are of docs/theory.md, 12.

#include "tendril/state/state.hpp"

#include <Eigen/Dense>

namespace tendril {

/// Where a joint is: its point and axes in both bodies, at a configuration or a state.
struct JointPlace {
  Vec3 arm, parent_arm;   ///< from the centres of mass to the point [m]
  Vec3 reach;             ///< from the parent's centre of mass to the child's point [m]
  Mat3 axes, parent_axes; ///< the child's and the parent's
  Vec3 spun;              ///< by how much more the child has turned than the parent since the step began [rad]
  double drawn = 0;       ///< target of the drive
  double before = 0;      ///< coordinate at the start of the step
};
JointPlace placeOf(const Joint &joint, const BodyPair &pair, const Elements &elements, const Configuration &c);
/// The same with the bodies as they are in a state. \param c has targets, and parents that no step moves
JointPlace placeOf(const Joint &joint, const BodyPair &pair, const Elements &elements, const State &state,
                   const Configuration &c);

/// Over displacements and spins, R -> Exp(d) R, of the child, then of the parent.
using Vec12 = Eigen::Matrix<double, 12, 1>;
using Mat12 = Eigen::Matrix<double, 12, 12>;
/// A scalar of both poses and its derivatives.
struct JointRow {
  double value = 0;
  Vec12 gradient = Vec12::Zero();
  Mat12 hessian = Mat12::Zero();
};

/// What may be held, in this order: where the child's point is from the parent's, along the parent's axes, or those of
/// the world where all of it is held; the child's
/// third axis along the parent's first and second; its second along the parent's first; and the coordinate. Behind, for
/// springs in place of the turns that are held, the cosine of the angle that these make: between both third axes, or of
/// the whole rotation.
inline constexpr int joint_rows = 8, coordinate_row = 6, cosine_row = 7;
using Rows = Eigen::Matrix<double, joint_rows, 1>;
/// Value and derivatives of a row: (12.1) and (12.2), of a point that is held (12.3).
JointRow jointRow(const Joint &joint, const JointPlace &place, int row);
/// Their values. A row that the joint has no use for is zero.
Rows jointValues(const Joint &joint, const JointPlace &place);
/// What its dampers act on: these, less the target of a drive.
inline Rows dampedRows(const Joint &joint, const JointPlace &place) {
  Rows rows = jointValues(joint, place);
  rows[coordinate_row] -= place.drawn;
  return rows;
}
/// Whether a joint holds a row, exactly or by springs, or draws its coordinate.
bool holds(const Joint &joint, int row);

/// Energy over the rows and its derivatives. Where forces are unknowns, `slope` has these, and `more` what the energy's
/// own slope has beyond.
struct JointLaw {
  double value = 0;
  Rows slope = Rows::Zero(), more = Rows::Zero();
  Eigen::Matrix<double, joint_rows, joint_rows> curvature = Eigen::Matrix<double, joint_rows, joint_rows>::Zero();
  /// Adds springs in place of what is held, (16.1) of the point and (12.5) of turns, those of a drive and of a range,
  /// at given values of the rows.
  void addSprings(const Joint &joint, const Rows &values, double target);
  /// Gradient over the poses by a part of the slope. \param rows of the joint
  Vec12 gradient(const std::array<JointRow, joint_rows> &rows, const Rows &by) const {
    Vec12 sum = Vec12::Zero();
    for (int k = 0; k < joint_rows; ++k)
      if (by[k] != 0) sum += by[k] * rows[std::size_t(k)].gradient;
    return sum;
  }
};

/// Forces of an exact joint, by row, that carry one of its bodies: with them, what acts on it does no work in motions
/// by which alone what the joint holds changes, shifts along its axes and turns about its point. \param of_parent
/// whether the body is the parent \param body out of balance, force and moment about its centre
Rows carryingForces(const Joint &joint, const JointPlace &place, bool of_parent, const Eigen::Vector<double, 6> &body);

/// How fast the bodies of a joint leave what it holds, turns by the size of the child [m/s].
double tearingOf(const Scene &scene, const Elements &elements, int index, const State &state, const Configuration &c);

/// What a joint does at a state.
struct JointReading {
  double coordinate = 0;                            ///< [m] or [rad]
  Vec3 distance = Vec3::Zero();                     ///< of the child's point from the parent's [m]
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero(); ///< on the child, about its point [N], [N m]
  double drive = 0;                                 ///< of the drive, along or about the axis [N] or [N m]
};
/// \param c of the state \param dynamic whether dampers act
JointReading readJoint(const Scene &scene, const Elements &elements, int index, const State &state,
                       const Configuration &c, bool dynamic);

} // namespace tendril
