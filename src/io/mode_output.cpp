#include "tendril/io/mode_output.hpp"

#include "tendril/dynamics/buckling.hpp"
#include "tendril/dynamics/simulation.hpp"
#include "tendril/energy/work.hpp"
#include "tendril/io/hdf5.hpp"
#include "tendril/solver/mass.hpp"

#include <algorithm>
#include <iomanip>
#include <sstream>

namespace tendril {
namespace {

[[noreturn]] void refuse(bool buckling, const std::string &what) {
  throw SceneError(std::string("option -mode ") + (buckling ? "buckling: " : "modes: ") + what);
}

/// Loads and contact that have no potential. Natural frequencies with friction would be those of what sticks.
void refuseUnsymmetric(const Scene &scene, bool buckling) {
  auto refuse = [&](const std::string &what) { tendril::refuse(buckling, what); };
  const std::string unsymmetric = " has no potential, and ",
                    friction = "friction" + unsymmetric + "what sticks may slide; write 'contact: {friction: 0}'";
  if (buckling) {
    constexpr const char *flutter = "the scene may flutter before it buckles; take -mode modes";
    for (const FollowerForce &f : scene.followers)
      refuse("the force of 'axes: material' on vertex " + std::to_string(f.vertex) + " of " +
             labelOf(scene.rods[std::size_t(f.rod)]) + unsymmetric + flutter);
    for (const EdgeMoment &m : scene.moments)
      refuse("the " + std::string(m.moment.isZero(0) ? "'torque'" : "'moment'") + " on edge " + std::to_string(m.edge) +
             " of " + labelOf(scene.rods[std::size_t(m.rod)]) + unsymmetric + flutter);
    for (const Body &b : scene.bodies)
      if (!b.torque.isZero(0)) refuse("the 'torque' on body '" + b.name + "'" + unsymmetric + flutter);
  }
  const bool touch = !scene.colliders.empty();
  for (const Rod &rod : scene.rods)
    if (rod.contact.on && rod.contact.friction > 0 && (touch || rod.contact.touchesMoving()))
      refuse(labelOf(rod) + ": " + friction);
  for (const Body &b : scene.bodies)
    if (b.contact.on && b.contact.friction > 0 && (touch || b.contact.touchesMoving()))
      refuse("body '" + b.name + "': " + friction);
}

std::string lineOf(const Modes &modes, int k) {
  std::ostringstream line;
  line << "mode " << k + 1 << ": " << std::setprecision(10);
  if (modes.flutters(k))
    line << "flutters with " << modes.frequency(k) << " rad/s, "
         << (modes.imaginary[std::size_t(k)] > 0 ? "grows as exp(" : "and its partner: exp(+-") << modes.growthRate(k)
         << "/s t)";
  else if (modes.isUnstable(k))
    line << "unstable, grows as exp(" << modes.growthRate(k) << "/s t)";
  else if (modes.isFree(k))
    line << "0 rad/s, a motion that costs nothing";
  else
    line << modes.frequency(k) << " rad/s, " << std::setprecision(6) << modes.frequency(k) / (2 * pi) << " Hz";
  return line.str();
}

std::string lineOf(const BucklingModes &modes, int k) {
  std::ostringstream line;
  line << "mode " << k + 1 << ": load factor " << std::setprecision(10) << modes.load_factor[std::size_t(k)]
       << (modes.limit[std::size_t(k)] ? ", a limit point" : "");
  return line.str();
}

/// Of body k's origin in the mode, with its rotation vector; of those that no step moves zero.
void addBodies(const Simulation &run, const Rates &shape, std::vector<double> &moved, std::vector<double> &turned) {
  const int count = int(run.scene.bodies.size());
  for (int b = 0; b < count + int(run.scene.held_bodies.size()); ++b) {
    Vec3 translation = Vec3::Zero(), spin = Vec3::Zero();
    if (b < count) {
      const BodyRate &rate = shape.body[std::size_t(b)];
      const Vec3 arm = rotationOf(run.state, run.elements->groups - count + b) *
                       (run.scene.bodies[std::size_t(b)].position - run.elements->bodyMass(b).centre);
      spin = rate.spin;
      translation = rate.translation + spin.cross(arm);
    }
    moved.insert(moved.end(), translation.begin(), translation.end());
    turned.insert(turned.end(), spin.begin(), spin.end());
  }
}

void writeShapes(Hdf5File &file, const Simulation &run, const std::vector<Rates> &shapes) {
  std::vector<double> shape, twist, moved, turned;
  for (const Rates &one : shapes) {
    for (const Vec3 &v : one.vertex) shape.insert(shape.end(), v.begin(), v.end());
    twist.insert(twist.end(), one.edge.begin(), one.edge.end());
    addBodies(run, one, moved, turned);
  }
  const hsize_t n = shapes.size(), bodies = moved.size() / 3 / n;
  file.write("modes/shape", {n, shape.size() / 3 / n, 3}, shape.data(), "m");
  file.write("modes/twist", {n, twist.size() / n}, twist.data(), "rad");
  if (bodies > 0) file.write("modes/body_shape", {n, bodies, 3}, moved.data(), "m");
  if (bodies > 0) file.write("modes/body_rotation", {n, bodies, 3}, turned.data(), "rad");
}

void writeModes(const std::string &path, const Simulation &run, const Modes &modes) {
  Hdf5File file = Hdf5File::reopen(path);
  std::vector<double> frequency, growth;
  for (int k = 0; k < modes.count(); ++k) {
    frequency.push_back(modes.frequency(k));
    growth.push_back(modes.growthRate(k));
  }
  const hsize_t n = hsize_t(modes.count());
  file.createGroup("modes");
  file.write("modes/frequency", {n}, frequency.data(), "rad/s");
  file.write("modes/growth_rate", {n}, growth.data(), "1/s");
  file.write("modes/eigenvalue", {n}, modes.eigenvalue.data(), "1/s^2");
  writeShapes(file, run, modes.shape);
  file.close();
}

void writeModes(const std::string &path, const Simulation &run, const BucklingModes &modes) {
  Hdf5File file = Hdf5File::reopen(path);
  file.createGroup("modes");
  file.write("modes/load_factor", {hsize_t(modes.count())}, modes.load_factor.data(), "1");
  writeShapes(file, run, modes.shape);
  file.close();
}

/// Whether anything grows with the load factor.
bool isLoaded(const Scene &scene) {
  return !scene.gravity.isZero(0) || !scene.forces.empty() || !scene.rotation.angular_velocity.isZero(0) ||
         !movingHolders(scene).empty() || !scene.tendons.empty() || scene.collidersMove() ||
         std::any_of(scene.bodies.begin(), scene.bodies.end(),
                     [](const Body &b) { return !b.force.isZero(0) || b.motion.moves(); });
}

} // namespace

void checkModes(const Scene &scene, const Options &o) {
  auto refuse = [&](const std::string &what) { tendril::refuse(o.buckling, what); };
  if (const int ranks = Team::world().size(); ranks > 1)
    refuse("runs on one rank, and mpiexec has started " + std::to_string(ranks) + "; start tendril without it");
  if (!o.restart.empty()) refuse("begins with the scene; take -restart away");
  if (o.loop.bifurcation == Bifurcation::stop)
    refuse("is about the equilibrium at full load, and -bifurcation stop ends before; take locate or switch");
  if (!scene.rotation.angular_velocity.isZero(0) && !o.buckling)
    refuse("the scene has a 'rotation': Coriolis forces act there, and gyroscopic problems are not supported yet");
  refuseUnsymmetric(scene, o.buckling);
  if (o.buckling && !isLoaded(scene))
    refuse("the scene has no load that could grow: give it a gravity, a force, or a support that moves");
}

void refuseTooManyModes(const Simulation &run, const Options &o) {
  const int most = o.buckling ? int(run.dofs.unknowns(run.dofs.all())) : massRank(*run.potential, run.dofs.all());
  if (o.modes > most)
    throw SceneError("option -modes: " + std::to_string(o.modes) + " are asked for, and the scene has " +
                     std::to_string(most) + (o.buckling ? " motions" : " motions with inertia") +
                     "; write at most that, or raise -rod_edges");
}

bool isAlone(const Scene &scene) {
  return std::none_of(scene.supports.begin(), scene.supports.end(),
                      [](const Support &s) { return s.holdsPosition(); }) &&
         scene.gravity.isZero(0) && scene.forces.empty() && scene.followers.empty() && scene.moments.empty() &&
         scene.tendons.empty() && scene.constraints.empty() && scene.joints.empty() && scene.colliders.empty() &&
         !scene.touchesMoving() &&
         std::all_of(scene.bodies.begin(), scene.bodies.end(), [](const Body &b) { return b.force.isZero(0); });
}

PetscErrorCode settleAlone(Simulation &run, const Options &o, const TimeLoop::Observer &observe, bool *finished,
                           std::string *failure) {
  PetscFunctionBeginUser;
  NewtonReport report;
  PetscCall(run.solver.solve(run.state, TimeLoop::stepOf(o.loop, run.state, 1), &report, Seek::equilibrium));
  *finished = report.converged;
  if (!*finished) *failure = "the rest state of a scene that nothing holds was not found: " + report.reason;
  if (!*finished) PetscFunctionReturn(0);
  run.potential->commit(run.state);
  Diagnostics row;
  row.time = row.dt = 1;
  row.newton_iterations = report.iterations;
  row.energy = energyBudget(run.scene, *run.elements, run.state, 1);
  PetscCall(observe(run.state, row));
  PetscFunctionReturn(0);
}

PetscErrorCode followBuckling(Prepared &prepared, const Options &o, const TimeLoop::Observer &observe,
                              const CriticalObserver &on_critical, const std::function<bool()> &stops, bool *finished,
                              std::string *failure) {
  PetscFunctionBeginUser;
  Simulation &run = *prepared.run;
  prepared.buckling = std::make_shared<BucklingPath>(run.solver, o.loop, o.modes);
  BucklingPath &path = *prepared.buckling;
  double last = 0;
  path.on_critical = on_critical;
  path.stops = stops;
  path.on_step = [&](const State &state, const NewtonReport &report, int unstable) {
    Diagnostics row;
    row.time = state.time;
    row.dt = state.time - std::exchange(last, state.time);
    row.newton_iterations = report.iterations;
    row.negative_pivots = unstable;
    row.energy = energyBudget(run.scene, *run.elements, state, state.time);
    return observe(state, row);
  };
  PetscCall(path.run(run.state, finished));
  if (!*finished) *failure = path.failure();
  path.on_step = nullptr; // what they refer to ends before the path
  path.on_critical = nullptr;
  path.stops = nullptr;
  PetscFunctionReturn(0);
}

static void tellBuckling(const Prepared &prepared, const Options &o, Progress &progress, int *exit_code) {
  const BucklingPath &path = *prepared.buckling;
  const BucklingModes &modes = path.modes();
  if (modes.count() > 0) writeModes(o.output_dir + "/trajectory.h5", prepared.whole(), modes);
  for (int k = 0; k < modes.count(); ++k) progress.say(lineOf(modes, k));
  const std::string few = std::to_string(modes.count()) + " of " + std::to_string(o.modes) + " modes found: ",
                    further = "; raise -buckling_to to look further";
  if (!path.failure().empty() || modes.count() == 0) {
    const bool reached = path.failure().empty();
    progress.fail("-mode buckling: " + few + (reached ? path.ending() + further : path.failure()));
    *exit_code = 2;
  } else if (!path.ending().empty())
    progress.say(few + path.ending() + (modes.limit.back() ? "" : further));
}

PetscErrorCode tellModes(const Prepared &prepared, const Options &o, Progress &progress, int *exit_code) {
  PetscFunctionBeginUser;
  if (o.buckling) {
    tellBuckling(prepared, o, progress, exit_code);
    PetscFunctionReturn(0);
  }
  Simulation &run = *prepared.run;
  if (run.state.time < o.loop.t_end) {
    progress.fail("-mode modes: the path of equilibria has not come to full load, about which modes are found");
    *exit_code = 2;
    PetscFunctionReturn(0);
  }
  Modes modes;
  std::string failure;
  PetscCall(
      findModes(run.solver, run.state, TimeLoop::stepOf(o.loop, run.state, o.loop.dt), o.modes, &modes, &failure));
  if (!failure.empty()) {
    progress.fail("-mode modes: " + failure);
    *exit_code = 2;
    PetscFunctionReturn(0);
  }
  writeModes(o.output_dir + "/trajectory.h5", run, modes);
  for (int k = 0; k < modes.count(); ++k) progress.say(lineOf(modes, k));
  PetscFunctionReturn(0);
}

} // namespace tendril
