#pragma once
/// \file tendon.hpp
/// Tendons: cords without mass that run through points of bodies, rods and the world, and weighted sums of the
/// coordinates of joints; with what pulls on them.

#include "tendril/model/motion.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

namespace tendril {

/// What pulls on a tendon, by its displacement x, which is zero as drawn.
struct Actuator {
  enum class Kind {
    none,
    displacement, ///< a spring with a damper to a target: tension stiffness (x - target) + damping x'
    force,        ///< a tension that is given
    mckibben      ///< a muscle of a bladder in a braid: tension by its length and pressure
  } kind = Kind::none;
  double input = 0;                  ///< target [m], tension [N] or pressure [Pa]; where there is no table ...
  Motion input_motion;               ///< ... of which it is the displacement along x
  double stiffness = 0, damping = 0; ///< [N/m], [N s/m]
  bool compression = false;          ///< whether it may push, too
  bool rigid = false;                ///< of a displacement: not beyond the target, in place of a spring
  /// Of a muscle: its length as drawn, that of a thread of its braid, the turns of this about it, and the pressure
  /// below which it does nothing [m], [m], -, [Pa].
  double muscle_length = 0, braid_length = 0, turns = 0, minimum_pressure = 0;

  double largestInput() const {
    double most = input_motion.table.empty() ? input : -HUGE_VAL;
    for (const Motion::Key &row : input_motion.table) most = std::max(most, row.displacement[0]);
    return most;
  }
  double inputAt(double time) const {
    return input_motion.table.empty() ? input : input_motion.displacementAt(time)[0];
  }
};
/// By their names in scenes.
inline constexpr std::string_view actuator_kinds[] = {"none", "displacement", "force", "mckibben"};
inline std::string_view nameOf(Actuator::Kind kind) { return actuator_kinds[int(kind)]; }

/// A point that a tendon runs through: one of a body, one that an edge of a rod carries, or one of the world, which may
/// go as it is told.
struct Waypoint {
  int body = -1;           ///< of the scene's bodies, or -1
  int rod = -1, edge = -1; ///< or -1
  double at = 0;           ///< part of the edge
  /// As drawn [m]; of an edge from its axis along the tangent and both directors.
  Vec3 point = Vec3::Zero();
  Motion motion;       ///< of one of the world
  double friction = 0; ///< coefficient of the tendon on it

  bool isTold() const { return body < 0 && rod < 0; }
  /// Whether an end of an edge, with no arm.
  bool isVertex() const { return rod >= 0 && (at == 0 || at == 1); }
  int vertex() const { return edge + int(at); }
  void setVertex(int vertex, int edges) {
    edge = vertex < edges ? vertex : edges - 1;
    at = vertex - edge;
  }
};

/// A cylinder or sphere that a straight part of a tendon winds round where it is in its way.
struct Wrap {
  int body = -1; ///< that carries it, or -1: the world
  bool sphere = false;
  double radius = 0;          ///< [m]
  Vec3 centre = Vec3::Zero(); ///< as drawn, of a cylinder any point of its axis [m]
  Vec3 axis = Vec3::UnitZ();  ///< as drawn, unit
  /// 0: round the nearer side, where the straight way meets it; 1, -1: anticlockwise or clockwise about the axis, from
  /// the first point to the second, always.
  int side = 0;
  double friction = 0; ///< coefficient of the tendon on it
};

struct Tendon {
  /// Between two points.
  struct Segment {
    int from, to;
    int wrap = -1; ///< what it may wind round, or -1
  };
  struct Pull {
    int joint;
    double coefficient; ///< [1] or [m/rad]
    int after = 0;      ///< how many segments the path has before it
  };
  /// A place where it rubs: what it winds round, or the point at the end of a segment. Behind it the tension is
  /// another. Of parts with one tension every segment has one, or two where it may wind round something.
  struct Rub {
    int segment;
    bool winds;
    int part; ///< behind it
    double friction;
  };
  static constexpr int drawn_points = 17; ///< where it winds round something, beside its own
  std::string name;
  std::vector<Waypoint> points;
  std::vector<Segment> segments;
  std::vector<Wrap> wraps;
  std::vector<Pull> joints; ///< displacement has coefficient times coordinate of these
  Actuator actuator;
  double slip_length = 0; ///< way over which friction comes to its limit [m]
  int rod = 0;            ///< the first of those that it pulls on, or that its bodies are tied to (Scene::hostBodies)

  /// Slots beside its rod: one with its actuator's input for a position along x, then those of points that are told.
  int slots() const {
    int count = 1;
    for (const Waypoint &p : points) count += p.isTold();
    return count;
  }
  int drawnPoints() const {
    int count = int(points.size());
    for (const Segment &s : segments) count += s.wrap < 0 ? 0 : drawn_points;
    return count;
  }
  /// How many numbers a state remembers: by how much it is drawn at each place where it rubs, up to where it slides
  /// [m]; and of a rigid one the tension [N].
  int remembered() const { return int(rubs().size()) + actuator.rigid; }
  bool dissipates() const { return actuator.damping > 0; }
  /// First of the parts of a segment; of the number of segments: how many parts there are.
  int firstPart(int segment) const {
    int count = 0;
    for (int n = 0; n < segment; ++n) count += segments[std::size_t(n)].wrap < 0 ? 1 : 2;
    return count;
  }
  int parts() const { return firstPart(int(segments.size())); }
  /// In the order of its path, which begins at the actuator.
  std::vector<Rub> rubs() const {
    std::vector<Rub> all;
    for (int n = 0, part = 0; n < int(segments.size()); ++n) {
      const Segment &s = segments[std::size_t(n)];
      if (s.wrap >= 0 && ++part > 0 && wraps[std::size_t(s.wrap)].friction > 0)
        all.push_back({n, true, part, wraps[std::size_t(s.wrap)].friction});
      ++part;
      const bool goes_on = n + 1 < int(segments.size()) && segments[std::size_t(n) + 1].from == s.to;
      if (goes_on && points[std::size_t(s.to)].friction > 0)
        all.push_back({n, false, part, points[std::size_t(s.to)].friction});
    }
    return all;
  }
  /// Whether its actuator is given a table, or points of it move as they are told.
  bool isMoved() const {
    return actuator.input_motion.moves() ||
           std::any_of(points.begin(), points.end(), [](const Waypoint &p) { return p.motion.moves(); });
  }
};

} // namespace tendril
