#pragma once
/// \file capstan.hpp
/// Friction of a tendon on what it runs over. Where its direction turns by an angle theta, the tensions T on both sides
/// of one that slides are apart by the factor exp(mu theta) (L. Euler 1769; Johnson, *Contact Mechanics*, 1985, 8.1 for
/// creep before it slides): docs/theory.md (10.8), and what a step makes of it.

#include "tendril/energy/tendon.hpp"

namespace tendril {

/// Over the tension that comes in: the potential of the friction at a place by which u has passed towards the end of
/// the path, and its derivatives. With a = exp(c) - 1 towards the end and 1 - exp(-c) back, v = |u|/slip:
/// a slip (v^2 - v^3/3) up to v = 1, a (|u| - slip/3) beyond, docs/theory.md (10.9): its derivative is within both a.
struct CapstanLaw {
  double value = 0, slope = 0, curvature = 0; ///< [m], [1], [1/m]
  CapstanLaw(double u, double exponent, double slip);
  double ratio() const { return 1 + slope; } ///< of the tension behind to that before
};

/// Friction of one tendon in a step. The tendon does not stretch behind its actuator: what passes a place is by how
/// much all behind it has grown. From an earlier iterate it takes the tensions that come in, the angles, and the
/// directions in which it leaves what it winds round, so that what is left has a potential, as contact does (Li et al.
/// 2020, 5).
class Capstan {
public:
  explicit Capstan(const TendonPath &path);
  bool rubs() const { return !rubs_.empty(); }
  /// \param stick of the state: by how much it is drawn at each place where it rubs [m] \param tension at the actuator
  void begin(const double *stick, const Configuration &start, double tension);
  /// [J]
  double energy(const Configuration &c) const;
  /// Of all parts, of a tension at the actuator [N].
  TensionsAlong tensions(const Configuration &c, double tension) const;
  /// Adds the second derivatives that slopes of friction have beyond the curvature of the path.
  void addHessian(const Configuration &c, Eigen::MatrixXd &hessian) const;
  /// Takes what it takes for constant anew. \param tension at the actuator, at the iterate \return by which part that
  /// changes friction
  double renew(const Configuration &c, double tension);
  /// What of the stick is left at the end of a step.
  void commit(const Configuration &c, double *stick) const;
  /// Steepest of its laws [N/m].
  double stiffness(const Configuration &c) const;

private:
  /// At a place where it rubs.
  struct Taken {
    double exponent = 0, incoming = 0; ///< friction coefficient times angle; tension before [N]
    /// What winds: its end and the direction there, at the iterate and at the start, in the axes of what it winds
    /// round; by how much it has passed between these [m].
    std::array<Vec3, 2> end{Vec3::Zero(), Vec3::Zero()}, start{Vec3::Zero(), Vec3::Zero()};
    double passed = 0;
  };
  const TendonPath *path_;
  std::vector<Tendon::Rub> rubs_;
  std::vector<Taken> taken_;
  std::vector<double> stick_, start_; ///< at the start: stick, lengths of segments [m]
  double slip_;
  /// Incoming tensions that were taken, and by how much those that came of them were larger [N].
  struct Round {
    Eigen::VectorXd taken, off;
  };
  std::vector<Round> rounds_; ///< of the step

  /// By how much it is drawn at each place [m].
  std::vector<double> drawn(const Configuration &c) const;
  CapstanLaw law(std::size_t k, double drawn) const { return {drawn, taken_[k].exponent, slip_}; }
  void take(const Configuration &c, const Eigen::VectorXd &incoming);
  std::vector<double> frictions(const Configuration &c) const;
};

/// Tensions of all parts at a state, by what it remembers.
TensionsAlong tensionsAlong(const TendonPath &path, const double *stick, const Configuration &c, double tension);

} // namespace tendril
