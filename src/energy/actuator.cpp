#include "tendril/energy/tendon.hpp"

#include <algorithm>

namespace tendril {
namespace {

/// Of a muscle its potential p (L^3/b^2 - L) b^2/(4 pi n^2), docs/theory.md (10.7): its factor, and the rest.
double muscleFactor(const Actuator &a, double pressure) {
  const double beyond = std::max(0.0, pressure - a.minimum_pressure);
  return beyond * a.braid_length * a.braid_length / (4 * pi * a.turns * a.turns);
}
double muscleShape(const Actuator &a, double length) {
  return length * (length * length / (a.braid_length * a.braid_length) - 1);
}

Pull muscleOf(const Actuator &a, double displacement, double pressure, const TendonDamper &damper) {
  const double factor = muscleFactor(a, pressure), damping = a.damping * damper.rate,
               square = a.braid_length * a.braid_length, rest = a.muscle_length + damper.rest,
               length = a.muscle_length + displacement;
  auto tension = [&](double l) { return factor * (3 * l * l / square - 1) + damping * (l - rest); };
  auto potential = [&](double l) { return factor * muscleShape(a, l) + 0.5 * damping * (l - rest) * (l - rest); };
  if (!(length > 0 && tension(length) > 0)) return {};
  // The longest length without tension: of a quadratic equation the root that is positive.
  const double lead = 3 * factor / square,
               slack = lead > 0 ? (std::sqrt(std::max(0.0, damping * damping + 4 * lead * (factor + damping * rest))) -
                                   damping) /
                                      (2 * lead)
                                : rest;
  return {potential(length) - potential(slack), tension(length), 2 * lead * length + damping};
}

} // namespace

Pull pullOf(const Actuator &a, double x, double input, const TendonDamper &damper, bool taut) {
  switch (a.kind) {
  case Actuator::Kind::none:
    return {};
  case Actuator::Kind::force:
    return {input * x, input, 0};
  case Actuator::Kind::mckibben:
    return muscleOf(a, x, input, damper);
  case Actuator::Kind::displacement:
    break;
  }
  if (a.rigid) return {};
  const double damping = a.damping * damper.rate, stiffness = a.stiffness + damping;
  if (!(stiffness > 0)) return {};
  const double tension = a.stiffness * (x - input) + damping * (x - damper.rest);
  if (tension <= 0 && !a.compression && !taut) return {};
  // docs/theory.md (10.6).
  return {0.5 * tension * tension / stiffness, tension, stiffness};
}

double storedBy(const Actuator &a, double x, double input) {
  return a.kind == Actuator::Kind::displacement && !a.rigid ? pullOf(a, x, input).value : 0;
}

double workBetween(const Actuator &a, double from, double to, double input) {
  if (a.kind == Actuator::Kind::none || a.kind == Actuator::Kind::displacement) return 0;
  return pullOf(a, from, input).value - pullOf(a, to, input).value;
}

double stiffnessAsDrawn(const Tendon &tendon) {
  const Actuator &a = tendon.actuator;
  if (a.kind == Actuator::Kind::displacement) return a.stiffness;
  if (a.kind != Actuator::Kind::mckibben) return 0;
  return 6 * muscleFactor(a, a.largestInput()) * a.muscle_length / (a.braid_length * a.braid_length);
}

} // namespace tendril
