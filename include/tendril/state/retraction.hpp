#pragma once
/// \file retraction.hpp
/// Moving along the configuration manifold: from a configuration, by increments of the unknowns, to another
/// configuration.

#include "tendril/state/state.hpp"

namespace tendril {

/// `additive` adds the increments to the positions. `length` gives every edge its linearised new length t.(e + de)
/// along its new direction, docs/theory.md (21.1), so that turning an edge does not stretch it: the stretching energy
/// no longer limits the step. `continued` lengthens edges as the last step did, where the increments are that step's:
/// (l^2 - |e - de|^2)/2l, which is not t.de (21.2). `kept` turns edges without lengthening them.
enum class RetractionKind { additive, length, continued, kept };

class Retraction {
public:
  explicit Retraction(const Elements &elements);

  /// Inertia of a step, 1/dt^2 [1/s^2]; weighs the corrections of spans held at both ends.
  void setInverseTimeSquared(double value);

  /// Writes rod `r` of `to` = R(from, scale * increment), all but its axial force. Directors are carried by the minimal
  /// rotation between tangents and turned by the twist increments. False when an edge vanishes or turns back on itself.
  /// Of joined rods only `additive`: their lengths hang together.
  /// \param increment x, y, z and twist of every slot, copies behind rings included, and spins of junctions' frames
  bool apply(const Configuration &from, const Planes &increment, double scale, int rod, RetractionKind kind,
             Configuration &to);

private:
  const Elements &elements_;
  double inverse_time_squared_ = -1;
  /// Over slots: displacement of a vertex per unit correcting force; and work space of one rod.
  enum Work : int { softness, target, direction, diagonal = direction + 3, upper, right, corner, work_planes };
  Planes work_;

  void turnArm(const Configuration &from, const Planes &increment, double scale, const JoinedVertex &j,
               Configuration &to) const;
  void stiffenNearHeld(const RodRange &rod, const Elements::Pins &pins);
  bool aim(const Configuration &from, const RodRange &rod, RetractionKind kind, const Configuration &to);
  void lay(int begin, int end, Configuration &to) const;
  void layFree(const Configuration &from, const RodRange &rod, int anchor, bool pinned, Configuration &to) const;
  bool restoreLengths(const Configuration &from, int rod, RetractionKind kind, Configuration &to);
  Pack measureSpan(const RodRange &rod, int first, int last, Configuration &to);
  void projectSpan(const RodRange &rod, int first, int last, Configuration &to);
  bool turnEdges(const Configuration &from, const Planes &increment, double scale, int rod, Configuration &to) const;
  bool updateFrames(const Configuration &from, const Planes &increment, double scale, int rod, Configuration &to) const;
};

} // namespace tendril
