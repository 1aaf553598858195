#include "tendril/energy/constraint.hpp"

namespace tendril {

namespace {

/// x/2 cot(x/2).
double halfCotangent(double x) {
  const double h = 0.5 * x;
  return h < 1e-3 ? 1 - h * h / 3 * (1 + h * h / 15) : h / std::tan(h);
}

double sineOver(double x) { return std::abs(x) < 1e-4 ? 1 - x * x / 6 : std::sin(x) / x; }

Vec3 unitOrZero(const Vec3 &g) { return g.norm() > 0 ? Vec3(g / g.norm()) : Vec3(Vec3::Zero()); }

} // namespace

RadialLaw radialLaw(const Constraint &c, double g) {
  const double k = c.stiffness, most = c.saturation;
  if (c.measure == Constraint::Measure::sine) {
    const double s = std::sin(0.5 * g);
    return {2 * k * s * s, k * std::sin(g), k * std::cos(g), k * sineOver(g)};
  }
  if (most < 0) return {0.5 * k * g * g, k * g, k, k};
  if (g >= most) return {k * most * (g - most / 3), k * most, 0, k * most / g};
  return {k * g * g * (1 - g / (3 * most)), k * g * (2 - g / most), 2 * k * (1 - g / most), k * (2 - g / most)};
}

VectorDerivatives distanceDerivatives(const Constraint &constraint, const Vec3 &g) {
  const RadialLaw law = radialLaw(constraint, g.norm());
  const Vec3 n = unitOrZero(g);
  return {law.slope_over_g * g,
          law.slope_over_g * Mat3::Identity() + (law.curvature - law.slope_over_g) * n * n.transpose()};
}

VectorDerivatives rotationDerivatives(const Constraint &constraint, const Vec3 &g, bool convex) {
  const double angle = g.norm();
  const RadialLaw law = radialLaw(constraint, angle);
  const Vec3 n = unitOrZero(g);
  const double across = law.slope_over_g * halfCotangent(angle),
               along = convex ? std::max(law.curvature, 0.0) : law.curvature;
  return {law.slope_over_g * g, across * Mat3::Identity() + (along - across) * n * n.transpose()};
}

VectorDerivatives chordDerivatives(double weight, const Mat3 &r, const Mat3 &a) {
  Vec3 turning = Vec3::Zero();
  for (int k = 0; k < 3; ++k) turning += r.col(k).cross(a.col(k));
  const Mat3 m = r * a.transpose();
  return {-0.5 * weight * turning, 0.5 * weight * (m.trace() * Mat3::Identity() - 0.5 * (m + m.transpose()))};
}

EdgeDerivatives overEdge(const Frame &f, const VectorDerivatives &by_spin, bool curved) {
  const Vec3 &t = f.tangent, &g = by_spin.gradient;
  const double inverse = 1 / f.length;
  Eigen::Matrix<double, 3, 4> spin; // by e and theta
  spin << 0, -t[2], t[1], 0, t[2], 0, -t[0], 0, -t[1], t[0], 0, 0;
  spin *= inverse;
  spin.col(3) = t;
  EdgeDerivatives d{spin.transpose() * g, spin.transpose() * by_spin.hessian * spin};
  if (!curved) return d;
  const Vec3 across = g.cross(t), mixed = 0.5 * inverse * (g - t * t.dot(g));
  d.hessian.topLeftCorner<3, 3>() -= (t * across.transpose() + across * t.transpose()) * (inverse * inverse);
  d.hessian.block<3, 1>(0, 3) += mixed;
  d.hessian.block<1, 3>(3, 0) += mixed.transpose();
  return d;
}

Vec3 deviation(const Elements &elements, const Constraint &constraint, int slot, const Configuration &c) {
  const int at = elements.rods[constraint.rod].slot(constraint.at);
  return constraint.isPin() ? Vec3(c.displacements<double>(at, c, slot))
                            : rotationBetween(c.frameAt(slot), c.frameAt(at));
}

Mat3 dampedStrain(const Elements &elements, const Constraint &constraint, int slot, double length,
                  const Configuration &c) {
  const int at = elements.rods[constraint.rod].slot(constraint.at);
  if (!constraint.isPin())
    return matrixOf(constraint.damps_motion ? c.frameAt(slot) : constraint.frame).transpose() * matrixOf(c.frameAt(at));
  Mat3 m = Mat3::Zero();
  const Vec3 distance = deviation(elements, constraint, slot, c);
  m.col(0) = (constraint.damps_motion ? distance : Vec3(distance + (c.positionAt(slot) - constraint.point))) / length;
  return m;
}

ConstraintReading readConstraint(const Scene &scene, const Elements &elements, int index, const State &state,
                                 const Configuration &c, bool dynamic) {
  const Constraint &constraint = scene.constraints[index];
  const double damping = dynamic ? constraint.damping : 0;
  const RodRange &rod = elements.rods[constraint.rod];
  const Vec3 g = deviation(elements, constraint, elements.constraint_slot[index], c);
  const Motion still, &motion = constraint.damps_motion ? constraint.motion : still;
  ConstraintReading out;
  if (constraint.isPin()) {
    Vec3 target_velocity = motion.velocityAt(state.time);
    if (constraint.isTie())
      target_velocity = state.velocity[elements.rods[constraint.to_rod].first_vertex + constraint.to_vertex];
    if (constraint.isToBody()) {
      const BodyRate &rate = state.body_rate[constraint.to_body];
      const Vec3 arm = c.positionAt(elements.constraint_slot[index]) - state.body_position[constraint.to_body];
      target_velocity = rate.translation + rate.spin.cross(arm);
    }
    out.distance = g;
    out.force = -distanceDerivatives(constraint, g).gradient -
                damping * (state.velocity[rod.first_vertex + constraint.at] - target_velocity);
    return out;
  }
  const int e = rod.first_edge + constraint.at;
  const Frame f = c.frameAt(rod.slot(constraint.at));
  const Vec3 spin =
      f.tangent.cross(state.velocity[elements.vertex1[e]] - state.velocity[elements.vertex0[e]]) / f.length +
      f.tangent * state.twist_rate[e];
  out.rotation = g;
  const Vec3 target_spin =
      constraint.isToBody() ? state.body_rate[constraint.to_body].spin : motion.angularVelocityAt(state.time);
  out.moment = -rotationDerivatives(constraint, g).gradient - damping * (spin - target_spin);
  return out;
}

} // namespace tendril
