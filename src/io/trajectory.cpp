#include "tendril/io/trajectory.hpp"

#include "tendril/energy/tendon.hpp"
#include "tendril/io/trajectory_fields.hpp"
#include "tendril/io/xdmf.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>

namespace tendril {
namespace {

std::vector<std::string> namesOf(bool derived) {
  std::vector<std::string> names;
  for (const Field &f : fields)
    if (isUsual(f.source) != derived) names.push_back(f.name);
  return names;
}

constexpr auto patience = std::chrono::milliseconds(500); ///< how long rows and frames may wait
constexpr std::size_t most_waiting = 4 << 20;             ///< [bytes]

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
  if (wanted(From::tendons)) {
    const Configuration c = configurationOf(state, scene_, elements_, state.time);
    for (int k = 0; k < int(scene_.tendons.size()); ++k) {
      const TendonReading t = readTendon(scene_, elements_, k, state, c, dynamic_);
      snapshot.tendon_displacement.push_back(t.displacement);
      snapshot.tendon_length.push_back(t.length);
      snapshot.tendon_rate.push_back(t.rate);
      snapshot.tendon_tension.push_back(t.tension);
      snapshot.tendon_point_tension.insert(snapshot.tendon_point_tension.end(), t.point_tension.begin(),
                                           t.point_tension.end());
      snapshot.tendon_position.insert(snapshot.tendon_position.end(), t.points.begin(), t.points.end());
    }
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
/// well; `bodies`: a point each, `tendons`: their segments, where they are written.
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
  XdmfBlock tendons{"tendons", "\"Polyline\" NodesPerElement=\"2\" NumberOfElements=" + count(tendon_segments_),
                    "tendons/segments", std::to_string(tendon_segments_) + " 2", "tendons in frame"};
  rods.position = edges.position = described(fields[0]);
  rods.has_radius = edges.has_radius = true;
  for (std::size_t k = 1; k < state_.size(); ++k) {
    const Field &f = fields[k];
    if (!state_[k]) continue;
    if (f.place == On::vertices)
      for (XdmfBlock *block : {&rods, &edges}) block->fields.push_back(described(f));
    if (f.place == On::edges) edges.fields.push_back(described(f, true));
    if (f.place == On::tendon_points && tendon_segments_ > 0) {
      if (std::string(f.name) == "tendon_position")
        tendons.position = described(f);
      else
        tendons.fields.push_back(described(f));
    }
    if (f.place != On::bodies) continue;
    if (std::string(f.name) == "body_position")
      bodies.position = described(f);
    else
      bodies.fields.push_back(described(f));
  }
  std::vector<XdmfBlock> blocks{rods, edges};
  for (const XdmfBlock &block : {bodies, tendons})
    if (!block.position.name.empty()) blocks.push_back(block);
  tendril::writeXdmf(folder_ + "/trajectory.xdmf", blocks, times_);
}

} // namespace tendril
