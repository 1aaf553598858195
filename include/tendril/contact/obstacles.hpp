#pragma once
/// \file obstacles.hpp
/// Samples of rods against the obstacles of a scene: where they are near, their distances, and how far a motion is
/// free. docs/theory.md, Contact.

#include "tendril/contact/law.hpp"
#include "tendril/contact/skin_samples.hpp"

#include <algorithm>

namespace tendril {

/// A point of an edge with its part of the edge's length.
struct SamplePoint {
  double at, weight;
};
/// Points of an edge: Gauss points, or, by themselves, both vertices and as many points between, all apart alike, as
/// keep `spacing`.
std::vector<SamplePoint> samplePoints(int quadrature, double longest_edge, double spacing);

/// Largest 64th part of a way up to which a condition holds that holds where it begins.
template <class Holds> double largestPart(Holds holds) {
  double part = 0, beyond = 1;
  for (int k = 0; k < 6; ++k) {
    const double middle = 0.5 * (part + beyond);
    (holds(middle) ? part : beyond) = middle;
  }
  return part;
}

/// That keeps what a rod feels of a surface the same wherever samples lie [m]: a tube of its radius against a surface
/// that curves as much touches it along about twice this length.
double sampleSpacing(const Shape &shape, const ContactSettings &contact);

/// Part of the straight way of a point on which it stays beyond a wall about a shape, 1 where all of it does. It stops
/// a fifth of the gap, or of a width, short of the wall. Conservative advancement (Li et al. 2021, Codimensional
/// incremental potential contact, 4.2).
/// \param from in the axes of the shape, as the way [m] \param radius about the point \param gap between surfaces there
double freeWay(const Shape &shape, const Vec3 &from, const Vec3 &way, double radius, double gap, double wall,
               double width);

/// Some samples of one rod against one obstacle, with distances between surfaces [m].
struct Samples {
  static constexpr int most = 128;
  int count = 0;
  std::array<int, most> slot;  ///< of their edges, on a skin of the first that carries each
  std::array<int, most> point; ///< of samplePoints, or among those of the skin with this edge
  std::array<double, most> distance;
  std::array<std::array<double, most>, 3> local; ///< in the axes of the obstacle
  Collider::Pose pose;
  int collider, chunk, first; ///< which these are
  Vec3 at(int k) const { return {local[0][k], local[1][k], local[2][k]}; }
};

/// What one rod may touch. Edges are looked at in chunks: one that moves less than it was away last is left out.
class RodContacts {
public:
  RodContacts(const Scene &scene, const Elements &elements, int rod);

  /// Notes how far every chunk is from every obstacle. \param all of them, or those that have moved since
  void look(const Configuration &c, bool all);
  /// Calls visit(Samples &) for those samples that may be nearer than the reach of the law. \param also another
  /// configuration in which samples may be near, or null
  template <class Visit> void visitNear(const Configuration &c, const Configuration *also, Visit visit) const;
  /// Calls visit(samples, k) for those that the law reaches.
  template <class Visit> void visitTouching(const Configuration &c, const NormalLaw &law, Visit visit) const {
    visitNear(c, nullptr, [&](const Samples &samples) {
      for (int k = 0; k < samples.count; ++k)
        if (samples.distance[k] < law.reach()) visit(samples, k);
    });
  }
  /// Part of the straight way from one configuration to another on which no sample passes the wall of its law: 1 where
  /// all of it is free. Conservative advancement (Li et al. 2021, Codimensional incremental potential contact, 4.2).
  double freeFraction(const Configuration &from, const Configuration &to) const;

  /// Whether a vertex that goes by so much from where it was looked at last may reach an obstacle.
  bool mayMeet(int vertex, int collider, double way) const {
    const int chunk = std::min(vertex / chunk_edges, chunks() - 1);
    return away_[chunk * int(scene_.colliders.size()) + collider] < skin_.gain() * way;
  }
  /// Smallest distance of samples from obstacles, between surfaces [m].
  double smallestGap(const Configuration &c) const;

  const NormalLaw &law() const { return law_; }
  /// Of a barrier [N/m].
  void setStiffness(double stiffness) { law_ = {settings_, stiffness}; }
  EdgePoint pointOf(const Samples &samples, int k) const {
    if (!skin_.empty()) return onSkin(samples, k).point;
    return {samples.slot[k], points_[samples.collider][samples.point[k]].at};
  }
  /// Weight of a sample: its part of the rod at rest [m].
  double weight(const Samples &samples, int k) const {
    if (!skin_.empty()) return onSkin(samples, k).weight;
    return points_[samples.collider][samples.point[k]].weight * elements_.restLength()[samples.slot[k]];
  }

private:
  static constexpr int chunk_edges = 16;
  const Scene &scene_;
  const Elements &elements_;
  const ContactSettings &settings_;
  const RodRange &rod_;
  const int index_;
  NormalLaw law_;
  std::vector<int> met_;                         ///< colliders that are there for the rod
  std::vector<std::vector<SamplePoint>> points_; ///< per collider
  SkinSamples skin_;                             ///< none where samples are on the axis
  std::vector<double> walls_;                    ///< per collider: distance that no way passes [m]
  std::vector<double> away_;          ///< per chunk and collider: no sample reaches an obstacle that moves less [m]
  std::vector<double> nearest_;       ///< per chunk: the least of these
  std::array<AlignedVector, 3> seen_; ///< vertices of each chunk, with both of its ends, where they were then [m]
  double seen_time_ = 0;              ///< obstacles where they were then [s]

  int edgesOf(int chunk) const { return std::min(chunk_edges, rod_.edges - chunk * chunk_edges); }
  int chunks() const { return (rod_.edges + chunk_edges - 1) / chunk_edges; }
  static int seenOf(int chunk) { return chunk * (chunk_edges + 2); }
  /// Vertices of a chunk: with those of the edge behind it, where samples of the skin are carried by both.
  int verticesOf(int chunk) const {
    return edgesOf(chunk) + 1 + (!skin_.empty() && (rod_.closed || chunk + 1 < chunks()) ? 1 : 0);
  }
  int firstOnSkin(int chunk) const { return skin_.first(chunk * chunk_edges); }
  int samplesIn(int chunk, int collider) const {
    return skin_.empty() ? edgesOf(chunk) * int(points_[collider].size())
                         : skin_.first(chunk * chunk_edges + edgesOf(chunk)) - firstOnSkin(chunk);
  }
  const OnSkin &onSkin(const Samples &samples, int k) const {
    return skin_[firstOnSkin(samples.chunk) + samples.first + k];
  }
  double movedSince(const Configuration &c, int chunk) const;
  Samples samplesOf(const Configuration &c, int chunk, int collider, int first) const;
  void placeSamples(const Configuration &c, Samples &out) const;
  void placeOnSkin(const Configuration &c, int begin, Samples &out) const;
};

template <class Visit>
void RodContacts::visitNear(const Configuration &c, const Configuration *also, Visit visit) const {
  const int colliders = int(scene_.colliders.size());
  auto stood = [&](const Configuration &x) { return x.obstacleTime(index_) == seen_time_; };
  const bool all_stood = stood(c) && (!also || stood(*also));
  for (int chunk = 0; chunk < chunks(); ++chunk) {
    const double moved = std::max(movedSince(c, chunk), also ? movedSince(*also, chunk) : 0);
    if (all_stood && moved < nearest_[chunk]) continue;
    for (const int k : met_) {
      const bool still = all_stood || !scene_.colliders[k].motion.moves();
      if (still && moved < away_[chunk * colliders + k]) continue;
      for (int first = 0; first < samplesIn(chunk, k); first += Samples::most) {
        Samples samples = samplesOf(c, chunk, k, first);
        visit(samples);
      }
    }
  }
}

} // namespace tendril
