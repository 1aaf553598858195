#pragma once
/// \file retraction.hpp
/// Moving along the configuration manifold: from a configuration, by increments of the rows, to another configuration.

#include "tendril/dynamics/state.hpp"

namespace tendril {

/// `additive` adds the increments to the positions. `length` gives every edge its linearised new length t.(e + de) along its new direction,
/// so that turning an edge does not stretch it: the stretching energy no longer limits the step (docs/theory.md, Retraction).
enum class RetractionKind { additive, length };

class Retraction {
public:
  Retraction(const Elements &elements, const DofMap &dofs);

  RetractionKind kind = RetractionKind::length;
  /// Increments continue the last step's: an edge then lengthens as it did there, (l^2 - |e - de|^2)/2l, which is not its linearised change t.de.
  bool continues = false;
  /// Inertia of a step, 1/dt^2 [1/s^2]; weighs the corrections of spans held at both ends.
  void setInverseTimeSquared(double value);

  /// Writes rod `r` of `to` = R(from, scale * increment), all but its axial force. Directors are carried by the minimal rotation between
  /// tangents and turned by the twist increments. False when an edge vanishes or turns back on itself.
  bool apply(const Configuration &from, const std::vector<double> &increment, double scale, int rod, Configuration &to);

private:
  const Elements &elements_;
  std::vector<bool> held_;
  std::vector<double> softness_;       ///< displacement of a vertex per unit correcting force
  double inverse_time_squared_ = 0;
  std::vector<double> target_, diagonal_, upper_, right_; ///< work space of one rod
  std::vector<Vec3> direction_;

  bool restoreLengths(const Configuration &from, int rod, std::vector<Vec3> &x);
  void projectSpan(int rod, int first, int last, std::vector<Vec3> &x);
  bool updateFrames(const Configuration &from, const std::vector<double> &increment, double scale, int rod, Configuration &to) const;
};

} // namespace tendril
