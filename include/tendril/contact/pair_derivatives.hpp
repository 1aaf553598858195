#pragma once
/// \file pair_derivatives.hpp
/// Derivatives of what two edges, an edge and a body, or two bodies do to each other, by the points that they carry:
/// first ones docs/theory.md (9.1) and (18.3), second ones as in addCurvature of carrier.hpp.

#include "tendril/contact/friction.hpp"
#include "tendril/energy/carrier.hpp"

#include <optional>

namespace tendril {

/// Over the variables of a pair (TouchingPair::place), those of the one first.
struct OfPair {
  static constexpr int half = TouchingPair::variables, size = 2 * half;
  /// A vector by the variables of one of both.
  using BySide = Eigen::Matrix<double, 3, half>;
  Eigen::Matrix<double, size, 1> gradient = Eigen::Matrix<double, size, 1>::Zero();
  Eigen::Matrix<double, size, size> hessian = Eigen::Matrix<double, size, size>::Zero();
  /// Where the position of one of the four vertices of two edges begins.
  static int vertex(int k) { return half * (k / 2) + 3 * (k % 2); }
};

/// Of one of both, a rod or a body.
inline const ContactSettings &settingsOf(const Scene &scene, const TouchingPair &pair, int side) {
  return pair.isBody(side) ? scene.bodies[std::size_t(pair.body(side))].contact
                           : scene.rods[std::size_t(pair.rodOf(side))].contact;
}

/// Derivatives of a point that a side carries by the variables of that side.
OfPair::BySide byPoint(const TouchingPair &pair, int side, const CarriedPoint &point, const Configuration &c);
/// Adds the second derivatives of g.y, with the point y, by the variables of its side.
void addCurvature(const TouchingPair &pair, int side, const CarriedPoint &point, const Vec3 &g, const Configuration &c,
                  OfPair &out);
/// Where the frame of an edge or body has taken its part of the point: arm in the axes of the world [m].
Vec3 armOf(const TouchingPair &pair, int side, const CarriedPoint &point, const Configuration &c);
/// From the second point to the first, relative to what was so before.
Vec3 wayBetween(const TouchingPair &pair, int side, const CarriedPoint &own, const CarriedPoint &other,
                const Configuration &c);

/// A sample of the one that slides along the other. The point where surfaces touch is carried by both, so that friction
/// turns them and makes no couple of its own.
struct SlidingPair {
  TouchingPair pair;
  int side, sample;        ///< which of the pair has it, and which of its samples
  CarriedPoint own, other; ///< of the sample's side; of the other
  SlidingPoint point;
  const ContactSettings *both = nullptr; ///< between its sides (bothSlide)
  std::optional<EdgePoint> skin = {};    ///< in place of `own`, of a rod that touches by its skin
  int next = -1;                         ///< number of the pair that the second edge of this has with the other
  SlidingPoint &slid() { return point; }
  bool isSame(const SlidingPair &b) const {
    return pair.number == b.pair.number && side == b.side && sample == b.sample;
  }
};
/// Adds derivatives of what friction does to it by the variables of the pair, docs/theory.md (17.9) on both sides.
void addFriction(const SlidingPair &p, const SlidingForce &force, const Configuration &c, HessianKind kind,
                 OfPair &out);

/// What an energy by the place of a sample on the skin of a rod, relative to a body, does to both: (18.2), (20.2).
struct OnSkinOfPair {
  const EdgePoint &point;
  Vec3 gradient; ///< by the place of the sample
  Mat3 hessian;
  OfPair::BySide by_body;                         ///< derivatives of that place, as the body sees it
  OfPair::BySide turned = OfPair::BySide::Zero(); ///< second derivatives by the sample and the body's variables
  std::array<int, 2> number{-1, -1};              ///< of the pairs that its edges have with the body
};
/// Adds the rod's own part to its blocks and gradients, and what it has with the body to the blocks of the pairs.
/// \param kind whether there are any, and with the curvature of the skin
void addOnSkin(const Elements &elements, const TouchingPair &pair, int side, const OnSkinOfPair &on,
               const Configuration &c, HessianKind kind, Derivatives &out);

/// Adds derivatives of a pair to both of the gradients and to the blocks: what each side has with itself by addOwn, the
/// rest to the block of the pair. \param number of the pair, or -1 where it has no block
void addPair(const Elements &elements, const TouchingPair &pair, int number, const OfPair &d, HessianKind kind,
             Derivatives &out);

} // namespace tendril
