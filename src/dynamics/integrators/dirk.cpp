/// Diagonally implicit Runge-Kutta methods, docs/theory.md (15.3), (15.5). With the table A, b and c = A 1, stage k at
/// t_n + c_k h has
///   v_k = (d_k - h sum_j<k a_kj v_j)/(a_kk h),   a_k = (v_k - v_n - h sum_j<k a_kj a_j)/(a_kk h)
/// and the step moves by h sum b_k v_k (15.6): to its last stage where the last row of A is b ("stiffly accurate"),
/// else beyond.
#include "tendril/dynamics/integrator.hpp"

#include <Eigen/LU>

namespace tendril {
namespace {

class Dirk final : public Integrator {
public:
  /// \param b the last row of `a` when empty
  Dirk(int order, const Eigen::MatrixXd &a, const Eigen::VectorXd &b = {})
      : order_(order), stages_(int(a.rows())), stiffly_accurate_(b.size() == 0), a_(a),
        b_(stiffly_accurate_ ? Eigen::VectorXd(a.row(stages_ - 1)) : b), c_(a.rowwise().sum()), inverse_(a.inverse()) {
    if (stiffly_accurate_) c_[stages_ - 1] = 1; // the end of the step to the last bit
    // What h^k x^(k + 1) has in the velocities of the start and of the stages; the error of the stages themselves is
    // allowed for.
    Eigen::MatrixXd parts = Eigen::MatrixXd::Zero(order_ + 1, stages_ + 1);
    parts.row(0).setOnes();
    Eigen::VectorXd power = Eigen::VectorXd::Ones(stages_);
    for (int k = 1; k <= order_; ++k) {
      power = a_ * power;
      parts.row(k).tail(stages_) = power.transpose();
    }
    double factorial = 1;
    for (int k = 2; k <= order_ + 1; ++k) factorial *= k;
    error_constant_ = b_.dot(power) - 1 / factorial;
    if (stages_ >= order_)
      error_weights_ = parts.inverse() * (error_constant_ * Eigen::VectorXd::Unit(order_ + 1, order_));
  }

  int order() const override { return order_; }
  int stages(const State &) const override { return stages_; }
  bool endsAtStage() const override { return stiffly_accurate_; }
  std::vector<double> forceWeights(const State &, double, std::size_t) const override { return {b_.begin(), b_.end()}; }

  /// Guesses of third order need the acceleration of the start.
  PetscErrorCode begin(StepSolver &solver, double h, State &state) const override {
    PetscFunctionBeginUser;
    if (order_ > 2) state.memory = {startAcceleration(solver, h, state)};
    PetscFunctionReturn(0);
  }

  StageRule stage(const State &start, double h, const Stages &done) const override {
    const int k = int(done.size());
    const double g = a_(k, k);
    StageRule rule;
    rule.fraction = c_[k];
    rule.dt = rule.damping_dt = g * h;
    rule.acceleration.add(-1, start);
    for (int j = 0; j < k; ++j) {
      rule.velocity.add(-a_(k, j) / g, done[j].velocity);
      rule.acceleration.add(-a_(k, j) * h, done[j].acceleration);
      if (!done[j].strains.empty()) rule.damping_past.push_back({g * inverse_(k, j), done[j].strains.data()});
    }
    rule.tangent_rates = order_ > 2 || !stiffly_accurate_;
    rule.guess.add(c_[k] * h, start);
    if (k > 0 || order_ > 2)
      rule.guess.add(a_.row(k).dot(c_) * h * h, k > 0 ? done.back().acceleration : start.memory.back());
    if (order_ > 2 && stiffly_accurate_ && k == stages_ - 1)
      rule.halfway.add(0.5 * h, start).add(0.125 * h * h, done.back().acceleration);
    return rule;
  }

  StageRule end(const State &start, double h, const Stages &done) const override {
    StageRule end;
    for (int k = 0; k < stages_; ++k) end.guess.add(h * b_[k], done[k].velocity);
    if (order_ < 3) return end;
    end.halfway.add(0.25 * h, start); // the parabola with the velocity of the start
    for (int k = 0; k < stages_; ++k) end.halfway.add(0.25 * h * b_[k], done[k].velocity);
    return end;
  }

  /// (b A^p 1 - 1/(p + 1)!) h^(p + 1) x^(p + 1) (15.14), as of a linear motion, by the velocities of the start and the
  /// stages; where those are too few, by the accelerations of the stages and of the last stage of the step before.
  Combination error(const State &start, double h, const Stages &done) const override {
    Combination error;
    if (stages_ >= order_) {
      error.add(h * error_weights_[0], start);
      for (int k = 0; k < stages_; ++k) error.add(h * error_weights_[k + 1], done[k].velocity);
      return error;
    }
    const double before = start.last_dt / h, late = c_[1], offset = a_.row(1).dot(c_);
    Eigen::Matrix3d parts;
    parts << 1, 1, 1, (late - 1) * before, c_[0], c_[1], (0.5 - late + offset) * before * before, a_.row(0).dot(c_),
        offset;
    const Eigen::Vector3d weights = parts.inverse() * Eigen::Vector3d(0, 0, error_constant_ * h * h);
    error.add(weights[0], start.memory.back());
    for (int k = 0; k < stages_; ++k) error.add(weights[k + 1], done[k].acceleration);
    return error;
  }

  Combination velocity(const State &start, double h, const Stages &done) const override {
    if (stiffly_accurate_) return Integrator::velocity(start, h, done);
    Combination sum;
    sum.add(1, start);
    for (int k = 0; k < stages_; ++k) sum.add(h * b_[k], done[k].acceleration);
    return sum;
  }
  std::vector<Combination> remembers(const State &, double, const Stages &done) const override {
    if (order_ > 2) return {Combination().add(1, done.back().acceleration)};
    return {};
  }

private:
  int order_, stages_;
  bool stiffly_accurate_;
  Eigen::MatrixXd a_;
  Eigen::VectorXd b_, c_;
  Eigen::MatrixXd inverse_;
  double error_constant_;
  Eigen::VectorXd error_weights_; ///< of the velocities of the start and of the stages
};

} // namespace

/// Alexander 1977, two stages: L-stable.
std::unique_ptr<Integrator> makeSdirk2(const IntegratorSettings &) {
  const double g = 1 - std::numbers::sqrt2 / 2;
  return std::make_unique<Dirk>(2, Eigen::MatrixXd{{g, 0}, {1 - g, g}});
}

/// Norsett 1974, Crouzeix 1975: A-stable, |R| at infinite frequency is sqrt 3 - 1.
std::unique_ptr<Integrator> makeSdirk23(const IntegratorSettings &) {
  const double g = 0.5 + std::numbers::sqrt3 / 6;
  return std::make_unique<Dirk>(3, Eigen::MatrixXd{{g, 0}, {1 - 2 * g, g}}, Eigen::VectorXd{{0.5, 0.5}});
}

/// Alexander 1977, three stages: L-stable; g is the root of g^3 - 3 g^2 + 3 g/2 - 1/6 between 1/6 and 1/2.
std::unique_ptr<Integrator> makeSdirk33(const IntegratorSettings &) {
  const double g = 0.43586652150845899942;
  return std::make_unique<Dirk>(
      3, Eigen::MatrixXd{
             {g, 0, 0}, {0.5 * (1 - g), g, 0}, {-0.25 * (6 * g * g - 16 * g + 1), 0.25 * (6 * g * g - 20 * g + 5), g}});
}

/// Symplectic methods of this kind are compositions of midpoint rules over b_k h (Sanz-Serna and Abia 1991). Of two
/// stages, none is of third order; the least error of second order has equal steps.
std::unique_ptr<Integrator> makeSymplectic2(const IntegratorSettings &) {
  return std::make_unique<Dirk>(2, Eigen::MatrixXd{{0.25, 0}, {0.5, 0.25}}, Eigen::VectorXd{{0.5, 0.5}});
}

} // namespace tendril
