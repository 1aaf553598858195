#include "tendril/io/options.hpp"

#include "tendril/io/yaml.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <sstream>

namespace tendril {
namespace {

std::string joined(const std::vector<std::string> &words) {
  std::string text;
  for (const std::string &w : words) {
    if (!text.empty()) text += ',';
    text += w;
  }
  return text;
}

/// An option of ours. Where `fallback` begins with a bracket it is a description, not a value.
struct Entry {
  std::string name, meaning, fallback;
};

const std::vector<Entry> &entries() {
  static const std::vector<Entry> list = [] {
    std::vector<Entry> l{
        {"scene", "scene file (YAML)", "(required)"},
        {"mode", "dynamic: steps in time; static: steps in load to an equilibrium", "(from the scene) dynamic"},
        {"dt", "time step [s]; chosen where -accuracy is given", "(from the scene) 0.01"},
        {"integrator", integratorMeanings(), "euler"},
        {"rho_inf", "generalized_alpha: what is left of the highest frequencies after a step, 0 to 1", "0.8"},
        {"dt_adapt", "none: steps of -dt; error: as long as the estimated error of a step allows, beginning with -dt (dynamic)", "none"},
        {"dt_rtol", "-dt_adapt error: error of a step allowed, relative to what it moves", "1e-3"},
        {"dt_atol", "-dt_adapt error: and in addition, relative to the length of the rod (twists in rad)", "1e-6"},
        {"dt_max", "-dt_adapt error: largest step [s]", "(none)"},
        {"dt_min", "smallest step after rejections [s, or load factor]", "(dt/1024)"},
        {"t_end", "end time [s]", "(from the scene) 1"},
        {"load_steps", "equal steps of the load factor from 0 to 1 (static)", "(from the scene) 1"},
        {"continuation", "load: steps of the load factor; arclength: along the path of equilibria, through limit points (static)", "load"},
        {"arclength_steps", "most steps along the path (-continuation arclength)", "200"},
        {"bifurcation", "where stability is lost between load steps: off, locate (find the critical load and go on), or stop there (static)", "locate"},
        {"gravity", "acceleration of gravity, e.g. 0,-9.81,0 [m/s^2]", "(from the scene)"},
        {"output_dir", "folder for the results", "out"},
        {"output_interval", "time between frames [s]; steps end at its multiples, shorter than dt where it is no divisor; 0: every step", "0"},
        {"checkpoint_interval", "steps between checkpoints; 0: only at the end", "0"},
        {"restart", "checkpoint of the same scene to go on from, to the same bits; the results go to another folder", "(none)"},
        {"output_fields",
         "fields of a frame besides the position: all for " + joined(TrajectoryWriter::fieldNames()) + "; by name also " +
             joined(TrajectoryWriter::derivedFieldNames()),
         "all"},
        {"error_estimate",
         "solve statics again with half the edge length and tell the estimated error; in dynamics tell that in time, where the integrator leaves it", "false"},
        {"accuracy", "largest relative error: chooses the edges of every rod, and in dynamics -dt (or -dt_rtol and -dt_atol), so that the estimate is below",
         "(edges from the scene)"},
        {"accuracy_of",
         "whose error: position (the largest, over the rod's length), tip (over the rod's length), or energy (elastic); in dynamics root mean square in time",
         "position"},
        {"rounding_tolerance", "where rounding stops Newton: what is left of the answer, over what the step or its loads move, at most", "1e-3"},
        {"retraction", "how positions move: additive (straight), or length (keeping the linearised lengths of the edges)", "length"},
        {"stretch", "axial force: primal (from the strain), or mixed (an unknown of its own)", "mixed"},
        {"hessian", "exact, or gauss_newton (without second derivatives of the strains; for comparison)", "exact"},
    };
    for (const auto &[name, meaning] : rodOverrides()) l.push_back({"rod_" + name, meaning + ", for every rod", "(from the scene)"});
    return l;
  }();
  return list;
}

[[noreturn]] void fail(const std::string &option, const std::string &message) { throw SceneError("option -" + option + ": " + message); }

/// Our options as text.
class Texts {
public:
  PetscErrorCode read() {
    char text[PETSC_MAX_PATH_LEN];
    PetscBool set;
    PetscFunctionBeginUser;
    PetscOptionsBegin(PETSC_COMM_WORLD, "", "Options of tendril", "docs/user.md");
    for (const Entry &e : entries()) {
      PetscCall(PetscOptionsString(("-" + e.name).c_str(), e.meaning.c_str(), "", e.fallback.c_str(), text, sizeof text, &set));
      if (set) given_[e.name] = text;
    }
    PetscOptionsEnd();
    for (const auto &[name, text_given] : given_)
      if (text_given.empty() && name != "error_estimate") fail(name, "needs a value");
    PetscFunctionReturn(0);
  }

  bool has(const std::string &name) const { return given_.count(name) > 0; }
  const std::string &at(const std::string &name) const { return given_.at(name); }

  /// Given alone, it is true.
  bool flag(const std::string &name) const {
    if (at(name).empty()) return true;
    const std::string word = oneOf(name, {"true", "false", "1", "0"});
    return word == "true" || word == "1";
  }

  double number(const std::string &name) const {
    const std::vector<double> v = numbers(name);
    if (v.size() != 1) fail(name, "needs one number, found '" + at(name) + "'");
    return v[0];
  }

  int count(const std::string &name) const {
    const double n = number(name);
    if (!(n >= 1 && n <= 1e9 && n == std::floor(n))) fail(name, "must be a whole number of at least 1, found '" + at(name) + "'");
    return int(n);
  }

  double positive(const std::string &name) const {
    const double value = number(name);
    if (!(value > 0)) fail(name, "must be greater than zero, found '" + at(name) + "'");
    return value;
  }

  std::vector<double> numbers(const std::string &name) const {
    std::vector<double> values;
    std::istringstream in(at(name));
    for (std::string word; std::getline(in, word, ',');) {
      std::size_t used = 0;
      double value = 0;
      try {
        value = std::stod(word, &used);
      } catch (const std::exception &) {}
      if (used == 0 || used != word.size()) fail(name, "'" + word + "' is not a number");
      if (!std::isfinite(value)) fail(name, "must be finite, found '" + word + "'");
      values.push_back(value);
    }
    return values;
  }

  std::string oneOf(const std::string &name, const std::vector<std::string> &choices) const {
    const std::string &value = at(name);
    if (std::find(choices.begin(), choices.end(), value) != choices.end()) return value;
    std::string all;
    for (const std::string &c : choices) all += (all.empty() ? "" : ", ") + c;
    const std::string near = closest(value, choices);
    fail(name, "must be one of " + all + "; found '" + value + "'" + (near.empty() ? "" : "; did you mean '" + near + "'?"));
  }

private:
  std::map<std::string, std::string> given_;
};

std::set<std::string> readFields(const Texts &texts) {
  const auto &names = TrajectoryWriter::fieldNames(), &derived = TrajectoryWriter::derivedFieldNames();
  std::set<std::string> fields;
  std::istringstream in(texts.has("output_fields") ? texts.at("output_fields") : "all");
  for (std::string word; std::getline(in, word, ',');) {
    if (word == "all")
      fields.insert(names.begin(), names.end());
    else if (std::find(names.begin(), names.end(), word) != names.end() || std::find(derived.begin(), derived.end(), word) != derived.end())
      fields.insert(word);
    else
      fail("output_fields", "there is no field '" + word + "'; choose from all," + joined(names) + "," + joined(derived));
  }
  return fields;
}

/// Prefixes of PETSc's options that are asked for only when the program ends.
constexpr const char *late_options[] = {"log_", "options_", "malloc", "help", "on_error"};

bool isOptionName(const char *word) { return word[0] == '-' && (std::isalpha(static_cast<unsigned char>(word[1])) || word[1] == '-'); }

} // namespace

PetscErrorCode readOptions(int argc, char **argv, Options *o) {
  PetscBool set;
  PetscFunctionBeginUser;
  for (int i = 1; i < argc; ++i)
    if (!isOptionName(argv[i]) && (i == 1 || !isOptionName(argv[i - 1])))
      throw SceneError(std::string("command line: '") + argv[i] + "' belongs to no option; options begin with - and take one value (lists without blanks)");
  Texts texts;
  PetscCall(texts.read());
  PetscCall(PetscOptionsHasName(nullptr, nullptr, "-help", &set));
  o->help = set;
  if (texts.has("scene")) o->scene = texts.at("scene");
  if (texts.has("mode")) o->mode = texts.oneOf("mode", {"dynamic", "static"});
  if (texts.has("dt")) o->dt = texts.positive("dt");
  if (texts.has("t_end")) o->t_end = texts.positive("t_end");
  if (texts.has("dt_min")) o->loop.dt_min = texts.positive("dt_min");
  if (texts.has("integrator")) o->loop.integrator.name = texts.oneOf("integrator", integratorNames());
  if (texts.has("rho_inf")) {
    o->loop.integrator.rho_inf = texts.number("rho_inf");
    if (!(o->loop.integrator.rho_inf >= 0 && o->loop.integrator.rho_inf <= 1)) fail("rho_inf", "must be from 0 to 1, found '" + texts.at("rho_inf") + "'");
    if (o->loop.integrator.name != "generalized_alpha") fail("rho_inf", "needs -integrator generalized_alpha");
  }
  if (texts.has("dt_adapt")) o->loop.adapt = texts.oneOf("dt_adapt", {"none", "error"}) == "error" ? Adaptation::error : Adaptation::none;
  for (const auto &[name, target] :
       std::initializer_list<std::pair<const char *, double *>>{{"dt_rtol", &o->loop.dt_rtol}, {"dt_atol", &o->loop.dt_atol}, {"dt_max", &o->loop.dt_max}})
    if (texts.has(name)) {
      *target = texts.positive(name);
      if (o->loop.adapt == Adaptation::none) fail(name, "needs -dt_adapt error");
    }
  for (const char *name : {"integrator", "dt_adapt"})
    if (texts.has(name)) o->dynamic_only = name;
  if (texts.has("load_steps")) o->given_load_steps = texts.count("load_steps");
  if (texts.has("arclength_steps")) o->arclength_steps = texts.count("arclength_steps");
  if (texts.has("continuation")) o->continuation = texts.oneOf("continuation", {"load", "arclength"}) == "load" ? Continuation::load : Continuation::arclength;
  if (texts.has("bifurcation")) {
    const std::string b = texts.oneOf("bifurcation", {"off", "locate", "stop"});
    o->bifurcation = b == "off" ? Bifurcation::off : b == "locate" ? Bifurcation::locate : Bifurcation::stop;
  }
  if (texts.has("gravity")) {
    const std::vector<double> g = texts.numbers("gravity");
    if (g.size() != 3) fail("gravity", "needs three numbers, e.g. 0,-9.81,0; found '" + texts.at("gravity") + "'");
    o->gravity = Vec3(g[0], g[1], g[2]);
  }
  if (texts.has("output_dir")) o->output_dir = texts.at("output_dir");
  if (texts.has("output_interval")) {
    o->output_interval = texts.number("output_interval");
    o->loop.output_interval = o->output_interval;
    if (o->output_interval < 0) fail("output_interval", "must not be negative, found '" + texts.at("output_interval") + "'");
  }
  if (texts.has("checkpoint_interval")) {
    if (texts.at("checkpoint_interval") != "0") o->checkpoint_interval = texts.count("checkpoint_interval");
  }
  if (texts.has("restart")) o->restart = texts.at("restart");
  o->fields = readFields(texts);
  if (texts.has("error_estimate")) o->error_estimate = o->loop.estimate_error = texts.flag("error_estimate");
  if (texts.has("accuracy_of")) {
    const std::string q = texts.oneOf("accuracy_of", {"position", "tip", "energy"});
    o->accuracy_of = q == "tip" ? Quantity::tip : q == "energy" ? Quantity::energy : Quantity::position;
  }
  if (texts.has("accuracy")) {
    o->accuracy = {texts.positive("accuracy"), o->accuracy_of.value_or(Quantity::position)};
    if (o->accuracy->tolerance >= 1) fail("accuracy", "is relative and must be below 1, e.g. 1e-3; found '" + texts.at("accuracy") + "'");
  }
  if (texts.has("rounding_tolerance")) {
    o->loop.rounding_tolerance = texts.positive("rounding_tolerance");
    if (o->loop.rounding_tolerance >= 1) fail("rounding_tolerance", "must be below 1, found '" + texts.at("rounding_tolerance") + "'");
  }
  if (texts.has("retraction"))
    o->loop.retraction = texts.oneOf("retraction", {"additive", "length"}) == "additive" ? RetractionKind::additive : RetractionKind::length;
  if (texts.has("stretch")) o->loop.mixed = texts.oneOf("stretch", {"primal", "mixed"}) == "mixed";
  if (texts.has("hessian")) o->loop.hessian = texts.oneOf("hessian", {"exact", "gauss_newton"}) == "exact" ? HessianKind::exact : HessianKind::gauss_newton;
  for (const auto &[name, meaning] : rodOverrides())
    if (texts.has("rod_" + name)) o->overrides[name] = texts.at("rod_" + name);
  PetscReal rtol = 1;
  PetscCall(PetscOptionsGetReal(nullptr, nullptr, "-snes_rtol", &rtol, nullptr));
  if (!(rtol > 0 && rtol <= 1)) fail("snes_rtol", "must be above 0 and at most 1: it is relative to the loads of each rod");
  PetscFunctionReturn(0);
}

namespace {

/// Of estimates and the choice of edges.
void checkAccuracy(const Options &o) {
  if (o.accuracy_of && !o.accuracy) fail("accuracy_of", "needs -accuracy, e.g. -accuracy 1e-3");
  if (!o.loop.dynamic && o.loop.continuation == Continuation::arclength && (o.accuracy || o.error_estimate))
    fail(o.accuracy ? "accuracy" : "error_estimate", "needs -continuation load: paths of two resolutions have no states in common");
  if (o.accuracy && o.loop.bifurcation == Bifurcation::stop) fail("accuracy", "is that of the answer at full load; -bifurcation stop ends before");
  if (o.accuracy && !o.restart.empty()) fail("accuracy", "chooses the edges, which a checkpoint already has; take -restart or -accuracy away");
}

} // namespace

void resolve(const RunSettings &scene, Options &o) {
  o.loop.dynamic = o.mode.value_or(scene.mode) == "dynamic";
  o.loop.continuation = o.continuation.value_or(Continuation::load);
  o.loop.bifurcation = o.bifurcation.value_or(Bifurcation::locate);
  o.loop.arclength_steps = o.arclength_steps.value_or(o.loop.arclength_steps);
  o.load_steps = o.given_load_steps.value_or(scene.load_steps);
  if (o.loop.dynamic) {
    if (o.given_load_steps) fail("load_steps", "has no meaning in -mode dynamic; use -dt");
    if (o.continuation || o.bifurcation || o.arclength_steps)
      fail(o.continuation ? "continuation" : o.bifurcation ? "bifurcation" : "arclength_steps", "has no meaning in -mode dynamic; use -mode static");
    o.loop.dt = o.dt.value_or(scene.dt);
    o.loop.t_end = o.t_end.value_or(scene.t_end);
    if (o.loop.t_end / o.loop.dt > 1e12)
      fail("dt", "a step of " + std::to_string(o.loop.dt) + " s never reaches the end at " + std::to_string(o.loop.t_end) +
                     " s; write a larger dt or a smaller t_end");
  } else {
    if (o.dt) fail("dt", "has no meaning in -mode static; use -load_steps");
    if (o.t_end) fail("t_end", "has no meaning in -mode static; the load factor ends at 1");
    if (!o.dynamic_only.empty()) fail(o.dynamic_only, "has no meaning in -mode static");
    o.loop.t_end = 1;
    o.loop.dt = 1.0 / o.load_steps;
    const bool arclength = o.loop.continuation == Continuation::arclength;
    if (o.arclength_steps && !arclength) fail("arclength_steps", "needs -continuation arclength");
    if (o.bifurcation && arclength)
      fail("bifurcation", "belongs to -continuation load; along the arc length, negative_pivots in the diagnostics tells stability");
  }
  checkAccuracy(o);
  if (o.loop.dt_min > o.loop.dt) fail("dt_min", "must not be larger than the step " + std::to_string(o.loop.dt));
}

PetscErrorCode refuseUnknownOptions() {
  PetscInt n;
  char **names, **values;
  PetscFunctionBeginUser;
  PetscCall(PetscOptionsLeftGet(nullptr, &n, &names, &values));
  std::string unknown;
  for (PetscInt i = 0; i < n; ++i) {
    const std::string name = names[i];
    const bool late = std::any_of(std::begin(late_options), std::end(late_options), [&](const char *p) { return name.rfind(p, 0) == 0; });
    if (!late && unknown.empty()) unknown = name;
  }
  PetscCall(PetscOptionsLeftRestore(nullptr, &n, &names, &values));
  if (unknown.empty()) PetscFunctionReturn(0);
  std::vector<std::string> known{"snes_rtol", "snes_max_it", "snes_monitor", "log_view"};
  for (const Entry &e : entries()) known.push_back(e.name);
  const std::string near = closest(unknown, known);
  fail(unknown, "unknown or unused" + (near.empty() ? "" : "; did you mean -" + near + "?") + " (-help lists all options)");
}

std::string writeOptionsFile(const std::string &path, const Options &o, const Provenance &p, const Scene &scene) {
  YAML::Emitter out;
  out.SetDoublePrecision(17);
  auto list = [&](auto begin, auto end) {
    out << YAML::Flow << YAML::BeginSeq;
    for (auto k = begin; k != end; ++k) out << *k;
    out << YAML::EndSeq;
  };
  auto put = [&](const char *key, const auto &value) { out << YAML::Key << key << YAML::Value << value; };
  out << YAML::Comment("All that was in force in this run.") << YAML::BeginMap;
  put("command_line", p.command_line);
  put("tendril_version", p.version);
  put("git_commit", p.git_commit);
  put("petsc_version", p.petsc_version);
  put("scene", o.scene);
  put("mode", o.loop.dynamic ? "dynamic" : "static");
  if (o.loop.dynamic) {
    put("dt", o.loop.dt);
    put("t_end", o.loop.t_end);
    put("integrator", o.loop.integrator.name);
    if (o.loop.integrator.name == "generalized_alpha") put("rho_inf", o.loop.integrator.rho_inf);
    put("dt_adapt", o.loop.adapt == Adaptation::error ? "error" : "none");
    if (o.loop.adapt == Adaptation::error) {
      put("dt_rtol", o.loop.dt_rtol);
      put("dt_atol", o.loop.dt_atol);
      if (o.loop.dt_max > 0) put("dt_max", o.loop.dt_max);
    }
  } else {
    put("load_steps", o.load_steps);
    put("continuation", o.loop.continuation == Continuation::load ? "load" : "arclength");
    put("bifurcation", o.loop.bifurcation == Bifurcation::off ? "off" : o.loop.bifurcation == Bifurcation::stop ? "stop" : "locate");
    put("arclength_steps", o.loop.arclength_steps);
  }
  put("dt_min", o.loop.dt_min > 0 ? o.loop.dt_min : o.loop.dt / 1024);
  out << YAML::Key << "gravity" << YAML::Value;
  list(scene.gravity.data(), scene.gravity.data() + 3);
  put("output_dir", o.output_dir);
  put("output_interval", o.output_interval);
  put("checkpoint_interval", o.checkpoint_interval);
  if (!o.restart.empty()) put("restart", o.restart);
  out << YAML::Key << "output_fields" << YAML::Value;
  list(o.fields.begin(), o.fields.end());
  put("error_estimate", o.error_estimate);
  if (o.accuracy) {
    put("accuracy", o.accuracy->tolerance);
    put("accuracy_of", o.accuracy->of == Quantity::tip ? "tip" : o.accuracy->of == Quantity::energy ? "energy" : "position");
  }
  put("rounding_tolerance", o.loop.rounding_tolerance);
  put("retraction", o.loop.retraction == RetractionKind::length ? "length" : "additive");
  put("stretch", o.loop.mixed ? "mixed" : "primal");
  put("hessian", o.loop.hessian == HessianKind::exact ? "exact" : "gauss_newton");
  out << YAML::Key << "rods" << YAML::Value << YAML::BeginSeq;
  for (const Rod &rod : scene.rods) {
    const Material &m = rod.material;
    out << YAML::BeginMap;
    put("name", rod.name);
    put("edges", rod.edges());
    put("measure", rod.measure == Measure::tan ? "tan" : "angle");
    put("linear_density", m.linear_density);
    put("linear_rotational_inertia", m.linear_rotational_inertia);
    put("axial_stiffness", m.axial_stiffness);
    put("torsional_stiffness", m.torsional_stiffness);
    out << YAML::Key << "flexural_stiffness" << YAML::Value;
    list(m.flexural_stiffness.begin(), m.flexural_stiffness.end());
    put("mass_damping_coefficient", m.mass_damping_coefficient);
    put("stiffness_damping_coefficient", m.stiffness_damping_coefficient);
    out << YAML::EndMap;
  }
  out << YAML::EndSeq;
  put("petsc_options", p.options);
  out << YAML::EndMap;
  const std::string text = std::string(out.c_str()) + "\n";
  std::ofstream(path) << text;
  return text;
}

} // namespace tendril
