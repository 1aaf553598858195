#include "tendril/io/checkpoint.hpp"

#include "tendril/energy/edge.hpp"
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

constexpr const char *format = "tendril-checkpoint";
constexpr int version = 3;     ///< 1 had no names, hashes and checksum, 2 no actions of supports
constexpr int most_memory = 8; ///< more than any integrator remembers

/// Every step is a one-to-one map of the sum, so that no single change of what is added leaves it as it was (after
/// FNV-1a by words).
class Digest {
public:
  void add(const void *data, std::size_t bytes) {
    const char *p = static_cast<const char *>(data);
    for (std::size_t i = 0; i < bytes; i += 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, p + i, std::min<std::size_t>(8, bytes - i));
      sum_ = (sum_ ^ word) * 0x100000001b3U;
      sum_ ^= sum_ >> 32;
    }
  }
  void add(const std::string &text) {
    const std::uint64_t size = text.size();
    add(&size, sizeof size);
    add(text.data(), text.size());
  }
  std::string hex() const {
    char text[17];
    std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(sum_));
    return text;
  }

private:
  std::uint64_t sum_ = 0xcbf29ce484222325U;
};

std::string hashOf(const std::string &text) {
  Digest d;
  d.add(text);
  return d.hex();
}

/// As many digits as bring the number back.
std::string textOf(double x) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, x).ptr};
}
std::string textOf(const Vec3 &x) { return "[" + textOf(x[0]) + ", " + textOf(x[1]) + ", " + textOf(x[2]) + "]"; }

std::string textOf(const Material &m) {
  return "linear_density " + textOf(m.linear_density) + ", linear_rotational_inertia " +
         textOf(m.linear_rotational_inertia) + ", axial_stiffness " + textOf(m.axial_stiffness) +
         ", torsional_stiffness " + textOf(m.torsional_stiffness) + ", flexural_stiffness [" +
         textOf(m.flexural_stiffness[0]) + ", " + textOf(m.flexural_stiffness[1]) + "], damping " +
         textOf(m.mass_damping_coefficient) + " and " + textOf(m.stiffness_damping_coefficient);
}

std::string textOf(const Support &support) {
  std::string text = nameOf(support.kind);
  if (support.holdsTwist())
    text += " of tangent " + textOf(support.frame.tangent) + " and director " + textOf(support.frame.director);
  const Motion &m = support.motion;
  if (m.table.empty())
    return m.moves() ? text + ", velocity " + textOf(m.velocity) + ", angular velocity " + textOf(m.angular_velocity)
                     : text;
  std::string table;
  for (const Motion::Key &k : m.table) table += textOf(k.time) + textOf(k.displacement) + textOf(k.rotation);
  return text + ", motion by a table of " + std::to_string(m.table.size()) + " rows, #" + hashOf(table);
}

class Writer {
public:
  static constexpr bool reads = false;
  static constexpr std::size_t format_version = version;
  Writer(const std::string &path) : file_(Hdf5File::create(path)) {}
  void number(const char *name, double value) {
    file_.writeAttribute(std::string(name), value);
    digest_.add(name);
    digest_.add(&value, sizeof value);
  }
  void text(const char *name, const std::string &value) {
    file_.writeAttribute(std::string(name), value);
    digest_.add(name);
    digest_.add(value);
  }
  void longText(const char *name, const std::string &value) {
    file_.writeText(name, value);
    digest_.add(name);
    digest_.add(value);
  }
  void array(const std::string &name, const double *values, std::size_t rows, hsize_t columns) {
    std::vector<hsize_t> shape{rows};
    if (columns > 1) shape.push_back(columns);
    file_.write(name, shape, values);
    digest_.add(name);
    digest_.add(values, rows * columns * sizeof(double));
  }
  template <class T> void array(const std::string &name, const std::vector<T> &values, std::size_t rows) {
    array(name, reinterpret_cast<const double *>(values.data()), rows, sizeof(T) / sizeof(double));
  }
  void finish() {
    file_.writeAttribute("checksum", digest_.hex());
    file_.close();
  }

private:
  Hdf5File file_;
  Digest digest_;
};

/// Takes nothing on trust: sizes are those that the caller asks for, and no more than the file can hold.
class Reader {
public:
  static constexpr bool reads = true;
  std::size_t format_version = 0; ///< of the file
  Reader(const std::string &path, const Hdf5File &file) : path_(path), file_(file) {
    std::error_code none;
    bytes_ = std::filesystem::file_size(path, none);
  }
  [[noreturn]] void fail(const std::string &what) const {
    throw DamagedCheckpoint(path_ + ": " + what + "; take another checkpoint");
  }
  void number(const char *name, double &value) {
    const std::optional<double> read = file_.number(name);
    if (!read) fail(std::string("has no number '") + name + "'");
    value = *read;
    digest_.add(name);
    digest_.add(&value, sizeof value);
  }
  /// A whole number up to a bound.
  std::size_t count(const char *name, double most) {
    double value;
    number(name, value);
    if (!(value >= 0 && value <= most && value == std::floor(value)))
      fail(std::string("'") + name + "' is " + textOf(value));
    return std::size_t(value);
  }
  void text(const char *name, std::string &value) {
    const std::optional<std::string> read = file_.text(name);
    if (!read) fail(std::string("has no text '") + name + "'");
    value = *read;
    digest_.add(name);
    digest_.add(value);
  }
  void longText(const char *name, std::string &value) {
    value = file_.readText(name, bytes_);
    digest_.add(name);
    digest_.add(value);
  }
  template <class T> void array(const std::string &name, std::vector<T> &values, std::size_t rows) {
    constexpr hsize_t columns = sizeof(T) / sizeof(double);
    if (rows * sizeof(T) > bytes_) fail("is too short for '" + name + "'");
    const std::vector<double> read = file_.read(name, columns, rows);
    values.resize(rows);
    std::copy(read.begin(), read.end(), reinterpret_cast<double *>(values.data()));
    digest_.add(name);
    digest_.add(read.data(), read.size() * sizeof(double));
  }
  /// Whether there was a checksum.
  bool finish() const {
    const std::optional<std::string> sum = file_.text("checksum");
    if (sum && *sum != digest_.hex()) fail("is damaged: its checksum is not that of its data");
    return sum.has_value();
  }

private:
  std::string path_;
  const Hdf5File &file_;
  Digest digest_;
  std::uintmax_t bytes_ = 0;
};

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

template <class Archive, class AnyContents> void exchange(Archive &a, AnyContents &c, const Elements &elements) {
  auto whole = [&](const char *name, auto &value, [[maybe_unused]] double most) {
    if constexpr (Archive::reads)
      value = std::decay_t<decltype(value)>(a.count(name, most));
    else
      a.number(name, double(value));
  };
  auto &s = c.state;
  auto &k = c.control;
  a.number("time", s.time);
  whole("step", s.step, 1e15);
  a.number("next_dt", k.dt);
  whole("good_steps", k.good, 2e9);
  whole("stable", k.stable, 1);
  a.number("step_error", k.error);
  a.number("error_sum", k.error_sum);
  a.number("rounding_sum", k.rounding_sum);
  a.number("energy", k.energy);
  a.number("last_dt", s.last_dt);
  a.number("dt_before", s.dt_before);
  std::size_t cells = c.cells.size(), twists = c.twists.size(), memory = s.memory.size(), strains = s.strains.size();
  const double vertices = elements.vertices();
  whole("cells", cells, 3 * vertices);
  whole("cells_with_twist", twists, 3 * vertices);
  whole("remembered_rates", memory, most_memory);
  whole("remembered_strains", strains, 1e15);
  whole("strain_row", c.strain_row, 1e15);
  a.array("position", s.position, elements.vertices());
  a.array("position_low", s.position_low, elements.vertices());
  a.array("director", s.director, elements.edges());
  a.array("velocity", s.velocity, elements.vertices());
  a.array("twist_rate", s.twist_rate, elements.edges());
  a.array("axial_force", s.axial_force, elements.edges());
  a.array("turns", s.turns, cells);
  a.array("cell_place", c.cells, cells);
  a.array("cell_twist", c.twists, twists);
  if constexpr (Archive::reads) s.memory.resize(memory);
  for (std::size_t n = 0; n < memory; ++n) {
    a.array("memory_vertex_" + std::to_string(n), s.memory[n].vertex, elements.vertices());
    a.array("memory_edge_" + std::to_string(n), s.memory[n].edge, elements.edges());
  }
  a.array("strains", s.strains, strains);
  if (a.format_version < 3) return;
  std::size_t actions = s.support_actions.size();
  whole("remembered_actions", actions, 1e15);
  a.array("support_actions", s.support_actions, actions);
}

using Kind = RunFacts::Kind;
constexpr const char *kinds[] = {"option", "load", "scene", "start"};
constexpr const char *order_of_rods = "order of the rods", *names_of_rods = "names of the rods";

std::string joined(const std::vector<RunFacts::Fact> &facts) {
  std::string text;
  for (const RunFacts::Fact &f : facts) text += std::string(kinds[int(f.kind)]) + '\t' + f.name + '\t' + f.value + '\n';
  return text;
}

using Values = std::map<std::pair<std::string, std::string>, std::string>; ///< by kind and name
Values valuesOf(const std::string &text) {
  Values values;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size()), tab = text.find('\t', at),
                      second = text.find('\t', tab + 1);
    if (tab < end && second < end) {
      std::string &value = values[{text.substr(at, tab - at), text.substr(tab + 1, second - tab - 1)}];
      value += (value.empty() ? "" : " and ") + text.substr(second + 1, end - second - 1);
    }
    at = end + 1;
  }
  return values;
}

/// Lines on what is other; the furthest kind of it: 0 for options and nothing, 1 for loads, 2 for anything else.
int compare(const Values &before, const Values &now, bool options, std::vector<std::string> *told) {
  constexpr std::size_t most = 20;
  int kind = 0;
  std::vector<std::string> lines;
  Values all = before;
  all.insert(now.begin(), now.end());
  for (const auto &[key, any] : all) {
    const auto old = before.find(key), present = now.find(key);
    const bool gone = present == now.end(), added = old == before.end();
    if (!gone && !added && old->second == present->second) continue;
    if (key.first == kinds[int(Kind::option)] && (!options || gone || added)) continue; // an option of another method
    if (key.first == kinds[int(Kind::start)]) {
      lines.push_back("changed since the checkpoint, but only for the start, so that it is ignored: " + key.second +
                      ": " + (added ? "none" : old->second) + " -> " + (gone ? "none" : present->second));
      continue;
    }
    if (added && (key.second == order_of_rods || key.second == names_of_rods))
      continue; // earlier versions did not keep it
    for (int k = 0; k < 3; ++k)
      if (key.first == kinds[k]) kind = std::max(kind, k);
    const bool is_long = any.find('#') != std::string::npos;
    const std::string value = is_long ? "" : ": " + any;
    lines.push_back(gone      ? "no longer there: " + key.second + value
                    : added   ? "new since the checkpoint: " + key.second + value
                    : is_long ? "changed since the checkpoint: " + key.second
                              : "changed since the checkpoint: " + key.second + ": " + old->second + " -> " +
                                    present->second);
  }
  for (std::size_t k = 0; k < lines.size() && k < most; ++k) told->push_back(lines[k]);
  if (lines.size() > most) told->push_back("... and " + std::to_string(lines.size() - most) + " more changes");
  return kind;
}

/// Whole turns of cells that were others in the checkpoint: the twist of a vertex along the rod stays what it was, by
/// whole cell or halves.
void carryTurns(const Simulation &run, const Contents &old, const std::vector<double> &places, State *state) {
  state->turns.assign(places.size(), 0.0);
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
      state->turns[n] = 2 * pi * std::round((expected - principal[n]) / (2 * pi));
    }
  }
}

/// After a change of the scene: axial forces are those of the strains, held vertices move with their supports, no
/// method remembers anything, and measure tan knows no whole turns.
void beginAnew(const Simulation &run, State *state, std::vector<std::string> *told) {
  for (std::size_t r = 0; r < run.elements->rods.size(); ++r) {
    if (run.elements->measure[r] == Measure::angle) continue;
    const auto begin = state->turns.begin() + run.elements->rod_cells[r],
               end = state->turns.begin() + run.elements->rod_cells[r + 1];
    if (std::all_of(begin, end, [](double turns) { return turns == 0; })) continue;
    std::fill(begin, end, 0.0);
    told->push_back("warning: rod '" + inOneLine(run.scene.rods[r].name) +
                    "' loses its whole turns of twist, which measure tan does not count");
  }
  state->memory.clear();
  state->strains.clear();
  state->support_actions.clear();
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
  array("turns", s.turns, elements.cell_slot.size());
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

RunFacts::RunFacts(const Scene &scene, const LoopSettings &settings, const std::string &text)
    : dynamic(settings.dynamic), integrator(settings.dynamic ? settings.integrator.name : "statics"), dt(settings.dt),
      scene_hash(hashOf(text)) {
  auto add = [&](Kind kind, const std::string &name, const std::string &value) {
    facts.push_back({kind, inOneLine(name), inOneLine(value)});
  };
  auto option = [&](const char *name, const auto &value) {
    if constexpr (std::is_convertible_v<decltype(value), std::string>)
      add(Kind::option, name, value);
    else
      add(Kind::option, name, textOf(double(value)));
  };
  if (dynamic) {
    option("dt", dt);
    option("integrator", integrator);
    if (integrator == "generalized_alpha") option("rho_inf", settings.integrator.rho_inf);
    option("dt_adapt", settings.adapt == Adaptation::error ? "error" : "none");
    if (settings.adapt == Adaptation::error) {
      option("dt_rtol", settings.dt_rtol);
      option("dt_atol", settings.dt_atol);
      option("dt_max", settings.dt_max);
    }
    option("output_interval", settings.output_interval);
  } else {
    option("load_steps", std::to_string(std::lround(1 / dt)));
  }
  option("stretch", settings.mixed ? "mixed" : "primal");
  option("retraction", settings.solve.retraction == RetractionKind::length ? "length" : "additive");
  option("hessian", settings.hessian == HessianKind::exact ? "exact" : "gauss_newton");
  option("line_search", settings.solve.line_search == LineSearchKind::energy  ? "energy"
                        : settings.solve.line_search == LineSearchKind::wolfe ? "wolfe"
                                                                              : "residual");
  option("quasi_newton", settings.solve.quasi_newton);
  option("rounding_tolerance", settings.solve.rounding_tolerance);

  add(Kind::scene, "gravity", textOf(scene.gravity));
  if (!scene.rotation.angular_velocity.isZero(0))
    add(Kind::scene, "rotation", textOf(scene.rotation.angular_velocity) + " about " + textOf(scene.rotation.centre));
  Digest topology, order, set;
  std::vector<std::string> names;
  for (const Rod &rod : scene.rods) {
    names.push_back(rod.name);
    order.add(rod.name + "\n");
    std::string start = rod.initial_velocity.isZero(0) ? "" : "velocity " + textOf(rod.initial_velocity);
    if (rod.initial_turns != 0) start += (start.empty() ? "turns " : ", turns ") + textOf(rod.initial_turns);
    if (!start.empty()) add(Kind::start, "start of rod '" + rod.name + "'", start);
    const int sizes[] = {rod.vertices(), rod.edges(), int(rod.closed)};
    topology.add(sizes, sizeof sizes);
    const std::string of = " of rod '" + rod.name + "'";
    add(Kind::scene, "material" + of, textOf(rod.material));
    add(Kind::scene, "law" + of,
        std::string(rod.measure == Measure::tan ? "measure tan" : "measure angle") +
            (rod.energy == Energy::seed ? ", energy seed" : ", energy classical") +
            (rod.gravity ? "" : ", without gravity"));
    Digest shape;
    shape.add(rod.position.data(), rod.position.size() * sizeof(Vec3));
    shape.add(rod.director.data(), rod.director.size() * sizeof(Vec3));
    shape.add(rod.natural == Rod::Natural::given ? textOf(rod.natural_strain) : "");
    add(Kind::scene, "shape at rest" + of, "#" + shape.hex());
  }
  topology_hash = topology.hex();
  std::sort(names.begin(), names.end());
  for (const std::string &name : names) set.add(name + "\n");
  add(Kind::scene, order_of_rods, "#" + order.hex());
  add(Kind::scene, names_of_rods, "#" + set.hex());
  auto at = [&](const char *what, int place, int rod) {
    return std::string(what) + std::to_string(place) + " of rod '" + scene.rods[rod].name + "'";
  };
  for (const Support &s : scene.supports) add(Kind::scene, at("support at vertex ", s.vertex, s.rod), textOf(s));
  for (const NodalForce &f : scene.forces) add(Kind::load, at("force on vertex ", f.vertex, f.rod), textOf(f.force));
  for (const EdgeMoment &m : scene.moments) {
    if (m.torque != 0) add(Kind::load, at("torque on edge ", m.edge, m.rod), textOf(m.torque));
    if (!m.moment.isZero(0)) add(Kind::load, at("moment on edge ", m.edge, m.rod), textOf(m.moment));
  }
}

void writeCheckpoint(const std::string &path, const Simulation &run, const StepControl &control,
                     const RunFacts &facts) {
  const std::string part = path + ".part";
  std::error_code error;
  try {
    Writer out(part);
    out.text("format", format);
    out.number("format_version", version);
    out.text("mode", facts.dynamic ? "dynamic" : "static");
    out.text("integrator", facts.integrator);
    out.number("dt", facts.dt);
    out.text("topology_hash", facts.topology_hash);
    out.text("scene_hash", facts.scene_hash);
    for (const auto &[name, n] : {std::pair{"rods", int(run.scene.rods.size())},
                                  {"vertices", run.elements->vertices()},
                                  {"edges", run.elements->edges()}})
      out.number(name, n);
    out.longText("facts", joined(facts.facts));
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

bool readCheckpoint(const std::string &path, Simulation *run, StepControl *control, const RunFacts &facts,
                    std::vector<std::string> *told) {
  const Elements &elements = *run->elements;
  Contents c;
  std::vector<std::string> lines;
  bool switches = false, same_dt = true, same_method = true;
  int other = 0;
  const std::vector<double> places = cellPlaces(elements);
  try {
    const Hdf5File file = Hdf5File::open(path);
    if (!file.text("format") && file.has("loop")) {
      readArrays1(path, file, elements, facts.integrator, &c);
      lines.push_back(path + ": is of an earlier version, without checksum and without the scene it is of: that of "
                             "this run has to be the same");
    } else {
      Reader in(path, file);
      std::string read, mode, integrator, scene_hash, topology_hash, text;
      in.text("format", read);
      if (read != format) in.fail("is no checkpoint");
      in.format_version = in.count("format_version", 1e9);
      if (in.format_version < 2 || in.format_version > version)
        throw OtherRun(path + ": is of format " + std::to_string(in.format_version) +
                       ", and this version reads formats 1 to " + std::to_string(version) + "; take a newer one");
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
                       std::to_string(vertices) + " vertices and " + std::to_string(edges) +
                       " edges, and the scene has " + std::to_string(run->scene.rods.size()) + " with " +
                       std::to_string(elements.vertices()) + " and " + std::to_string(elements.edges()) +
                       "; restart with the scene that wrote the checkpoint, or one that only changes loads, supports, "
                       "materials and options");
      in.longText("facts", text);
      exchange(in, c, elements);
      if (!in.finish()) lines.push_back(path + ": has no checksum: its data are taken as they are");
      switches = mode != (facts.dynamic ? "dynamic" : "static");
      const Values old = valuesOf(text), now = valuesOf(joined(facts.facts));
      const std::pair<std::string, std::string> order{kinds[int(Kind::scene)], order_of_rods},
          names{kinds[int(Kind::scene)], names_of_rods};
      if (old.count(order) && old.at(order) != now.at(order) && old.at(names) == now.at(names))
        throw OtherRun(path +
                       ": has the same rods in another order; write them in the scene in the order of the checkpoint");
      const std::pair<std::string, std::string> adapt{kinds[int(Kind::option)], "dt_adapt"};
      same_dt = dt == facts.dt && old.count(adapt) == now.count(adapt) &&
                (!now.count(adapt) || old.at(adapt) == now.at(adapt));
      same_method = integrator == facts.integrator && c.strain_row == strainRow(elements);
      const std::size_t before = lines.size();
      other = compare(old, now, !switches, &lines);
      if (scene_hash != facts.scene_hash && lines.size() == before)
        lines.push_back("the text of the scene has changed since the checkpoint, but not what it says");
    }
  } catch (const DamagedCheckpoint &) {
    throw;
  } catch (const OtherRun &) {
    throw;
  } catch (const SceneError &e) {
    throw DamagedCheckpoint(e.what());
  }
  if (!std::isfinite(c.state.time) || !(c.state.time >= 0) || !std::isfinite(c.control.dt))
    throw DamagedCheckpoint(path + ": its time or step is no number");
  State &s = c.state;
  const bool other_cells = !c.cells.empty() && c.cells != places;
  if (c.cells.empty() && s.turns.size() != places.size()) s.turns.assign(places.size(), 0.0);
  if (!same_method) {
    s.memory.clear();
    s.strains.clear();
    s.support_actions.clear();
    s.last_dt = s.dt_before = 0;
  }
  if (switches) {
    s.time = 0;
    s.step = 0;
    std::fill(s.velocity.begin(), s.velocity.end(), Vec3::Zero());
    std::fill(s.twist_rate.begin(), s.twist_rate.end(), 0.0);
    c.control = {};
    lines.push_back(facts.dynamic ? "the state of statics is the start of dynamics: at rest, at time 0"
                                  : "the state of dynamics is the start of statics, with the load factor from 0");
  }
  if (!same_dt) c.control.dt = 0; // what is asked for now
  if (other_cells) carryTurns(*run, c, places, &s);
  if (other == int(Kind::scene) || other_cells || switches) {
    beginAnew(*run, &s, &lines);
    c.control.energy = NAN;
    tellJumps(*run, s, &lines);
  }
  run->state = std::move(s);
  *control = c.control;
  told->insert(told->end(), lines.begin(), lines.end());
  return other > 0 || switches;
}

} // namespace tendril
