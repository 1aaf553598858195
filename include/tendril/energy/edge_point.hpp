#pragma once
/// \file edge_point.hpp
/// Points that edges carry with their frames, and derivatives of what acts on them (docs/theory.md, 18).

#include "tendril/energy/term.hpp"
#include "tendril/state/state.hpp"

namespace tendril {

/// A point that the frame of an edge or of a body carries.
struct CarriedPoint {
  double at; ///< part of the edge
  Vec3 arm;  ///< from there along tangent and both directors, or from the centre of mass as drawn [m]
};

/// What moves at e + arm by the edge's vector and twist: P of docs/theory.md (18.3).
using ByEdge = Eigen::Matrix<double, 3, edge_size>;
ByEdge byEdge(const CarriedPoint &point, const Frame &frame);

/// A point that one edge of a rod carries, or two behind each other: the sum of weight (x + at e + arm), by their
/// vertices x and vectors e.
struct EdgePoint {
  struct By {
    int slot, next; ///< of the edge, and of the vertex where it ends, of a ring the first
    double weight = 1;
    CarriedPoint point;
  };
  int edges = 1;
  std::array<By, 2> by{};

  EdgePoint() = default;
  EdgePoint(int slot, double at, const Vec3 &arm = Vec3::Zero()) : by{By{slot, slot + 1, 1, {at, arm}}, By{}} {}
  int slot() const { return by[0].slot; }
  /// Whether it is on the axis of one edge, whose frame does not matter.
  bool isOnAxis() const { return edges == 1 && by[0].point.arm.isZero(0); }
};

Vec3 placeOf(const EdgePoint &point, const Configuration &c);
/// By how much an increment moves it, to first order. \param increment of positions and twists, over slots
Vec3 motionOf(const EdgePoint &point, const Configuration &c, const Planes &increment);
/// Adds what a vector does at it to the unknowns of its rod.
void spread(const EdgePoint &point, const Vec3 &value, const Configuration &c, Planes &out);
/// Adds the derivatives of an energy by its place to those of its rod: by docs/theory.md (18.2), on the axis (17.5).
/// \param curved whether with the second derivatives of its place \param blocks or null
void addAt(const EdgePoint &point, const Vec3 &gradient, const Mat3 &hessian, bool curved, const Configuration &c,
           const BlockPlanes *blocks, Derivatives &out);

} // namespace tendril
