#pragma once
/// \file touching_bodies.hpp
/// Edges of rods and rigid bodies that touch bodies in a step: samples of the ones against the others as solids.

#include "tendril/contact/body_samples.hpp"
#include "tendril/contact/obstacles.hpp"
#include "tendril/contact/pair_derivatives.hpp"

#include <map>

namespace tendril {

/// A sample of the one within the reach of the other, a body, as a solid.
struct TouchingSolid {
  int side, sample;             ///< which of the pair has it (0, 1), and which of its samples
  double at = 0;                ///< part of the edge
  const OnSkin *skin = nullptr; ///< of a rod that touches by its skin
  double weight; ///< of an edge its part of the rod at rest [m]; of a body 1, or 1/2 where both have samples
  double radius; ///< about the sample [m]
  double gap;    ///< between surfaces [m]
  Vec3 local;    ///< in the axes of the solid
  int solid() const { return 1 - side; }
};

/// Where a rod, or a body, comes nearest to a body.
struct BodyMeeting {
  int rod = -1, other = -1, body = -1; ///< rod or other body, the one that is not is -1; the body
  double gap = HUGE_VAL;               ///< between surfaces [m]
  double arc = 0;                      ///< along the rod at rest [m]
  double wall = 0;                     ///< gap that its law lets nothing below [m]
  double width = 0;                    ///< of its barrier [m]
};
/// That of each rod and body, and of each two bodies, that are so near that their law acts; the least gap first.
std::vector<BodyMeeting> tightestAmongBodies(const Scene &scene, const Elements &elements, const Configuration &c);

/// What rods and bodies touch bodies. Neighbours do not: bodies that a joint ties to each other, and the edges of a rod
/// from where it is tied to a body on until it has left it.
class TouchingBodies {
public:
  /// \param is_static before the first step that it is told of
  TouchingBodies(const Scene &scene, const Elements &elements, bool is_static = false);

  /// Finds what may touch in a step in which rods and bodies go about so far, and how stiff barriers are in it.
  void find(const Configuration &start, const Planes &way, const Step &step, double room);
  void addRooms(int rod, std::vector<Box> &rooms) const; ///< see Term::addRooms
  /// Finds what touches anew where a rod or a body beside it is not where it has been looked for.
  void cover(const Configuration &c, int rod) const;
  const ByRod<TouchingPair> &pairs() const { return pairs_; }
  /// Those of a rod or of bodies beside it, which it has or another one.
  const std::vector<int> &pairsOf(int rod) const { return of_rod_[std::size_t(rod)]; }

  const NormalLaw &lawOf(const TouchingPair &p) const { return laws_[std::size_t(p.number)]; }
  const ContactSettings &settingsOf(const TouchingPair &p, int side) const {
    return tendril::settingsOf(scene_, p, side);
  }
  Collider::Pose poseOf(int body, const Configuration &c) const;
  /// The point that a sample stands for.
  CarriedPoint pointOf(const TouchingPair &p, const TouchingSolid &t) const {
    return {t.at, p.isBody(t.side) ? samplesOf(p.body(t.side))[std::size_t(t.sample)].arm : Vec3(Vec3::Zero())};
  }
  /// Of the pair that the edge behind that of a pair has with the same body; -1 where there is none.
  int next(const TouchingPair &p) const { return next_[std::size_t(p.number)]; }
  int before(const TouchingPair &p) const { return before_[std::size_t(p.number)]; } ///< that of the edge before
  const Shape &solidOf(int body) const { return *solids_[std::size_t(body)].shape; }

  /// Calls visit(sample) for those of a pair within reach.
  template <class Visit> void visit(const TouchingPair &p, const Configuration &c, double reach, Visit visit) const;
  /// Calls visit(pair, sample) for all that touch of those pairs that some rods have.
  template <class Visit> void visit(const Configuration &c, RodSet rods, Visit visit) const {
    for (const TouchingPair &p : pairs_.of(rods))
      this->visit(p, c, lawOf(p).reach(), [&](const TouchingSolid &t) { visit(p, t); });
  }

  double smallestGap(const Configuration &c, int rod) const;
  /// Part of the straight way, as the body sees it, on which no sample of a pair that a rod has passes its wall, and
  /// all stay where what they may touch is known.
  double freeFraction(const Configuration &from, const Configuration &to, int rod) const;
  int timesBounded(int rod) const { return bounded_[std::size_t(rod)]; } ///< see Term::timesBounded
  /// See tightestAmongBodies.
  std::vector<BodyMeeting> tightest(const Configuration &c) const;

private:
  /// A body that is touched.
  struct Solid {
    std::shared_ptr<const Shape> shape; ///< null: it touches nothing that moves
    std::vector<BodySample> samples;
    double reach = 0; ///< of its farthest sample from the centre of mass [m]
    double force = 0; ///< that presses on it [N]
  };
  /// The samples of one of a pair, in the axes of the other.
  struct Side {
    int count;
    const SamplePoint *points; ///< of an edge, or null
    const BodySample *samples;
    const OnSkin *skin; ///< of an edge, or null
    const Configuration *c;
    Collider::Pose pose;
    double radius; ///< of an edge
    Vec3 first;    ///< vertex of an edge, or centre of mass
    Vec3 along;    ///< the edge
    Mat3 turned;   ///< of the body
    Vec3 at(int k) const {
      if (skin) return pose.toLocal(placeOf(skin[k].point, *c));
      return points ? Vec3(first + points[k].at * along) : Vec3(first + turned * samples[k].arm);
    }
    double radiusAt(int k) const { return samples ? samples[k].radius : radius; }
  };
  const Scene &scene_;
  const Elements &elements_;
  std::vector<Solid> solids_;
  /// Edges of a rod that do not touch a body which the rod is tied to.
  std::map<std::pair<int, int>, std::vector<int>> tied_;
  std::vector<std::pair<int, int>> jointed_;    ///< bodies that a joint ties to each other, the smaller number first
  std::vector<double> load_;                    ///< per rod [N]
  std::map<std::pair<int, int>, double> borne_; ///< part of its stiffness that loads press against as drawn
  mutable std::map<std::pair<int, int>, std::vector<SamplePoint>>
      points_; ///< of the edges of a rod, by it and the body
  // What find and cover set:
  mutable bool static_ = false;
  mutable Configuration start_;
  mutable std::vector<double> rod_room_, body_room_; ///< how far from there each may be [m]
  mutable ByRod<TouchingPair> pairs_;
  mutable std::vector<NormalLaw> laws_;                         ///< per pair
  mutable std::vector<std::span<const SamplePoint>> points_of_; ///< per pair: of its edge
  mutable std::vector<int> next_, before_;                      ///< per pair, see next
  mutable std::vector<std::vector<int>> of_rod_;
  mutable std::vector<int> bounded_; ///< per rod

  std::vector<SkinSamples> skins_; ///< per rod
  /// How far samples of a rod are at most from the middle of their edge, beyond half of it [m].
  double aboutAxis(int rod, const Configuration &c) const;
  double aboutEdge(int rod, int edge, const Configuration &c) const; ///< the same of one edge of a skin
  const std::vector<BodySample> &samplesOf(int body) const { return solids_[std::size_t(body)].samples; }
  Side sideOf(const TouchingPair &p, int side, const Collider::Pose &pose, const Configuration &c) const;
  /// Whether none of it is within reach of the other.
  bool isAway(const TouchingPair &p, int side, const Side &samples, double reach) const;
  double wallOf(const TouchingPair &p) const;
  double widthOf(const TouchingPair &p) const;
  void leaveOut();
  bool mayTouch(int rod, int edge, int body) const;
  bool mayTouch(int body, int other) const;
  void makeRoom(const Configuration &start, const Planes *way, double room) const;
  bool isInRoom(const Configuration &from, const Configuration &to, double part, int rod) const;
  void addPair(int rod, int edge, std::array<int, 2> slot, int to_rod, int to_edge, std::array<int, 2> to_slot) const;
  void takePairsOf(int body) const;
  void numberPairs() const;
  void take() const;
  NormalLaw makeLaw(const TouchingPair &p) const;
  std::span<const SamplePoint> pointsFor(int rod, int body) const;
  void bearAsDrawn();
};

template <class Visit>
void TouchingBodies::visit(const TouchingPair &p, const Configuration &c, double reach, Visit visit) const {
  for (const int side : {0, 1}) {
    if (!p.isBody(1 - side)) continue;
    const Collider::Pose pose = poseOf(p.body(1 - side), c);
    const Side samples = sideOf(p, side, pose, c);
    if (isAway(p, side, samples, reach)) continue;
    const Shape &solid = solidOf(p.body(1 - side));
    constexpr int most = 128;
    std::array<std::array<double, most>, 3> x;
    std::array<double, most> distance;
    const double *const points[3] = {x[0].data(), x[1].data(), x[2].data()};
    for (int first = 0; first < samples.count; first += most) {
      const int count = std::min(most, samples.count - first);
      for (int k = 0; k < count; ++k) {
        const Vec3 at = samples.at(first + k);
        for (std::size_t a = 0; a < 3; ++a) x[a][std::size_t(k)] = at[int(a)];
      }
      solid.distances(points, count, distance.data());
      for (int k = 0; k < count; ++k) {
        const std::size_t here = std::size_t(k);
        TouchingSolid t;
        t.side = side;
        t.sample = first + k;
        t.radius = samples.radiusAt(t.sample);
        t.gap = distance[here] - t.radius;
        if (!(t.gap < reach)) continue;
        t.weight = 0.5; // of a body, for the other has samples, too
        if (samples.skin) {
          t.skin = samples.skin + t.sample;
          if (t.skin->point.edges == 2 && next(p) < 0) continue; // its other edge does not touch this body
          t.at = t.skin->point.by[0].point.at;
          t.weight = t.skin->weight;
        } else if (samples.points) {
          t.at = samples.points[t.sample].at;
          t.weight = samples.points[t.sample].weight * elements_.restLength()[p.slot[std::size_t(2 * side)]];
        }
        t.local = {x[0][here], x[1][here], x[2][here]};
        visit(t);
      }
    }
  }
}

} // namespace tendril
