/// Weight, loads and inertia of rigid bodies: of the centre of mass as of a vertex, docs/theory.md (15.2), and the
/// balance of angular momentum in axes fixed in space (9.2), for which the work since the last iterate (9.5) stands in
/// place of a potential.
#include "tendril/energy/term.hpp"
#include "tendril/state/spin_stage.hpp"

namespace tendril {
namespace {

class BodyMotion final : public Term {
public:
  BodyMotion(const Scene &scene, const Elements &elements, bool dynamic)
      : scene_(scene), elements_(elements), dynamic_(dynamic), bodies_(scene.bodies.size()) {}

  bool isLoad() const override { return !dynamic_; }
  bool roundsAsStrains() const override { return false; }

  void beginStep(const State &, const Configuration &start, const Step &step, int rod) override {
    start_ = &start;
    factor_ = step.load_factor;
    small_motions_ = step.small_motions;
    for (const JoinedBody &b : elements_.bodies({rod, rod + 1})) {
      Motion &m = bodies_[b.body];
      if (dynamic_) {
        const StageRule &rule = *step.rule;
        m.weight = elements_.bodyMass(b.body).mass * rule.mass / (step.dt * step.dt);
        m.predicted = -step.dt * (rule.velocity.ofBody(b.body).translation +
                                  rule.acceleration.ofBody(b.body).translation / rule.mass);
        m.spin = spinStage(elements_.bodyMass(b.body).inertia, start.rotationAt(b.rotation), rule, b.body);
      }
    }
    moveIterate(start, rod);
  }

  void moveIterate(const Configuration &iterate, int rod) override {
    for (const JoinedBody &b : elements_.bodies({rod, rod + 1})) {
      Motion &m = bodies_[b.body];
      m.iterate = iterate.frameAt(b.rotation);
      m.couple = coupleOn(b, iterate);
    }
  }

  void setLoadFactor(double factor) override { factor_ = factor; }

  double energy(const Configuration &c, int rod) const override {
    double sum = 0;
    for (const JoinedBody &b : elements_.bodies({rod, rod + 1})) {
      const Motion &m = bodies_[b.body];
      const Vec3 moved = c.displacementAt(b.position, *start_);
      sum -= forceOn(b.body).dot(moved);
      if (!scene_.bodies[b.body].force.isZero(0))
        sum -= factor_ * scene_.bodies[b.body].force.dot(ownCentre(b, c) - ownCentre(b, *start_));
      if (dynamic_) sum += 0.5 * m.weight * (moved - m.predicted).squaredNorm();
      // (9.5): exact slope at the iterate, and an error of the third power of the turn (Load has the same for couples).
      sum += 0.5 * rotationBetween(m.iterate, c.frameAt(b.rotation)).dot(m.couple + coupleOn(b, c));
    }
    return sum;
  }

  void addEnergies(const State &state, const Configuration &, double load_factor, int rod,
                   EnergyBudget &out) const override {
    for (const JoinedBody &b : elements_.bodies({rod, rod + 1})) {
      const MassProperties &all = elements_.bodyMass(b.body);
      const BodyRate &rate = state.body_rate[b.body];
      const Mat3 turned = rotationOf(state, b.group);
      const Vec3 momentum = turned.transpose() * rate.momentum;
      if (dynamic_)
        out.body_kinetic +=
            0.5 * (all.mass * rate.translation.squaredNorm() + momentum.dot(elements_.spinOf(b.body, momentum)));
      out.gravity -= load_factor * weightOf(b.body).dot(state.body_position[b.body]);
    }
  }

  void addDerivatives(const Configuration &c, int r, Derivatives &out, HessianKind hessian) const override {
    const RodRange &rod = elements_.rods[r];
    const BlockPlanes blocks(out.blocks, rod);
    for (const JoinedBody &b : elements_.bodies({r, r + 1})) {
      const Motion &m = bodies_[b.body];
      Vec3 force = -forceOn(b.body);
      if (dynamic_) force += m.weight * (c.displacementAt(b.position, *start_) - m.predicted);
      out.equilibrium.setVector(0, b.position, out.equilibrium.vector(0, b.position) + force);
      out.equilibrium.setVector(0, b.rotation, out.equilibrium.vector(0, b.rotation) + coupleOn(b, c));
      const Vec3 arm = ownCentre(b, c), pull = -factor_ * scene_.bodies[b.body].force;
      out.equilibrium.setVector(0, b.rotation, out.equilibrium.vector(0, b.rotation) + arm.cross(pull));
      if (hessian == HessianKind::none) continue;
      Mat3 by_turn = curvatureOfArm(pull, arm);
      if (dynamic_)
        by_turn += m.spin.derivative(turnOf(b, *start_, c));
      else if (!small_motions_)
        by_turn += neutralStiffness(b.body) * Mat3::Identity();
      for (int i = 0; i < 3; ++i) {
        blocks.vertex(i, i)[b.position] += m.weight;
        for (int j = i; j < 3; ++j) blocks.vertex(i, j)[b.rotation] += 0.5 * (by_turn(i, j) + by_turn(j, i));
      }
    }
  }

  /// The symmetric blocks are those of the coordinates exp(d) R, in which the gradient of a couple rho is rho + (its
  /// derivative + [rho]x/2) d, docs/theory.md (9.4): so is the rest.
  Vec3 circulation(const JoinedBody &b, const Configuration &c) const override {
    const Vec3 couple = coupleOn(b, c);
    if (!dynamic_) return 0.5 * couple;
    const Mat3 m = bodies_[b.body].spin.derivative(turnOf(b, *start_, c));
    return 0.5 * (Vec3(m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1)) + couple);
  }

private:
  struct Motion {
    double weight = 0; ///< mass over time squared
    Vec3 predicted = Vec3::Zero();
    SpinStage spin;
    Frame iterate;
    Vec3 couple; ///< at the iterate
  };
  const Scene &scene_;
  const Elements &elements_;
  bool dynamic_, small_motions_ = false;
  std::vector<Motion> bodies_;
  const Configuration *start_ = nullptr;
  double factor_ = 1;

  Vec3 weightOf(int b) const {
    return scene_.bodies[b].gravity ? Vec3(elements_.bodyMass(b).mass * scene_.gravity) : Vec3(Vec3::Zero());
  }
  /// So little that no answer feels it: a body that hangs on a pin turns freely about the line to it.
  double neutralStiffness(int b) const {
    const MassProperties &all = elements_.bodyMass(b);
    return 1e-10 * (std::sqrt(all.inertia.trace() / all.mass) * forceOn(b).norm() + scene_.bodies[b].torque.norm());
  }
  /// At the centre of mass [N].
  Vec3 forceOn(int b) const { return factor_ * (weightOf(b) + scene_.bodies[b].force); }
  /// By which its angular momentum changes, less the couple on it [N m].
  Vec3 coupleOn(const JoinedBody &b, const Configuration &c) const {
    const Body &body = scene_.bodies[b.body];
    Vec3 couple = -factor_ * body.torque;
    if (dynamic_) couple += bodies_[b.body].spin.rate(turnOf(b, *start_, c));
    return couple;
  }
  /// From the centre of mass of all to that of the body alone.
  Vec3 ownCentre(const JoinedBody &b, const Configuration &c) const {
    return c.rotationAt(b.rotation) * (scene_.bodies[b.body].own.centre - elements_.bodyMass(b.body).centre);
  }
};

} // namespace

std::unique_ptr<Term> makeBodyMotion(const Scene &scene, const Elements &elements, bool dynamic) {
  return std::make_unique<BodyMotion>(scene, elements, dynamic);
}

} // namespace tendril
