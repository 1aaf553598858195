#include "tendril/io/recorder.hpp"

#include "tendril/io/shape_file.hpp"
#include "tendril/io/summary.hpp"
#include "tendril/io/text.hpp"
#include "tendril/solver/events.hpp"

#include <iomanip>
#include <sstream>
#include <sys/resource.h>

namespace tendril {

Recorder::Recorder(const Options &options, const Prepared &prepared, const StepControl &control, const RunFacts &facts,
                   const Provenance &origin, Progress &progress)
    : options_(options), prepared_(prepared), run_(prepared.whole()), control_(control), facts_(facts),
      progress_(progress), checkpoint_(options.output_dir + "/checkpoint.h5"),
      arclength_(!options.loop.dynamic && options.loop.continuation == Continuation::arclength), widest_{pi / 6} {
  if (const double interval = options.output_interval; interval > 0)
    next_output_ = interval * (1 + std::floor(run_.state.time / interval * (1 + 1e-12)));
  if (leads() && !options.output_shapes.empty()) writeShapes(options.output_shapes, run_.scene);
  if (leads())
    trajectory_ = std::make_unique<TrajectoryWriter>(options.output_dir, run_.scene, *run_.elements, origin,
                                                     options.fields, options.loop.dynamic);
  writeFrame(run_.state);
  if (leads()) trajectory_->flushWhenDue();
  widest_.rod = -1; // told at the start
}

void Recorder::writeFrame(const State &whole) {
  last_frame_ = whole.time;
  if (!leads()) return;
  trajectory_->writeFrame(whole);
  widest_.include(run_.scene, *run_.elements, whole);
  noteSpins(whole);
}

/// The body that turns farthest in a step.
void Recorder::noteSpins(const State &whole) {
  for (int b = 0; b < int(whole.body_rate.size()) && options_.loop.dynamic; ++b) {
    const double dt = last_.dt > 0 ? last_.dt : options_.loop.dt,
                 turn = dt * whole.body_rate[std::size_t(b)].spin.norm();
    if (turn > fastest_.turn) fastest_ = {turn, b, whole.time, dt};
  }
}

PetscErrorCode Recorder::observe(const State &state, const Diagnostics &row) {
  PetscFunctionBeginUser;
  PetscCall(PetscLogEventBegin(events().output, 0, 0, 0, 0));
  ++steps_;
  iterations_ += row.newton_iterations;
  rejected_ += row.rejected_steps;
  last_ = row;
  const bool frame = arclength_ || state.time >= next_output_ * (1 - 1e-12) || state.time >= options_.loop.t_end,
             checkpoint = options_.checkpoint_interval > 0 && state.step % options_.checkpoint_interval == 0;
  if (frame || checkpoint) prepared_.collect(state);
  while (options_.output_interval > 0 && next_output_ <= state.time * (1 + 1e-12))
    next_output_ += options_.output_interval;
  if (leads()) trajectory_->writeDiagnostics(row);
  if (frame) writeFrame(leads() ? run_.state : state);
  if (leads()) {
    trajectory_->flushWhenDue();
    if (checkpoint) {
      trajectory_->flush(); // a restart goes on where the frames end
      writeCheckpoint(checkpoint_, run_, control_, facts_);
    }
  }
  progress_.step(row);
  dissipated_ += row.dissipated;
  work_ += std::abs(row.work.loads + row.work.supports);
  work_of_obstacles_ += std::abs(row.work.obstacles);
  const double kinetic = row.energy.kinetic + row.energy.body_kinetic, stored = row.energy.total() - kinetic;
  most_kinetic_ = std::max(most_kinetic_, kinetic - row.carried);
  if (std::isnan(first_stored_)) first_stored_ = stored;
  most_stored_ = std::max(most_stored_, std::abs(stored - first_stored_));
  gained_ = std::max(gained_, -dissipated_);
  if (!options_.loop.dynamic && row.negative_pivots > 0 && !told_unstable_) tellInstability(row);
  PetscCall(PetscLogEventEnd(events().output, 0, 0, 0, 0));
  PetscFunctionReturn(0);
}

void Recorder::tellInstability(const Diagnostics &row) {
  const std::string count =
      std::to_string(row.negative_pivots) + (row.negative_pivots == 1 ? " negative pivot" : " negative pivots");
  const std::string unknown = !run_.scene.followers.empty() ? "follower forces"
                              : !run_.scene.moments.empty() ? "couples"
                              : run_.scene.hasFriction()    ? "friction"
                                                            : "";
  progress_.say(unknown.empty()
                    ? "at load factor " + shortText(row.time) +
                          " the path is unstable, as it is wherever negative_pivots in the diagnostics is "
                          "not 0: " +
                          count
                    : "warning: " + count + " at an accepted state with " + unknown + ": " + unknown +
                          (unknown == "friction" ? " has" : " have") + " no potential, so its stability is not known");
  told_unstable_ = true;
}

PetscErrorCode Recorder::noteCritical(const CriticalPoint &point) {
  PetscFunctionBeginUser;
  std::ostringstream line;
  line << (point.limit ? "limit point: " : "") << "critical load factor " << std::setprecision(10) << point.load_factor;
  progress_.say(line.str());
  critical_factors_.push_back(point.load_factor);
  if (leads()) trajectory_->writeCritical(point.load_factor);
  writeFrame(prepared_.collect(*point.state));
  if (leads()) trajectory_->flush();
  PetscFunctionReturn(0);
}

namespace {

constexpr int many_edges = 100000; ///< of a scene whose memory is more than that of the libraries

/// Largest resident memory of all ranks together [bytes].
double memoryOf(const Team &team) {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::int64_t kilobytes = usage.ru_maxrss;
  Tally tally;
  team.combine(tally.sum(kilobytes));
  return 1024.0 * double(kilobytes);
}

} // namespace

PetscErrorCode Recorder::end(bool stopped) {
  PetscFunctionBeginUser;
  const State &whole = prepared_.collect(prepared_.run->state);
  if (stopped && last_frame_ < whole.time) writeFrame(whole);
  const double memory = memoryOf(prepared_.team);
  if (!leads()) PetscFunctionReturn(0);
  PetscCall(PetscLogEventBegin(events().output, 0, 0, 0, 0));
  const Summary at_end = summarize(run_.scene, *run_.elements, run_.state, options_.loop.dynamic ? 1 : run_.state.time,
                                   options_.loop.dynamic);
  trajectory_->writeSummary(at_end);
  trajectory_->finish();
  if (!arclength_) writeCheckpoint(checkpoint_, run_, control_, facts_);
  PetscCall(PetscLogEventEnd(events().output, 0, 0, 0, 0));
  std::ostringstream counts;
  counts << steps_ << " steps, " << iterations_ << " Newton iterations (mean " << std::setprecision(3)
         << (steps_ ? double(iterations_) / double(steps_) : 0) << "), " << rejected_ << " rejected, "
         << last_.wall_seconds << " s, results in " << options_.output_dir;
  progress_.say(counts.str());
  for (const std::string &line : describe(at_end, run_.scene)) progress_.say(line);
  if (run_.elements->edges() >= many_edges) {
    std::ostringstream line;
    line << "  memory        " << std::setprecision(3) << memory / (1 << 20) << " MiB at most"
         << (prepared_.team.isAlone() ? "" : ", of all ranks") << ", " << std::llround(memory / run_.elements->edges())
         << " bytes an edge";
    progress_.say(line.str());
  }
  PetscFunctionReturn(0);
}

namespace {

/// What rounding moves [J]: 1e-9 of bending by one radian.
double smallEnergy(const Simulation &run) {
  double little = 0;
  for (std::size_t r = 0; r < run.scene.rods.size(); ++r) {
    const Material &m = run.scene.rods[r].material;
    const double length = run.elements->length(int(r)),
                 stiff = std::max(m.flexural_stiffness[0], m.flexural_stiffness[1]);
    little += 1e-9 * (stiff > 0 ? stiff / length : 1e-6 * m.axial_stiffness * length);
  }
  return little;
}

/// The rod or body of the largest kinetic energy.
std::string liveliest(const Simulation &run) {
  std::string most;
  double largest = -1;
  for (std::size_t r = 0; r < run.elements->rods.size(); ++r) {
    const RodRange &rod = run.elements->rods[r];
    double energy = 0;
    for (int i = 0; i < rod.vertices; ++i)
      energy +=
          0.5 * run.elements->mass()[rod.slot(i)] * run.state.velocity[std::size_t(rod.first_vertex + i)].squaredNorm();
    if (energy > largest) largest = energy, most = labelOf(run.scene.rods[r]);
  }
  for (std::size_t b = 0; b < run.scene.bodies.size(); ++b) {
    const BodyRate &rate = run.state.body_rate[b];
    const double energy =
        0.5 * (run.elements->bodyMass(int(b)).mass * rate.translation.squaredNorm() + rate.spin.dot(rate.momentum));
    if (energy > largest) largest = energy, most = "body '" + run.scene.bodies[b].name + "'";
  }
  return most;
}

} // namespace

std::string Recorder::tellGrowth(bool finished) {
  constexpr double told = 0.1, passes = 0.5; // of the motion's own energy and the work of loads and supports
  // What an obstacle throws off has its velocity from it; only what is stored shows that it has done more.
  const double work = work_ + std::min(work_of_obstacles_, most_stored_), moved = most_kinetic_ + work,
               little = smallEnergy(run_);
  // The work of motors at the corners of their tables is not known so well.
  const bool driven = std::any_of(run_.scene.joints.begin(), run_.scene.joints.end(), [](const Joint &j) {
    return j.motion.moves() || (j.target_motion.moves() && j.drive_stiffness < 0);
  });
  if (driven || !options_.loop.dynamic || !(gained_ > told * moved + little)) return {};
  const std::string &method = options_.loop.integrator.name;
  std::string remedy = !run_.scene.joints.empty() ? "or take euler"
                       : method == "bdf2"         ? "or take energy_momentum or euler"
                                                  : "or take bdf2 or energy_momentum";
  if (!run_.scene.colliders.empty())
    remedy = std::string("give the impacts 'contact: {normal_damping: ...}', ") +
             (method == "euler" ? "or fix 'contact: {stiffness: ...}'" : "or take euler");
  std::ostringstream growth;
  growth << "the energy rose by " << std::setprecision(2) << gained_ / moved << " of the largest kinetic energy"
         << (work > 0 ? " and the work done on it" : "") << " (at most " << passes
         << " passes), with nothing to put it in but -integrator " << method
         << " in steps too long for it: shorten -dt, " << remedy << "; " << liveliest(run_) << " moves most";
  // A method that is unstable has made most of the motion itself.
  if (finished && gained_ > passes * moved + little) return growth.str();
  progress_.say("warning: " + growth.str());
  return {};
}

void Recorder::tellAccuracy() {
  if (fastest_.body >= 0) {
    std::ostringstream line;
    line << "warning: body '" << run_.scene.bodies[std::size_t(fastest_.body)].name << "' turned by "
         << std::setprecision(3) << fastest_.turn << " rad in a step, at time " << fastest_.time
         << ": its way is far off; take a -dt below " << 0.3 * fastest_.dt / fastest_.turn;
    progress_.say(line.str());
  }
  if (widest_.rod >= 0) {
    std::ostringstream line;
    line << "warning: neighbouring edges of rod '" << run_.scene.rods[std::size_t(widest_.rod)].name
         << "' came to turn or twist by up to " << std::setprecision(3) << widest_.angle * 180 / pi
         << " degrees, at vertex " << widest_.vertex << " and " << (options_.loop.dynamic ? "time " : "load factor ")
         << widest_.time << "; measure tan is stiffer than the rod above 30: use more edges, or -rod_measure angle";
    progress_.say(line.str());
  }
  if (last_.rounding_error > 0) {
    std::ostringstream rounding;
    rounding << "rounding error: " << std::setprecision(2) << last_.rounding_error << " of the rod length"
             << (options_.loop.dynamic ? ", summed over the steps" : "");
    progress_.say(rounding.str());
  }
}

} // namespace tendril
