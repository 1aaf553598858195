#include "tendril/energy/edge_point.hpp"

#include "tendril/energy/constraint.hpp"
#include "tendril/geometry/rotation.hpp"
#include "tendril/state/spin_stage.hpp"

namespace tendril {
namespace {

/// Where the frame of an edge has taken an arm.
Vec3 turned(const CarriedPoint &point, const Frame &frame) { return matrixOf(frame) * point.arm; }

/// Of the whole point by the edges that carry it, with the vertex where the first begins: weights sum to one, and the
/// second begins where the first ends.
std::array<ByEdge, 2> byEdges(const EdgePoint &point, const Configuration &c) {
  std::array<ByEdge, 2> by;
  for (std::size_t k = 0; k < std::size_t(point.edges); ++k)
    by[k] = point.by[k].weight * byEdge(point.by[k].point, c.frameAt(point.by[k].slot));
  if (point.edges == 2) by[0].leftCols<3>() += point.by[1].weight * Mat3::Identity();
  return by;
}

/// A force at the axis of an edge, docs/theory.md (17.5). A quadratic form A of its place is (1 - s) A(x_i) + s
/// A(x_{i+1}) - s (1 - s) A(e_i): nothing that joins vertices.
void addOnAxis(double at, int slot, int next, const Vec3 &gradient, const Mat3 &hessian, const BlockPlanes *blocks,
               Derivatives &out) {
  for (int a = 0; a < 3; ++a) {
    out.equilibrium[a][slot] += (1 - at) * gradient[a];
    out.equilibrium[a][next] += at * gradient[a];
  }
  for (int a = 0; blocks && a < 3; ++a)
    for (int b = a; b < 3; ++b) {
      blocks->vertex(a, b)[slot] += (1 - at) * hessian(a, b);
      blocks->vertex(a, b)[next] += at * hessian(a, b);
      blocks->own(a, b)[slot] -= at * (1 - at) * hessian(a, b);
    }
}

/// spread() of a point off the axis. \param by byEdges
void spreadOff(const EdgePoint &point, const std::array<ByEdge, 2> &by, const Vec3 &value, Planes &out) {
  for (int a = 0; a < 3; ++a) out[a][point.slot()] += value[a];
  for (std::size_t k = 0; k < std::size_t(point.edges); ++k) {
    const int edge = point.by[k].slot;
    const Eigen::Vector4d d = by[k].transpose() * value;
    for (int a = 0; a < 3; ++a) {
      out[a][edge] -= d[a];
      out[a][point.by[k].next] += d[a];
    }
    out[3][edge] += d[3];
  }
}

} // namespace

ByEdge byEdge(const CarriedPoint &point, const Frame &frame) {
  ByEdge spin;
  spin << crossMatrix(frame.tangent) / frame.length, frame.tangent;
  ByEdge by = -crossMatrix(turned(point, frame)) * spin;
  by.leftCols<3>() += point.at * Mat3::Identity();
  return by;
}

Vec3 placeOf(const EdgePoint &point, const Configuration &c) {
  Vec3 y = Vec3::Zero();
  for (std::size_t k = 0; k < std::size_t(point.edges); ++k) {
    const auto &[slot, next, weight, carried] = point.by[k];
    const Vec3 from = c.positionAt(slot);
    Vec3 own = from + carried.at * (c.positionAt(next) - from);
    if (!carried.arm.isZero(0)) own += turned(carried, c.frameAt(slot));
    y += weight * own;
  }
  return y;
}

Vec3 motionOf(const EdgePoint &point, const Configuration &c, const Planes &increment) {
  const int slot = point.slot();
  if (point.isOnAxis())
    return (1 - point.by[0].point.at) * increment.vector(0, slot) +
           point.by[0].point.at * increment.vector(0, point.by[0].next);
  const std::array<ByEdge, 2> by = byEdges(point, c);
  Vec3 moved = increment.vector(0, slot);
  for (std::size_t k = 0; k < std::size_t(point.edges); ++k) {
    const int edge = point.by[k].slot;
    Eigen::Vector4d d;
    d << increment.vector(0, point.by[k].next) - increment.vector(0, edge), increment[3][edge];
    moved += by[k] * d;
  }
  return moved;
}

void spread(const EdgePoint &point, const Vec3 &value, const Configuration &c, Planes &out) {
  if (!point.isOnAxis()) return spreadOff(point, byEdges(point, c), value, out);
  for (int a = 0; a < 3; ++a) {
    out[a][point.slot()] += (1 - point.by[0].point.at) * value[a];
    out[a][point.by[0].next] += point.by[0].point.at * value[a];
  }
}

void addAt(const EdgePoint &point, const Vec3 &gradient, const Mat3 &hessian, bool curved, const Configuration &c,
           const BlockPlanes *blocks, Derivatives &out) {
  if (point.isOnAxis())
    return addOnAxis(point.by[0].point.at, point.slot(), point.by[0].next, gradient, hessian, blocks, out);
  const std::array<ByEdge, 2> by = byEdges(point, c);
  spreadOff(point, by, gradient, out.equilibrium);
  if (!blocks) return;
  const int slot = point.slot();
  for (int a = 0; a < 3; ++a)
    for (int b = a; b < 3; ++b) blocks->vertex(a, b)[slot] += hessian(a, b);
  for (std::size_t k = 0; k < std::size_t(point.edges); ++k) {
    const auto &[edge, next, weight, carried] = point.by[k];
    const ByEdge joined = hessian * by[k];
    Eigen::Matrix4d own = by[k].transpose() * joined;
    if (curved) {
      const Frame frame = c.frameAt(edge);
      const Vec3 arm = turned(carried, frame), g = weight * gradient;
      own += overEdge(frame, {arm.cross(g), curvatureOfArm(g, arm)}, true).hessian;
    }
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < edge_size; ++b) blocks->joined(a, b)[edge] += joined(a, b);
    for (int a = 0; a < edge_size; ++a)
      for (int b = a; b < edge_size; ++b) blocks->own(a, b)[edge] += own(a, b);
  }
  if (point.edges == 1) return;
  // What the first vertex has with the second edge stands at the vertex between, of a ring where it ends: x_i = x_{i+1}
  // - e_i.
  const int second = slot + 1;
  const ByEdge joined = hessian * by[1];
  Eigen::Matrix4d across = by[0].transpose() * joined;
  across.topRows<3>() -= joined;
  for (int a = 0; a < edge_size; ++a)
    for (int b = 0; b < edge_size; ++b) blocks->across(a, b)[second] += across(a, b);
}

} // namespace tendril
