#include "tendril/io/samples.hpp"

#include <algorithm>
#include <map>
#include <numeric>

namespace tendril {
namespace {

constexpr int sample_count = 32;    ///< in the time of a run; also the fewest steps
constexpr double negligible = 0.05; ///< part of the tolerance that needs no order
constexpr double least_order = 0.7; ///< below, halving tells nothing of the error that is left
constexpr double reach = 1.5;       ///< how far beyond its runs a prediction is trusted
constexpr int most_growth = 4;      ///< of the coarsest runs from round to round: a first estimate may be far off
constexpr double most_steps = 1e7;
constexpr int most_coarse_steps = 4096; ///< or 4 times those of the scene: what does not converge there is given up
constexpr int most_coarse_factor = 64;  ///< of the first edges, or 4 times those of the scene

/// How fine a run is. Adapted steps have a number too, by which their tolerance goes as an error of the integrator's order goes with steps.
struct Resolution {
  std::vector<int> edges; ///< per rod
  int steps;
  auto operator<=>(const Resolution &) const = default;
};

/// Error of the finest of three runs, each with half the step or edge of the one before, by the ratio of their differences (Aitken).
struct Trend {
  double error = 0, order = 0; ///< not above the formal one
  double seen = 0;             ///< the order as seen
  bool trusted = true;
  double at(double refinement) const { return error * std::pow(refinement, -order); } ///< with steps or edges so many times those of the finest
};

Trend trendOf(double first, double second, int formal, double tolerance) {
  Trend t;
  t.order = formal;
  if (second > 0 && first > 0) t.seen = std::log2(first / second);
  if (second > negligible * tolerance) {
    t.trusted = t.seen >= least_order;
    t.order = std::clamp(t.seen, least_order, double(formal));
  }
  t.error = second / (std::pow(2, t.order) - 1);
  return t;
}

class Chooser {
public:
  Chooser(const Scene &scene, const std::vector<Drawing> &drawings, const LoopSettings &settings, const Accuracy &accuracy, Choice &choice)
      : scene_(scene), drawings_(drawings), settings_(settings), accuracy_(accuracy), choice_(choice), multiple_(edgeMultiples(scene, drawings)),
        first_(firstEdges(scene, drawings, multiple_)), order_(makeIntegrator(settings.integrator)->order()), adapts_(settings.adapt == Adaptation::error) {
    const double given = settings.output_interval, even = settings.t_end / sample_count;
    landing_ = given > 0 ? given / std::ceil(given / even) : even;
    const int stride = std::max(1, int(even / landing_ * (1 + 1e-9)));
    for (int k = 1; k <= sample_count; ++k)
      if (const double time = adapts_ ? k * stride * landing_ : k * even; time <= settings.t_end * (1 + 1e-12)) times_.push_back(time);
  }

  PetscErrorCode choose() {
    PetscFunctionBeginUser;
    Resolution base{first_, sample_count};
    for (;;) {
      std::vector<Trend> steps, edges;
      PetscCall(trends(base, &Chooser::withSteps, order_, &steps));
      if (!converges(steps)) {
        moreSteps(base, steps);
        continue;
      }
      PetscCall(trends(base, &Chooser::withEdges, 2, &edges));
      if (edges.empty()) {
        moreSteps(base, edges);
        continue;
      }
      sayTrends(base, steps, edges);
      if (!converges(edges)) {
        moreEdges(base, edges);
        continue;
      }
      const Resolution best = cheapest(base, steps, edges);
      if (within(base, best)) {
        take(base, best, steps, edges);
        PetscFunctionReturn(0);
      }
      base = towards(base, best);
      runs_.clear();
    }
  }

private:
  const Scene &scene_;
  const std::vector<Drawing> &drawings_;
  const LoopSettings &settings_;
  const Accuracy &accuracy_;
  Choice &choice_;
  std::vector<int> multiple_, first_;
  int order_;
  bool adapts_;
  double landing_;            ///< adapted steps end at its multiples [s]
  std::vector<double> times_; ///< of the samples [s]
  std::map<Resolution, Samples> runs_;
  std::string failure_; ///< of the last run that failed
  int probes_ = 0;
  double seconds_ = 0, work_ = 0; ///< of all probes [s; edges x steps]

  LoopSettings settingsAt(int steps) const {
    LoopSettings s = settings_;
    if (adapts_) {
      s.dt_rtol = std::pow(double(sample_count) / steps, order_) / sample_count;
      s.dt_atol = settings_.dt_atol / settings_.dt_rtol * s.dt_rtol;
      s.output_interval = landing_;
    } else {
      s.dt = s.t_end / steps;
      if (s.dt_min > s.dt) s.dt_min = 0;
    }
    return s;
  }
  std::string stepText(int steps) const {
    const LoopSettings s = settingsAt(steps);
    return adapts_ ? "dt_rtol " + shortText(s.dt_rtol) : "dt " + shortText(s.dt);
  }

  Resolution withSteps(const Resolution &base, int factor) const { return {base.edges, factor * base.steps}; }
  Resolution withEdges(const Resolution &base, int factor) const {
    Resolution r = base;
    for (int &n : r.edges) n *= factor;
    return r;
  }

  PetscErrorCode probe(const Resolution &resolution, const Samples **out) {
    PetscFunctionBeginUser;
    const auto [place, is_new] = runs_.try_emplace(resolution);
    if (is_new) {
      PetscCall(sample(redraw(scene_, drawings_, resolution.edges), settingsAt(resolution.steps), times_, &place->second));
      ++probes_;
      seconds_ += place->second.seconds;
      work_ += place->second.work();
      if (!place->second.failure.empty()) failure_ = "with " + stepText(resolution.steps) + ", " + place->second.failure;
    }
    *out = &place->second;
    PetscFunctionReturn(0);
  }

  /// Per rod, from runs refined once and twice; none where one fails.
  PetscErrorCode trends(const Resolution &base, Resolution (Chooser::*refined)(const Resolution &, int) const, int formal, std::vector<Trend> *out) {
    PetscFunctionBeginUser;
    const Samples *run[3];
    for (int k = 0; k < 3; ++k) {
      PetscCall(probe((this->*refined)(base, 1 << k), &run[k]));
      if (!run[k]->failure.empty()) PetscFunctionReturn(0);
    }
    const std::vector<double> first = distances(scene_, *run[0], *run[1], accuracy_.of), second = distances(scene_, *run[1], *run[2], accuracy_.of);
    for (std::size_t r = 0; r < first.size(); ++r) out->push_back(trendOf(first[r], second[r], formal, accuracy_.tolerance));
    PetscFunctionReturn(0);
  }

  static bool converges(const std::vector<Trend> &trends) {
    return !trends.empty() && std::all_of(trends.begin(), trends.end(), [](const Trend &t) { return t.trusted; });
  }
  static std::size_t worst(const std::vector<Trend> &trends) {
    return std::max_element(trends.begin(), trends.end(),
                            [](const Trend &a, const Trend &b) { return std::pair(!a.trusted, a.error) < std::pair(!b.trusted, b.error); }) -
           trends.begin();
  }
  static std::string text(const Trend &t) { return shortText(t.error) + " (order " + shortText(t.seen) + ")"; }

  [[noreturn]] void giveUp(const std::string &what) const {
    throw SceneError(askedFor(accuracy_) + ": " + what +
                     ". Motion that grows from the smallest difference, as of what buckles or folds by chance, has no answer to converge to: write a smaller "
                     "-t_end or a larger tolerance");
  }

  void moreSteps(Resolution &base, const std::vector<Trend> &steps) {
    const std::string why = steps.empty() ? failure_
                                          : "no convergence from " + stepText(base.steps) + " to " + stepText(4 * base.steps) + ", estimated error of the " +
                                                nameOf(accuracy_.of) + " " + text(steps[worst(steps)]);
    choice_.say("accuracy: " + why);
    base.steps *= 2;
    if (base.steps > std::max<double>(most_coarse_steps, 4 * settings_.t_end / settings_.dt)) giveUp(why);
  }

  void moreEdges(Resolution &base, const std::vector<Trend> &edges) {
    for (std::size_t r = 0; r < edges.size(); ++r) {
      if (edges[r].trusted) continue;
      base.edges[r] *= 2;
      if (base.edges[r] > std::max(most_coarse_factor * first_[r], 4 * scene_.rods[r].edges()) || 4 * base.edges[r] > most_edges)
        giveUp("no convergence from " + std::to_string(base.edges[r] / 2) + " to " + std::to_string(2 * base.edges[r]) + " edges of rod '" +
               scene_.rods[r].name + "', estimated error " + text(edges[r]));
    }
  }

  void sayTrends(const Resolution &base, const std::vector<Trend> &steps, const std::vector<Trend> &edges) {
    const std::size_t r = worst(edges);
    choice_.say("accuracy: " + std::to_string(base.edges[r]) + " to " + std::to_string(4 * base.edges[r]) + " edges of rod '" + scene_.rods[r].name + "', " +
                stepText(base.steps) + " to " + shortText(adapts_ ? settingsAt(4 * base.steps).dt_rtol : settingsAt(4 * base.steps).dt) +
                ": estimated error of the " + nameOf(accuracy_.of) + " " + text(edges[r]) + " by the edges, " + text(steps[worst(steps)]) + " by the steps");
  }

  /// The least edges x steps for which the two errors of each rod add up to the tolerance. For one rod with errors a/N^2 and b/n^p that is where
  /// a/N^2 : b/n^p = p : 2 (Lagrange's multiplier of the sum).
  Resolution cheapest(const Resolution &base, const std::vector<Trend> &steps, const std::vector<Trend> &edges) const {
    Resolution best{{}, 0};
    double least = std::numeric_limits<double>::infinity();
    for (double n = base.steps; n <= 4 * most_steps; n *= 1.01) {
      Resolution r{{}, int(std::ceil(n * (1 - 1e-12)))};
      for (std::size_t k = 0; k < edges.size(); ++k) {
        const double left = aim * accuracy_.tolerance - steps[k].at(n / (4.0 * base.steps));
        if (left <= 0) break;
        const double count = 4.0 * base.edges[k] * std::pow(edges[k].error / left, 1 / edges[k].order);
        r.edges.push_back(count > 1e8 ? int(1e8) : std::max(base.edges[k], roundedUp(count, multiple_[k])));
      }
      const double work = std::accumulate(r.edges.begin(), r.edges.end(), 0.0) * r.steps;
      if (r.edges.size() == edges.size() && work < least) {
        least = work;
        best = r;
      }
      if (work > 4 * least) break;
    }
    if (best.steps == 0 || best.steps > most_steps)
      throw SceneError(askedFor(accuracy_) + " needs more than " + shortText(most_steps) + " steps; write a larger tolerance" +
                       (order_ < 2 ? " or an -integrator of second order" : ""));
    return best;
  }

  static bool within(const Resolution &base, const Resolution &best) {
    bool all = best.steps <= reach * 4 * base.steps;
    for (std::size_t r = 0; r < best.edges.size(); ++r) all = all && best.edges[r] <= reach * 4 * base.edges[r];
    return all;
  }

  /// Coarsest runs for which the finest are about as fine as the best.
  Resolution towards(const Resolution &base, const Resolution &best) const {
    Resolution next = base;
    next.steps = std::clamp(roundedUp(best.steps / 4.0, sample_count), base.steps, most_growth * base.steps);
    for (std::size_t r = 0; r < best.edges.size(); ++r) {
      next.edges[r] = std::clamp(roundedUp(best.edges[r] / 4.0, multiple_[r]), base.edges[r], most_growth * base.edges[r]);
      if (4 * next.edges[r] > most_edges)
        throw SceneError(askedFor(accuracy_) + " needs about " + shortText(best.edges[r]) + " edges of rod '" + scene_.rods[r].name +
                         "', more than rounding allows; write a larger tolerance");
    }
    return next;
  }

  void take(const Resolution &base, const Resolution &best, const std::vector<Trend> &steps, const std::vector<Trend> &edges) {
    choice_.edges = best.edges;
    choice_.loop = settingsAt(best.steps);
    for (std::size_t r = 0; r < edges.size(); ++r) {
      choice_.step_error.push_back(steps[r].at(best.steps / (4.0 * base.steps)));
      choice_.error.push_back(choice_.step_error[r] + edges[r].at(best.edges[r] / (4.0 * base.edges[r])));
    }
    const double finest = double(runs_.at(withSteps(base, 4)).steps);
    const double run = std::accumulate(best.edges.begin(), best.edges.end(), 0.0) * finest * best.steps / (4.0 * base.steps);
    choice_.sayEdges(scene_, accuracy_);
    choice_.say("accuracy: " +
                (adapts_ ? "dt_rtol " + shortText(choice_.loop.dt_rtol) + ", dt_atol " + shortText(choice_.loop.dt_atol)
                         : "dt " + shortText(choice_.loop.dt) + " (" + std::to_string(best.steps) + " steps)") +
                "; " + std::to_string(probes_) + " runs to find out took " + shortText(seconds_) + " s, " + shortText(work_ / run) +
                " times the edges x steps of the run");
  }
};

} // namespace

PetscErrorCode chooseEdgesAndSteps(const Scene &scene, const std::vector<Drawing> &drawings, const LoopSettings &settings, const Accuracy &accuracy,
                                   Choice *choice) {
  PetscFunctionBeginUser;
  PetscCall(Chooser(scene, drawings, settings, accuracy, *choice).choose());
  PetscFunctionReturn(0);
}

} // namespace tendril
