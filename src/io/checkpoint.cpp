#include "tendril/io/checkpoint.hpp"

#include "tendril/energy/edge.hpp"
#include "tendril/io/checkpoint_archive.hpp"
#include "tendril/io/text.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <iomanip>
#include <map>
#include <sstream>

namespace tendril {
namespace {

/// Where each cell of a scene is: four times the vertex, plus 0 for the cell between two edges, 1 from an edge to a
/// support and 2 from a support to an edge.
std::vector<double> cellPlaces(const Elements &elements) {
  std::vector<double> places;
  for (int r = 0; r < int(elements.rods.size()); ++r) {
    const RodRange &rod = elements.rods[r];
    for (const LooseCell &cell : cellsOf(elements, r)) {
      const int v = cell.vertex - rod.first_slot, side = edgeAt(rod, cell.frame1) < 0   ? 1
                                                         : edgeAt(rod, cell.frame0) < 0 ? 2
                                                                                        : 0;
      places.push_back(4.0 * (rod.first_vertex + (v == rod.vertices ? 0 : v)) + side);
    }
  }
  return places;
}

/// Twist angles of all cells, whole turns included.
std::vector<double> cellTwists(const Simulation &run, const State &state) {
  const Configuration c = configurationOf(state, run.scene, *run.elements, state.time);
  std::vector<double> twists;
  for (const int slot : run.elements->cell_slot) twists.push_back(c[Configuration::twist][slot]);
  return twists;
}

bool countsTurns(const Elements &elements) {
  return std::find(elements.measure.begin(), elements.measure.end(), Measure::angle) != elements.measure.end();
}

/// What is in the file besides the facts of the run: one list for writing and reading.
struct Contents {
  State state;
  StepControl control;
  std::vector<double> cells, twists; ///< places and twist angles of cells; the angles only where turns are counted
  std::size_t strain_row = 0;
};

template <class Archive, class AnyState, class Whole> void exchangeBodies(Archive &a, AnyState &s, const Whole &whole) {
  std::size_t count = s.body_rate.size();
  whole("bodies", count, 1e15);
  a.array("body_position", s.body_position, count);
  a.array("body_position_low", s.body_position_low, count);
  a.array("body_rate", s.body_rate, count);
  for (int n = 0; n < int(s.memory.size()); ++n) a.array("memory_body_" + std::to_string(n), s.memory[n].body, count);
}

template <class Archive, class AnyContents> void exchange(Archive &a, AnyContents &c, const Elements &elements) {
  auto whole = [&](const char *name, auto &value, [[maybe_unused]] double most) {
    if constexpr (Archive::reads)
      value = std::decay_t<decltype(value)>(a.count(name, most));
    else
      a.number(name, double(value));
  };
  auto &s = c.state;
  a.number("time", s.time);
  whole("step", s.step, 1e15);
  a.number("next_dt", c.control.dt);
  whole("good_steps", c.control.good, 2e9);
  whole("stable", c.control.stable, 1);
  a.number("step_error", c.control.error);
  a.number("error_sum", c.control.error_sum);
  a.number("rounding_sum", c.control.rounding_sum);
  a.number("energy", c.control.energy);
  a.number("last_dt", s.last_dt);
  a.number("dt_before", s.dt_before);
  std::size_t cells = c.cells.size(), twists = c.twists.size(), memory = s.memory.size(), strains = s.strains.size();
  whole("cells", cells, 3.0 * elements.vertices());
  whole("cells_with_twist", twists, 3.0 * elements.vertices());
  whole("remembered_rates", memory, most_memory);
  whole("remembered_strains", strains, 1e15);
  whole("strain_row", c.strain_row, 1e15);
  a.array("position", s.position, elements.vertices());
  a.array("position_low", s.position_low, elements.vertices());
  a.array("director", s.director, elements.edges());
  a.array("velocity", s.velocity, elements.vertices());
  a.array("twist_rate", s.twist_rate, elements.edges());
  a.array("axial_force", s.axial_force, elements.edges());
  a.array("turns", s.winding, cells);
  a.array("cell_place", c.cells, cells);
  a.array("cell_twist", c.twists, twists);
  if constexpr (Archive::reads) s.memory.resize(memory);
  for (std::size_t n = 0; n < memory; ++n) {
    a.array("memory_vertex_" + std::to_string(n), s.memory[n].vertex, elements.vertices());
    a.array("memory_edge_" + std::to_string(n), s.memory[n].edge, elements.edges());
  }
  a.array("strains", s.strains, strains);
  auto list = [&](std::size_t since, const char *count, const char *name, auto &array) {
    if (a.format_version < since) return;
    std::size_t size = array.size();
    whole(count, size, 1e15);
    a.array(name, array, size);
  };
  list(3, "remembered_actions", "support_actions", s.support_actions);
  list(4, "rods_in_contact", "contact_stiffness", s.contact_stiffness);
  if (a.format_version >= 5) exchangeContacts(a, s, whole);
  list(6, "junction_groups", "junction_axes", s.junction_axes);
  if (a.format_version < 7) return;
  exchangeBodies(a, s, whole);
  list(8, "joints", "joints", s.joints);
  list(9, "rods_that_touch_rods", "rod_contact_stiffness", s.rod_contact_stiffness);
  if (a.format_version >= 10) exchangePairs(a, s, whole);
  list(11, "tendon_numbers", "tendon_memory", s.tendon_memory);
}

/// Whole turns of cells that were others in the checkpoint: twists of vertices stay as they were, by cells or halves.
void carryTurns(const Simulation &run, const Contents &old, const std::vector<double> &places, State *state) {
  state->winding.assign(places.size(), 0.0);
  if (!countsTurns(*run.elements) || old.twists.size() != old.cells.size()) return;
  std::map<double, double> twist;
  for (std::size_t n = 0; n < old.cells.size(); ++n) twist[old.cells[n]] = old.twists[n];
  const std::vector<double> principal = cellTwists(run, *state);
  for (std::size_t r = 0; r < run.elements->rods.size(); ++r) {
    if (run.elements->measure[r] != Measure::angle) continue;
    for (int n = run.elements->rod_cells[r]; n < run.elements->rod_cells[r + 1]; ++n) {
      double expected = principal[n];
      if (const auto same = twist.find(places[n]); same != twist.end())
        expected = same->second;
      else if (std::fmod(places[n], 4) == 0 && twist.count(places[n] + 1) && twist.count(places[n] + 2))
        expected = twist[places[n] + 1] + twist[places[n] + 2];
      state->winding[n] = 2 * pi * std::round((expected - principal[n]) / (2 * pi));
    }
  }
}

/// After a change of the scene: axial forces are those of the strains, held vertices move with their supports, no
/// method remembers anything, and measure tan knows no whole turns.
void beginAnew(const Simulation &run, State *state, std::vector<std::string> *told) {
  for (std::size_t r = 0; r < run.elements->rods.size(); ++r) {
    if (run.elements->measure[r] == Measure::angle) continue;
    const auto begin = state->winding.begin() + run.elements->rod_cells[r],
               end = state->winding.begin() + run.elements->rod_cells[r + 1];
    if (std::all_of(begin, end, [](double turns) { return turns == 0; })) continue;
    std::fill(begin, end, 0.0);
    told->push_back("warning: rod '" + inOneLine(run.scene.rods[r].name) +
                    "' loses its whole turns of twist, which measure tan does not count");
  }
  state->memory.clear();
  state->strains.clear();
  state->support_actions.clear();
  state->contacts.clear();
  state->pairs.clear();
  std::fill(state->tendon_memory.begin(), state->tendon_memory.end(), 0.0);
  state->last_dt = state->dt_before = 0;
  const Configuration c = configurationOf(*state, run.scene, *run.elements, state->time);
  for (std::size_t r = 0; r < run.elements->rods.size(); ++r) {
    const RodRange &rod = run.elements->rods[r];
    for (int i = 0; i < rod.edges; ++i)
      state->axial_force[rod.first_edge + i] =
          run.scene.rods[r].material.axial_stiffness * c[Configuration::strain][rod.slot(i)];
  }
  for (const Support &s : run.scene.supports)
    if (s.holdsPosition())
      state->velocity[run.elements->rods[s.rod].first_vertex + s.vertex] =
          run.dynamic ? s.motion.velocityAt(state->time) : Vec3::Zero();
}

/// Supports that the vertex they hold is not at: the first step would move it there.
void tellJumps(const Simulation &run, const State &state, std::vector<std::string> *told) {
  for (const Support &s : run.scene.supports) {
    if (!s.holdsPosition()) continue;
    const Rod &rod = run.scene.rods[s.rod];
    const Vec3 place = rod.position[s.vertex] + s.motion.displacementAt(state.time);
    const double off = (state.position[run.elements->rods[s.rod].first_vertex + s.vertex] - place).norm();
    if (off <= 1e-6 * dimensionlessGroups(rod, run.scene.gravity).length) continue;
    std::ostringstream line;
    line << "warning: the support at vertex " << s.vertex << " of rod '" << inOneLine(rod.name) << "' is "
         << std::setprecision(3) << off << " m from where the checkpoint has the vertex: the first step moves it there";
    told->push_back(line.str());
  }
}

/// A file that is whole, but of no use to this run.
struct OtherRun : SceneError {
  using SceneError::SceneError;
};

/// Files of version 1: numbers without names in `loop`.
void readArrays1(const std::string &path, const Hdf5File &file, const Elements &elements, const std::string &integrator,
                 Contents *c) {
  State &s = c->state;
  auto array = [&](const std::string &name, auto &values, std::size_t rows) {
    using T = std::decay_t<decltype(values[0])>;
    std::vector<double> read;
    try {
      read = file.read(name, sizeof(T) / sizeof(double), rows);
    } catch (const SceneError &e) {
      throw OtherRun(std::string(e.what()) + "; restart with the scene that wrote the checkpoint");
    }
    values.resize(rows);
    std::copy(read.begin(), read.end(), reinterpret_cast<double *>(values.data()));
  };
  array("position", s.position, elements.vertices());
  array("position_low", s.position_low, elements.vertices());
  array("director", s.director, elements.edges());
  array("velocity", s.velocity, elements.vertices());
  array("twist_rate", s.twist_rate, elements.edges());
  array("axial_force", s.axial_force, elements.edges());
  array("turns", s.winding, elements.cell_slot.size());
  std::vector<double> loop = file.read("loop", 1);
  if (loop.size() != 10 && loop.size() != 11) throw DamagedCheckpoint(path + ": 'loop' is not that of a checkpoint");
  s.time = loop[0];
  s.step = std::int64_t(loop[1]);
  c->control = {loop[2], int(loop[3]), loop[4] != 0, loop[5], loop[6], loop[9]};
  double code = 0; // a number that stood for the name of an integrator
  for (const char letter : integrator == "statics" ? std::string("euler") : integrator)
    code = std::fmod(31 * code + letter, 1e9 + 7);
  if (loop[8] != code) return;
  s.last_dt = loop[7];
  if (loop.size() > 10) s.dt_before = loop[10];
  for (int k = 0; k < most_memory && file.has("memory_vertex_" + std::to_string(k)); ++k) {
    Rates &rates = s.memory.emplace_back();
    array("memory_vertex_" + std::to_string(k), rates.vertex, elements.vertices());
    array("memory_edge_" + std::to_string(k), rates.edge, elements.edges());
  }
  if (!file.has("strains")) return;
  s.strains = file.read("strains", 1);
  if (s.strains.size() % (4 * strainRow(elements)) != 0)
    throw OtherRun(path + ": 'strains' does not fit the scene; restart with the scene that wrote the checkpoint");
}
} // namespace

void writeCheckpoint(const std::string &path, const Simulation &run, const StepControl &control,
                     const RunFacts &facts) {
  const std::string part = path + ".part";
  std::error_code error;
  try {
    CheckpointWriter out(part);
    out.text("format", checkpoint_format);
    out.number("format_version", checkpoint_version);
    out.text("mode", facts.dynamic ? "dynamic" : "static");
    out.text("integrator", facts.integrator);
    out.number("dt", facts.dt);
    out.text("topology_hash", facts.topology_hash);
    out.text("scene_hash", facts.scene_hash);
    for (const auto &[name, n] : {std::pair{"rods", int(run.scene.rods.size())},
                                  {"vertices", run.elements->vertices()},
                                  {"edges", run.elements->edges()}})
      out.number(name, n);
    out.longText("facts", textOf(facts.facts));
    const bool turns = countsTurns(*run.elements);
    const Contents contents{run.state, control, cellPlaces(*run.elements),
                            turns ? cellTwists(run, run.state) : std::vector<double>(), strainRow(*run.elements)};
    exchange(out, contents, *run.elements);
    out.finish();
  } catch (const SceneError &) {
    std::filesystem::remove(part, error);
    throw WriteError(path + ": the checkpoint cannot be written; is the disk full?");
  }
  std::filesystem::rename(part, path, error);
  if (error) throw WriteError(path + ": cannot be written");
}

namespace {

/// What a checkpoint has, and how the run that wrote it was other than this one.
struct Found {
  Contents contents;
  std::vector<std::string> lines; ///< to be told
  bool switches = false;          ///< between statics and dynamics
  bool same_dt = true, same_method = true;
  int other = 0; ///< the furthest kind of change (RunFacts::Kind)
};

/// \throws OtherRun where the file is of no use to this run
void readWithFacts(const std::string &path, const Hdf5File &file, const Simulation &run, const RunFacts &facts,
                   Found *f) {
  const Elements &elements = *run.elements;
  CheckpointReader in(path, file);
  std::string read, mode, integrator, scene_hash, topology_hash, text;
  in.text("format", read);
  if (read != checkpoint_format) in.fail("is no checkpoint");
  in.format_version = in.count("format_version", 1e9);
  if (in.format_version < 2 || in.format_version > checkpoint_version)
    throw OtherRun(path + ": is of format " + std::to_string(in.format_version) +
                   ", and this version reads formats 1 to " + std::to_string(checkpoint_version) +
                   "; take a newer one");
  in.text("mode", mode);
  in.text("integrator", integrator);
  double dt;
  in.number("dt", dt);
  in.text("topology_hash", topology_hash);
  in.text("scene_hash", scene_hash);
  const std::size_t rods = in.count("rods", 1e12), vertices = in.count("vertices", 1e12),
                    edges = in.count("edges", 1e12);
  if (topology_hash != facts.topology_hash || vertices != std::size_t(elements.vertices()) ||
      edges != std::size_t(elements.edges()))
    throw OtherRun(path + ": is of another topology, " + std::to_string(rods) + " rods with " +
                   std::to_string(vertices) + " vertices and " + std::to_string(edges) + " edges, and the scene has " +
                   std::to_string(run.scene.rods.size()) + " with " + std::to_string(elements.vertices()) + " and " +
                   std::to_string(elements.edges()) +
                   "; restart with the scene that wrote the checkpoint, or one that only changes loads, supports, "
                   "materials and options" +
                   (run.scene.bodies.empty() ? "" : "; junctions, the masses of bodies and what is tied to them stay"));
  in.longText("facts", text);
  exchange(in, f->contents, elements);
  if (!in.finish()) f->lines.push_back(path + ": has no checksum: its data are taken as they are");
  f->switches = mode != (facts.dynamic ? "dynamic" : "static");
  const FactValues old = factsOf(text), now = factsOf(textOf(facts.facts));
  if (areInAnotherOrder(old, now))
    throw OtherRun(path +
                   ": has the same rods in another order; write them in the scene in the order of the checkpoint");
  const std::pair<std::string, std::string> adapt{"option", "dt_adapt"};
  f->same_dt =
      dt == facts.dt && old.count(adapt) == now.count(adapt) && (!now.count(adapt) || old.at(adapt) == now.at(adapt));
  f->same_method = integrator == facts.integrator && f->contents.strain_row == strainRow(elements);
  const std::size_t before = f->lines.size();
  f->other = compareFacts(old, now, !f->switches, &f->lines);
  if (scene_hash != facts.scene_hash && f->lines.size() == before)
    f->lines.push_back("the text of the scene has changed since the checkpoint, but not what it says");
}

/// What the found state needs to go on in this run.
void adapt(Found *f, const std::vector<double> &places, const Simulation &run, const RunFacts &facts) {
  State &s = f->contents.state;
  StepControl &control = f->contents.control;
  const std::vector<double> &cells = f->contents.cells;
  const bool other_cells = !cells.empty() && cells != places;
  if (cells.empty() && s.winding.size() != places.size()) s.winding.assign(places.size(), 0.0);
  const std::size_t rods = run.elements->rods.size(),
                    sticks = std::size_t(run.scene.firstMemory(int(run.scene.tendons.size())));
  for (auto stiffness : {&State::contact_stiffness, &State::rod_contact_stiffness})
    if ((s.*stiffness).size() < rods) (s.*stiffness).clear();
  if (s.contacts.size() != rods) s.contacts.clear();
  if (s.pairs.size() != rods) s.pairs.clear();
  s.junction_axes.resize(run.elements->groups, {Vec3::UnitX(), Vec3::UnitY()});
  for (Rates &rates : s.memory) rates.body.resize(run.scene.bodies.size());
  s.joints.resize(run.scene.joints.size());
  s.tendon_memory.resize(std::max(s.tendon_memory.size(), sticks));
  if (!f->same_method) {
    s.memory.clear();
    s.strains.clear();
    s.support_actions.clear();
    s.last_dt = s.dt_before = 0;
  }
  if (f->switches) {
    s.time = 0;
    s.step = 0;
    std::fill(s.velocity.begin(), s.velocity.end(), Vec3::Zero());
    std::fill(s.twist_rate.begin(), s.twist_rate.end(), 0.0);
    control = {};
    f->lines.push_back(facts.dynamic ? "the state of statics is the start of dynamics: at rest, at time 0"
                                     : "the state of dynamics is the start of statics, with the load factor from 0");
  }
  if (!f->same_dt) control.dt = 0; // what is asked for now
  if (other_cells) carryTurns(run, f->contents, places, &s);
  if (f->other != int(RunFacts::Kind::scene) && !other_cells && !f->switches) return;
  beginAnew(run, &s, &f->lines);
  control.energy = NAN;
  tellJumps(run, s, &f->lines);
}

} // namespace

bool readCheckpoint(const std::string &path, Simulation *run, StepControl *control, const RunFacts &facts,
                    std::vector<std::string> *told) {
  Found f;
  try {
    const Hdf5File file = Hdf5File::open(path);
    if (file.text("format") || !file.has("loop")) {
      readWithFacts(path, file, *run, facts, &f);
    } else {
      readArrays1(path, file, *run->elements, facts.integrator, &f.contents);
      f.lines.push_back(path + ": is of an earlier version, without checksum and without the scene it is of: that of "
                               "this run has to be the same");
    }
  } catch (const DamagedCheckpoint &) {
    throw;
  } catch (const OtherRun &) {
    throw;
  } catch (const SceneError &e) {
    throw DamagedCheckpoint(e.what());
  }
  const Contents &c = f.contents;
  if (!std::isfinite(c.state.time) || !(c.state.time >= 0) || !std::isfinite(c.control.dt))
    throw DamagedCheckpoint(path + ": its time or step is no number");
  adapt(&f, cellPlaces(*run->elements), *run, facts);
  run->state = std::move(f.contents.state);
  *control = f.contents.control;
  told->insert(told->end(), f.lines.begin(), f.lines.end());
  return f.other > 0 || f.switches;
}

} // namespace tendril
