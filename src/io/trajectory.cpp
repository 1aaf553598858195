#include "tendril/io/trajectory.hpp"

#include "tendril/energy/derived.hpp"
#include "tendril/io/xdmf.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>

namespace tendril {
namespace {

enum class On { vertices, edges, cells, supports, constraints, colliders, bodies, attachments, joints };
constexpr const char *places[] = {"vertices",  "edges",  "cells",       "supports", "constraints",
                                  "colliders", "bodies", "attachments", "joints"};

/// Bodies by their origins and axes: places, quaternions, velocities, spins, and angular momenta about the centres of
/// mass.
struct BodyMotion {
  std::vector<Vec3> position, velocity, spin, momentum;
  std::vector<Eigen::Vector4d> rotation;
};

/// A frame about to be written: a state and what is derived from it, as far as some field needs it.
struct Snapshot {
  const State &state;
  RodStrains strains;
  RodActions actions;
  std::vector<double> constraint_deviation = {}, constraint_force = {}, joint_coordinate = {};
  std::vector<Vec3> joint_distance = {}, joint_force = {}, joint_moment = {};
  std::vector<ContactReading> contacts = {};
  std::vector<Vec3> contact_force = {}, collider_force = {}, collider_moment = {}, collider_position = {};
  std::vector<Eigen::Vector4d> collider_rotation = {};
  BodyMotion body = {};
};
enum class From { state, second_word, strains, actions, contact, motion, bodies };

struct Field {
  const char *name, *unit;
  On place;
  hsize_t components;
  From source;
  const double *(*data)(const Snapshot &);
};

const Field fields[] = {
    {"position", "m", On::vertices, 3, From::state, [](const Snapshot &s) { return s.state.position[0].data(); }},
    {"director", "1", On::edges, 3, From::state, [](const Snapshot &s) { return s.state.director[0].data(); }},
    {"velocity", "m/s", On::vertices, 3, From::state, [](const Snapshot &s) { return s.state.velocity[0].data(); }},
    {"twist_rate", "rad/s", On::edges, 1, From::state, [](const Snapshot &s) { return s.state.twist_rate.data(); }},
    {"axial_force", "N", On::edges, 1, From::state, [](const Snapshot &s) { return s.state.axial_force.data(); }},
    // Measure `angle`: 2 pi x whole turns of each cell's twist [rad].
    {"turns", "rad", On::cells, 1, From::state, [](const Snapshot &s) { return s.state.winding.data(); }},
    {"position_low", "m", On::vertices, 3, From::second_word,
     [](const Snapshot &s) { return s.state.position_low[0].data(); }},
    {"curvature", "1/m", On::vertices, 2, From::strains,
     [](const Snapshot &s) { return s.strains.curvature[0].data(); }},
    {"twist", "rad/m", On::vertices, 1, From::strains, [](const Snapshot &s) { return s.strains.twist.data(); }},
    {"strain_energy_density", "J/m", On::vertices, 1, From::strains,
     [](const Snapshot &s) { return s.strains.strain_energy_density.data(); }},
    {"force", "N", On::edges, 3, From::actions, [](const Snapshot &s) { return s.actions.force[0].data(); }},
    {"moment", "N m", On::vertices, 3, From::actions, [](const Snapshot &s) { return s.actions.moment[0].data(); }},
    {"reaction", "N", On::supports, 3, From::actions, [](const Snapshot &s) { return s.actions.reaction[0].data(); }},
    {"reaction_moment", "N m", On::supports, 3, From::actions,
     [](const Snapshot &s) { return s.actions.reaction_moment[0].data(); }},
    // Of pins the first three numbers, of rotations the last three.
    {"constraint_deviation", "m, rad", On::constraints, 6, From::actions,
     [](const Snapshot &s) { return s.constraint_deviation.data(); }},
    {"constraint_force", "N, N m", On::constraints, 6, From::actions,
     [](const Snapshot &s) { return s.constraint_force.data(); }},
    {"contact_force", "N", On::vertices, 3, From::contact, [](const Snapshot &s) { return s.contact_force[0].data(); }},
    // On the rods; moments about the positions of the obstacles.
    {"collider_force", "N", On::colliders, 3, From::contact,
     [](const Snapshot &s) { return s.collider_force[0].data(); }},
    {"collider_moment", "N m", On::colliders, 3, From::contact,
     [](const Snapshot &s) { return s.collider_moment[0].data(); }},
    // On bodies, where rods are tied to them exactly; the moment about the vertex.
    {"attachment_force", "N", On::attachments, 3, From::actions,
     [](const Snapshot &s) { return s.actions.attachment[0].data(); }},
    {"attachment_moment", "N m", On::attachments, 3, From::actions,
     [](const Snapshot &s) { return s.actions.attachment_moment[0].data(); }},
    // By how much the child is from the parent, and what acts on it: at the joint's point.
    {"joint_coordinate", "m, rad", On::joints, 1, From::actions,
     [](const Snapshot &s) { return s.joint_coordinate.data(); }},
    {"joint_distance", "m", On::joints, 3, From::actions, [](const Snapshot &s) { return s.joint_distance[0].data(); }},
    {"joint_force", "N", On::joints, 3, From::actions, [](const Snapshot &s) { return s.joint_force[0].data(); }},
    {"joint_moment", "N m", On::joints, 3, From::actions, [](const Snapshot &s) { return s.joint_moment[0].data(); }},
    // Where obstacles stand, and quaternions w, x, y, z from their axes to the world's; where any moves.
    {"collider_position", "m", On::colliders, 3, From::motion,
     [](const Snapshot &s) { return s.collider_position[0].data(); }},
    {"collider_rotation", "1", On::colliders, 4, From::motion,
     [](const Snapshot &s) { return s.collider_rotation[0].data(); }},
    // Of the origins of bodies, but the last: it is about the centres of mass.
    {"body_position", "m", On::bodies, 3, From::bodies, [](const Snapshot &s) { return s.body.position[0].data(); }},
    {"body_rotation", "1", On::bodies, 4, From::bodies, [](const Snapshot &s) { return s.body.rotation[0].data(); }},
    {"body_velocity", "m/s", On::bodies, 3, From::bodies, [](const Snapshot &s) { return s.body.velocity[0].data(); }},
    {"body_angular_velocity", "rad/s", On::bodies, 3, From::bodies,
     [](const Snapshot &s) { return s.body.spin[0].data(); }},
    {"body_momentum", "kg m^2/s", On::bodies, 3, From::bodies,
     [](const Snapshot &s) { return s.body.momentum[0].data(); }},
};

/// Fields that are written where nothing else is said.
bool isUsual(From source) { return source == From::state || source == From::motion || source == From::bodies; }

std::vector<std::string> namesOf(bool derived) {
  std::vector<std::string> names;
  for (const Field &f : fields)
    if (isUsual(f.source) != derived) names.push_back(f.name);
  return names;
}

constexpr auto patience = std::chrono::milliseconds(500); ///< how long rows and frames may wait
constexpr std::size_t most_waiting = 4 << 20;             ///< [bytes]

/// w, x, y, z
Eigen::Vector4d quaternionOf(const Mat3 &rotation) {
  const Eigen::Quaterniond q(rotation);
  return {q.w(), q.x(), q.y(), q.z()};
}

BodyMotion motionOfBodies(const Scene &scene, const Elements &elements, const State &state) {
  BodyMotion motion;
  const int count = int(scene.bodies.size());
  for (int b = 0; b < count; ++b) {
    const Body &body = scene.bodies[b];
    const BodyRate &rate = state.body_rate[b];
    const Mat3 turn = rotationOf(state, elements.groups - count + b);
    const Vec3 arm = turn * (body.position - elements.bodyMass(b).centre);
    motion.position.push_back(state.body_position[b] + (arm + state.body_position_low[b]));
    motion.rotation.push_back(quaternionOf(turn * body.rotation));
    motion.velocity.push_back(rate.translation + rate.spin.cross(arm));
    motion.spin.push_back(rate.spin);
    motion.momentum.push_back(rate.momentum);
  }
  for (const Body &body : scene.held_bodies) {
    const Mat3 turn = body.motion.rotationAt(state.time);
    motion.position.push_back(body.position + body.motion.displacementAt(state.time));
    motion.rotation.push_back(quaternionOf(turn * body.rotation));
    motion.velocity.push_back(body.motion.velocityAt(state.time));
    motion.spin.push_back(body.motion.angularVelocityAt(state.time));
    const Vec3 spin = turn.transpose() * motion.spin.back();
    motion.momentum.push_back(turn * (body.own.inertia * spin));
  }
  return motion;
}

std::array<int, std::size(places)> sizes(const Scene &scene, const Elements &e) {
  return {e.vertices(),
          e.edges(),
          int(e.cell_slot.size()),
          int(e.support_slot.size()),
          int(e.constraint_slot.size()),
          int(scene.colliders.size()),
          int(scene.bodies.size() + scene.held_bodies.size()),
          int(scene.attachments.size()),
          int(scene.joints.size())};
}

} // namespace

const std::vector<std::string> &TrajectoryWriter::fieldNames() {
  static const std::vector<std::string> names = namesOf(false);
  return names;
}

const std::vector<std::string> &TrajectoryWriter::derivedFieldNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all = namesOf(true);
    all.push_back("contacts"); // groups of their own
    all.push_back("touching");
    return all;
  }();
  return names;
}

TrajectoryWriter::TrajectoryWriter(const std::string &folder, const Scene &scene, const Elements &elements,
                                   const Provenance &provenance, const std::set<std::string> &wanted, bool dynamic)
    : scene_(scene), elements_(elements), dynamic_(dynamic), folder_(folder), rods_(elements.rods.size()),
      vertices_(elements.vertices()), edges_(elements.edges()), csv_(folder + "/diagnostics.csv"),
      file_(Hdf5File::create(folder + "/trajectory.h5")) {
  for (const DiagnosticsColumn &column : diagnosticsColumns()) {
    if (!csv_rows_.empty()) csv_rows_ += ',';
    csv_rows_ += column.name;
  }
  csv_rows_ += '\n';
  writeHeader(scene, elements, provenance);
  file_.createGroup("state");
  for (const Field &f : fields) {
    state_.push_back(nullptr);
    if (std::string(f.name) != "position" && !wanted.count(f.name)) continue;
    if (f.place == On::cells &&
        std::find(elements.measure.begin(), elements.measure.end(), Measure::angle) == elements.measure.end())
      continue;
    if ((f.source == From::contact && scene.colliders.empty()) || (f.source == From::motion && !scene.collidersMove()))
      continue;
    std::vector<hsize_t> slab{hsize_t(sizes(scene, elements)[std::size_t(f.place)])};
    if (slab[0] == 0) continue; // cables have no cells, free rods no supports, constraints or bodies
    if (f.components > 1) slab.push_back(f.components);
    state_.back() = std::make_unique<Hdf5Series>(file_, std::string("state/") + f.name, slab);
    file_.writeAttribute(std::string("state/") + f.name, "unit", std::string(f.unit));
    file_.writeAttribute(std::string("state/") + f.name, "place", std::string(places[std::size_t(f.place)]));
  }
  if (wanted.count("contacts") && !scene.colliders.empty()) contacts_ = makeContactWriter(file_);
  if (wanted.count("touching") && scene.touchesMoving()) touching_ = makePairWriter(file_);
  file_.createGroup("summary");
  writeSummary(emptySummary(scene));
  file_.createGroup("diagnostics");
  for (const DiagnosticsColumn &column : diagnosticsColumns()) {
    const std::string path = "diagnostics/" + column.name;
    diagnostics_.push_back(std::make_unique<Hdf5Series>(file_, path, std::vector<hsize_t>{}));
    const bool is_load_factor = !dynamic && (column.name == "time" || column.name == "dt");
    file_.writeAttribute(path, "unit", is_load_factor ? "1" : column.unit);
  }
  file_.createGroup("critical");
  critical_ = std::make_unique<Hdf5Series>(file_, "critical/load_factor", std::vector<hsize_t>{});
  file_.writeAttribute("critical/load_factor", "unit", std::string("1"));
  step_ = std::make_unique<Hdf5Series>(file_, "step", std::vector<hsize_t>{}, true);
  time_ = std::make_unique<Hdf5Series>(file_, "time", std::vector<hsize_t>{});
  file_.writeAttribute("time", "unit", std::string(dynamic ? "s" : "1"));
  file_.startAppending();
}

TrajectoryWriter::~TrajectoryWriter() {
  if (!broken_ && !finished_) {
    try {
      finish();
    } catch (const SceneError &) { // a run that goes on to its end finishes before, and tells
    }
  }
  if (!broken_) return;
  // The file stays as the last flush has left it. HDF5 would write what describes data that are not there when it
  // closes: nothing is closed.
  for (auto *all : {&state_, &diagnostics_})
    for (auto &series : *all) (void)series.release();
  for (auto *series : {&time_, &step_, &critical_}) (void)series->release();
  if (contacts_) contacts_->abandon();
  if (touching_) touching_->abandon();
  new Hdf5File(std::move(file_));
}

void TrajectoryWriter::finish() {
  flush();
  writeXdmf();
  finished_ = true;
}

void TrajectoryWriter::writeFrame(const State &state) {
  Snapshot snapshot{state, {}, {}};
  auto wanted = [&](From source) {
    for (std::size_t k = 0; k < state_.size(); ++k)
      if (state_[k] && fields[k].source == source) return true;
    return false;
  };
  if (wanted(From::strains))
    snapshot.strains = rodStrains(scene_, elements_, state, state.time, dynamic_ ? 1 : state.time);
  if (wanted(From::actions))
    snapshot.actions = rodActions(scene_, elements_, state, state.time, dynamic_ ? 1 : state.time, dynamic_);
  if (wanted(From::contact) || contacts_)
    snapshot.contacts =
        contactReadings(scene_, elements_, state, configurationOf(state, scene_, elements_, state.time));
  if (wanted(From::contact)) {
    snapshot.contact_force = contactForces(elements_, snapshot.contacts);
    colliderActions(scene_, snapshot.contacts, state.time, &snapshot.collider_force, &snapshot.collider_moment);
  }
  if (contacts_) contacts_->append(snapshot.contacts);
  if (touching_)
    touching_->append(
        pairReadings(scene_, elements_, state, configurationOf(state, scene_, elements_, state.time), !dynamic_));
  for (const Collider &c : wanted(From::motion) ? scene_.colliders : std::vector<Collider>()) {
    const Collider::Pose pose = c.poseAt(state.time);
    snapshot.collider_position.push_back(pose.position);
    snapshot.collider_rotation.push_back(quaternionOf(pose.rotation));
  }
  if (wanted(From::bodies)) snapshot.body = motionOfBodies(scene_, elements_, state);
  for (const ConstraintReading &c : snapshot.actions.constraint) {
    for (const Vec3 *x : {&c.distance, &c.rotation})
      snapshot.constraint_deviation.insert(snapshot.constraint_deviation.end(), x->data(), x->data() + 3);
    for (const Vec3 *x : {&c.force, &c.moment})
      snapshot.constraint_force.insert(snapshot.constraint_force.end(), x->data(), x->data() + 3);
  }
  for (const JointReading &j : snapshot.actions.joint) {
    snapshot.joint_coordinate.push_back(j.coordinate);
    snapshot.joint_distance.push_back(j.distance);
    snapshot.joint_force.push_back(j.force);
    snapshot.joint_moment.push_back(j.moment);
  }
  for (std::size_t k = 0; k < state_.size(); ++k)
    if (state_[k]) state_[k]->append(fields[k].data(snapshot));
  const double step = double(state.step);
  step_->append(&step);
  time_->append(&state.time);
  times_.push_back(state.time);
}

void TrajectoryWriter::writeDiagnostics(const Diagnostics &row) {
  char text[32];
  for (std::size_t k = 0; k < diagnostics_.size(); ++k) {
    const double value = diagnosticsColumns()[k].value(row);
    diagnostics_[k]->append(&value);
    if (k) csv_rows_ += ',';
    csv_rows_.append(text,
                     std::to_chars(text, text + sizeof text, value).ptr); // as many digits as bring the number back
  }
  csv_rows_ += '\n';
}

void TrajectoryWriter::writeCritical(double load_factor) { critical_->append(&load_factor); }

/// The times of frames go last: frames are complete up to the length of /time, whenever the run is killed.
void TrajectoryWriter::flush() {
  broken_ = true; // until all went well: half of a frame must not be followed by another
  csv_ << csv_rows_ << std::flush;
  if (!csv_) throw WriteError(folder_ + "/diagnostics.csv: cannot be written; is the disk full?");
  csv_rows_.clear();
  for (const auto &series : diagnostics_) series->flush();
  critical_->flush();
  for (const auto &series : state_)
    if (series) series->flush();
  if (contacts_) contacts_->flush();
  if (touching_) touching_->flush();
  step_->flush();
  time_->flush();
  broken_ = false;
  flushed_ = Clock::now();
}

void TrajectoryWriter::flushWhenDue() {
  std::size_t waiting =
      csv_rows_.size() + (contacts_ ? contacts_->waitingBytes() : 0) + (touching_ ? touching_->waitingBytes() : 0);
  for (const auto &series : state_)
    if (series) waiting += series->waitingBytes();
  const Clock::time_point now = Clock::now();
  const bool describe = times_.size() >= 2 * described_ &&
                        now - described_at_ > 4 * patience; // now and then: a killed run keeps a usable XDMF file
  if (describe || waiting > most_waiting || now - flushed_ > patience) flush();
  if (!describe) return;
  writeXdmf();
  described_ = times_.size();
  described_at_ = now;
}

/// `rods`: a polyline each, with the fields of vertices; `edges`: a segment each, with those of edges as cell data as
/// well; `bodies`: a point each, where they are written.
void TrajectoryWriter::writeXdmf() const {
  const auto rows = sizes(scene_, elements_);
  auto described = [&](const Field &f, bool of_cells = false) {
    return XdmfField{f.name, rows[std::size_t(f.place)], int(f.components), of_cells};
  };
  auto count = [](auto n) { return "\"" + std::to_string(n) + "\""; };
  XdmfBlock rods{"rods", "\"Mixed\" NumberOfElements=" + count(rods_), "topology/polylines",
                 std::to_string(polyline_entries_), "frame"};
  XdmfBlock edges{"edges", "\"Polyline\" NodesPerElement=\"2\" NumberOfElements=" + count(edges_), "topology/edges",
                  std::to_string(edges_) + " 2", "frame"};
  XdmfBlock bodies{"bodies",
                   "\"Polyvertex\" NodesPerElement=\"1\" NumberOfElements=" +
                       count(scene_.bodies.size() + scene_.held_bodies.size()),
                   "topology/bodies", std::to_string(scene_.bodies.size() + scene_.held_bodies.size()),
                   "bodies in frame"};
  rods.position = edges.position = described(fields[0]);
  rods.has_radius = edges.has_radius = true;
  for (std::size_t k = 1; k < state_.size(); ++k) {
    const Field &f = fields[k];
    if (!state_[k]) continue;
    if (f.place == On::vertices)
      for (XdmfBlock *block : {&rods, &edges}) block->fields.push_back(described(f));
    if (f.place == On::edges) edges.fields.push_back(described(f, true));
    if (f.place != On::bodies) continue;
    if (std::string(f.name) == "body_position")
      bodies.position = described(f);
    else
      bodies.fields.push_back(described(f));
  }
  std::vector<XdmfBlock> blocks{rods, edges};
  if (!bodies.position.name.empty()) blocks.push_back(bodies);
  tendril::writeXdmf(folder_ + "/trajectory.xdmf", blocks, times_);
}

} // namespace tendril
