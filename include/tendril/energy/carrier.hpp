#pragma once
/// \file carrier.hpp
/// Edges and bodies alike, as what carries points that forces act at.

#include "tendril/energy/edge_point.hpp"

namespace tendril {

/// An edge, with the positions of its two vertices and its twist for variables, or a body, with its displacement and
/// its spin: as a side of a TouchingPair.
struct Carrier {
  int rod, edge;           ///< of a body TouchingPair::ofBody
  std::array<int, 2> slot; ///< of the vertices, or of the body's position and rotation
  static constexpr int variables = TouchingPair::variables;
  using Gradient = Eigen::Matrix<double, variables, 1>;
  using Hessian = Eigen::Matrix<double, variables, variables>;
  /// A vector by the variables.
  using By = Eigen::Matrix<double, 3, variables>;

  bool isBody() const { return edge < 0; }
  int body() const { return -1 - edge; }
  /// Of how many variables it is.
  int count() const { return isBody() ? 6 : variables; }
  /// Slot and component of a variable.
  std::pair<int, int> place(int variable) const {
    return variable == 6 ? std::pair(slot[0], 3) : std::pair(slot[std::size_t(variable / 3)], variable % 3);
  }
  bool operator==(const Carrier &) const = default;

  static Carrier ofBody(const JoinedBody &body) {
    return {body.rod, TouchingPair::ofBody(body.body), {body.position, body.rotation}};
  }
  /// Of a ring the last edge ends at the first vertex.
  static Carrier ofEdge(const Elements &elements, int rod, int edge) {
    const RodRange &range = elements.rods[std::size_t(rod)];
    return {rod, edge, {range.slot(edge), range.slot((edge + 1) % range.vertices)}};
  }
};
/// Of a pair: side 0 the one, 1 the other.
inline Carrier carrierOf(const TouchingPair &pair, int side) {
  const std::size_t first = std::size_t(2 * side);
  return {pair.rodOf(side), pair.edgeOf(side), {pair.slot[first], pair.slot[first + 1]}};
}
/// Without a number.
TouchingPair pairOf(const Carrier &a, const Carrier &b);

/// Where the frame of the carrier has taken its part of a point: arm in the axes of the world [m].
Vec3 armOf(const Carrier &carrier, const CarriedPoint &point, const Configuration &c);
/// Derivatives of a point: docs/theory.md (9.1) of a body, (18.3) of an edge.
Carrier::By byPoint(const Carrier &carrier, const CarriedPoint &point, const Configuration &c);
/// Adds the second derivatives of g.y, with the point y: docs/theory.md (9.1), of an edge over its variables by (16.5).
void addCurvature(const Carrier &carrier, const CarriedPoint &point, const Vec3 &g, const Configuration &c,
                  Eigen::Ref<Carrier::Hessian, 0, Eigen::OuterStride<>> hessian);
/// Adds what a carrier has with itself to both of the gradients, and to the blocks: of an edge by its first vertex, its
/// vector and its twist, of a body to BodyPair. \param kind whether there is a Hessian
void addOwn(const Elements &elements, const Carrier &carrier, const Carrier::Gradient &gradient,
            const Carrier::Hessian &hessian, HessianKind kind, Derivatives &out);

} // namespace tendril
