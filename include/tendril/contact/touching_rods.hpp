#pragma once
/// \file touching_rods.hpp
/// Edges of rods that touch in a step: where their samples are near, and how far they may move.

#include "tendril/contact/neighbours.hpp"
#include "tendril/contact/obstacles.hpp"
#include "tendril/contact/segments.hpp"
#include "tendril/energy/term.hpp"

#include <algorithm>

namespace tendril {

/// A sample of one edge within the reach of the other; or, to be taken off again, of the vertex behind the other, which
/// that edge and the next both count.
struct Touching {
  int side, sample; ///< whether of the pair's edge (0) or of its other (1), and which
  bool taken_off;
  double weight; ///< its part of the rod at rest, halved, for it counts from both sides [m]; negative if taken off
  double gap;    ///< between surfaces [m]
  double distance;
  Vec3 normal;                ///< from the other edge to the sample
  std::array<double, 4> part; ///< of the motions of the four vertices in that of the sample from the other edge
  bool inside;                ///< whether it is nearest between the other's vertices
  int other() const { return 2 - 2 * side; } ///< where the vertices of the other edge begin
};

/// How far apart samples of an edge lie at most that touches another [m], where no more than so many are asked for.
/// \param thinner radius of both rods \param width of the barrier between them, or what stands for it [m]
inline double spacingOfSamples(double thinner, double width) {
  return thinner * std::sqrt(std::min(1.0, width / (0.2 * thinner))) / 3;
}
inline constexpr double most_samples = 1000; ///< of an edge

class TouchingRods {
public:
  TouchingRods(const Scene &scene, const Elements &elements);

  /// Finds what may touch in a step whose vertices go about so far, and how stiff barriers are in it.
  void find(const State &state, const Configuration &start, const Planes &way, const Step &step, double room);
  void addRooms(int rod, std::vector<Box> &rooms) const; ///< see Term::addRooms
  /// Finds what touches anew where a rod is not where it has been looked for.
  void cover(const Configuration &c, int rod) const;
  const ByRod<TouchingPair> &pairs() const { return pairs_; }
  /// Those that the matrix has to know of. Edges of one rod that the step is not expected to bring together are only
  /// watched: a rod that does not touch itself is solved as one that cannot.
  std::vector<TouchingPair> expected() const;
  /// Number of a pair among these, or -1 of one that is watched.
  int expectedNumber(const TouchingPair &p) const { return expected_[std::size_t(p.number)]; }
  /// Takes note that a watched pair touches: the step has to be begun again, with all of them expected.
  void note(const TouchingPair &p) const { surprised_[std::size_t(p.rod)] = true; }
  /// Those of a rod, which it has or another one.
  const std::vector<int> &pairsOf(int rod) const { return of_rod_[std::size_t(rod)]; }

  const ContactSettings &settings(int rod) const { return scene_.rods[std::size_t(rod)].contact; }
  const std::vector<double> &stiffness() const { return stiffness_; } ///< of barriers, per rod [N/m]
  const NormalLaw &lawOf(const TouchingPair &p) const { return laws_[std::size_t(p.number)]; }
  NormalLaw lawOf(const std::vector<double> &stiffness, const TouchingPair &p) const {
    return lawBetween(settings(p.rod), stiffness[std::size_t(p.rod)], settings(p.to_rod),
                      stiffness[std::size_t(p.to_rod)]);
  }
  /// The four vertices of a pair from the first [m].
  static std::array<Vec3, 4> pointsOf(const TouchingPair &p, const Configuration &c) {
    std::array<Vec3, 4> x;
    for (std::size_t k = 0; k < 4; ++k) x[k] = c.displacements<double>(p.slot[k], c, p.slot[0]);
    return x;
  }
  /// Whether a pair touches by points: both of its rods do, or neither.
  bool isCloud(const TouchingPair &p) const { return settings(p.rod).point_cloud; }
  /// Calls visit(sample) for those of a pair within reach, one edge after the other.
  template <class Visit>
  void visit(const TouchingPair &p, const std::array<Vec3, 4> &x, double reach, Visit visit) const;
  /// Calls visit(pair, sample) for all that touch of those pairs that some rods have.
  template <class Visit> void visit(const Configuration &c, RodSet rods, Visit visit) const {
    for (const TouchingPair &p : pairs_.of(rods))
      this->visit(p, pointsOf(p, c), lawOf(p).reach(), [&](const Touching &t) { visit(p, t); });
  }

  double smallestGap(const Configuration &c, int rod) const;
  /// Part of the straight way on which no pair that a rod has passes its wall, and its vertices stay where all that
  /// they may touch is known.
  double freeFraction(const Configuration &from, const Configuration &to, int rod) const;
  /// See Term::timesBounded; what has been noted counts for many.
  int timesBounded(int rod) const { return surprised_[std::size_t(rod)] ? 1 << 20 : bounded_[std::size_t(rod)]; }

private:
  const Scene &scene_;
  const Elements &elements_;
  const Neighbours neighbours_;
  std::array<std::vector<SamplePoint>, 4> points_; ///< of clouds: by quadrature, where none is asked for three
  std::vector<double> stiffness_;
  mutable std::vector<int> bounded_;    ///< per rod
  mutable std::vector<char> surprised_; ///< per rod: whether a watched pair touches
  mutable std::vector<int> expected_;   ///< per pair
  mutable Room room_;
  bool static_ = false;
  mutable std::vector<NormalLaw> laws_; ///< per pair
  mutable ByRod<TouchingPair> pairs_;
  mutable std::vector<std::array<char, 2>> goes_on_; ///< per pair and side: whether the edge behind the other touches
  mutable std::vector<std::vector<int>> of_rod_;

  double radiiOf(const TouchingPair &p) const { return settings(p.rod).radius + settings(p.to_rod).radius; }
  double widthOf(const TouchingPair &p) const {
    return settings(p.rod).isBarrier() ? 0.5 * (settings(p.rod).distance + settings(p.to_rod).distance)
                                       : 0.2 * radiiOf(p);
  }
  double wallOf(const TouchingPair &p) const;
  void setLaws() const;
  void makeRoom(const Configuration &start, const Planes *way, double room) const;
  bool isInRoom(const Configuration &from, const Configuration &to, double part, int rod) const;
  void take(std::vector<TouchingPair> pairs) const;
  void expect(const Configuration &start, const Planes &way, bool all);
  void setStiffness(const State &state, const Configuration &start, const Planes &way, const Step &step);
  void bearAsDrawn(const Configuration &start, const std::vector<double> &load);
  template <class Visit>
  void visitCloud(const TouchingPair &p, const std::array<Vec3, 4> &x, double reach, Visit visit) const;
  /// Spheres that belong to an edge: of its vertices the first, and the last where the rod ends there.
  /// \return how many, with their parts of the edge and of the rod at rest [m]
  int spheresOf(int rod, int edge, std::array<SamplePoint, 3> &out) const;
  /// Of a point of an edge as drawn [m].
  Vec3 drawnAt(int rod, int edge, double at) const {
    const Rod &r = scene_.rods[std::size_t(rod)];
    const std::size_t next = std::size_t(edge + 1) % r.position.size();
    return (1 - at) * r.position[std::size_t(edge)] + at * r.position[next];
  }
  /// No more than the distance of both edges.
  static double farApart(const std::array<Vec3, 4> &x) {
    return 0.5 * ((x[0] + x[1] - x[2] - x[3]).norm() - (x[1] - x[0]).norm() - (x[3] - x[2]).norm());
  }
};

/// Samples are at both ends of an edge and between, a fraction of the thinner radius apart, so that where they lie does
/// not matter (docs/theory.md). Those that are farther off than others between could come nearer are passed over.
template <class Visit>
void TouchingRods::visit(const TouchingPair &p, const std::array<Vec3, 4> &x, double reach, Visit visit) const {
  const double radii = radiiOf(p);
  if (farApart(x) > radii + reach) return;
  if (isCloud(p)) return visitCloud(p, x, reach, visit);
  const double apart = spacingOfSamples(std::min(settings(p.rod).radius, settings(p.to_rod).radius), widthOf(p));
  for (const int side : {0, 1}) {
    const std::size_t own = std::size_t(2 * side), other = 2 - own;
    const int rod = side == 0 ? p.rod : p.to_rod, edge = side == 0 ? p.edge : p.to_edge;
    const double rest = elements_.restLength()[elements_.rods[std::size_t(rod)].slot(edge)];
    constexpr double alike = 1 - 1e-9; // edges whose lengths differ by rounding have as many
    const int count = int(std::clamp(std::ceil(alike * rest / apart), 1.0, most_samples));
    const Vec3 along = x[own + 1] - x[own];
    const double spacing = along.norm() / count;
    for (int k = 0; k <= count;) {
      const double at = double(k) / count;
      const Vec3 place = x[own] + at * along;
      const Projection near = project(place, x[other], x[other + 1]);
      Touching t;
      t.gap = near.distance - radii;
      if (!(t.gap < reach)) {
        k += 1 + int(std::min(most_samples, 0.999 * (t.gap - reach) / spacing));
        continue;
      }
      t.side = side;
      t.sample = k;
      t.taken_off = false;
      t.weight = (k == 0 || k == count ? 0.25 : 0.5) * rest / count;
      t.distance = near.distance;
      t.normal = near.from / near.distance;
      t.part[own] = 1 - at;
      t.part[own + 1] = at;
      t.part[other] = near.part - 1;
      t.part[other + 1] = -near.part;
      t.inside = near.inside();
      visit(t);
      ++k;
      if (!goes_on_[std::size_t(p.number)][std::size_t(side)]) continue;
      const Vec3 from = place - x[other + 1];
      t.taken_off = true;
      t.distance = from.norm();
      t.gap = t.distance - radii;
      if (!(t.gap < reach)) continue;
      t.weight = -t.weight;
      t.normal = from / t.distance;
      t.part[other] = 0;
      t.part[other + 1] = -1;
      t.inside = false;
      visit(t);
    }
  }
}

/// Points of each edge against spheres of the other, W(|x - y| - radius of the sphere) by both of their weights over
/// that radius.
template <class Visit>
void TouchingRods::visitCloud(const TouchingPair &p, const std::array<Vec3, 4> &x, double reach, Visit visit) const {
  for (const int side : {0, 1}) {
    const std::size_t own = std::size_t(2 * side), other = 2 - own;
    const int rod = p.rodOf(side), edge = p.edgeOf(side), to_rod = p.rodOf(1 - side), to_edge = p.edgeOf(1 - side);
    const double rest = elements_.restLength()[elements_.rods[std::size_t(rod)].slot(edge)];
    const ContactSettings &spheres = settings(to_rod);
    std::array<SamplePoint, 3> sphere;
    const int count = spheresOf(to_rod, to_edge, sphere);
    const std::vector<SamplePoint> &points =
        points_[std::size_t(settings(rod).on_surface ? 0 : settings(rod).quadrature)];
    for (std::size_t k = 0; k < points.size(); ++k)
      for (int n = 0; n < count; ++n) {
        const SamplePoint &point = points[k], &at = sphere[std::size_t(n)];
        const Vec3 from =
            (1 - point.at) * x[own] + point.at * x[own + 1] - (1 - at.at) * x[other] - at.at * x[other + 1];
        Touching t;
        t.distance = from.norm();
        t.gap = t.distance - spheres.radius;
        if (!(t.gap < reach)) continue;
        const double least = spheres.exclusion_ratio * spheres.radius + spheres.threshold;
        if (rod == to_rod && (drawnAt(rod, edge, point.at) - drawnAt(to_rod, to_edge, at.at)).norm() < least) continue;
        t.side = side;
        t.sample = int(k) * 3 + n;
        t.taken_off = t.inside = false;
        t.weight = point.weight * rest * at.weight / spheres.radius;
        t.normal = from / t.distance;
        t.part[own] = 1 - point.at;
        t.part[own + 1] = point.at;
        t.part[other] = at.at - 1;
        t.part[other + 1] = -at.at;
        visit(t);
      }
  }
}

} // namespace tendril
