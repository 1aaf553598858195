#include "tendril/energy/joint.hpp"

#include "tendril/energy/constraint.hpp"
#include "tendril/state/spin_stage.hpp"

namespace tendril {
namespace {

constexpr int child = 0, child_spin = 3, parent = 6, parent_spin = 9; // first variables

/// s.w of a direction s of the parent and a vector w that turns with the child; and where `from_point`, w is that from
/// the parent's centre of mass to the child's point, less what the parent's own point has: docs/theory.md (12.1),
/// (12.2). By both spins d of w and e of s: (e x s).(d x b) = (d.e)(s.b) - (e.b)(d.s).
JointRow product(const Vec3 &s, const Vec3 &w, const Vec3 &arm, bool from_point) {
  JointRow row;
  row.value = s.dot(w);
  row.gradient.segment<3>(child_spin) = arm.cross(s);
  row.gradient.segment<3>(parent_spin) = s.cross(w);
  row.hessian.block<3, 3>(child_spin, child_spin) = curvatureOfArm(s, arm);
  row.hessian.block<3, 3>(parent_spin, parent_spin) = curvatureOfArm(w, s);
  row.hessian.block<3, 3>(child_spin, parent_spin) = s.dot(arm) * Mat3::Identity() - s * arm.transpose();
  row.hessian.block<3, 3>(parent_spin, child_spin) = row.hessian.block<3, 3>(child_spin, parent_spin).transpose();
  if (!from_point) return row;
  row.gradient.segment<3>(child) = s;
  row.gradient.segment<3>(parent) = -s;
  const Mat3 turned = crossMatrix<double>(s);
  for (const auto &[at, sign] : {std::pair(child, -1.0), std::pair(parent, 1.0)}) {
    row.hessian.block<3, 3>(at, parent_spin) = sign * turned;
    row.hessian.block<3, 3>(parent_spin, at) = sign * turned.transpose();
  }
  return row;
}

JointRow pointRow(const JointPlace &p, int k) {
  const Vec3 s = p.parent_axes.col(k);
  JointRow row = product(s, p.reach, p.arm, true);
  row.value = s.dot(p.reach - p.parent_arm);
  return row;
}

/// The same along an axis of the world, where all of the point is held, docs/theory.md (12.3): turns of the parent do
/// not turn the axis.
JointRow heldPointRow(const JointPlace &p, int k) {
  const Vec3 s = Vec3::Unit(k);
  JointRow row;
  row.value = p.reach[k] - p.parent_arm[k];
  row.gradient.segment<3>(child) = s;
  row.gradient.segment<3>(parent) = -s;
  row.gradient.segment<3>(child_spin) = p.arm.cross(s);
  row.gradient.segment<3>(parent_spin) = s.cross(p.parent_arm);
  row.hessian.block<3, 3>(child_spin, child_spin) = curvatureOfArm(s, p.arm);
  row.hessian.block<3, 3>(parent_spin, parent_spin) = -curvatureOfArm(s, p.parent_arm);
  return row;
}

/// Cosine between an axis of the parent and one of the child.
JointRow axesRow(const JointPlace &p, int k, int l) {
  const Vec3 t = p.axes.col(l);
  return product(p.parent_axes.col(k), t, t, false);
}

/// A function of two rows, by its first and second derivatives.
JointRow composed(double value, const JointRow &u, const JointRow &v, double fu, double fv, double fuu, double fuv,
                  double fvv) {
  JointRow row;
  row.value = value;
  row.gradient = fu * u.gradient + fv * v.gradient;
  const Mat12 mixed = u.gradient * v.gradient.transpose();
  row.hessian = fu * u.hessian + fv * v.hessian + fuu * u.gradient * u.gradient.transpose() +
                fvv * v.gradient * v.gradient.transpose() + fuv * (mixed + mixed.transpose());
  return row;
}

double withTurns(const JointPlace &p, double principal) {
  const double expected = p.before + p.parent_axes.col(2).dot(p.spun);
  return principal + 2 * pi * std::round((expected - principal) / (2 * pi));
}

/// By which the child has turned about the parent's third axis: atan2 of what its first axis has along the parent's.
JointRow turnRow(const JointPlace &p) {
  const JointRow u = axesRow(p, 0, 0), v = axesRow(p, 1, 0);
  const double x = u.value, y = v.value, q = x * x + y * y, q2 = q * q;
  return composed(withTurns(p, std::atan2(y, x)), u, v, -y / q, x / q, 2 * x * y / q2, (y * y - x * x) / q2,
                  -2 * x * y / q2);
}

/// Cosine of the angle of the rotation of the child from the parent.
JointRow rotationRow(const JointPlace &p) {
  JointRow sum;
  sum.value = -0.5;
  for (int k = 0; k < 3; ++k) {
    const JointRow row = axesRow(p, k, k);
    sum.value += 0.5 * row.value;
    sum.gradient += 0.5 * row.gradient;
    sum.hessian += 0.5 * row.hessian;
  }
  return sum;
}

/// That angle: of no use near zero, where no range ends.
JointRow angleRow(const JointPlace &p) {
  const JointRow cosine = rotationRow(p);
  const double c = std::clamp(cosine.value, -1.0, 1.0), s = std::sqrt(std::max(1 - c * c, 1e-300));
  JointRow row;
  row.value = std::acos(c);
  row.gradient = -cosine.gradient / s;
  row.hessian = -cosine.hessian / s - (c / (s * s * s)) * cosine.gradient * cosine.gradient.transpose();
  return row;
}

} // namespace

/// A body at a configuration or state: its centre of mass in two words, its rotation since it was drawn, and what it
/// has turned by since the step began.
struct JointPose {
  Vec3 high, low;
  Mat3 turned;
  Vec3 spun;
};

static JointPlace placeOf(const Joint &joint, const BodyPair &pair, const Elements &elements, const Configuration &c,
                          const JointPose &own, const JointPose *of_parent) {
  JointPlace p;
  p.arm = own.turned * (joint.point - elements.bodyMass(joint.child).centre);
  p.axes = own.turned * joint.axes;
  p.spun = own.spun;
  if (of_parent) {
    p.reach = (own.high - of_parent->high) + (own.low - of_parent->low) + p.arm;
    p.parent_arm = of_parent->turned * (joint.point - elements.bodyMass(joint.parent).centre);
    p.parent_axes = of_parent->turned * joint.axes;
    p.spun -= of_parent->spun;
  } else {
    p.reach = (own.high - c.positionAt(pair.parent(0))) + own.low + p.arm;
    p.parent_arm = Vec3::Zero();
    p.parent_axes = c.rotationAt(pair.parent(0));
  }
  p.drawn = c.positionAt(pair.target())[0];
  p.before = c[Configuration::winding][pair.target()];
  return p;
}

JointPlace placeOf(const Joint &joint, const BodyPair &pair, const Elements &elements, const Configuration &c) {
  auto pose = [&](int k) {
    const int at = pair.of[std::size_t(k)], turn = pair.of[std::size_t(k + 1)];
    return JointPose{c.positionAt(at), c.values().vector(Configuration::position_low, at), c.rotationAt(turn),
                     c.positionAt(turn)};
  };
  if (joint.parent < 0) return placeOf(joint, pair, elements, c, pose(0), nullptr);
  const JointPose parent = pose(2);
  return placeOf(joint, pair, elements, c, pose(0), &parent);
}

JointPlace placeOf(const Joint &joint, const BodyPair &pair, const Elements &elements, const State &state,
                   const Configuration &c) {
  auto pose = [&](int body) {
    return JointPose{state.body_position[std::size_t(body)], state.body_position_low[std::size_t(body)],
                     rotationOf(state, elements.body(body).group), Vec3::Zero()};
  };
  JointPlace place;
  if (joint.parent < 0)
    place = placeOf(joint, pair, elements, c, pose(joint.child), nullptr);
  else {
    const JointPose parent = pose(joint.parent);
    place = placeOf(joint, pair, elements, c, pose(joint.child), &parent);
  }
  place.before = state.joints[std::size_t(pair.joint)].coordinate;
  return place;
}

bool holds(const Joint &joint, int row) {
  const Joint::Held held = joint.held();
  switch (row) {
  case 0:
  case 1:
    return held.across;
  case 2:
    return held.along;
  case 3:
  case 4:
    return held.tilt;
  case 5:
    return held.turn;
  }
  if (row == cosine_row) return !joint.isExact() && (held.tilt || held.turn);
  return joint.driven || joint.hasRange();
}

JointRow jointRow(const Joint &joint, const JointPlace &place, int row) {
  switch (row) {
  case 0:
  case 1:
  case 2:
    return joint.held().across && joint.held().along ? heldPointRow(place, row) : pointRow(place, row);
  case 3:
  case 4:
    return axesRow(place, row - 3, 2);
  case 5:
    return axesRow(place, 0, 1);
  case cosine_row:
    return joint.held().turn ? rotationRow(place) : axesRow(place, 2, 2);
  }
  if (joint.type == Joint::Type::ball) return angleRow(place);
  if (joint.held().turnsFreely() && !joint.held().slidesFreely()) return turnRow(place);
  return joint.held().slidesFreely() ? pointRow(place, 2) : JointRow();
}

Rows jointValues(const Joint &joint, const JointPlace &place) {
  Rows values = Rows::Zero();
  for (int k = 0; k < joint_rows; ++k)
    if (k == coordinate_row || holds(joint, k)) values[k] = jointRow(joint, place, k).value;
  return values;
}

void JointLaw::addSprings(const Joint &joint, const Rows &values, double target) {
  if (!joint.isExact()) {
    Constraint spring{};
    spring.stiffness = joint.stiffness;
    spring.saturation = joint.saturation;
    const Vec3 distance = values.head<3>();
    const VectorDerivatives of_point = distanceDerivatives(spring, distance);
    value += radialLaw(spring, distance.norm()).value;
    slope.head<3>() += of_point.gradient;
    curvature.topLeftCorner<3, 3>() += of_point.hessian;
    if (holds(joint, cosine_row)) { // stiffness/2 times the square of the angle, (12.5)
      const double c = std::clamp(values[cosine_row], -1.0, 1.0), angle = std::acos(c), sine = std::sin(angle),
                   square = angle * angle;
      const bool small = square < 1e-4; // by power series
      value += 0.5 * joint.rotational_stiffness * square;
      slope[cosine_row] -= joint.rotational_stiffness * (small ? 1 + square / 6 : angle / std::max(sine, 1e-9));
      curvature(cosine_row, cosine_row) +=
          joint.rotational_stiffness *
          (small ? 1.0 / 3 + 2.0 / 15 * square : (sine - angle * c) / std::max(sine * sine * sine, 1e-27));
    }
  }
  auto add = [&](double stiffness, double off) {
    value += 0.5 * stiffness * off * off;
    slope[coordinate_row] += stiffness * off;
    curvature(coordinate_row, coordinate_row) += stiffness;
  };
  const double q = values[coordinate_row];
  if (joint.driven && joint.drive_stiffness >= 0) add(joint.drive_stiffness, q - target);
  if (joint.range_stiffness >= 0 && q > joint.upper) add(joint.range_stiffness, q - joint.upper);
  if (joint.range_stiffness >= 0 && q < joint.lower) add(joint.range_stiffness, q - joint.lower);
}

/// Velocities and spins of the child and the parent.
static Vec12 ratesOf(const Joint &joint, const State &state) {
  Vec12 rate;
  const BodyRate &own = state.body_rate[std::size_t(joint.child)];
  rate.head<6>() << own.translation, own.spin;
  if (joint.parent >= 0)
    rate.tail<6>() << state.body_rate[std::size_t(joint.parent)].translation,
        state.body_rate[std::size_t(joint.parent)].spin;
  else
    rate.tail<6>() << joint.motion.velocityAt(state.time), joint.motion.angularVelocityAt(state.time);
  return rate;
}

Rows carryingForces(const Joint &joint, const JointPlace &place, bool of_parent, const Eigen::Vector<double, 6> &body) {
  using UpToSix = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6>;
  const int first = of_parent ? 6 : 0;
  const Vec3 &arm = of_parent ? place.parent_arm : place.arm;
  UpToSix rows(6, 6), along(6, 6);
  std::array<int, 6> held;
  int n = 0;
  for (int k = 0; k < coordinate_row; ++k) {
    if (!joint.isExact() || !holds(joint, k)) continue;
    rows.col(n) = jointRow(joint, place, k).gradient.segment<6>(first);
    const bool turns = k > 2;
    const Vec3 axis = rows.col(n).segment<3>(turns ? 3 : 0).normalized();
    along.col(n) << (turns ? Vec3(arm.cross(axis)) : axis), (turns ? axis : Vec3(Vec3::Zero()));
    held[std::size_t(n++)] = k;
  }
  Rows forces = Rows::Zero();
  if (n == 0) return forces;
  const Eigen::MatrixXd moved = along.leftCols(n).transpose() * rows.leftCols(n);
  const Eigen::VectorXd solved = moved.partialPivLu().solve(-along.leftCols(n).transpose() * body);
  for (int k = 0; k < n && solved.allFinite(); ++k) forces[held[std::size_t(k)]] = solved[k];
  return forces;
}

double tearingOf(const Scene &scene, const Elements &elements, int index, const State &state, const Configuration &c) {
  const Joint &joint = scene.joints[std::size_t(index)];
  if (joint.motion.moves()) return 0; // it begins to move with the first step
  const JointPlace place = placeOf(joint, elements.pairOf(index), elements, c);
  const Vec12 rate = ratesOf(joint, state);
  double most = 0;
  for (int k = 0; k < coordinate_row; ++k)
    if (holds(joint, k))
      most = std::max(most, std::abs(jointRow(joint, place, k).gradient.dot(rate)) *
                                (k < 3 ? 1 : elements.bodySize(joint.child)));
  return most;
}

JointReading readJoint(const Scene &scene, const Elements &elements, int index, const State &state,
                       const Configuration &c, bool dynamic) {
  const Joint &joint = scene.joints[std::size_t(index)];
  const BodyPair &pair = elements.pairOf(index);
  const JointPlace place = placeOf(joint, pair, elements, c);
  const Rows values = jointValues(joint, place);
  std::array<JointRow, joint_rows> rows;
  for (int k = 0; k < joint_rows; ++k) rows[std::size_t(k)] = jointRow(joint, place, k);
  JointLaw law;
  law.addSprings(joint, values, place.drawn);
  JointReading out;
  const auto &force = state.joints[std::size_t(index)].force;
  out.drive =
      joint.driven ? (joint.drive_stiffness < 0 ? force[6] : joint.drive_stiffness * (values[6] - place.drawn)) : 0;
  for (int k = 0; k <= coordinate_row; ++k) law.slope[k] += force[std::size_t(k)];
  law.slope[coordinate_row] += force[7];
  if (dynamic && joint.dissipates()) {
    const Vec12 rate = ratesOf(joint, state);
    for (int k = 0; k <= coordinate_row; ++k) {
      const double damping = k < 3 ? joint.damping : k < 6 ? joint.rotational_damping : joint.drive_damping;
      double of_row = rows[std::size_t(k)].gradient.dot(rate);
      if (k == coordinate_row) of_row -= joint.target_motion.velocityAt(state.time)[0];
      if (holds(joint, k) && (k == coordinate_row ? joint.driven : !joint.isExact())) law.slope[k] += damping * of_row;
      if (k == coordinate_row && joint.driven) out.drive += damping * of_row;
    }
  }
  const Vec12 gradient = law.gradient(rows, law.slope);
  out.coordinate = values[coordinate_row];
  out.distance = place.reach - place.parent_arm;
  out.force = -gradient.segment<3>(child);
  out.moment = -gradient.segment<3>(child_spin) - place.arm.cross(out.force);
  out.drive = -out.drive;
  return out;
}

} // namespace tendril
