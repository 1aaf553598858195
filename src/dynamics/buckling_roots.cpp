/// Critical load factors between two points of a path of equilibria.
#include "tendril/dynamics/bifurcation.hpp"
#include "tendril/dynamics/buckling.hpp"
#include "tendril/solver/activity.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>

namespace tendril {
namespace {

constexpr double agreement = 1e-9; // of two estimates of a factor
constexpr double closest = 1e-4;   // of a factor: estimates agree from points as near
constexpr double beside = 3e-5;    // of a factor: where its modes are taken; nearer, Newton's answers are rough

/// The value at zero of the polynomial through points (w, factor) (Neville).
double atZero(std::vector<std::pair<double, double>> p, std::size_t count) {
  for (std::size_t order = 1; order < count; ++order)
    for (std::size_t i = 0; i + order < count; ++i)
      p[i].second =
          (p[i].first * p[i + 1].second - p[i + order].first * p[i].second) / (p[i].first - p[i + order].first);
  return p[0].second;
}

/// Whether a state lies no farther from both ends of a piece of a path than these are apart, but for rounding.
bool liesBetween(const Team &team, const State &low, const State &state, const State &high) {
  constexpr double rounding = 1e-7, room = 1.5;
  return std::max(distanceBetween(team, low, state), distanceBetween(team, state, high)) <=
         room * distanceBetween(team, low, high) + rounding;
}

/// Components of motions, twists and spins times a length.
Eigen::MatrixXd columnsOf(const std::vector<const Rates *> &shapes, double length) {
  std::vector<double> all;
  for (const Rates *shape : shapes) {
    for (const Vec3 &v : shape->vertex) all.insert(all.end(), v.begin(), v.end());
    for (const double t : shape->edge) all.push_back(length * t);
    for (const BodyRate &b : shape->body) {
      const Vec3 turn = length * b.spin;
      all.insert(all.end(), b.translation.begin(), b.translation.end());
      all.insert(all.end(), turn.begin(), turn.end());
    }
  }
  const Eigen::Index n = Eigen::Index(shapes.size());
  return Eigen::Map<const Eigen::MatrixXd>(all.data(), Eigen::Index(all.size()) / n, n);
}

Rates combined(const std::vector<const Rates *> &shapes, const Eigen::VectorXd &share) {
  Rates sum = *shapes[0];
  for (Vec3 &v : sum.vertex) v.setZero();
  for (double &t : sum.edge) t = 0;
  for (BodyRate &b : sum.body) b = {};
  for (std::size_t k = 0; k < shapes.size(); ++k) {
    const double x = share[Eigen::Index(k)];
    for (std::size_t v = 0; v < sum.vertex.size(); ++v) sum.vertex[v] += x * shapes[k]->vertex[v];
    for (std::size_t e = 0; e < sum.edge.size(); ++e) sum.edge[e] += x * shapes[k]->edge[e];
    for (std::size_t b = 0; b < sum.body.size(); ++b) sum.body[b].add(x, shapes[k]->body[b]);
  }
  return sum;
}

} // namespace

const BucklingPath::Point &BucklingPath::nearest(double factor) const {
  return *std::min_element(near_.begin(), near_.end(), [&](const Point &a, const Point &b) {
    return std::abs(a.factor - factor) < std::abs(b.factor - factor);
  });
}

/// Where the k-th stiffness is zero, by as many of the points where it is smallest as put it within the bracket.
double BucklingPath::estimate(int k, double low, double high) const {
  constexpr std::size_t most = 5;
  std::vector<std::pair<double, double>> points;
  for (const Point &p : near_)
    if (std::size_t(k) < p.stiffness.size()) points.emplace_back(p.stiffness[std::size_t(k)], p.factor);
  std::sort(points.begin(), points.end(),
            [](const auto &a, const auto &b) { return std::abs(a.first) < std::abs(b.first); });
  for (std::size_t count = std::min(most, points.size()); count > 1; --count)
    if (const double there = atZero(points, count); there > low && there < high) return there;
  return 0.5 * (low + high);
}

/// All roots between two points beside them, one for each count. The motions that are soft at both span nearly one
/// space, in which the Hessian is taken as linear in the load factor: diagonal by the motions of `a` there, and at `b`
/// by its own, which the overlap O relates to those of `a`. So modes are told apart however close their loads are.
/// \param apart how far they may be apart, over the size of the scene; farther, they are on two branches
PetscErrorCode BucklingPath::resolve(const Point &a, const Point &b, double apart, std::vector<Root> *roots) {
  constexpr double soft = 30; // times the stiffness of what changes its sign
  PetscFunctionBeginUser;
  roots->clear();
  std::array<Point, 2> at;
  std::array<Modes, 2> modes;
  PetscCall(reach(a, a.factor, &at[0], &modes[0]));
  PetscCall(reach(b, b.factor, &at[1], &modes[1]));
  const int first = std::min(at[0].unstable, at[1].unstable), last = std::max(at[0].unstable, at[1].unstable);
  if (!at[0].found || !at[1].found || first == last) PetscFunctionReturn(0);
  if (distanceBetween(solver_.team(), at[0].state, at[1].state) > apart) PetscFunctionReturn(0);
  const double sign = at[0].unstable < at[1].unstable ? 1 : -1, length = lengthOfAll();
  const int known = int(std::min(at[0].stiffness.size(), at[1].stiffness.size()));
  double largest = 0;
  for (int k = first; k < last; ++k)
    for (const Point &p : at) largest = std::max(largest, std::abs(p.stiffness[std::size_t(k)]));
  auto isSoft = [&](int k) {
    return std::all_of(at.begin(), at.end(),
                       [&](const Point &p) { return std::abs(p.stiffness[std::size_t(k)]) <= soft * largest; });
  };
  int begin = first, end = last;
  while (begin > 0 && isSoft(begin - 1)) --begin;
  while (end < known && isSoft(end)) ++end;
  for (const bool all :
       {true, false}) { // where softer and stiffer motions do not all go one way, those that change sign
    if (!all) begin = first, end = last;
    std::array<std::vector<const Rates *>, 2> shapes;
    std::array<Eigen::MatrixXd, 2> stiffness;
    for (const std::size_t side : {0, 1}) {
      const std::vector<std::size_t> numbers = numbersOf(modes[side]);
      Eigen::VectorXd w(end - begin);
      for (int k = begin; k < end; ++k) {
        shapes[side].push_back(&modes[side].shape[numbers[std::size_t(k)]]);
        w[k - begin] = sign * at[side].stiffness[std::size_t(k)];
      }
      stiffness[side] = w.asDiagonal();
    }
    const Eigen::MatrixXd
        span = columnsOf(shapes[0], length),
        inverse = (span.transpose() * span).ldlt().solve(span.transpose() * columnsOf(shapes[1], length)).inverse();
    const Eigen::MatrixXd loss = stiffness[0] - inverse.transpose() * stiffness[1] * inverse;
    if (Eigen::LLT<Eigen::MatrixXd>(loss).info() != Eigen::Success) continue;
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> pencil(stiffness[0], loss);
    for (Eigen::Index k = 0; k < end - begin; ++k) {
      const double part = pencil.eigenvalues()[k];
      if (part <= 0 || part > 1) continue;
      roots->push_back({a.factor + part * (b.factor - a.factor), false, at[0].state,
                        combined(shapes[0], pencil.eigenvectors().col(k))});
    }
    if (int(roots->size()) == last - first) break;
    roots->clear();
  }
  PetscFunctionReturn(0);
}

/// Whether the load cannot rise beyond a factor: the path comes there as the root of what is left of the load, while it
/// goes straight through a bifurcation.
PetscErrorCode BucklingPath::isLimit(const Point &low, double factor, bool *limit) {
  constexpr double between = 0.375; // along a root the second step is half of the first, straight on a quarter
  std::array<State, 3> at;
  PetscFunctionBeginUser;
  *limit = false;
  State from = low.state;
  for (std::size_t k = 0; k < at.size(); ++k) {
    NewtonReport report;
    bool found;
    const double there = factor - beside * std::pow(4.0, 2.0 - double(k)) * std::abs(factor);
    PetscCall(balance(from, there, &at[k], &report, &found));
    if (!found) PetscFunctionReturn(0);
    from = at[k];
  }
  const double first = distanceBetween(solver_.team(), at[0], at[1]),
               second = distanceBetween(solver_.team(), at[1], at[2]);
  *limit = first > 1e-9 && second > between * first;
  PetscFunctionReturn(0);
}

/// The limit point ahead, at which the k-th stiffness is zero.
PetscErrorCode BucklingPath::takeLimit(const Point &low, double factor, int k, std::vector<Root> *roots) {
  PetscFunctionBeginUser;
  Point below;
  Modes modes;
  PetscCall(reach(low, std::max(low.factor, factor - beside * std::abs(factor)), &below, &modes));
  if (below.found && below.unstable <= k && std::size_t(k) < below.stiffness.size())
    roots->push_back({factor, true, below.state, modes.shape[numbersOf(modes)[std::size_t(k)]]});
  PetscFunctionReturn(0);
}

/// The root of the k-th stiffness between a point and `high`, with those right beside it. \param ahead whether the path
/// goes on at `high`; else it ends before
PetscErrorCode BucklingPath::locate(int k, Point low, Point high, bool ahead, bool rising, std::vector<Root> *roots) {
  constexpr int most_rounds = 100;
  constexpr double part = 0.05, part_of_limit = 0.25;
  PetscFunctionBeginUser;
  const Doing here([](std::ostream &out) { out << "a critical load is searched for"; });
  roots->clear();
  double last = std::nan(""), width = high.factor - low.factor;
  const double whole = width, whole_apart = ahead ? distanceBetween(solver_.team(), low.state, high.state) : HUGE_VAL;
  for (int round = 0; round < most_rounds; ++round) {
    for (const Point &p : near_) // the tightest bracket
      if (p.factor > low.factor && p.factor < high.factor) {
        const bool beyond = (p.unstable > k) == rising;
        (beyond ? high : low) = p;
        ahead = ahead || beyond;
      }
    const double found = estimate(k, low.factor, high.factor), size = std::abs(found), before = found - low.factor,
                 behind = high.factor - found, now = high.factor - low.factor;
    const bool agrees = std::abs(found - last) <= agreement * size;
    last = found;
    if (ahead && now <= 2.2 * beside * size) {
      // The path may go like a root of the load there, no faster.
      PetscCall(resolve(low, high, 1e-7 + 3 * whole_apart * std::sqrt(now / whole), roots));
      PetscFunctionReturn(0);
    }
    if (!ahead && agrees && before <= 2 * closest * size) {
      PetscCall(takeLimit(low, found, k, roots));
      PetscFunctionReturn(0);
    }
    if (now <= 1e-3 * beside * size) break; // nothing leads there
    const double middle = 0.5 * (low.factor + high.factor);
    double factor = middle;
    const bool slow = round % 4 == 3 && now > 0.1 * std::exchange(width, now);
    if (ahead && !slow) { // to both sides in turn, beside it where it is known
      const double least = (agrees ? beside : closest) * size;
      factor = behind > before ? found + std::max(least, part * behind) : found - std::max(least, part * before);
    } else if (!slow)
      factor = found - std::max(std::min(closest * size, 0.5 * before), part_of_limit * before);
    if (!(factor > low.factor && factor < high.factor)) factor = middle;
    Point point;
    for (const double other : {factor, low.factor + 0.4 * now}) {
      const Point from = ahead ? nearest(other) : low;
      PetscCall(ahead ? reach(from, other, &point) : advance(from, other, &point));
      point.found = point.found && (!ahead || liesBetween(solver_.team(), low.state, point.state, high.state));
      if (point.found || !ahead) break;
    }
    if (point.found)
      near_.push_back(std::move(point));
    else {
      high = {};
      high.factor = factor;
      ahead = false;
      last = std::nan(""); // the next estimate is no other than this one
      std::erase_if(near_, [&](const Point &p) { return p.factor >= factor; });
    }
  }
  PetscFunctionReturn(0);
}

} // namespace tendril
