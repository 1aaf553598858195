#include "tendril/io/options.hpp"

#include "tendril/io/yaml.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
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

[[noreturn]] void fail(const std::string &option, const std::string &message) {
  throw SceneError("option -" + option + ": " + message);
}

/// Our options as text, read by the table of keys.
class Texts {
public:
  PetscErrorCode read() {
    PetscFunctionBeginUser;
    for (const Key &key : keys)
      if (key.isOption()) PetscCall(readOne(key.path, key.type == KeyType::flag));
    for (const Key *key : rodOverrides()) PetscCall(readOne(("-rod_" + std::string(key->name())).c_str(), false));
    PetscFunctionReturn(0);
  }

  bool isGiven(const std::string &option) const { return given_.count(option) > 0; }
  bool has(AnyKey key) const { return isGiven(key->path); }
  std::string text(const Key &key) const {
    return isGiven(key.path) ? given_.at(key.path) : key.hasFallback() ? key.fallback : "";
  }
  std::string text(KeyOf<KeyType::text, KeyType::file> key) const { return text(*key); }
  const std::string &given(const std::string &option) const { return given_.at(option); }

  bool flag(KeyOf<KeyType::flag> key) const {
    const std::string word = text(*key);
    if (word.empty() || word == "true" || word == "1") return true; // given alone
    if (word == "false" || word == "0") return false;
    fail(*key, "must be true or false, found '" + word + "'");
  }

  double number(KeyOf<KeyType::number> key) const {
    const std::vector<double> v = numbers(*key);
    if (v.size() != 1) fail(*key, "needs one number, found '" + text(*key) + "'");
    return inBounds(*key, v[0]);
  }

  int integer(KeyOf<KeyType::integer> key) const {
    const std::vector<double> v = numbers(*key);
    if (v.size() != 1 || v[0] != std::floor(v[0])) fail(*key, "must be a whole number, found '" + text(*key) + "'");
    if (v[0] > 1e9) fail(*key, "must be at most 1e9, found '" + text(*key) + "'");
    return int(inBounds(*key, v[0]));
  }

  Vec3 vector(KeyOf<KeyType::vector> key) const {
    const std::vector<double> v = numbers(*key);
    if (v.size() != 3)
      fail(*key, std::string("needs three numbers, e.g. ") + key->example + "; found '" + text(*key) + "'");
    return {v[0], v[1], v[2]};
  }

  std::string word(KeyOf<KeyType::word> key) const {
    const std::string value = text(*key);
    const std::vector<std::string> choices = choicesOf(*key);
    if (std::find(choices.begin(), choices.end(), value) != choices.end()) return value;
    std::string all;
    for (const std::string &c : choices) all += (all.empty() ? "" : ", ") + c;
    const std::string near = closest(value, choices);
    fail(*key,
         "must be one of " + all + "; found '" + value + "'" + (near.empty() ? "" : "; did you mean '" + near + "'?"));
  }

  /// Which of the words of the table it is.
  int choice(KeyOf<KeyType::word> key) const {
    const std::vector<std::string> choices = choicesOf(*key);
    return int(std::find(choices.begin(), choices.end(), word(key)) - choices.begin());
  }

  [[noreturn]] static void fail(const Key &key, const std::string &message) {
    tendril::fail(std::string(key.name()), message);
  }

private:
  std::map<std::string, std::string> given_;

  PetscErrorCode readOne(const char *option, bool flag) {
    char text[PETSC_MAX_PATH_LEN];
    PetscBool set;
    PetscFunctionBeginUser;
    PetscCall(PetscOptionsGetString(nullptr, nullptr, option, text, sizeof text, &set));
    if (!set) PetscFunctionReturn(0);
    if (!*text && !flag) tendril::fail(option + 1, "needs a value");
    given_[option] = text;
    PetscFunctionReturn(0);
  }

  double inBounds(const Key &key, double value) const {
    if (const std::string wrong = outOfBounds(key, value); !wrong.empty())
      fail(key, wrong + ", found '" + text(key) + "'");
    return value;
  }

  std::vector<double> numbers(const Key &key) const {
    std::vector<double> values;
    std::istringstream in(text(key));
    for (std::string word; std::getline(in, word, ',');) {
      std::size_t used = 0;
      double value = 0;
      try {
        value = std::stod(word, &used);
      } catch (const std::exception &) {}
      if (used == 0 || used != word.size()) fail(key, "'" + word + "' is not a number");
      if (const std::string wrong = unfitNumber(value); !wrong.empty()) fail(key, wrong + ", found '" + word + "'");
      values.push_back(value);
    }
    return values;
  }
};

/// n of all rods, or name:n with commas.
std::vector<std::pair<std::string, int>> readRodEdges(const std::string &text) {
  std::vector<std::pair<std::string, int>> edges;
  std::istringstream in(text);
  for (std::string word; std::getline(in, word, ',');) {
    const std::size_t colon = word.rfind(':');
    const YamlValue number(YAML::Node(colon == std::string::npos ? word : word.substr(colon + 1)), "option -rod_edges",
                           "edges");
    edges.emplace_back(colon == std::string::npos ? "all" : word.substr(0, colon),
                       number.integer(*KeyOf<KeyType::integer>("rods[].line.edges")));
  }
  return edges;
}

std::set<std::string> readFields(const Texts &texts) {
  const auto &names = TrajectoryWriter::fieldNames(), &derived = TrajectoryWriter::derivedFieldNames();
  std::set<std::string> fields;
  std::istringstream in(texts.text("-output_fields"));
  for (std::string word; std::getline(in, word, ',');) {
    if (word == "all")
      fields.insert(names.begin(), names.end());
    else if (std::find(names.begin(), names.end(), word) != names.end() ||
             std::find(derived.begin(), derived.end(), word) != derived.end())
      fields.insert(word);
    else
      fail("output_fields",
           "there is no field '" + word + "'; choose from all," + joined(names) + "," + joined(derived));
  }
  return fields;
}

/// Options of PETSc with which its solvers run, but not to an answer of ours.
PetscErrorCode refuseUnsuited() {
  struct Unsuited {
    const char *option, *fits, *reason; ///< the one value that fits; empty: none does
  };
  constexpr Unsuited unsuited[] = {
      {"snes_type", "newtonls",
       "is always newtonls: what counts as an answer, ways out of saddles and steps on the manifold of frames are its "
       "own"},
      {"snes_mf", "", "is not for rods: the Hessian is exact, and cheaper than a difference of residuals"},
      {"snes_mf_operator", "", "is not for rods: the Hessian is exact, and cheaper than a difference of residuals"},
      {"snes_fd", "", "is not for rods: the Hessian is exact; tests compare it with automatic differentiation"},
      {"snes_fd_color", "", "is not for rods: the Hessian is exact; tests compare it with automatic differentiation"},
  };
  PetscFunctionBeginUser;
  for (const Unsuited &u : unsuited) {
    char value[PETSC_MAX_PATH_LEN];
    PetscBool given;
    PetscCall(
        PetscOptionsGetString(nullptr, nullptr, (std::string("-") + u.option).c_str(), value, sizeof value, &given));
    const std::string word = value;
    if (given && word != "false" && word != "0" && (word.empty() || word != u.fits)) fail(u.option, u.reason);
  }
  char search[PETSC_MAX_PATH_LEN];
  PetscBool given;
  PetscCall(PetscOptionsGetString(nullptr, nullptr, "-snes_linesearch_type", search, sizeof search, &given));
  if (given && std::string(search) == "shell")
    fail("snes_linesearch_type", "shell needs a program's own function; use retraction, basic, bt, l2 or cp");
  PetscFunctionReturn(0);
}

bool isOptionName(const char *word) {
  return word[0] == '-' && (std::isalpha(static_cast<unsigned char>(word[1])) || word[1] == '-');
}

void readTime(Texts &texts, Options *o) {
  if (texts.has("-mode")) o->mode = texts.word("-mode");
  if (texts.has("-dt")) o->dt = texts.number("-dt");
  if (texts.has("-t_end")) o->t_end = texts.number("-t_end");
  if (texts.has("-dt_min")) o->loop.dt_min = texts.number("-dt_min");
  o->loop.integrator.name = texts.word("-integrator");
  o->loop.integrator.rho_inf = texts.number("-rho_inf");
  if (texts.has("-rho_inf") && o->loop.integrator.name != "generalized_alpha")
    fail("rho_inf", "needs -integrator generalized_alpha");
  o->loop.adapt = texts.word("-dt_adapt") == "error" ? Adaptation::error : Adaptation::none;
  o->loop.dt_rtol = texts.number("-dt_rtol");
  o->loop.dt_atol = texts.number("-dt_atol");
  if (texts.has("-dt_max")) o->loop.dt_max = texts.number("-dt_max");
  for (const char *name : {"dt_rtol", "dt_atol", "dt_max"})
    if (texts.isGiven(std::string("-") + name) && o->loop.adapt == Adaptation::none)
      fail(name, "needs -dt_adapt error");
  if (texts.has("-dt_adapt")) o->dynamic_only = "dt_adapt"; // -integrator may stay in statics, in sweeps over both
}

void readStatics(Texts &texts, Options *o) {
  o->modes_given = texts.has("-modes");
  o->modes = texts.integer("-modes");
  if (texts.has("-buckling_to")) o->buckling_to = texts.number("-buckling_to");
  if (texts.has("-load_steps")) o->given_load_steps = texts.integer("-load_steps");
  if (texts.has("-arclength_steps")) o->arclength_steps = texts.integer("-arclength_steps");
  o->loop.arclength_steps = texts.integer("-arclength_steps");
  o->loop.continuation = Continuation(texts.choice("-continuation"));
  if (texts.has("-continuation")) o->continuation = o->loop.continuation;
  o->loop.bifurcation = Bifurcation(texts.choice("-bifurcation"));
  if (texts.has("-bifurcation")) o->bifurcation = o->loop.bifurcation;
}

void readOutput(Texts &texts, Options *o) {
  o->output_dir = texts.text("-output_dir");
  o->output_shapes = texts.text("-output_shapes");
  o->output_interval = o->loop.output_interval = texts.number("-output_interval");
  o->checkpoint_interval = texts.integer("-checkpoint_interval");
  o->restart = texts.text("-restart");
  if (texts.has("-restart_time")) o->restart_time = texts.number("-restart_time");
  if (texts.has("-time_limit")) o->time_limit = texts.number("-time_limit");
  o->fields = readFields(texts);
}

void readAccuracy(Texts &texts, Options *o) {
  o->error_estimate = o->loop.estimate_error = texts.flag("-error_estimate");
  const std::string of = texts.word("-accuracy_of");
  const Quantity quantity = of == "tip" ? Quantity::tip : of == "energy" ? Quantity::energy : Quantity::position;
  if (texts.has("-accuracy_of")) o->accuracy_of = quantity;
  if (texts.has("-accuracy")) o->accuracy = {texts.number("-accuracy"), quantity};
}

void readSolver(Texts &texts, Options *o) {
  o->loop.solve.rounding_tolerance = texts.number("-rounding_tolerance");
  o->loop.solve.retraction = RetractionKind(texts.choice("-retraction"));
  o->loop.solve.line_search = LineSearchKind(texts.choice("-line_search"));
  o->loop.solve.quasi_newton = texts.integer("-quasi_newton");
  o->partition = PartitionKind(texts.choice("-partition"));
  o->loop.mixed = texts.word("-stretch") == "mixed";
  o->loop.hessian = texts.word("-hessian") == "exact" ? HessianKind::exact : HessianKind::gauss_newton;
}

void readOverrides(const Texts &texts, Options *o) {
  if (texts.isGiven("-model")) o->overrides["model"] = texts.word("-model");
  o->model_check = texts.flag("-model_check");
  for (const auto key :
       std::initializer_list<KeyOf<KeyType::number>>{"-contact_stiffness", "-contact_distance", "-contact_friction"})
    if (texts.isGiven(key->path) && std::isfinite(texts.number(key))) // what is no number is told here
      o->overrides[std::string(key->name())] = texts.text(*key);
}

void readMaterial(Texts &texts, Options *o) {
  for (const Key *key : rodOverrides())
    if (const std::string name(key->name()); texts.isGiven("-rod_" + name)) {
      const std::string text = texts.given("-rod_" + name);
      const bool bare =
          key->type == KeyType::pair && text.find(',') != std::string::npos && text[0] != '['; // as vectors are written
      o->overrides[name] = bare ? "[" + text + "]" : text;
    }
}

} // namespace

PetscErrorCode readOptions(int argc, char **argv, Options *o) {
  PetscBool set;
  PetscFunctionBeginUser;
  for (int i = 1; i < argc; ++i)
    if (!isOptionName(argv[i]) && (i == 1 || !isOptionName(argv[i - 1])))
      throw SceneError(std::string("command line: '") + argv[i] +
                       "' belongs to no option; options begin with - and take one value (lists without blanks)");
  Texts texts;
  PetscCall(texts.read());
  PetscCall(PetscOptionsHasName(nullptr, nullptr, "-help", &set));
  o->help = set;
  o->schema = texts.flag("-schema");
  o->keys = texts.flag("-keys");
  o->scene = texts.text("-scene");
  readTime(texts, o);
  readStatics(texts, o);
  if (texts.has("-gravity")) o->gravity = texts.vector("-gravity");
  o->rod_edges = readRodEdges(texts.text("-rod_edges"));
  readOutput(texts, o);
  readAccuracy(texts, o);
  readSolver(texts, o);
  readMaterial(texts, o);
  readOverrides(texts, o);
  PetscCall(refuseUnsuited());
  texts.number("-snes_rtol"); // PETSc reads them, with less to say about mistakes
  texts.integer("-snes_max_it");
  PetscFunctionReturn(0);
}

std::vector<int> edgesAsked(const Scene &scene, const Options &o) {
  std::vector<int> edges = edgesOf(scene);
  const RodNames names(scene.rods);
  for (const auto &[name, number] : o.rod_edges) {
    const std::vector<int> rods = names.find(name);
    if (rods.empty())
      fail("rod_edges", "there is no rod '" + name + "'; write a name of the scene, a number from 0 to " +
                            std::to_string(edges.size() - 1) + ", or edges alone for all");
    for (const int r : rods) edges[r] = number;
  }
  return edges;
}

PetscErrorCode unusedOptions(bool touches, std::vector<std::string> *unused) {
  PetscInt n;
  char **names, **values;
  std::vector<std::string> late{"log_", "options_", "malloc", "help", "on_error"}; // asked for when the program ends
  PetscFunctionBeginUser;
  if (touches) late.emplace_back("mat_mumps_"); // in steps in which rods touch
  PetscCall(PetscOptionsLeftGet(nullptr, &n, &names, &values));
  for (PetscInt i = 0; i < n; ++i)
    if (const std::string name = names[i];
        std::none_of(late.begin(), late.end(), [&](const std::string &p) { return name.rfind(p, 0) == 0; }))
      unused->push_back(name);
  PetscCall(PetscOptionsLeftRestore(nullptr, &n, &names, &values));
  PetscFunctionReturn(0);
}

void refuseUnused(const std::string &unknown) {
  std::vector<std::string> known{"snes_monitor", "log_view", "options_file"};
  for (const Key &key : keys)
    if (key.isOption()) known.emplace_back(key.name());
  for (const Key *key : rodOverrides()) known.push_back("rod_" + std::string(key->name()));
  const bool of_rod =
      std::find(known.begin(), known.end(), "rod_" + unknown) != known.end(); // a key of the scene, as in -young
  const std::string near = of_rod ? "rod_" + unknown : closest(unknown, known);
  fail(unknown,
       "unknown or unused" + (near.empty() ? "" : "; did you mean -" + near + "?") + " (-help lists all options)");
}

} // namespace tendril
