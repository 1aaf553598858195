/// Tendons with their actuators. Every one has all derivatives between any two of what it pulls on, that of tension by
/// displacement included, as blocks of pairs: no tendon is a column of its own, and slack ones cost what taut ones do.
/// The tension of a stiff tendon is an unknown of its own, as the axial force of an edge is: what the linearised
/// displacement asks for. So a step that a stiff tendon begins far from its tension is not lost in what that tension,
/// many times too large, would do by the curvature of its path. A rigid one is a spring whose target goes on by the
/// tension over its stiffness: so the tension grows until the displacement is at the target itself, as those of exact
/// joints do (augmented Lagrangian, see coupling/joints.cpp). Friction adds to that tension part by part (Capstan).
#include "tendril/coupling/couplings.hpp"
#include "tendril/coupling/held_bodies.hpp"
#include "tendril/energy/capstan.hpp"

namespace tendril {
namespace {

class Tendons final : public Term {
public:
  Tendons(const Scene &scene, const Elements &elements)
      : scene_(scene), elements_(elements), held_(whatHolds(scene, elements)), work_(scene.tendons.size()),
        by_rod_(scene.tendons, elements.rods.size()) {
    paths_.reserve(scene.tendons.size()); // capstans have their places
    for (int k = 0; k < int(scene.tendons.size()); ++k) {
      const TendonPath &path = paths_.emplace_back(scene, elements, k);
      capstans_.emplace_back(path);
      double size = HUGE_VAL;
      for (const Carrier &c : path.carriers())
        size = std::min(size, c.isBody() ? elements.bodySize(c.body()) : elements.restLength()[c.slot[0]]);
      sizes_.push_back(size);
    }
  }
  bool couplesPositions() const override { return true; }
  bool joinsPositions() const override { return true; }
  bool roundsAsStrains() const override { return false; }

  /// Of what tendons pull on all pairs are together for good.
  void findTouching(const State &, const Configuration &, const Planes &, const Step &, double,
                    std::vector<TouchingPair> &pairs) override {
    first_number_.clear();
    begin_ = int(pairs.size());
    for (const TendonPath &path : paths_) {
      first_number_.push_back(int(pairs.size()));
      forPairs(path, [&](std::size_t a, std::size_t b) {
        TouchingPair p = pairOf(path.carriers()[a], path.carriers()[b]);
        p.number = int(pairs.size());
        pairs.push_back(p);
      });
    }
    end_ = int(pairs.size());
  }
  bool nearlyTouch(const TouchingPair &pair, const Configuration &) const override {
    return pair.number >= begin_ && pair.number < end_;
  }

  void beginStep(const State &state, const Configuration &start, const Step &step, int rod) override {
    for (const int k : by_rod_.of(rod)) {
      const TendonPath &path = paths_[std::size_t(k)];
      Work &w = work_[std::size_t(k)];
      w = {};
      if (path.tendon().actuator.rigid) {
        w.stiffness = stiffnessAround(k, step);
        w.at_start = state.tendon_memory[std::size_t(scene_.firstMemory(k + 1)) - 1];
      } else
        w.at_start = pull(k, start).tension;
      w.tension = w.at_start;
      w.taut = w.tension > 0;
      if (!step.isStatic() && path.tendon().dissipates()) {
        w.damper.rate = 1 / step.dampingDt();
        w.damper.rest = dampedRest(step, path.displacement(start), std::size_t(path.slot()));
      }
      Capstan &capstan = capstans_[std::size_t(k)];
      if (!capstan.rubs()) continue;
      // One that is given comes at once, and might find too little friction to be held.
      const Actuator &a = path.tendon().actuator;
      const double expected = a.kind == Actuator::Kind::displacement
                                  ? w.tension
                                  : pullOf(a, path.displacement(start), a.inputAt(step.time), w.damper).tension;
      capstan.begin(state.tendon_memory.data() + scene_.firstMemory(k), start, expected);
    }
  }
  /// At the start of a step the plane of axial forces is zero in the slots of tendons.
  void moveIterate(const Configuration &iterate, int rod) override {
    for (const int k : by_rod_.of(rod)) {
      Work &w = work_[std::size_t(k)];
      w.tension = w.at_start + iterate[Configuration::axial_force][paths_[std::size_t(k)].slot()];
      w.taut = w.tension > 0;
    }
  }
  void setTrialForces(const Configuration &iterate, const Planes &increment, double scale, int rod,
                      Configuration &trial) const override {
    for (const int k : by_rod_.of(rod)) {
      const Work &w = work_[std::size_t(k)];
      const Pull p = pull(k, iterate);
      const double now = tensionAt(k, p),
                   wanted =
                       p.tension + (p.stiffness > 0 ? p.stiffness * motion(k, gradientOf(k, iterate), increment) : 0),
                   next = now + scale * (wanted - now);
      trial[Configuration::axial_force][paths_[std::size_t(k)].slot()] =
          (paths_[std::size_t(k)].tendon().actuator.compression ? next : std::max(next, 0.0)) - w.at_start;
    }
  }
  double mismatch(const Configuration &c, int rod) const override {
    double most = 0;
    for (const int k : by_rod_.of(rod))
      if (const Pull p = pull(k, c); p.stiffness > 0)
        most = std::max(most, std::abs(p.tension - tensionAt(k, p)) / (p.stiffness * sizes_[std::size_t(k)]));
    return most;
  }
  double energy(const Configuration &c, int rod) const override {
    double sum = 0;
    for (const int k : by_rod_.of(rod)) {
      sum += pull(k, c).value;
      if (capstans_[std::size_t(k)].rubs() && std::isfinite(sum)) sum += capstans_[std::size_t(k)].energy(c);
    }
    return sum;
  }
  double noise(const Configuration &c, int rod, double) const override {
    double sum = 0;
    for (const int k : by_rod_.of(rod)) {
      const Pull p = pull(k, c);
      const double blur = paths_[std::size_t(k)].blur(c);
      sum += (std::abs(p.tension) + (p.stiffness + steepest(k, c)) * blur) * blur;
    }
    return sum;
  }
  double forceNoise(const Configuration &c, int rod) const override {
    double sum = 0;
    for (const int k : by_rod_.of(rod)) sum += (pull(k, c).stiffness + steepest(k, c)) * paths_[std::size_t(k)].blur(c);
    return sum;
  }
  void addEnergies(const State &, const Configuration &c, double, int rod, EnergyBudget &out) const override {
    for (const int k : by_rod_.of(rod)) {
      const TendonPath &path = paths_[std::size_t(k)];
      out.constraint += storedBy(path.tendon().actuator, path.displacement(c), path.input(c));
    }
  }
  double renew(const Configuration &iterate, int rod) override {
    double most = 0;
    for (const int k : by_rod_.of(rod))
      if (capstans_[std::size_t(k)].rubs())
        most = std::max(most, capstans_[std::size_t(k)].renew(iterate, pull(k, iterate).tension));
    return most;
  }
  void commit(State &state, const Configuration &c, int rod) const override {
    for (const int k : by_rod_.of(rod))
      if (capstans_[std::size_t(k)].rubs())
        capstans_[std::size_t(k)].commit(c, state.tendon_memory.data() + scene_.firstMemory(k));
    for (const int k : by_rod_.of(rod))
      if (paths_[std::size_t(k)].tendon().actuator.rigid)
        state.tendon_memory[std::size_t(scene_.firstMemory(k + 1)) - 1] = work_[std::size_t(k)].tension;
  }
  void addDerivatives(const Configuration &, int, Derivatives &, HessianKind) const override {} // none is of one alone
  void addBetween(const Configuration &c, RodSet island, Derivatives &out, HessianKind kind) const override {
    for (int r = island.begin; r < island.end; ++r)
      for (const int k : by_rod_.of(r)) add(k, c, kind, out);
  }
  /// Points on bodies go on circles, which stiff tendons must not be the longer for.
  double addExcess(const Configuration &iterate, const Planes &increment, double scale, const Configuration &trial,
                   int rod, Planes &force) const override {
    double most = 0;
    for (const int k : by_rod_.of(rod)) {
      const Pull p = pull(k, iterate);
      if (p.stiffness == 0) continue;
      const TendonPath &path = paths_[std::size_t(k)];
      const Eigen::VectorXd by = gradientOf(k, iterate);
      const double excess = path.displacement(trial) - path.displacement(iterate) - scale * motion(k, by, increment);
      if (!std::isfinite(excess)) continue;
      forVariables(path, [&](Eigen::Index v, int a, int slot) { force[a][slot] += p.stiffness * excess * by[v]; });
      most = std::max(most, std::abs(excess) / sizes_[std::size_t(k)]);
    }
    return most;
  }
  /// Of its own slots the first has the input, whose derivative is that of a target; the others have told points.
  std::array<Vec3, 2> actionFrom(int slot, const Configuration &c, int rod) const override {
    std::array<Vec3, 2> action{Vec3::Zero(), Vec3::Zero()};
    for (const int k : by_rod_.of(rod)) {
      const TendonPath &path = paths_[std::size_t(k)];
      const double tension = pull(k, c).tension;
      const auto [along, factor] = tensionsOf(k, c, tension);
      for (const Tendon::Pull &joint : path.tendon().joints)
        if (elements_.pairOf(joint.joint).parent(0) == slot) {
          const std::array<Vec3, 2> by = path.byParent(joint, c, along ? &*along : nullptr);
          for (const std::size_t n : {0u, 1u}) action[n] += factor * by[n];
        }
      if (slot < path.slot() || slot >= path.slot() + path.tendon().slots()) continue;
      action[0] = slot == path.slot()
                      ? Vec3(-tension, 0, 0)
                      : Vec3(factor * path.byTold(c, along ? &*along : nullptr)[std::size_t(slot - path.slot() - 1)]);
    }
    return action;
  }

private:
  const Scene &scene_;
  const Elements &elements_;
  std::vector<Held> held_;
  std::vector<TendonPath> paths_;
  std::vector<Capstan> capstans_;
  std::vector<double> sizes_; ///< of the smallest thing that each pulls on [m]
  struct Work {
    TendonDamper damper;
    bool taut = false; ///< at the iterate: a spring both ways there, lest all that it holds is free where it is let out
    double stiffness = 0;             ///< of a rigid one, between two updates of its tension [N/m]
    double at_start = 0, tension = 0; ///< at the start of the step, and at the iterate [N]
  };
  std::vector<Work> work_;
  NumbersByRod by_rod_;
  std::vector<int> first_number_; ///< of pairs, per tendon
  int begin_ = 0, end_ = 0;       ///< of all of them

  Pull pull(int k, const Configuration &c) const {
    const TendonPath &path = paths_[std::size_t(k)];
    const double x = path.displacement(c);
    if (path.tendon().actuator.kind == Actuator::Kind::none) return {};
    if (!std::isfinite(x)) return {HUGE_VAL, 0, 0};
    const Work &w = work_[std::size_t(k)];
    const Actuator &a = path.tendon().actuator;
    if (!a.rigid) return pullOf(a, x, path.input(c), w.damper, w.taut);
    const double beyond = x - path.input(c), tension = w.tension + w.stiffness * beyond;
    if (tension <= 0 && !a.compression && !w.taut) return {};
    return {beyond * (w.tension + 0.5 * w.stiffness * beyond), tension, w.stiffness};
  }
  /// Where its displacement does not change it, the tension is what the actuator gives.
  double tensionAt(int k, const Pull &p) const { return p.stiffness > 0 ? work_[std::size_t(k)].tension : p.tension; }
  /// Those of its parts where it rubs, and what derivatives with these are multiplied by.
  std::pair<std::optional<TensionsAlong>, double> tensionsOf(int k, const Configuration &c, double tension) const {
    if (!capstans_[std::size_t(k)].rubs()) return {std::nullopt, tension};
    return {capstans_[std::size_t(k)].tensions(c, tension), 1};
  }
  /// So much stiffer than inertia and what else holds the things that it pulls on [N/m].
  double stiffnessAround(int k, const Step &step) const {
    constexpr double stiffer = 1e3;
    const double rate = step.isStatic() ? 0 : step.rule->mass / (step.dt * step.dt);
    double most = 0;
    for (const Carrier &c : paths_[std::size_t(k)].carriers()) {
      if (!c.isBody()) {
        const Rod &rod = scene_.rods[std::size_t(c.rod)];
        const double length = elements_.restLength()[c.slot[0]];
        most = std::max({most, rate * elements_.mass()[c.slot[0]], rod.material.axial_stiffness / length});
        continue;
      }
      const Held &held = held_[std::size_t(c.body())];
      const double size = elements_.bodySize(c.body());
      most = std::max({most, held.stiffness + rate * elements_.bodyMass(c.body()).mass, held.turning / (size * size)});
      for (const Joint &j : scene_.joints)
        if (j.driven && (j.child == c.body() || j.parent == c.body()))
          most = std::max(most, j.drive_stiffness / (j.held().slidesFreely() ? 1 : size * size));
    }
    const Rod &host = scene_.rods[std::size_t(paths_[std::size_t(k)].tendon().rod)];
    return stiffer * (most > 0 ? most : host.material.axial_stiffness / host.length());
  }
  double steepest(int k, const Configuration &c) const {
    return capstans_[std::size_t(k)].rubs() ? capstans_[std::size_t(k)].stiffness(c) : 0;
  }
  /// Calls visit(variable, component, slot).
  template <class Visit> static void forVariables(const TendonPath &path, Visit visit) {
    for (std::size_t c = 0; c < path.carriers().size(); ++c)
      for (int v = 0; v < path.carriers()[c].count(); ++v) {
        const auto [slot, a] = path.carriers()[c].place(v);
        visit(Eigen::Index(Carrier::variables * c) + v, a, slot);
      }
  }
  Eigen::VectorXd gradientOf(int k, const Configuration &c) const {
    return paths_[std::size_t(k)].derivatives(c, false).gradient;
  }
  /// Of the displacement, to first order. \param by its gradient
  double motion(int k, const Eigen::VectorXd &by, const Planes &increment) const {
    double sum = 0;
    forVariables(paths_[std::size_t(k)], [&](Eigen::Index v, int a, int slot) { sum += by[v] * increment[a][slot]; });
    return sum;
  }
  /// One that pulls on one thing alone has that with itself, without entries: its rod goes as rods do that are joined.
  template <class Visit> static void forPairs(const TendonPath &path, Visit visit) {
    if (path.carriers().size() == 1) visit(0, 0);
    for (std::size_t b = 0; b < path.carriers().size(); ++b)
      for (std::size_t a = 0; a < b; ++a) visit(a, b);
  }

  void add(int k, const Configuration &c, HessianKind kind, Derivatives &out) const {
    constexpr int width = Carrier::variables;
    const TendonPath &path = paths_[std::size_t(k)];
    const Pull p = pull(k, c);
    const double tension = tensionAt(k, p);
    if (p.tension == 0 && p.stiffness == 0 && !capstans_[std::size_t(k)].rubs()) return;
    const bool any = kind != HessianKind::none, bent = any && kind != HessianKind::gauss_newton;
    const auto [along, factor] = tensionsOf(k, c, tension);
    const TendonPath::Derivatives d = path.derivatives(c, bent);
    const TendonPath::Derivatives rubbing = along ? path.derivatives(c, bent, &*along) : TendonPath::Derivatives(),
                                  &work = along ? rubbing : d;
    Eigen::MatrixXd hessian;
    if (any) hessian = p.stiffness * d.gradient * d.gradient.transpose();
    if (bent) hessian += factor * work.hessian;
    if (any && along) capstans_[std::size_t(k)].addHessian(c, hessian);
    auto block = [&](std::size_t a, std::size_t b) -> Carrier::Hessian {
      if (!any) return Carrier::Hessian::Zero();
      return hessian.block<width, width>(width * Eigen::Index(a), width * Eigen::Index(b));
    };
    for (std::size_t a = 0; a < path.carriers().size(); ++a)
      addOwn(elements_, path.carriers()[a], factor * work.gradient.segment<width>(width * Eigen::Index(a)), block(a, a),
             kind, out);
    forVariables(
        path, [&](Eigen::Index v, int a, int slot) { out.gradient[a][slot] += (p.tension - tension) * d.gradient[v]; });
    int number = first_number_[std::size_t(k)];
    if (!any) return;
    forPairs(path, [&](std::size_t a, std::size_t b) {
      if (a == b) return;
      const bool swapped = path.carriers()[a].rod < path.carriers()[b].rod; // as pairOf
      const Carrier::Hessian h = swapped ? block(b, a) : block(a, b);
      double *const to = out.blocks.touching(number++);
      for (int i = 0; i < width; ++i)
        for (int j = 0; j < width; ++j) to[width * i + j] += h(i, j);
    });
  }
};

} // namespace

std::unique_ptr<Term> makeTendons(const Scene &scene, const Elements &elements) {
  return scene.tendons.empty() ? nullptr : std::make_unique<Tendons>(scene, elements);
}

} // namespace tendril
