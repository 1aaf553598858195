#pragma once
/// \file tendon.hpp
/// Kernels of tendons (see Tendon): their displacement with exact derivatives, and what actuators do with it.
/// Numbers in brackets are of docs/theory.md, 10.

#include "tendril/energy/carrier.hpp"

namespace tendril {

struct WayLength;

/// What an actuator does at a displacement: potential over a step [J], tension [N], its derivative [N/m].
struct Pull {
  double value = 0, tension = 0, stiffness = 0;
};
/// A damper over a step: damping times `rate` times the way from `rest`.
struct TendonDamper {
  double rate = 0; ///< one over time [1/s], 0 where none acts
  double rest = 0; ///< [m]
};
/// Tension is nowhere negative, unless the actuator may push; where there is none, the potential is zero. A spring is
/// (10.6). A muscle of length L with the pressure p beyond its least one, b the length of a thread of its braid and n
/// its turns, has the tension p b^2/(4 pi n^2) (3 L^2/b^2 - 1), (10.7) (Chou and Hannaford 1996, eq. 8).
/// \param input target [m], tension [N] or pressure [Pa]
/// \param taut that of a displacement is a spring both ways: as it is where Newton's method looks for its tension
Pull pullOf(const Actuator &actuator, double displacement, double input, const TendonDamper &damper = {},
            bool taut = false);
/// What of it a state stores: the energy of a spring [J]. Tensions and pressures that are given do work instead.
double storedBy(const Actuator &actuator, double displacement, double input);
/// Work on what is pulled between two displacements at an input that is given, without its damper; 0 of a spring [J].
double workBetween(const Actuator &actuator, double from, double to, double input);

/// How stiff an actuator is at most near what is drawn, whatever its input [N/m].
double stiffnessAsDrawn(const Tendon &tendon);

/// Where a point of a tendon is as drawn [m].
Vec3 asDrawn(const Scene &scene, const Waypoint &point);
/// Length of a segment as drawn [m].
double segmentAsDrawn(const Scene &scene, const Tendon &tendon, const Tendon::Segment &segment);

/// Tensions of a tendon that rubs, which multiply the derivatives of its parts.
struct TensionsAlong {
  std::vector<double> part; ///< of its parts (Tendon::Rub) [N]
  /// Direction in which a segment comes to its end, in the axes of what it winds round, by which the tension of its
  /// second part is another: where that is taken for constant; empty: as it is. Unit.
  std::vector<Vec3> arriving = {};
};

/// A tendon in a scene that is laid out.
class TendonPath {
public:
  struct Derivatives {
    Eigen::VectorXd gradient; ///< by the variables of all carriers, one after the other (Carrier::variables)
    Eigen::MatrixXd hessian;  ///< empty where it is not asked for
  };

  /// \param index of the tendon
  TendonPath(const Scene &scene, const Elements &elements, int index);
  const Tendon &tendon() const { return scene_->tendons[std::size_t(index_)]; }
  int slot() const { return slot_; } ///< first of its own
  /// What it pulls on, each once.
  const std::vector<Carrier> &carriers() const { return carriers_; }

  /// Of all segments [m].
  double length(const Configuration &c) const;
  /// Zero as drawn [m]; infinite where points that follow each other are one, or lie in what it winds round.
  double displacement(const Configuration &c) const { return length(c) - drawn_ + coordinates(c); }
  /// Of the displacement, by (10.1) to (10.4); with tensions, of the work that they do.
  Derivatives derivatives(const Configuration &c, bool second, const TensionsAlong *along = nullptr) const;
  /// Places of its points [m], and with those between them where it winds round something.
  std::vector<Vec3> points(const Configuration &c) const;
  std::vector<Vec3> drawn(const Configuration &c) const;
  /// Its displacement by the place of each point that is told, in their order; with tensions, forces.
  std::vector<Vec3> byTold(const Configuration &c, const TensionsAlong *along = nullptr) const;
  /// The same by moving and by turning the parent of a joint where that is told; zero of other joints.
  std::array<Vec3, 2> byParent(const Tendon::Pull &pull, const Configuration &c,
                               const TensionsAlong *along = nullptr) const;
  /// Lengths of its segments [m].
  std::vector<double> lengths(const Configuration &c) const;
  /// By how much its direction turns where it rubs [rad].
  double turningAt(const Tendon::Rub &rub, const Configuration &c) const;
  /// Of a segment that may wind round something, in the axes of that: its end [m], and the direction in which it comes
  /// there.
  std::array<Vec3, 2> endOf(int segment, const Configuration &c) const;
  /// Rate of its displacement at a state [m/s].
  double rate(const State &state, const Configuration &c) const;
  double input(const Configuration &c) const { return c.positionAt(slot_)[0]; }
  /// How far its points are at least from what they wind round, over its radius; infinite where there is nothing.
  double clearance(const Configuration &c) const;
  /// How far rounding blurs its displacement [m].
  double blur(const Configuration &c) const;

private:
  /// A point in two words.
  struct Place {
    Vec3 high, low;
    Vec3 from(const Place &other) const { return (high - other.high) + (low - other.low); }
  };
  struct Carried {
    int carrier = -1, told = -1; ///< which carries it, or the slot of one that is told
    CarriedPoint point{0, Vec3::Zero()};
  };
  /// A cylinder or sphere, with its own axes as columns: as drawn in those of the world, later turned with its body.
  struct Round {
    Carried centre;
    Mat3 axes;
  };
  const Scene *scene_;
  const Elements *elements_;
  int index_, slot_;
  std::vector<Carrier> carriers_;
  std::vector<Carried> points_;
  std::vector<Round> rounds_;
  double drawn_ = 0; ///< its length

  int numberOf(const Carrier &carrier);
  Place placeOf(const Carried &point, const Configuration &c) const;
  /// What a segment winds round, and both its ends as that sees them.
  struct Seen {
    const Wrap &wrap;
    Mat3 axes; ///< its own, as columns
    Place centre;
    std::array<Vec3, 2> end; ///< from the centre, in its axes [m]
  };
  Seen seen(const Tendon::Segment &segment, const Configuration &c) const;
  double coordinates(const Configuration &c) const;
  /// Of a segment, by the places of its ends as what it winds round sees them, in the axes of the world.
  WayLength wayOf(const Tendon::Segment &segment, const Configuration &c) const;
  /// The same; with tensions, derivatives of the work that they do by the ends.
  WayLength workOf(int segment, const Configuration &c, const TensionsAlong *along) const;
  void addSegment(int segment, const Configuration &c, bool second, const TensionsAlong *along, Derivatives &out) const;
  void addJoint(const Tendon::Pull &pull, const Configuration &c, bool second, double times, Derivatives &out) const;
  double factorOf(const Tendon::Pull &pull, const TensionsAlong *along) const;
};

/// What a tendon does at a state.
struct TendonReading {
  double displacement = 0, length = 0;             ///< [m]
  double rate = 0;                                 ///< of the displacement [m/s]
  double tension = 0;                              ///< at the actuator [N]
  std::vector<Vec3> points;                        ///< [m]
  TensionsAlong along;                             ///< where it rubs; else empty
  std::vector<double> point_tension;               ///< behind each of the points; of the last before it [N]
  double power() const { return -tension * rate; } ///< of the actuator on what it pulls on [W]
  /// Forces are derivatives with `tensions`, times `factor`.
  const TensionsAlong *tensions() const { return along.part.empty() ? nullptr : &along; }
  double factor() const { return along.part.empty() ? tension : 1; }
};
/// \param c of the state \param dynamic whether dampers act
TendonReading readTendon(const Scene &scene, const Elements &elements, int index, const State &state,
                         const Configuration &c, bool dynamic);

} // namespace tendril
