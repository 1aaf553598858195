/// Gravity, centrifugal and nodal forces, follower forces, and couples on edges. Numbers in brackets are of
/// docs/theory.md.
#include "tendril/energy/load.hpp"

#include "tendril/energy/work.hpp"

#include <algorithm>
#include <map>

namespace tendril {
namespace {

/// Dead and centrifugal forces have the potentials (32.1). A couple does the work M.t d(theta) + M.(t x dt) along the
/// path of the iterates (28.2), a follower force F.dx (32.2); they have no potential over large rotations, so their
/// work is measured from the last iterate: all that a line search compares starts there. The derivative of follower
/// forces is `Circulatory`'s (33.3).
class Load final : public Term {
public:
  Load(const Scene &scene, const Elements &elements)
      : scene_(scene), elements_(elements), turns_(!scene.rotation.angular_velocity.isZero(0)),
        centre_(scene.rotation.centre), spin_(scene.rotation.matrix()), full_(3, elements.slots),
        couples_(scene.rods.size()), followers_(scene.rods.size()), ends_(scene.rods.size()) {
    for (std::size_t r = 0; r < scene.rods.size(); ++r)
      if (scene.rods[r].gravity)
        for (int s = elements.rods[r].first_slot; s < elements.rods[r].vertexEnd(); ++s)
          full_.setVector(0, s, elements.mass()[s] * scene.gravity);
    for (const NodalForce &f : scene.forces) {
      const int s = elements.rods[f.rod].slot(f.vertex);
      full_.setVector(0, s, full_.vector(0, s) + f.force);
    }
    for (const EdgeMoment &m : scene.moments)
      couples_[m.rod].push_back({m, elements.rods[m.rod].slot(m.edge), Vec3::Zero(), 0.0});
    for (const PlacedFollower &f : elements.followers({0, int(scene.rods.size())}))
      followers_[f.rod].push_back({f, Vec3::Zero(), Vec3::Zero()});
    for (std::size_t r = 0; r < scene.rods.size(); ++r)
      for (const EndCouple &end : elements.end_couples[r])
        if (end.stretches) ends_[r].push_back({end, {}});
    force_ = full_;
  }

  bool isLoad() const override { return true; }
  bool couplesPositions() const override { return turns_; }

  void beginStep(const State &, const Configuration &start, const Step &step, int rod) override {
    start_ = &start;
    setLoadFactor(step.load_factor);
    moveIterate(start, rod);
  }

  void moveIterate(const Configuration &iterate, int rod) override {
    for (Couple &m : couples_[rod]) {
      m.tangent = iterate.frameAt(m.slot).tangent;
      m.spin = iterate[Configuration::spin][m.slot];
    }
    for (Follower &f : followers_[rod]) {
      f.iterate = iterate.displacementAt(f.vertex, *start_);
      f.acting = f.along(iterate.frameAt(f.edge));
    }
    for (End &end : ends_[rod]) end.iterate = iterate.frameAt(end.edge);
  }

  void setLoadFactor(double factor) override {
    if (factor == factor_) return;
    factor_ = factor;
    for (std::size_t k = 0; k < full_.size(); ++k) force_.data()[k] = factor * full_.data()[k];
  }

  double energy(const Configuration &c, int r) const override {
    const RodRange &rod = elements_.rods[r];
    Pack work(0.0);
    for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes)
      work += readVector<Pack>(force_, 0, s).dot(c.displacements<Pack>(s, *start_));
    double sum = -reduce(work);
    if (turns_) {
      Pack centrifugal(0.0);
      for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes) {
        const Vector3<Pack> x = c.positions<Pack>(s), a = accelerationAt(x);
        centrifugal +=
            read<Pack>(elements_.mass() + s) *
            ((x[0] - Pack(centre_[0])) * a[0] + (x[1] - Pack(centre_[1])) * a[1] + (x[2] - Pack(centre_[2])) * a[2]);
      }
      sum -= 0.5 * factor_ * reduce(centrifugal);
    }
    for (const Couple &m : couples_[r])
      sum -= factor_ * coupleWork(m.moment, m.torque, m.tangent, c.frameAt(m.slot).tangent,
                                  c[Configuration::spin][m.slot] - m.spin);
    for (const Follower &f : followers_[r])
      sum -=
          0.5 * factor_ * (f.acting + f.along(c.frameAt(f.edge))).dot(c.displacementAt(f.vertex, *start_) - f.iterate);
    for (const End &end : ends_[r]) {
      const Frame f = c.frameAt(end.edge);
      sum += 0.5 * (pullOf(end, end.iterate).force + pullOf(end, f).force) * (f.length - end.iterate.length);
    }
    return sum;
  }

  /// Forces and couples do work, and store nothing.
  void addEnergies(const State &state, const Configuration &, double load_factor, int r,
                   EnergyBudget &out) const override {
    const RodRange &rod = elements_.rods[r];
    double gravity = 0;
    for (int i = 0; i < rod.vertices && scene_.rods[r].gravity; ++i)
      gravity -= elements_.mass()[rod.slot(i)] * scene_.gravity.dot(state.position[rod.first_vertex + i]);
    gravity *= load_factor;
    for (int i = 0; i < rod.vertices && turns_; ++i) {
      const Vec3 away = state.position[rod.first_vertex + i] - scene_.rotation.centre;
      gravity -= 0.5 * load_factor * elements_.mass()[rod.slot(i)] * away.dot(spin_ * away);
    }
    out.gravity += gravity;
  }

  void addDerivatives(const Configuration &c, int r, Derivatives &out, HessianKind hessian) const override {
    const RodRange &rod = elements_.rods[r];
    const BlockPlanes blocks(out.blocks, rod);
    for (int a = 0; a < 3; ++a)
      for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes)
        addTo<Pack>(out.equilibrium[a] + s, -read<Pack>(force_[a] + s));
    if (turns_)
      for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes) {
        const Pack weight = Pack(factor_) * read<Pack>(elements_.mass() + s);
        const Vector3<Pack> a = accelerationAt(c.positions<Pack>(s));
        for (int k = 0; k < 3; ++k) {
          addTo<Pack>(out.equilibrium[k] + s, -weight * a[k]);
          for (int l = k; l < 3 && hessian != HessianKind::none; ++l)
            addTo<Pack>(blocks.vertex(k, l) + s, -weight * Pack(spin_(k, l)));
        }
      }
    for (const Follower &f : followers_[r]) {
      const Vec3 force = factor_ * f.along(c.frameAt(f.edge));
      for (int a = 0; a < 3; ++a) out.equilibrium[a][f.vertex] -= force[a];
    }
    for (const Couple &m : couples_[r]) {
      const Frame f = c.frameAt(m.slot);
      const Vec3 pair = factor_ * m.moment.cross(f.tangent) / f.length;
      out.equilibrium[3][m.slot] -= factor_ * (m.torque + m.moment.dot(f.tangent));
      for (int a = 0; a < 3; ++a) {
        out.equilibrium[a][m.slot] += pair[a];
        out.equilibrium[a][m.slot + 1] -= pair[a];
      }
      if (hessian != HessianKind::none) addCoupleHessian(factor_ * m.moment, f, m.slot, blocks);
    }
    for (const End &end : ends_[r]) {
      const Frame f = c.frameAt(end.edge);
      const EndPull pull = pullOf(end, f);
      for (int a = 0; a < 3; ++a) {
        out.equilibrium[a][end.edge] -= pull.force * f.tangent[a];
        out.equilibrium[a][end.edge + 1] += pull.force * f.tangent[a];
        for (int b = a; b < 3 && hessian != HessianKind::none; ++b)
          blocks.own(a, b)[end.edge] += (pull.by_length - pull.force / f.length) * f.tangent[a] * f.tangent[b] +
                                        (a == b ? pull.force / f.length : 0);
      }
    }
  }

private:
  struct Couple : EdgeMoment {
    int slot;
    Vec3 tangent; ///< at the iterate
    double spin;
  };
  struct Follower : PlacedFollower {
    Vec3 iterate; ///< displacement of its vertex at the iterate, from the start
    Vec3 acting;  ///< there, at load factor 1 [N]
  };
  struct End : EndCouple {
    Frame iterate;
  };
  const Scene &scene_;
  const Elements &elements_;
  bool turns_;
  Vec3 centre_;
  Mat3 spin_;           ///< see Scene::Rotation::matrix
  Planes full_, force_; ///< forces on vertices [N] at load factor 1, and now
  std::vector<std::vector<Couple>> couples_;
  std::vector<std::vector<Follower>> followers_;
  std::vector<std::vector<End>> ends_; ///< end couples that pull
  const Configuration *start_ = nullptr;
  double factor_ = 1;

  EndPull pullOf(const End &end, const Frame &f) const { return endPull(elements_, f, end, factor_); }

  /// Centrifugal acceleration, by (32.1).
  Vector3<Pack> accelerationAt(const Vector3<Pack> &x) const {
    Vector3<Pack> a;
    for (int k = 0; k < 3; ++k)
      a[k] = Pack(spin_(k, 0)) * (x[0] - Pack(centre_[0])) + Pack(spin_(k, 1)) * (x[1] - Pack(centre_[1])) +
             Pack(spin_(k, 2)) * (x[2] - Pack(centre_[2]));
    return a;
  }

  /// Symmetric part of the derivative of the gradient (32.3) of a couple over (e, theta): (16.5) with c = -M and H = 0,
  /// as d g_theta/d e = -(I - t t') M/l and d g_e/d theta = 0. The rest is `Circulatory`'s (33.2).
  static void addCoupleHessian(const Vec3 &moment, const Frame &f, int slot, const BlockPlanes &blocks) {
    const Vec3 &t = f.tangent;
    const double inverse = 1 / f.length;
    const Vec3 cross = moment.cross(t), off = (moment - t * moment.dot(t)) * (-0.5 * inverse);
    const Mat3 h = (cross * t.transpose() + t * cross.transpose()) * (inverse * inverse);
    for (int a = 0; a < 3; ++a) {
      blocks.own(a, 3)[slot] += off[a];
      for (int b = a; b < 3; ++b) blocks.own(a, b)[slot] += h(a, b);
    }
  }
};

} // namespace

std::unique_ptr<Term> makeLoad(const Scene &scene, const Elements &elements) {
  return std::make_unique<Load>(scene, elements);
}

double loadScale(const Scene &scene, const Elements &elements, int r, double length) {
  const Rod &rod = scene.rods[r];
  double s = rod.gravity ? rod.material.linear_density * length * scene.gravity.norm() : 0;
  s += rod.material.linear_density * length * length * scene.rotation.angular_velocity.squaredNorm();
  auto held = [&](int vertex) {
    const auto own = elements.supportsOf(r);
    return std::any_of(own.begin(), own.end(),
                       [&](int k) { return scene.supports[k].vertex == vertex && scene.supports[k].holdsPosition(); });
  };
  std::map<int, Vec3> force; // per vertex: forces that cancel are none
  for (const int k : elements.forcesOf(r)) {
    const NodalForce &f = scene.forces[k];
    Vec3 &sum = force.try_emplace(f.vertex, Vec3::Zero()).first->second += f.force;
    if (rod.gravity) sum += f.mass * scene.gravity;
  }
  for (const auto &[vertex, f] : force)
    if (!held(vertex)) s += f.norm();
  for (const PlacedFollower &f : elements.followers({r, r + 1})) s += f.force.norm();
  for (const int k : elements.momentsOf(r))
    s += (std::abs(scene.moments[k].torque) + scene.moments[k].moment.norm()) / length;
  return s;
}

} // namespace tendril
