#include "tendril/energy/capstan.hpp"

#include <algorithm>
#include <cmath>

namespace tendril {

/// docs/theory.md (10.9).
CapstanLaw::CapstanLaw(double u, double exponent, double slip) {
  const double most = u < 0 ? -std::expm1(-exponent) : std::expm1(exponent), v = std::abs(u) / slip;
  const bool slides = v >= 1;
  value = most * slip * (slides ? v - 1.0 / 3 : v * v * (1 - v / 3));
  slope = std::copysign(most * (slides ? 1 : v * (2 - v)), u);
  curvature = slides ? 0 : 2 * most * (1 - v) / slip;
}

Capstan::Capstan(const TendonPath &path)
    : path_(&path), rubs_(path.tendon().rubs()), taken_(rubs_.size()), stick_(rubs_.size()),
      slip_(path.tendon().slip_length) {}

void Capstan::begin(const double *stick, const Configuration &start, double tension) {
  stick_.assign(stick, stick + rubs_.size());
  start_ = path_->lengths(start);
  for (std::size_t k = 0; k < rubs_.size(); ++k)
    if (rubs_[k].winds) taken_[k].start = path_->endOf(rubs_[k].segment, start);
  rounds_.clear();
  Eigen::VectorXd incoming(Eigen::Index(rubs_.size()));
  for (std::size_t k = 0; k < rubs_.size(); ++k) {
    incoming[Eigen::Index(k)] = tension;
    tension *= CapstanLaw(stick_[k], rubs_[k].friction * path_->turningAt(rubs_[k], start), slip_).ratio();
  }
  take(start, incoming);
}

std::vector<double> Capstan::drawn(const Configuration &c) const {
  const std::vector<double> now = path_->lengths(c);
  std::vector<double> all(rubs_.size());
  double grown = 0;
  int next = int(now.size());
  for (std::size_t k = rubs_.size(); k-- > 0;) {
    const auto &[segment, winds, part, friction] = rubs_[k];
    for (; next > segment + 1; --next) grown += now[std::size_t(next) - 1] - start_[std::size_t(next) - 1];
    all[k] = stick_[k] + grown;
    if (!winds) continue;
    const Taken &t = taken_[k];
    all[k] += t.passed + t.end[1].dot(path_->endOf(segment, c)[0] - t.end[0]);
  }
  return all;
}

/// What winds has passed, along the path of its end, by the mean of the directions there.
void Capstan::take(const Configuration &c, const Eigen::VectorXd &incoming) {
  for (std::size_t k = 0; k < rubs_.size(); ++k) {
    Taken &t = taken_[k];
    t.exponent = rubs_[k].friction * path_->turningAt(rubs_[k], c);
    t.incoming = incoming[Eigen::Index(k)];
    if (!rubs_[k].winds) continue;
    t.end = path_->endOf(rubs_[k].segment, c);
    t.passed = 0.5 * (t.start[1] + t.end[1]).dot(t.end[0] - t.start[0]);
  }
}

double Capstan::energy(const Configuration &c) const {
  const std::vector<double> u = drawn(c);
  double sum = 0;
  for (std::size_t k = 0; k < u.size(); ++k) sum += taken_[k].incoming * law(k, u[k]).value;
  return sum;
}

std::vector<double> Capstan::frictions(const Configuration &c) const {
  std::vector<double> u = drawn(c);
  for (std::size_t k = 0; k < u.size(); ++k) u[k] = taken_[k].incoming * law(k, u[k]).slope;
  return u;
}

TensionsAlong Capstan::tensions(const Configuration &c, double tension) const {
  const Tendon &tendon = path_->tendon();
  TensionsAlong along{std::vector<double>(std::size_t(tendon.parts()), tension),
                      std::vector<Vec3>(tendon.segments.size(), Vec3::Zero())};
  const std::vector<double> friction = frictions(c);
  for (std::size_t k = 0; k < rubs_.size(); ++k) {
    for (auto part = std::size_t(rubs_[k].part); part < along.part.size(); ++part) along.part[part] += friction[k];
    if (rubs_[k].winds) along.arriving[std::size_t(rubs_[k].segment)] = taken_[k].end[1];
  }
  return along;
}

void Capstan::addHessian(const Configuration &c, Eigen::MatrixXd &hessian) const {
  const std::vector<double> u = drawn(c);
  TensionsAlong behind = tensions(c, 0);
  for (std::size_t k = 0; k < rubs_.size(); ++k) {
    const double stiffness = taken_[k].incoming * law(k, u[k]).curvature;
    if (stiffness == 0) continue;
    std::fill(behind.part.begin(), behind.part.end(), 0.0);
    std::fill(behind.part.begin() + rubs_[k].part, behind.part.end(), 1.0);
    const Eigen::VectorXd by = path_->derivatives(c, false, &behind).gradient;
    hessian += stiffness * by * by.transpose();
  }
}

/// Tensions that come of those taken fall as these grow, by more than these where much turns: of the rounds before the
/// combination that would leave least is taken (D. G. Anderson 1965, *Iterative procedures for nonlinear integral
/// equations*), which for one place is a secant.
double Capstan::renew(const Configuration &c, double tension) {
  constexpr std::size_t most = 5; // rounds that it remembers
  constexpr double sharper = 100; // than what touches is asked for, as rounds come to it fast
  const std::vector<double> before = frictions(c);
  const std::vector<Taken> old = taken_;
  const auto count = Eigen::Index(rubs_.size());
  Round now{Eigen::VectorXd(count), Eigen::VectorXd(count)};
  for (Eigen::Index k = 0; k < count; ++k) {
    now.taken[k] = taken_[std::size_t(k)].incoming;
    now.off[k] = std::max(tension, 0.0) - now.taken[k];
    tension += before[std::size_t(k)];
  }
  take(c, now.taken + now.off);
  const std::vector<double> after = frictions(c);
  double change = 0, size = 0, turning = 0;
  for (std::size_t k = 0; k < after.size(); ++k) {
    change += std::abs(after[k] - before[k]) + std::abs(after[k]) * (taken_[k].end[1] - old[k].end[1]).norm();
    turning += taken_[k].exponent;
    size += std::max(taken_[k].incoming * std::expm1(taken_[k].exponent), std::abs(before[k]));
  }
  if (const auto depth = Eigen::Index(rounds_.size()); depth > 0) {
    Eigen::MatrixXd by_off(count, depth), by_taken(count, depth);
    for (Eigen::Index m = 0; m < depth; ++m) {
      by_off.col(m) = now.off - rounds_[std::size_t(m)].off;
      by_taken.col(m) = now.taken - rounds_[std::size_t(m)].taken;
    }
    const Eigen::VectorXd part = by_off.completeOrthogonalDecomposition().solve(now.off);
    take(c, (now.taken + now.off - (by_taken + by_off) * part).cwiseMax(0));
  }
  if (rounds_.size() == most) rounds_.erase(rounds_.begin());
  rounds_.push_back(std::move(now));
  // What falls by little from round to round is far from where it goes; what is asked for is a thousandth.
  return size > 0 ? sharper * change / size * std::exp(turning) : 0;
}

void Capstan::commit(const Configuration &c, double *stick) const {
  const std::vector<double> u = drawn(c);
  for (std::size_t k = 0; k < u.size(); ++k) stick[k] = std::clamp(u[k], -slip_, slip_);
}

double Capstan::stiffness(const Configuration &c) const {
  const std::vector<double> u = drawn(c);
  double most = 0;
  for (std::size_t k = 0; k < u.size(); ++k) most = std::max(most, taken_[k].incoming * law(k, u[k]).curvature);
  return most;
}

TensionsAlong tensionsAlong(const TendonPath &path, const double *stick, const Configuration &c, double tension) {
  const Tendon &tendon = path.tendon();
  TensionsAlong along{std::vector<double>(std::size_t(tendon.parts()), tension)};
  for (const Tendon::Rub &rub : tendon.rubs()) {
    const CapstanLaw law(*stick++, rub.friction * path.turningAt(rub, c), tendon.slip_length);
    for (auto part = std::size_t(rub.part); part < along.part.size(); ++part) along.part[part] *= law.ratio();
  }
  return along;
}

TendonReading readTendon(const Scene &scene, const Elements &elements, int index, const State &state,
                         const Configuration &c, bool dynamic) {
  const TendonPath path(scene, elements, index);
  const Actuator &actuator = path.tendon().actuator;
  TendonReading out;
  out.length = path.length(c);
  out.displacement = path.displacement(c);
  if (dynamic) out.rate = path.rate(state, c);
  const std::vector<Tendon::Rub> rubs = path.tendon().rubs();
  const std::vector<double> none(rubs.size() + 1, 0.0);
  const double *memory =
      state.tendon_memory.empty() ? none.data() : state.tendon_memory.data() + scene.firstMemory(index);
  // The damper pulls by the rate: as one whose way over a second this is.
  out.tension = actuator.rigid ? memory[rubs.size()]
                               : pullOf(actuator, out.displacement, path.input(c),
                                        {dynamic ? 1.0 : 0.0, out.displacement - out.rate})
                                     .tension;
  const Tendon &tendon = path.tendon();
  if (!rubs.empty()) out.along = tensionsAlong(path, memory, c, out.tension);
  out.points = path.drawn(c);
  out.point_tension.assign(out.points.size(), out.tension);
  if (rubs.empty()) return out;
  out.point_tension.clear();
  for (int p = 0; p < int(tendon.points.size()); ++p) {
    const std::vector<Tendon::Segment> &all = tendon.segments;
    const auto from = std::find_if(all.begin(), all.end(), [&](const Tendon::Segment &s) { return s.from == p; }),
               to = std::find_if(all.begin(), all.end(), [&](const Tendon::Segment &s) { return s.to == p; });
    if (from == all.end()) {
      out.point_tension.push_back(out.along.part[std::size_t(tendon.firstPart(int(to - all.begin()) + 1)) - 1]);
      continue;
    }
    const double *const part = &out.along.part[std::size_t(tendon.firstPart(int(from - all.begin())))];
    out.point_tension.push_back(part[0]);
    for (int k = 0; from->wrap >= 0 && k < Tendon::drawn_points; ++k)
      out.point_tension.push_back(
          part[0] > 0 ? part[0] * std::pow(part[1] / part[0], double(k) / (Tendon::drawn_points - 1)) : 0);
  }
  return out;
}

} // namespace tendril
