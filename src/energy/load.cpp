/// Gravity, nodal forces, and couples on edges.
#include "tendril/energy/term.hpp"

namespace tendril {
namespace {

/// Dead forces have the potential -F.(x - x_start). A couple does the work M.t d(theta) + M.(t x dt) along the path of the iterates; it has
/// no potential over large rotations, so it is measured from the last iterate: all that a line search compares starts there.
class Load final : public Term {
public:
  Load(const Scene &scene, const Elements &elements) : scene_(scene), elements_(elements), couples_(scene.rods.size()) {
    force_.assign(elements.mass.size(), Vec3::Zero());
    for (const NodalForce &f : scene.forces) force_[elements.rods[f.rod].first_vertex + f.vertex] += f.force;
    for (const EdgeMoment &m : scene.moments) couples_[m.rod].push_back({m, Vec3::Zero(), 0.0});
  }

  void beginStep(const State &start, const Configuration &configuration, const Step &step) override {
    start_ = start.position;
    factor_ = step.load_factor;
    moveIterate(configuration);
  }

  void moveIterate(const Configuration &iterate) override {
    for (std::size_t r = 0; r < couples_.size(); ++r)
      for (Couple &m : couples_[r]) {
        const int i = elements_.rods[r].first_edge + m.edge;
        m.tangent = iterate.frame[i].tangent;
        m.spin = iterate.spin[i];
      }
  }

  void setLoadFactor(double factor) override { factor_ = factor; }

  double energy(const Configuration &c, int r) const override {
    const RodRange &rod = elements_.rods[r];
    double sum = 0;
    for (int v = rod.first_vertex; v < rod.first_vertex + rod.vertices; ++v) sum -= forceOn(r, v).dot(c.position[v] - start_[v]);
    for (const Couple &m : couples_[r]) {
      const int i = rod.first_edge + m.edge;
      const Vec3 &t = c.frame[i].tangent, axis = m.tangent.cross(t);
      const double sine = axis.norm(), turning = sine > 0 ? std::atan2(sine, m.tangent.dot(t)) / sine : 1;
      const Vec3 mean = (m.tangent + t).normalized();
      sum -= factor_ * ((m.torque + m.moment.dot(mean)) * (c.spin[i] - m.spin) + turning * m.moment.dot(axis));
    }
    return sum;
  }

  void addDerivatives(const Configuration &c, int r, Rows &rows, HessianKind) const override {
    const RodRange &rod = elements_.rods[r];
    for (int v = rod.first_vertex; v < rod.first_vertex + rod.vertices; ++v) {
      const Vec3 f = forceOn(r, v);
      for (int a = 0; a < 3; ++a) rows.gradient[elements_.vertex_row[v] + a] -= f[a];
    }
    for (const Couple &m : couples_[r]) {
      const int i = rod.first_edge + m.edge, row = elements_.edge_row[i];
      const Frame &f = c.frame[i];
      const Vec3 pair = factor_ * m.moment.cross(f.tangent) / f.length;
      rows.gradient[row + 3] -= factor_ * (m.torque + m.moment.dot(f.tangent));
      for (int a = 0; a < 3; ++a) {
        rows.gradient[row + a] += pair[a];
        rows.gradient[row + 4 + a] -= pair[a];
      }
      addCoupleHessian(factor_ * m.moment, f, row, rows);
    }
  }

private:
  struct Couple : EdgeMoment {
    Vec3 tangent; ///< at the iterate
    double spin;
  };
  const Scene &scene_;
  const Elements &elements_;
  std::vector<Vec3> force_, start_;
  std::vector<std::vector<Couple>> couples_;
  double factor_ = 1;

  Vec3 forceOn(int rod, int vertex) const {
    const Vec3 weight = scene_.rods[rod].gravity ? Vec3(elements_.mass[vertex] * scene_.gravity) : Vec3(Vec3::Zero());
    return factor_ * (force_[vertex] + weight);
  }

  /// Symmetric part of the derivative of the gradient of a couple over (e, theta): with g_e = -(M x t)/l and g_theta = -M.t,
  /// d g_e/d e = -[M]x (I - 2 t t')/l^2 ... symmetrised, d g_theta/d e = -(I - t t') M/l and d g_e/d theta = 0.
  static void addCoupleHessian(const Vec3 &moment, const Frame &f, int row, Rows &rows) {
    const Vec3 &t = f.tangent;
    const double inverse = 1 / f.length;
    const Vec3 cross = moment.cross(t), off = (moment - t * moment.dot(t)) * (-0.5 * inverse);
    const Mat3 h = (cross * t.transpose() + t * cross.transpose()) * (inverse * inverse);
    auto band = [&](int r, int c) -> double & { return rows.band[std::size_t(row + r) * DofMap::band + (c - r)]; };
    for (int a = 0; a < 3; ++a) {
      band(a, 3) -= off[a];
      band(3, 4 + a) += off[a];
      for (int b = 0; b < 3; ++b) {
        if (b >= a) {
          band(a, b) += h(a, b);
          band(4 + a, 4 + b) += h(a, b);
        }
        band(a, 4 + b) -= h(a, b);
      }
    }
  }
};

} // namespace

std::unique_ptr<Term> makeLoad(const Scene &scene, const Elements &elements) { return std::make_unique<Load>(scene, elements); }

} // namespace tendril
