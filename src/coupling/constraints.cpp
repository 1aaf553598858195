/// Constraints by springs and dampers: a vertex to a point or the frame of an edge to a frame, both fixed in the world
/// or moving there; and a vertex to another one.
#include "tendril/coupling/couplings.hpp"
#include "tendril/energy/constraint.hpp"

namespace tendril {
namespace {

/// What both kinds have: where they stand, and the damper, weight/2 |strain - rest|^2 with strains as dampedStrain and
/// a weight [J] that holds the time.
class Spring {
public:
  int rod, slot;
  int target; ///< slot of the point or frame

  Spring(const Scene &scene, const Elements &elements, int k)
      : rod(scene.constraints[k].rod), slot(elements.rods[rod].slot(scene.constraints[k].at)),
        target(elements.constraint_slot[k]), constraint_(scene.constraints[k]), elements_(elements),
        length_(elements.length(rod)) {}

  void begin(const Configuration &start, const Step &step) {
    weight_ = step.isStatic() || constraint_.damping == 0 ? 0 : constraint_.damping / step.dampingDt();
    if (weight_ == 0) return;
    const Mat3 strain = strainOf(start);
    for (int j = 0; j < 3; ++j)
      for (int a = 0; a < 3; ++a)
        rest_(a, j) = dampedRest(step, strain(a, j), (a + 1) * strainRow(elements_) + target + j);
  }

  double stored(const Configuration &c) const { return radialLaw(constraint_, deviationOf(c).norm()).value; }

protected:
  const Constraint &constraint_;
  const Elements &elements_;
  double length_; ///< of the rod at rest [m]
  double weight_ = 0;
  Mat3 rest_ = Mat3::Zero();

  Vec3 deviationOf(const Configuration &c) const { return deviation(elements_, constraint_, target, c); }
  Mat3 strainOf(const Configuration &c) const { return dampedStrain(elements_, constraint_, target, length_, c); }
  /// What an error of the deviation costs.
  double noiseOf(const Vec3 &g, double error) const {
    const RadialLaw law = radialLaw(constraint_, g.norm());
    return error * (law.slope + (law.slope_over_g + weight_) * error);
  }
};

class Pin : public Spring {
public:
  static constexpr SiteKind site = SiteKind::vertex;
  using Spring::Spring;

  void moveIterate(const Configuration &) {}
  double value(const Configuration &c) const {
    return stored(c) + (weight_ > 0 ? 0.5 * weight_ * movedSinceRest(c).squaredNorm() : 0);
  }
  double noise(const Configuration &c, double blur) const {
    const Vec3 g = deviationOf(c);
    return noiseOf(g, blur * g.norm());
  }
  void derivatives(const Configuration &c, HessianKind, Local<3> &out) const {
    const VectorDerivatives spring = distanceDerivatives(constraint_, deviationOf(c));
    out.gradient = spring.gradient;
    out.hessian = spring.hessian;
    if (weight_ == 0) return;
    out.gradient += weight_ * movedSinceRest(c);
    out.hessian += weight_ * Mat3::Identity();
  }
  std::array<Vec3, 2> action(const Configuration &c) const {
    Vec3 force = -distanceDerivatives(constraint_, deviationOf(c)).gradient;
    if (weight_ > 0 && constraint_.damps_motion) force -= weight_ * movedSinceRest(c);
    return {force, Vec3::Zero()};
  }

private:
  Vec3 movedSinceRest(const Configuration &c) const { return length_ * (strainOf(c) - rest_).col(0); }
};

/// A pin whose point is another vertex, or a point of a body.
class PinToVertex : public Pin {
public:
  static constexpr SiteKind site = SiteKind::tie;
  using Pin::Pin;
};

/// A rotation vector jumps at half a turn: trials that lead across it from the iterate are impossible.
class Rotation : public Spring {
public:
  static constexpr SiteKind site = SiteKind::edge;
  using Spring::Spring;

  void begin(const Configuration &start, const Step &step) {
    Spring::begin(start, step);
    moveIterate(start);
  }
  void moveIterate(const Configuration &iterate) { iterate_ = deviationOf(iterate); }
  double value(const Configuration &c) const {
    const Vec3 g = deviationOf(c);
    if (constraint_.measure == Constraint::Measure::angle && jumpsBetween(iterate_, g))
      return std::numeric_limits<double>::infinity();
    return radialLaw(constraint_, g.norm()).value +
           (weight_ > 0 ? 0.25 * weight_ * (strainOf(c) - rest_).squaredNorm() : 0);
  }
  double noise(const Configuration &c, double blur) const { return noiseOf(deviationOf(c), 4 * blur); }
  void derivatives(const Configuration &c, HessianKind kind, Local<edge_size> &out) const {
    const bool exact = kind != HessianKind::gauss_newton;
    const EdgeDerivatives d = overEdge(c.frameAt(slot), bySpin(c, exact), exact);
    out.gradient = d.gradient;
    out.hessian = d.hessian;
  }
  std::array<Vec3, 2> action(const Configuration &c) const {
    Vec3 moment = -rotationDerivatives(constraint_, deviationOf(c)).gradient;
    if (weight_ > 0 && constraint_.damps_motion) moment -= damperAt(c).gradient;
    return {Vec3::Zero(), moment};
  }

protected:
  /// By a spin of the edge.
  VectorDerivatives bySpin(const Configuration &c, bool exact) const {
    VectorDerivatives by_spin = rotationDerivatives(constraint_, deviationOf(c), !exact);
    if (weight_ == 0) return by_spin;
    const VectorDerivatives damper = damperAt(c);
    by_spin.gradient += damper.gradient;
    by_spin.hessian += exact ? damper.hessian : Mat3(weight_ * Mat3::Identity());
    return by_spin;
  }

private:
  Vec3 iterate_ = Vec3::Zero();

  /// The strain is T'R, T the frame that the damper is tied to: |T'R - rest| = |R - T rest|.
  VectorDerivatives damperAt(const Configuration &c) const {
    const Mat3 tied = matrixOf(constraint_.damps_motion ? c.frameAt(target) : constraint_.frame);
    return chordDerivatives(weight_, matrixOf(c.frameAt(slot)), tied * rest_);
  }
};

/// A rotation whose frame is that of a body. Turning both alike costs nothing: with m and H the derivatives by the spin
/// a of the edge, those by the spin b of the body are -m and H, and between them a'(-H - [m]x/2) b, the last of the
/// commutator of both.
class RotationToBody : public Rotation {
public:
  static constexpr SiteKind site = SiteKind::edge_to_frame;
  int cell; ///< slot of what edge and frame have between them

  RotationToBody(const Scene &scene, const Elements &elements, int k) : Rotation(scene, elements, k) {
    for (const JoinedEdge &j : elements.joinedEdges({rod, rod + 1}))
      if (j.frame == target) cell = j.cell;
  }
  void derivatives(const Configuration &c, HessianKind kind, Local<edge_size + 3> &out) const {
    const bool exact = kind != HessianKind::gauss_newton;
    const Frame f = c.frameAt(slot);
    const VectorDerivatives by_spin = bySpin(c, exact);
    const EdgeDerivatives d = overEdge(f, by_spin, exact);
    Eigen::Matrix<double, 3, 4> spin; // of the edge, by its vector and twist
    spin << crossMatrix<double>(f.tangent) / f.length, f.tangent;
    Mat3 between = -by_spin.hessian;
    if (exact) between += 0.5 * crossMatrix<double>(by_spin.gradient);
    out.gradient << d.gradient, -by_spin.gradient;
    out.hessian.topLeftCorner<4, 4>() = d.hessian;
    out.hessian.bottomRightCorner<3, 3>() = by_spin.hessian;
    out.hessian.bottomLeftCorner<3, 4>() = between * spin;
    out.hessian.topRightCorner<4, 3>() = out.hessian.bottomLeftCorner<3, 4>().transpose();
  }
};

template <class Stencil>
std::unique_ptr<Term> makeConstraints(const Scene &scene, const Elements &elements, Constraint::Kind kind,
                                      bool to_world = true) {
  std::vector<Stencil> stencils;
  for (std::size_t k = 0; k < scene.constraints.size(); ++k)
    if (scene.constraints[k].kind == kind && scene.constraints[k].isToWorld() == to_world)
      stencils.emplace_back(scene, elements, int(k));
  if (stencils.empty()) return nullptr;
  return std::make_unique<StencilTerm<Stencil, &EnergyBudget::constraint>>(std::move(stencils), elements);
}

} // namespace

std::unique_ptr<Term> makePins(const Scene &scene, const Elements &elements) {
  return makeConstraints<Pin>(scene, elements, Constraint::Kind::pin);
}
std::unique_ptr<Term> makeTies(const Scene &scene, const Elements &elements) {
  return makeConstraints<PinToVertex>(scene, elements, Constraint::Kind::pin, false);
}
std::unique_ptr<Term> makeRotationsToBodies(const Scene &scene, const Elements &elements) {
  return makeConstraints<RotationToBody>(scene, elements, Constraint::Kind::rotation, false);
}
std::unique_ptr<Term> makeRotations(const Scene &scene, const Elements &elements) {
  return makeConstraints<Rotation>(scene, elements, Constraint::Kind::rotation);
}

} // namespace tendril
