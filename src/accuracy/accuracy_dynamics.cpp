#include "tendril/accuracy/samples.hpp"
#include "tendril/accuracy/trend.hpp"
#include "tendril/solver/activity.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>

namespace tendril {
namespace {

constexpr int sample_count = 32;         ///< in the time of a run; also the fewest steps
constexpr double reach = 1.5;            ///< how far beyond its runs a prediction is trusted
constexpr double start_tolerance = 1e-2; ///< -dt_rtol of the run that tells whether steps are short enough at the start
constexpr int most_growth = 4;           ///< of the coarsest runs from round to round: a first estimate may be far off
constexpr double most_steps = 1e7;
constexpr int most_coarse_steps = 4096; ///< or 4 times those of the scene
constexpr int most_coarse_factor = 64;  ///< of the first edges, or 4 times those of the scene
constexpr int more_tries = 8;           ///< where a prediction led to finer runs, so many times theirs

/// How fine a run is. Adapted steps have a number too, by which their tolerance goes as an error of the integrator's
/// order goes with steps.
struct Resolution {
  std::vector<int> edges; ///< per rod
  int steps;
  bool operator<(const Resolution &other) const { return std::tie(edges, steps) < std::tie(other.edges, other.steps); }
};

class Chooser {
public:
  Chooser(const Scene &scene, const std::vector<Drawing> &drawings, const LoopSettings &settings,
          const Accuracy &accuracy, Choice &choice)
      : scene_(scene), drawings_(drawings), settings_(settings), accuracy_(accuracy), choice_(choice),
        multiple_(edgeMultiples(scene, drawings)), first_(firstEdges(scene, drawings, multiple_)),
        order_(makeIntegrator(settings.integrator)->order()), adapts_(settings.adapt == Adaptation::error) {
    const double given = settings.output_interval, even = settings.t_end / sample_count;
    landing_ = given > 0 ? given / std::ceil(given / even) : even;
    const int stride = std::max(1, int(even / landing_ * (1 + 1e-9)));
    const double interval = adapts_ ? stride * landing_ : even;
    for (int k = 1; k * interval <= settings.t_end * (1 + 1e-12); ++k) times_.push_back(k * interval);
    if (const double frames = settings.t_end / std::max(given, 1e-300);
        std::abs(frames - std::round(frames)) < 1e-9 * frames && frames <= most_steps)
      frames_ = std::max(1, int(std::round(frames)));
    most_.steps = int(std::clamp(4 * settings.t_end / settings.dt, double(most_coarse_steps), most_steps));
    for (std::size_t r = 0; r < scene.rods.size(); ++r)
      most_.edges.push_back(std::max(most_coarse_factor * first_[r], 4 * scene.rods[r].edges()));
  }

  PetscErrorCode choose() {
    PetscFunctionBeginUser;
    Resolution base{first_, sample_count};
    for (;;) {
      Found found;
      PetscCall(trends(base, &Chooser::withSteps, order_, seen_steps_, &found.steps));
      if (!converges(found.steps)) {
        moreSteps(base, found.steps.empty() ? failure_
                                            : "no convergence" + between(base) + text(found.steps[worst(found.steps)]));
        continue;
      }
      if (bool resolved; !start_resolved_) {
        PetscCall(resolvesStart(base, &resolved));
        if (!resolved) {
          moreSteps(base, "steps" + between(base) + text(found.steps[worst(found.steps)]) +
                              ", but they miss motion in the first " + shortText(times_[0]) + " s");
          continue;
        }
        start_resolved_ = true;
      }
      PetscCall(trends(base, &Chooser::withEdges, 2, seen_edges_, &found.edges));
      if (found.edges.empty()) {
        moreSteps(base, failure_);
        continue;
      }
      say(base, found);
      if (!converges(found.edges)) {
        moreEdges(base, found.edges);
        continue;
      }
      for (std::size_t r = 0; r < found.edges.size(); ++r)
        found.correlation.push_back(correlation(found.edges[r].errors, found.steps[r].errors));
      const Resolution best = cheapest(base, found);
      if (within(base, best)) {
        take(base, best, found);
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
  int frames_ = 1;            ///< where steps are short against the time between frames, they divide it
  Resolution most_;           ///< of coarsest runs: what does not converge there is given up
  std::map<Resolution, RunSamples> runs_;
  std::vector<double> seen_steps_, seen_edges_; ///< orders seen last, per rod
  std::string failure_;                         ///< of the last run that failed
  bool start_resolved_ = false;
  RunSamples start_; ///< at the first of the times, by adapted steps
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
      s.output_interval = 0; // samples are taken between steps
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

  void count(const RunSamples &run) {
    ++probes_;
    seconds_ += run.seconds;
    work_ += run.work();
  }

  PetscErrorCode probe(const Resolution &resolution, const RunSamples **out) {
    PetscFunctionBeginUser;
    const auto [place, is_new] = runs_.try_emplace(resolution);
    if (is_new) {
      LoopSettings s = settingsAt(resolution.steps);
      const Doing here([&](std::ostream &out) {
        out << "accuracy, run " << probes_ + 1 << " with " << resolution.edges[0] << " edges of rod '"
            << scene_.rods[0].name << "' and " << stepText(resolution.steps);
      });
      if (!adapts_ && s.dt_min == 0) s.dt_min = s.dt / 16; // where shorter ones are needed, all should be
      PetscCall(sample(remesh(scene_, drawings_, resolution.edges), s, times_, &place->second));
      count(place->second);
      if (!place->second.failure.empty())
        failure_ = "with " + stepText(resolution.steps) + ", " + place->second.failure;
    }
    *out = &place->second;
    PetscFunctionReturn(0);
  }

  /// Per rod, from runs refined once and twice; none where one fails. \param before orders seen last, replaced by those
  /// seen now
  PetscErrorCode trends(const Resolution &base, Resolution (Chooser::*refined)(const Resolution &, int) const,
                        int formal, std::vector<double> &before, std::vector<Trend> *out) {
    PetscFunctionBeginUser;
    const RunSamples *run[3];
    for (int k = 0; k < 3; ++k) {
      PetscCall(probe((this->*refined)(base, 1 << k), &run[k]));
      if (!run[k]->failure.empty()) PetscFunctionReturn(0);
    }
    const std::vector<Errors> first = difference(scene_, *run[0], *run[1], base.edges, accuracy_.of);
    std::vector<Errors> second = difference(scene_, *run[1], *run[2], base.edges, accuracy_.of);
    for (std::size_t r = 0; r < first.size(); ++r)
      out->push_back(trendOf(first[r], std::move(second[r]), formal, accuracy_.tolerance,
                             r < before.size() ? std::optional(before[r]) : std::nullopt));
    before.clear();
    for (const Trend &t : *out) before.push_back(t.seen);
    PetscFunctionReturn(0);
  }

  static bool converges(const std::vector<Trend> &trends) {
    return !trends.empty() && std::all_of(trends.begin(), trends.end(), [](const Trend &t) { return t.trusted; });
  }
  static std::size_t worst(const std::vector<Trend> &trends) {
    return std::max_element(trends.begin(), trends.end(),
                            [](const Trend &a, const Trend &b) {
                              return std::pair(!a.trusted, a.finest()) < std::pair(!b.trusted, b.finest());
                            }) -
           trends.begin();
  }
  static std::string text(const Trend &t) { return shortText(t.finest()) + " (order " + shortText(t.seen) + ")"; }

  [[noreturn]] void giveUp(const std::string &what) const {
    throw SceneError(askedFor(accuracy_) + ": " + what +
                     ". Motion that the smallest difference changes, as of what buckles or folds by chance, has no "
                     "answer to converge to; vibrations through very many "
                     "periods need more steps than were tried. Write a smaller -t_end or a larger tolerance");
  }

  std::string between(const Resolution &base) const {
    return " from " + stepText(base.steps) + " to " + stepText(4 * base.steps) + ", estimated error of the " +
           nameOf(accuracy_.of) + " ";
  }

  void moreSteps(Resolution &base, const std::string &why) {
    choice_.say("accuracy: " + why);
    base.steps *= 2;
    if (base.steps > most_.steps) giveUp(why);
  }

  /// Whether the series of steps is right in the first of the times, by adapted steps that begin with short ones: where
  /// steps are much longer than the motion, methods that damp agree at all lengths on a rod at rest.
  PetscErrorCode resolvesStart(const Resolution &base, bool *resolved) {
    PetscFunctionBeginUser;
    if (start_.edges.empty()) {
      LoopSettings s = settings_;
      s.integrator.name = "bdf2";
      s.adapt = Adaptation::error;
      s.dt_rtol = start_tolerance;
      s.dt_atol = start_tolerance * accuracy_.tolerance;
      s.t_end = times_[0];
      s.dt = 1e-3 * s.t_end;
      s.dt_min = 1e-5 * s.t_end;
      s.dt_max = s.output_interval = 0;
      PetscCall(sample(remesh(scene_, drawings_, base.edges), s, {times_[0]}, &start_));
      count(start_);
    }
    *resolved = true;
    if (!start_.failure.empty()) PetscFunctionReturn(0);
    const RunSamples *run[3];
    for (int k = 0; k < 3; ++k) PetscCall(probe(withSteps(base, 1 << k), &run[k]));
    auto apart = [&](const RunSamples &a, const RunSamples &b) {
      return difference(scene_, a.first(), b.first(), base.edges, Quantity::position);
    };
    const std::vector<Errors> once = apart(*run[0], *run[1]), twice = apart(*run[1], *run[2]),
                              all = apart(*run[2], start_);
    for (std::size_t r = 0; r < all.size(); ++r)
      *resolved = *resolved && sizeOf(all[r]) <= 2 * (sizeOf(once[r]) + sizeOf(twice[r])) + accuracy_.tolerance;
    PetscFunctionReturn(0);
  }

  void moreEdges(Resolution &base, const std::vector<Trend> &edges) {
    for (std::size_t r = 0; r < edges.size(); ++r) {
      if (edges[r].trusted) continue;
      base.edges[r] *= 2;
      if (base.edges[r] > most_.edges[r] || 4 * base.edges[r] > most_edges)
        giveUp("no convergence from " + std::to_string(base.edges[r] / 2) + " to " + std::to_string(2 * base.edges[r]) +
               " edges of rod '" + scene_.rods[r].name + "', estimated error " + text(edges[r]));
    }
  }

  void say(const Resolution &base, const Found &found) {
    const std::size_t r = worst(found.edges);
    const std::string finest = shortText(adapts_ ? settingsAt(4 * base.steps).dt_rtol : settingsAt(4 * base.steps).dt);
    choice_.say("accuracy: " + std::to_string(base.edges[r]) + " to " + std::to_string(4 * base.edges[r]) +
                " edges of rod '" + scene_.rods[r].name + "', " + stepText(base.steps) + " to " + finest +
                ": estimated error of the " + nameOf(accuracy_.of) + " " + text(found.edges[r]) + " by the edges, " +
                text(found.steps[worst(found.steps)]) + " by the steps");
  }

  /// The least edges x steps for which the two errors of each rod together come to the tolerance. For one rod with
  /// errors a/N^2 and b/n^p that add up that is where a/N^2 : b/n^p = p : 2 (Lagrange's multiplier), their squares
  /// where the two have nothing to do with each other.
  Resolution cheapest(const Resolution &base, const Found &found) const {
    Resolution best{{}, 0};
    double least = std::numeric_limits<double>::infinity();
    for (double n = std::max(sample_count, base.steps / 2); n <= 4 * most_steps; n *= 1.01) {
      Resolution r{{}, roundedUp(n, n < 4.0 * frames_ || adapts_ ? 1 : frames_)};
      for (std::size_t k = 0; k < found.edges.size(); ++k) {
        const Trend &edges = found.edges[k];
        const double room = roomBeside(found.steps[k].at(r.steps / (4.0 * base.steps)), found.correlation[k],
                                       aim * accuracy_.tolerance);
        if (room <= 0) break;
        const double count = std::min(4.0 * base.edges[k] * edges.reaching(room), 1e8);
        r.edges.push_back(std::max(first_[k], roundedUp(std::max(count, 0.5 * base.edges[k]), multiple_[k])));
      }
      if (r.edges.size() < found.edges.size()) continue;
      const double work = total(r.edges) * r.steps;
      if (work < least) best = r;
      least = std::min(least, work);
      if (work > 4 * least) break;
    }
    if (best.steps == 0 || best.steps > most_steps)
      throw SceneError(askedFor(accuracy_) + " needs more than " + shortText(most_steps) +
                       " steps; write a larger tolerance" + (order_ < 2 ? " or an -integrator of second order" : ""));
    return best;
  }

  double total(const std::vector<int> &edges) const {
    double sum = 0;
    for (std::size_t r = 0; r < edges.size(); ++r) sum += double(choice_.countOf(r)) * edges[r];
    return sum;
  }

  static bool within(const Resolution &base, const Resolution &best) {
    bool all = best.steps <= reach * 4 * base.steps;
    for (std::size_t r = 0; r < best.edges.size(); ++r) all = all && best.edges[r] <= reach * 4 * base.edges[r];
    return all;
  }

  /// Coarsest runs for which the finest are about as fine as the best.
  Resolution towards(const Resolution &base, const Resolution &best) {
    Resolution next = base;
    next.steps = std::clamp(roundedUp(best.steps / 4.0, sample_count), base.steps, most_growth * base.steps);
    most_.steps = std::max(most_.steps, more_tries * next.steps);
    for (std::size_t r = 0; r < best.edges.size(); ++r) {
      next.edges[r] =
          std::clamp(roundedUp(best.edges[r] / 4.0, multiple_[r]), base.edges[r], most_growth * base.edges[r]);
      most_.edges[r] = std::max(most_.edges[r], more_tries * next.edges[r]);
      if (4 * next.edges[r] > most_edges)
        throw SceneError(askedFor(accuracy_) + " needs about " + shortText(best.edges[r]) + " edges of rod '" +
                         scene_.rods[r].name + "', more than rounding allows; write a larger tolerance");
    }
    return next;
  }

  void take(const Resolution &base, const Resolution &best, const Found &found) {
    choice_.edges = best.edges;
    choice_.loop = settingsAt(best.steps);
    const double finer = best.steps / (4.0 * base.steps);
    double rounding_error = 0;
    for (const auto &[resolution, run] : runs_) rounding_error = std::max(rounding_error, run.rounding_error);
    if (rounding_error > accuracy_.tolerance)
      throw SceneError(askedFor(accuracy_) + ": rounding alone makes errors of " + shortText(rounding_error) +
                       "; write a larger tolerance");
    for (std::size_t r = 0; r < found.edges.size(); ++r) {
      choice_.step_error.push_back(found.steps[r].at(finer));
      choice_.edge_error.push_back(found.edges[r].at(best.edges[r] / (4.0 * base.edges[r])));
      choice_.error.push_back(
          std::max(rounding_error, together(choice_.edge_error[r], choice_.step_error[r], found.correlation[r])));
    }
    const double work = total(best.edges) * double(runs_.at(withSteps(base, 4)).steps) * finer;
    choice_.sayEdges(scene_, accuracy_);
    choice_.say("accuracy: " +
                (adapts_ ? "dt_rtol " + shortText(choice_.loop.dt_rtol) + ", dt_atol " + shortText(choice_.loop.dt_atol)
                         : "dt " + shortText(choice_.loop.dt) + " (" + std::to_string(best.steps) + " steps)") +
                "; " + std::to_string(probes_) + " runs to find out took " + shortText(seconds_) + " s, " +
                shortText(work_ / work) + " times the edges x steps of the run");
  }
};

} // namespace

PetscErrorCode chooseEdgesAndSteps(const Scene &scene, const std::vector<Drawing> &drawings,
                                   const LoopSettings &settings, const Accuracy &accuracy, Choice *choice) {
  PetscFunctionBeginUser;
  PetscCall(Chooser(scene, drawings, settings, accuracy, *choice).choose());
  PetscFunctionReturn(0);
}

} // namespace tendril
