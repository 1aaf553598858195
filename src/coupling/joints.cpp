/// Joints between bodies. What a joint holds exactly is an equation C = 0 in both poses, with a force L that is an
/// unknown of its own, as the axial forces of edges are: Newton's step on L and the poses, with the compliance 1/k in
/// place of 0, is that on E + L C + k/2 C^2, after which L has grown by k (C + dC). So the forces are exact, equations
/// that say the same twice do no harm, and negative pivots count unstable motions (augmented Lagrangian; D. P.
/// Bertsekas, *Constrained Optimization and Lagrange Multiplier Methods*, 1982, 2.2 and 4.2). docs/theory.md has more.
#include "tendril/coupling/couplings.hpp"
#include "tendril/coupling/held_bodies.hpp"
#include "tendril/energy/linkage.hpp"
#include "tendril/state/spin_stage.hpp"

#include <limits>
#include <map>

namespace tendril {
namespace {

/// By how much stiffer than what it holds an exact joint is between two updates of its forces: each takes the error of
/// these down by as much. In statics those that close loops do with less; bodies that are not alike take at most so
/// much of the softer.
constexpr double stiffer = 1e6, stiffer_in_statics = 1e3, stiffest = 1e9;
/// Slots of forces of a drive and of an end of the range.
constexpr int drive_force = 6, range_force = 7;

class Joints final : public Term {
public:
  Joints(const Scene &scene, const Elements &elements)
      : scene_(scene), elements_(elements), work_(scene.joints.size()), held_(whatHolds(scene, elements)),
        linkage_(scene, elements) {
    for (const BodyPair &p : elements.pairs({0, int(elements.rods.size())}))
      if (p.joint >= 0) pairs_.items.push_back(p);
    pairs_.sort(elements.rods.size());
  }
  bool roundsAsStrains() const override { return false; }

  void beginStep(const State &state, const Configuration &start, const Step &step, int rod) override {
    for (const BodyPair &p : pairs(rod)) {
      const Joint &joint = jointOf(p);
      Work &w = work_[std::size_t(p.joint)];
      std::tie(w.stiffness, w.turning) = stiffnessOf(joint, step);
      w.size = sizeOf(joint);
      w.is_static = step.isStatic();
      w.damping = 0;
      if (!step.isStatic() && joint.dissipates()) {
        w.damping = 1 / step.dampingDt();
        const Rows strain = dampedRows(joint, placeOf(joint, p, elements_, state, start));
        for (int k = 0; k < joint_rows; ++k) w.rest[k] = dampedRest(step, strain[k], std::size_t(p.first + k));
      }
      takeForces(p, start);
    }
  }
  void moveIterate(const Configuration &iterate, int rod) override {
    for (const BodyPair &p : pairs(rod)) takeForces(p, iterate);
  }

  double energy(const Configuration &c, int rod) const override {
    return sumOver(c, rod, [&](const BodyPair &p, const Rows &values, const JointPlace &place) {
      return lawOf(p, values, place.drawn).value;
    });
  }
  double violation(const Configuration &c, int rod) const override {
    return sumOver(c, rod, [&](const BodyPair &p, const Rows &values, const JointPlace &place) {
      JointLaw exact;
      addExact(p, values, place.drawn, exact);
      return exact.value;
    });
  }
  double noise(const Configuration &c, int rod, double) const override {
    return sumOver(c, rod, [&](const BodyPair &p, const Rows &values, const JointPlace &place) {
      const JointLaw law = lawOf(p, values, place.drawn);
      double sum = 0;
      for (int k = 0; k < joint_rows; ++k) {
        const double blur = 16 * epsilon * (isTurn(jointOf(p), k) ? 1 : place.reach.norm() + place.arm.norm());
        sum += (std::abs(law.slope[k] + law.more[k]) + law.curvature(k, k) * blur) * blur;
      }
      return sum;
    });
  }
  double mismatch(const Configuration &c, int rod) const override {
    double most = 0;
    for (const BodyPair &p : pairs(rod)) {
      const Joint &joint = jointOf(p);
      const JointPlace place = placeOf(joint, p, elements_, c);
      const Rows values = jointValues(joint, place);
      const Work &w = work_[std::size_t(p.joint)];
      for (int k = 0; k <= coordinate_row; ++k)
        if (const Equation e = equation(joint, w, k, values, place.drawn); e.exact)
          most = std::max(most, std::abs(e.off) / (isTurn(joint, k) ? 1 : w.size));
      if (const Equation e = rangeEquation(p, values); e.exact)
        most = std::max(most, std::abs(e.off) / (isTurn(joint, coordinate_row) ? 1 : w.size));
    }
    return most;
  }

  void addEnergies(const State &, const Configuration &c, double, int rod, EnergyBudget &out) const override {
    out.constraint += sumOver(c, rod, [&](const BodyPair &p, const Rows &values, const JointPlace &place) {
      JointLaw springs;
      springs.addSprings(jointOf(p), values, place.drawn);
      return springs.value;
    });
  }

  void addDerivatives(const Configuration &c, int r, Derivatives &out, HessianKind hessian) const override {
    for (const BodyPair &p : pairs(r)) {
      const Joint &joint = jointOf(p);
      const JointPlace place = placeOf(joint, p, elements_, c);
      const Rows values = jointValues(joint, place);
      const JointLaw law = lawOf(p, values, place.drawn);
      const std::array<JointRow, joint_rows> rows = rowsOf(joint, place);
      add(p, law.gradient(rows, law.slope), out.equilibrium);
      add(p, law.gradient(rows, law.more), out.gradient);
      if (hessian == HessianKind::none) continue;
      Mat12 h = Mat12::Zero();
      for (int k = 0; k < joint_rows; ++k) {
        const JointRow &row = rows[std::size_t(k)];
        if (law.slope[k] != 0 && hessian == HessianKind::exact) h += law.slope[k] * row.hessian;
        for (int l = 0; l < joint_rows; ++l)
          if (law.curvature(k, l) != 0)
            h += law.curvature(k, l) * row.gradient * rows[std::size_t(l)].gradient.transpose();
      }
      // A body on two balls turns freely about the line between: above what Newton leaves undone there.
      const Work &w = work_[std::size_t(p.joint)];
      const double neutral = 1e-12 * (linkage_.isOfTree(p.joint) ? stiffer_in_statics / stiffer : 1);
      for (int k = 0; k < 3 && w.is_static; ++k) {
        h(3 + k, 3 + k) += neutral * w.stiffness * place.arm.squaredNorm();
        h(9 + k, 9 + k) += neutral * w.stiffness * place.parent_arm.squaredNorm();
      }
      const RodRange &rod = elements_.rods[std::size_t(r)];
      for (int i = 0; i < p.variables(); ++i)
        for (int j = i; j < p.variables(); ++j) {
          const auto [plane, slot] = EdgeBlocks::pair(i, j);
          out.blocks.entry(rod, plane)[p.first + slot - rod.first_slot] += h(i, j);
        }
    }
  }

  void setTrialForces(const Configuration &iterate, const Planes &increment, double scale, int rod,
                      Configuration &trial) const override {
    for (const BodyPair &p : pairs(rod)) {
      const Joint &joint = jointOf(p);
      const Work &w = workOf(p);
      const JointPlace place = placeOf(joint, p, elements_, iterate);
      const Vec12 moved = motion(p, increment);
      Rows values = jointValues(joint, place);
      for (int k = 0; k < joint_rows; ++k)
        if (holds(joint, k)) values[k] += jointRow(joint, place, k).gradient.dot(moved);
      double *force = trial[Configuration::axial_force] + p.first;
      for (int k = 0; k <= coordinate_row; ++k) {
        const Equation e = equation(joint, w, k, values, place.drawn);
        force[k] = w.force[std::size_t(k)] + (e.exact ? scale * e.stiffness * e.off : 0);
      }
      const Equation e = rangeEquation(p, values);
      force[range_force] = e.exact ? w.force[range_force] + scale * e.stiffness * e.off : 0;
    }
  }
  double addExcess(const Configuration &iterate, const Planes &increment, double scale, const Configuration &trial,
                   int rod, Planes &force) const override {
    double most = 0;
    for (const BodyPair &p : pairs(rod)) {
      const Joint &joint = jointOf(p);
      const Work &w = work_[std::size_t(p.joint)];
      const JointPlace before = placeOf(joint, p, elements_, iterate), now = placeOf(joint, p, elements_, trial);
      const Rows values = jointValues(joint, before), there = jointValues(joint, now);
      const Vec12 moved = scale * motion(p, increment);
      const JointLaw law = lawOf(p, values, before.drawn);
      Vec12 pull = Vec12::Zero();
      for (int k = 0; k < joint_rows; ++k) {
        if (!holds(joint, k) || law.curvature(k, k) == 0) continue;
        const JointRow row = jointRow(joint, before, k);
        const double excess = there[k] - values[k] - row.gradient.dot(moved);
        pull += law.curvature(k, k) * excess * row.gradient;
        most = std::max(most, std::abs(excess) / (isTurn(joint, k) ? 1 : w.size));
      }
      add(p, pull, force);
    }
    return most;
  }

  /// From leaves to roots: the force L of a joint does with what it carries no work in motions U of the body that it
  /// places by which alone what it holds changes: shifts along its axes, and turns about its point.
  bool carry(int rod, const Planes &gradient, Configuration &iterate) override {
    const std::span<const Linkage::TreeJoint> joints = linkage_.trees(rod);
    for (const Linkage::TreeJoint &j : joints) { // out of balance, of all bodies of the trees
      const BodyPair &p = elements_.pairOf(j.joint);
      for (int k = 0; k < p.variables(); ++k) carried_[p.of[k / 3]][k % 3] = gradient[k % 3][p.of[k / 3]];
    }
    for (auto j = joints.rbegin(); j != joints.rend(); ++j) {
      const BodyPair &p = elements_.pairOf(j->joint);
      const Joint &joint = jointOf(p);
      const JointPlace place = placeOf(joint, p, elements_, iterate);
      Eigen::Vector<double, 6> body;
      for (const int k : {0, 1}) body.segment<3>(3 * k) = carried_[p.of[std::size_t(k + (j->places_parent ? 2 : 0))]];
      const Rows forces = carryingForces(joint, place, j->places_parent, body);
      for (int k = 0; k < coordinate_row; ++k) iterate[Configuration::axial_force][p.first + k] += forces[k];
      const Vec12 on_both = JointLaw().gradient(rowsOf(joint, place), forces);
      for (int k = 0; k < p.variables() / 3; ++k) carried_[p.of[std::size_t(k)]] += on_both.segment<3>(3 * k);
      takeForces(p, iterate);
    }
    return !joints.empty();
  }

  void commit(State &state, const Configuration &c, int rod) const override {
    for (const BodyPair &p : pairs(rod)) {
      JointState &joint = state.joints[std::size_t(p.joint)];
      std::copy_n(c[Configuration::axial_force] + p.first, BodyPair::forces, joint.force.begin());
      joint.coordinate = jointValues(jointOf(p), placeOf(jointOf(p), p, elements_, c))[coordinate_row];
    }
  }

  std::array<Vec3, 2> actionFrom(int slot, const Configuration &c, int rod) const override {
    for (const BodyPair &p : pairs(rod)) {
      if (slot != p.parent(0) && slot != p.target()) continue;
      const Joint &joint = jointOf(p);
      const JointPlace place = placeOf(joint, p, elements_, c);
      const JointLaw law = lawOf(p, jointValues(joint, place), place.drawn);
      if (slot == p.target()) return {Vec3(-driveForce(p, place), 0, 0), Vec3::Zero()};
      const Vec12 by = law.gradient(rowsOf(joint, place), law.slope);
      return {by.segment<3>(6), by.segment<3>(9)};
    }
    return {Vec3::Zero(), Vec3::Zero()};
  }

private:
  struct Work {
    std::array<double, BodyPair::forces> force{}; ///< at the iterate
    const Configuration *iterate = nullptr;       ///< where the end of the range is to be found, or null: it is
    int end = 0;                                  ///< of the range that presses: 1 the upper, -1 the lower, 0 none
    double stiffness = 0, turning = 0;            ///< of exact equations [N/m], [N m]
    double size = 1;                              ///< of the smaller body [m]
    double damping = 0;                           ///< one over time [1/s], or 0
    bool is_static = false;
    Rows rest = Rows::Zero(); ///< around which dampers pull (dampedRows)
  };
  /// One that is exact: by how much it is off, and how stiff it is between two updates of its force.
  struct Equation {
    bool exact = false;
    double off = 0, stiffness = 0;
  };
  const Scene &scene_;
  const Elements &elements_;
  mutable std::vector<Work> work_;
  std::vector<Held> held_;
  Linkage linkage_;
  std::map<int, Vec3> carried_; ///< by slots, while forces of trees are found
  ByRod<BodyPair> pairs_;

  std::span<const BodyPair> pairs(int rod) const { return pairs_.of({rod, rod + 1}); }
  const Joint &jointOf(const BodyPair &p) const { return scene_.joints[std::size_t(p.joint)]; }
  template <class Value> double sumOver(const Configuration &c, int rod, Value value) const {
    double sum = 0;
    for (const BodyPair &p : pairs(rod)) {
      const JointPlace place = placeOf(jointOf(p), p, elements_, c);
      sum += value(p, jointValues(jointOf(p), place), place);
    }
    return sum;
  }
  static bool isTurn(const Joint &joint, int row) {
    return row == coordinate_row ? !joint.held().slidesFreely() : row > 2;
  }
  void takeForces(const BodyPair &p, const Configuration &c) {
    Work &w = work_[std::size_t(p.joint)];
    std::copy_n(c[Configuration::axial_force] + p.first, BodyPair::forces, w.force.begin());
    w.iterate = jointOf(p).hasRange() && jointOf(p).range_stiffness < 0 ? &c : nullptr;
    if (!w.iterate) w.end = 0;
  }
  /// The end that presses at the iterate, once all of it has moved: by its force, or where the coordinate is beyond.
  const Work &workOf(const BodyPair &p) const {
    Work &w = work_[std::size_t(p.joint)];
    if (!w.iterate) return w;
    const Joint &joint = jointOf(p);
    const double q = jointValues(joint, placeOf(joint, p, elements_, *w.iterate))[coordinate_row],
                 force = w.force[range_force], soft = softness(joint, w);
    w.iterate = nullptr;
    w.end = std::isfinite(joint.upper) && force + soft * (q - joint.upper) > 0   ? 1
            : std::isfinite(joint.lower) && force + soft * (q - joint.lower) < 0 ? -1
                                                                                 : 0;
    if (w.end == 0) w.force[range_force] = 0;
    return w;
  }
  /// Of what opposes the coordinate [N/m] or [N m].
  static double softness(const Joint &joint, const Work &w) {
    return (isTurn(joint, coordinate_row) ? w.turning : w.stiffness) / stiffer;
  }
  double sizeOf(const Joint &joint) const {
    return std::min(elements_.bodySize(joint.child), joint.parent < 0 ? HUGE_VAL : elements_.bodySize(joint.parent));
  }
  /// So much stiffer than inertia and what else holds both bodies.
  std::pair<double, double> stiffnessOf(const Joint &joint, const Step &step) const {
    std::pair<double, double> least{HUGE_VAL, HUGE_VAL}, most{0, 0};
    for (const int body : {joint.child, joint.parent}) {
      if (body < 0) continue;
      const MassProperties &all = elements_.bodyMass(body);
      const Held &held = held_[std::size_t(body)];
      const double rate = step.isStatic() ? 0 : step.rule->mass / (step.dt * step.dt),
                   spring = joint.driven ? std::max(joint.drive_stiffness, 0.0) : 0,
                   moving = all.mass * rate + held.stiffness + spring,
                   turning = all.inertia.trace() * rate + held.turning + spring;
      least = {std::min(least.first, moving), std::min(least.second, turning)};
      most = {std::max(most.first, moving), std::max(most.second, turning)};
    }
    const Rod &host = scene_.rods[std::size_t(joint.rod)];
    const double any = host.material.axial_stiffness / host.length(), size = sizeOf(joint);
    const bool does_with_less =
        step.isStatic() && !step.small_motions && !linkage_.isOfTree(int(&joint - &scene_.joints[0]));
    const double times = does_with_less ? stiffer_in_statics : stiffer;
    auto between = [&](double low, double high, double other) {
      return high > 0 ? std::min(times * high, stiffest * (low > 0 ? low : high)) : times * other;
    };
    return {between(least.first, most.first, any), between(least.second, most.second, any * size * size)};
  }

  Equation equation(const Joint &joint, const Work &w, int k, const Rows &values, double target) const {
    if (k == coordinate_row)
      return {joint.driven && joint.drive_stiffness < 0, values[k] - target,
              isTurn(joint, k) ? w.turning : w.stiffness};
    return {joint.isExact() && holds(joint, k), values[k], isTurn(joint, k) ? w.turning : w.stiffness};
  }
  /// That of the end of the range that presses. Where none does, trials beyond one cost what opposes them, and
  /// no more: the next iterate takes that end for an equation.
  Equation rangeEquation(const BodyPair &p, const Rows &values) const {
    const Joint &joint = jointOf(p);
    const Work &w = workOf(p);
    if (!joint.hasRange() || joint.range_stiffness >= 0) return {};
    const double q = values[coordinate_row], soft = softness(joint, w);
    if (w.end != 0) return {true, q - (w.end > 0 ? joint.upper : joint.lower), stiffer * soft};
    return {false, std::max(q - joint.upper, 0.0) + std::min(q - joint.lower, 0.0), soft};
  }

  void addExact(const BodyPair &p, const Rows &values, double target, JointLaw &law) const {
    const Joint &joint = jointOf(p);
    const Work &w = workOf(p);
    auto add = [&](int row, double force, const Equation &e) {
      if (!e.exact) return;
      law.value += (force + 0.5 * e.stiffness * e.off) * e.off;
      law.slope[row] += force;
      law.more[row] += e.stiffness * e.off;
      law.curvature(row, row) += e.stiffness;
    };
    for (int k = 0; k <= coordinate_row; ++k) add(k, w.force[std::size_t(k)], equation(joint, w, k, values, target));
    const Equation range = rangeEquation(p, values);
    add(coordinate_row, w.force[range_force], range);
    if (!range.exact) law.value += 0.5 * range.stiffness * range.off * range.off;
  }
  JointLaw lawOf(const BodyPair &p, const Rows &values, double target) const {
    const Joint &joint = jointOf(p);
    const Work &w = work_[std::size_t(p.joint)];
    JointLaw law;
    law.addSprings(joint, values, target);
    addExact(p, values, target, law);
    if (w.damping == 0) return law;
    for (int k = 0; k < joint_rows; ++k) {
      const double damping = dampingOf(joint, k) * w.damping,
                   off = values[k] - (k == coordinate_row ? target : 0) - w.rest[k];
      law.value += 0.5 * damping * off * off;
      law.slope[k] += damping * off;
      law.curvature(k, k) += damping;
    }
    return law;
  }
  static double dampingOf(const Joint &joint, int row) {
    if (row == coordinate_row) return joint.driven ? joint.drive_damping : 0;
    if (row == cosine_row) return 0;
    if (joint.isExact() || !holds(joint, row)) return 0;
    return row < 3 ? joint.damping : joint.rotational_damping;
  }
  /// Derivative of the energy by the coordinate that a drive makes.
  double driveForce(const BodyPair &p, const JointPlace &place) const {
    const Joint &joint = jointOf(p);
    const Work &w = work_[std::size_t(p.joint)];
    if (joint.drive_stiffness < 0) return w.force[drive_force];
    const double q = jointValues(joint, place)[coordinate_row];
    return joint.drive_stiffness * (q - place.drawn) +
           joint.drive_damping * w.damping * (q - place.drawn - w.rest[coordinate_row]);
  }

  std::array<JointRow, joint_rows> rowsOf(const Joint &joint, const JointPlace &place) const {
    std::array<JointRow, joint_rows> rows;
    for (int k = 0; k < joint_rows; ++k)
      if (holds(joint, k)) rows[std::size_t(k)] = jointRow(joint, place, k);
    return rows;
  }
  static Vec12 motion(const BodyPair &p, const Planes &increment) {
    Vec12 x = Vec12::Zero();
    for (int k = 0; k < p.variables() / 3; ++k) x.segment<3>(3 * k) = increment.vector(0, p.of[std::size_t(k)]);
    return x;
  }
  static void add(const BodyPair &p, const Vec12 &force, Planes &out) {
    for (int k = 0; k < p.variables(); ++k) {
      const auto [slot, a] = p.place(k, true);
      out[a][slot] += force[k];
    }
  }
};

} // namespace

std::unique_ptr<Term> makeJoints(const Scene &scene, const Elements &elements) {
  return scene.joints.empty() ? nullptr : std::make_unique<Joints>(scene, elements);
}

} // namespace tendril
