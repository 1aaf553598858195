#pragma once
/// \file keys.hpp
/// The table of all keys of a scene and all options of the program. Readers take types, bounds, choices and fallbacks
/// from it, and what is not in it cannot be read: a path that is missing, or of another type, does not compile. -help,
/// -schema and -keys print it; scripts/docs makes pages of it.

#include <limits>
#include <string>
#include <string_view>

namespace tendril {

enum class KeyType {
  number,
  integer,
  flag, ///< true or false; an option alone is true
  word, ///< one of the choices
  text,
  file,
  vector,  ///< three numbers
  pair,    ///< two numbers, or one for both
  vectors, ///< a list of vectors
  index,   ///< a whole number from 0, or `last`
  rod,     ///< a name, a number from 0, or `all`
  rows,    ///< rows of a table
  list,    ///< of maps
  map,
  word_or_map
};

struct Bounds {
  double least = -std::numeric_limits<double>::infinity(), most = std::numeric_limits<double>::infinity();
  bool above = false, below = false; ///< the bounds themselves are left out
};
inline constexpr Bounds anything{}, positive{0, anything.most, true}, not_negative{0}, from_one{1},
    fraction{0, 1, true, true};

struct Key {
  const char *path; ///< of a scene: `rods[].material.young`; of an option: `-dt`
  KeyType type;
  const char *unit;
  const char *fallback; ///< as one would write it; `required`; or in brackets what happens without the key
  const char *meaning;
  Bounds bounds{};
  const char *choices = ""; ///< a|b|c
  const char *example = ""; ///< a value
  const char *group = "";   ///< of an option
  const char *more = "";    ///< what -help leaves out and pages have

  constexpr bool isOption() const { return path[0] == '-'; }
  constexpr bool isRequired() const { return std::string_view(fallback) == "required"; }
  /// Whether `fallback` is a value.
  constexpr bool hasFallback() const { return !isRequired() && fallback[0] != '('; }
  constexpr std::string_view name() const {
    const std::string_view whole = path, end = whole.substr(isOption() ? 1 : whole.rfind('.') + 1);
    return end;
  }
  /// Path of the map that holds it, empty at the top.
  constexpr std::string_view parent() const {
    const std::size_t dot = std::string_view(path).rfind('.');
    return isOption() || dot == std::string_view::npos ? std::string_view() : std::string_view(path).substr(0, dot);
  }
};

inline constexpr Key keys[] = {
    // Scenes.
    {"gravity", KeyType::vector, "m/s^2", "[0, -9.81, 0]", "acceleration of gravity", anything, "", "[0, 0, -9.81]"},
    {"rotation", KeyType::map, "", "(none)",
     "statics in a frame that turns: centrifugal forces, which the load factor scales"},
    {"rotation.angular_velocity", KeyType::vector, "rad/s", "required", "of the frame", anything, "", "[0, 3, 0]"},
    {"rotation.centre", KeyType::vector, "m", "[0, 0, 0]", "a point of the axis", anything, "", "[0, 1, 0]"},
    {"simulation", KeyType::map, "", "(none)", "how to run; options replace it"},
    {"simulation.mode", KeyType::word, "", "dynamic", "dynamic: steps in time; static: steps in load to an equilibrium",
     anything, "dynamic|static", "static"},
    {"simulation.dt", KeyType::number, "s", "0.01", "time step", positive, "", "5e-3"},
    {"simulation.t_end", KeyType::number, "s", "1", "end time", positive, "", "0.02"},
    {"simulation.load_steps", KeyType::integer, "", "1", "first increment of the load factor is one over this (static)",
     from_one, "", "2"},
    {"rods", KeyType::list, "", "required", "the rods; each block is one, or several of a file or of copies"},
    {"rods[].name", KeyType::text, "", "(rod0, rod1, ...)",
     "by which supports and loads find it; stands for all rods of its block, name.1 and name#2 for one", anything, "",
     "spring"},
    {"rods[].line", KeyType::map, "", "(another shape)", "a straight rod"},
    {"rods[].line.from", KeyType::vector, "m", "required", "first vertex", anything, "", "[0, 0, 0]"},
    {"rods[].line.to", KeyType::vector, "m", "required", "last vertex", anything, "", "[1, 0, 0]"},
    {"rods[].line.edges", KeyType::integer, "", "required", "number of edges", from_one, "", "20"},
    {"rods[].ring", KeyType::map, "", "(another shape)", "a closed circle"},
    {"rods[].ring.center", KeyType::vector, "m", "[0, 0, 0]", "its centre", anything, "", "[0, 0, 1]"},
    {"rods[].ring.normal", KeyType::vector, "", "[0, 0, 1]", "of its plane, of any length", anything, "", "[0, 1, 0]"},
    {"rods[].ring.radius", KeyType::number, "m", "required", "of its vertices", positive, "", "0.5"},
    {"rods[].ring.edges", KeyType::integer, "", "required", "number of edges", {3}, "", "32"},
    {"rods[].helix", KeyType::map, "", "(another shape)", "a spring, or a spiral"},
    {"rods[].helix.origin", KeyType::vector, "m", "[0, 0, 0]", "where its axis begins", anything, "", "[0, 0, 1]"},
    {"rods[].helix.axis", KeyType::vector, "", "[1, 0, 0]", "its direction, of any length", anything, "", "[0, 0, 1]"},
    {"rods[].helix.start", KeyType::vector, "", "(a normal of the axis)",
     "from the axis to the first vertex, normal to it, of any length"},
    {"rods[].helix.length", KeyType::number, "m", "required", "along the axis", positive, "", "1.25"},
    {"rods[].helix.radius", KeyType::number, "m", "required", "from the axis", positive, "", "0.125"},
    {"rods[].helix.turns", KeyType::number, "", "required", "about the axis", anything, "", "8"},
    {"rods[].helix.taper",
     KeyType::number,
     "",
     "0",
     "part of the length at each end over which the radius grows from zero",
     {0, 0.5},
     "",
     "0.1"},
    {"rods[].helix.edges", KeyType::integer, "", "required", "number of edges", {2}, "", "128"},
    {"rods[].points", KeyType::vectors, "m", "(another shape)", "its vertices", anything, "",
     "[[0, 0, 0], [1, 0, 0], [1, 1, 0]]"},
    {"rods[].file", KeyType::file, "m", "(another shape)",
     "polylines: .csv/.txt (a point a line, # begins a comment, an empty line ends a rod), .obj (l elements; those "
     "that share a vertex are one rod, closed when it ends where it began), .h5 "
     "(position (n, 3), rod_vertex_offsets (rods + 1), closed (rods)); the path is relative to the scene"},
    {"rods[].place", KeyType::map, "", "(as drawn)",
     "where the shape is put: scaled about the origin, turned about it, then moved"},
    {"rods[].place.scale", KeyType::number, "", "1", "factor of all coordinates", positive, "", "0.001"},
    {"rods[].place.rotation", KeyType::vector, "rad", "[0, 0, 0]", "rotation vector: axis times angle", anything, "",
     "[0, 0, 1.5708]"},
    {"rods[].place.translation", KeyType::vector, "m", "[0, 0, 0]", "added last", anything, "", "[0, 0, 1]"},
    {"rods[].closed", KeyType::flag, "", "false", "one more edge joins the last vertex to the first", anything, "",
     "false"},
    {"rods[].director", KeyType::vector, "", "(a normal of the first edge)",
     "first director of the first edge, normal to it, of any length; the others follow without twist"},
    {"rods[].directors", KeyType::vectors, "", "(from director)", "first directors of all edges, normal to them"},
    {"rods[].natural", KeyType::word_or_map, "", "as_drawn",
     "the shape without stress: as drawn, straight, or of constant strains", anything, "as_drawn|straight", "straight"},
    {"rods[].natural.curvature", KeyType::pair, "1/m", "[0, 0]", "about the first and the second director", anything,
     "", "[2, 0]"},
    {"rods[].natural.twist", KeyType::number, "1/m", "0", "angle per length", anything, "", "3"},
    {"rods[].turns", KeyType::number, "", "0", "turns of twist put in at the start, spread by length", anything, "",
     "2"},
    {"rods[].measure", KeyType::word, "", "tan",
     "strain measure: tan, 2 tan(angle/2), with a barrier at 180 degrees; angle, the angle itself, also whole turns",
     anything, "tan|angle", "angle"},
    {"rods[].energy", KeyType::word, "", "seed",
     "law of stretch and bending: seed, curvatures times the stretch and strain ((l/L)^2 - 1)/2; classical, without "
     "that factor, and strain l/L - 1",
     anything, "seed|classical", "classical"},
    {"rods[].gravity", KeyType::flag, "", "true", "whether gravity acts on it", anything, "", "false"},
    {"rods[].velocity", KeyType::vector, "m/s", "[0, 0, 0]", "of all vertices at the start", anything, "", "[0, 0, 1]"},
    {"rods[].copies", KeyType::map, "", "(one)", "the same rod several times"},
    {"rods[].copies.count", KeyType::integer, "", "required", "number of rods", from_one, "", "3"},
    {"rods[].copies.offset", KeyType::vector, "m", "required", "from one to the next", anything, "", "[0, 0, 0.1]"},
    {"rods[].material", KeyType::word_or_map, "", "required",
     "a homogeneous section and/or stiffnesses, which replace what follows from it; each key is an option -rod_<key>, "
     "too, beside which the block may be left out. default: a thin soft rod",
     anything, "default", "default"},
    {"rods[].material.radius", KeyType::number, "m", "(another section)", "of a circular section", positive, "",
     "0.01"},
    {"rods[].material.radii", KeyType::pair, "m", "(another section)",
     "semi-axes of an elliptic section, along the first and the second director", positive, "", "[2e-3, 1e-3]"},
    {"rods[].material.width", KeyType::number, "m", "(another section)",
     "of a rectangular section, along the first director", positive, "", "0.02"},
    {"rods[].material.height", KeyType::number, "m", "(another section)",
     "of a rectangular section, along the second director", positive, "", "0.005"},
    {"rods[].material.young", KeyType::number, "Pa", "(with a section: required)", "Young's modulus", positive, "",
     "1e7"},
    {"rods[].material.poisson", KeyType::number, "", "(or shear)", "Poisson's ratio", {-1, 0.5, true}, "", "0.3"},
    {"rods[].material.shear", KeyType::number, "Pa", "(or poisson)", "shear modulus", positive, "", "4e6"},
    {"rods[].material.density", KeyType::number, "kg/m^3", "(with a section: required)", "density", positive, "",
     "1000"},
    {"rods[].material.linear_density", KeyType::number, "kg/m", "(of the section, or 0.1)", "mass per length", positive,
     "", "0.3"},
    {"rods[].material.linear_rotational_inertia", KeyType::number, "kg m", "(of the section, or 1e-6)",
     "rotational inertia about the axis, per length", not_negative, "", "1e-5"},
    {"rods[].material.axial_stiffness", KeyType::number, "N", "(of the section, or 100)", "EA", positive, "", "3000"},
    {"rods[].material.torsional_stiffness", KeyType::number, "N m^2", "(of the section, or 5e-4)", "GJ", not_negative,
     "", "0.06"},
    {"rods[].material.flexural_stiffness", KeyType::pair, "N m^2", "(of the section, or 5e-4)",
     "EI about the first and the second director; 0 is a cable", not_negative, "", "0.08"},
    {"rods[].material.mass_damping_coefficient", KeyType::number, "1/s", "0", "dissipation proportional to mass",
     not_negative, "", "0.1"},
    {"rods[].material.stiffness_damping_coefficient", KeyType::number, "s", "0",
     "dissipation proportional to stiffness", not_negative, "", "1e-3"},
    {"supports", KeyType::list, "", "(none)", "what holds rods"},
    {"supports[].rod", KeyType::rod, "", "(the only one)", "which rod", anything, "", "all"},
    {"supports[].vertex", KeyType::index, "", "required", "which vertex", not_negative, "", "last"},
    {"supports[].type", KeyType::word, "", "required",
     "clamp: position, tangent and twist; pin: position; fix_twist: tangent and twist", anything, "clamp|pin|fix_twist",
     "clamp"},
    {"supports[].tangent", KeyType::vector, "", "(as drawn)", "of the rod there (clamp, fix_twist), of any length"},
    {"supports[].director", KeyType::vector, "", "(as drawn)",
     "first director there (clamp, fix_twist), normal to the tangent, of any length"},
    {"supports[].motion", KeyType::map, "", "(none)", "how it moves; in statics time is the load factor, 0 to 1"},
    {"supports[].motion.velocity", KeyType::vector, "m/s", "[0, 0, 0]", "of the vertex", anything, "", "[0.1, 0, 0]"},
    {"supports[].motion.angular_velocity", KeyType::vector, "rad/s", "[0, 0, 0]", "about the vertex", anything, "",
     "[1, 0, 0]"},
    {"supports[].motion.table", KeyType::rows, "s, m, rad", "(velocities)",
     "rows of [time, dx, dy, dz] or [time, dx, dy, dz, rx, ry, rz], the last three a rotation vector; linear between "
     "rows, at rest outside",
     anything, "", "[[0, 0, 0, 0], [1, 0.1, 0, 0]]"},
    {"constraints", KeyType::list, "", "(none)", "springs and dampers between rods and the world"},
    {"constraints[].name", KeyType::text, "", "(constraint0, constraint1, ...)",
     "for files and messages; on several rods name#0, name#1, ...", anything, "", "anchor"},
    {"constraints[].type", KeyType::word, "", "required",
     "pin: draws a vertex to a point; rotation: turns the frame of an edge to a given one", anything, "pin|rotation",
     "pin"},
    {"constraints[].to", KeyType::word, "", "world", "where the other end is", anything, "world", "world"},
    {"constraints[].rod", KeyType::rod, "", "(the only one)", "which rod", anything, "", "0"},
    {"constraints[].vertex", KeyType::index, "", "(of a pin: required)", "which vertex", not_negative, "", "last"},
    {"constraints[].closest", KeyType::flag, "", "false", "the vertex nearest to 'point', in place of 'vertex'",
     anything, "", "false"},
    {"constraints[].point", KeyType::vector, "m", "(as drawn)", "of a pin: where it draws the vertex to", anything, "",
     "[0, 0, 0.1]"},
    {"constraints[].edge", KeyType::index, "", "(of a rotation: required)", "which edge", not_negative, "", "last"},
    {"constraints[].tangent", KeyType::vector, "", "(as drawn)",
     "of a rotation: where it turns the edge, of any length"},
    {"constraints[].director", KeyType::vector, "", "(as drawn)",
     "of a rotation: where it turns the first director, normal to the tangent, of any length"},
    {"constraints[].stiffness", KeyType::number, "N/m, N m", "required",
     "force over distance, or couple over angle; a support holds a vertex exactly", not_negative, "", "1e3"},
    {"constraints[].damping", KeyType::number, "N s/m, N m s", "0",
     "force over velocity, or couple over angular velocity", not_negative, "", "0.1"},
    {"constraints[].update_old_target", KeyType::flag, "", "false",
     "the damper stands still in the world, in place of moving with the point or frame", anything, "", "true"},
    {"constraints[].saturation", KeyType::number, "m, rad", "-1",
     "distance or angle g at which the force, stiffness (2 g - g^2/saturation) up to there, grows no more; negative: "
     "none, and the force is stiffness g",
     anything, "", "0.05"},
    {"constraints[].measure", KeyType::word, "", "angle",
     "of a rotation: couple by the angle itself, below half a turn, or by its sine", anything, "angle|sine", "sine"},
    {"constraints[].motion", KeyType::map, "", "(none)",
     "how the point or frame moves; in statics time is the load factor, 0 to 1"},
    {"constraints[].motion.velocity", KeyType::vector, "m/s", "[0, 0, 0]", "of the point", anything, "", "[0.1, 0, 0]"},
    {"constraints[].motion.angular_velocity", KeyType::vector, "rad/s", "[0, 0, 0]", "of the frame", anything, "",
     "[1, 0, 0]"},
    {"constraints[].motion.table", KeyType::rows, "s, m, rad", "(velocities)", "rows as those of supports", anything,
     "", "[[0, 0, 0, 0], [1, 0.1, 0, 0]]"},
    {"loads", KeyType::list, "", "(none)", "dead loads; in statics they grow with the load factor"},
    {"loads[].rod", KeyType::rod, "", "(the only one)", "which rod", anything, "", "0"},
    {"loads[].vertex", KeyType::index, "", "(with force: required)", "where the force acts", not_negative, "", "last"},
    {"loads[].force", KeyType::vector, "N", "(another load)", "force on a vertex", anything, "", "[0, 0, 1e-3]"},
    {"loads[].edge", KeyType::index, "", "(with couples: required)", "where the couple acts", not_negative, "", "last"},
    {"loads[].torque", KeyType::number, "N m", "(another load)", "couple about the present tangent of the edge",
     anything, "", "1e-4"},
    {"loads[].moment", KeyType::vector, "N m", "(another load)", "couple of fixed direction", anything, "",
     "[0, 0, 1e-4]"},

    // Options.
    {"-scene", KeyType::file, "", "required", "scene file (YAML)", anything, "", "data/scenes/helix.yaml", "scene"},
    {"-gravity", KeyType::vector, "m/s^2", "(of the scene)", "acceleration of gravity", anything, "", "0,-9.81,0",
     "scene"},
    {"-restart", KeyType::file, "", "(none)",
     "checkpoint, or its folder, to go on from, to the same bits, or with what has changed; the results go to another "
     "folder",
     anything, "", "", "scene",
     "auto: from the newest whole checkpoint in -output_dir, or from the start where there is none; what is there "
     "moves to part_1, part_2 ..."},
    {"-restart_time", KeyType::number, "s", "(of the checkpoint)", "time at which a restarted run begins", not_negative,
     "", "", "scene", "0 where it goes from statics to dynamics"},
    {"-schema", KeyType::flag, "", "false", "print the scene language as a JSON Schema and stop", anything, "", "",
     "scene"},
    {"-keys", KeyType::flag, "", "false", "print the table of all keys and options as JSON and stop", anything, "", "",
     "scene"},
    {"-mode", KeyType::word, "", "(of the scene)", "dynamic: steps in time; static: steps in load to an equilibrium",
     anything, "dynamic|static", "static", "time"},
    {"-dt", KeyType::number, "s", "(of the scene)", "time step; chosen where -accuracy is given", positive, "", "5e-3",
     "time"},
    {"-t_end", KeyType::number, "s", "(of the scene)", "end time", positive, "", "0.05", "time"},
    {"-time_limit", KeyType::number, "s", "(none)",
     "wall time after which the run ends after its step, with a checkpoint and exit code 75", positive, "", "3600",
     "time"},
    {"-integrator", KeyType::word, "", "euler",
     "time integrator, of second or third order but for euler (docs/user.md says which for what)", anything,
     "euler|bdf2|bdf3|sdirk2|sdirk23|sdirk33|midpoint|symplectic2|energy_momentum|generalized_alpha", "bdf2", "time"},
    {"-rho_inf",
     KeyType::number,
     "",
     "0.8",
     "generalized_alpha: what is left of the highest frequencies after a step",
     {0, 1},
     "",
     "",
     "time"},
    {"-dt_adapt", KeyType::word, "", "none",
     "none: steps of -dt; error: as long as the estimated error of a step allows", anything, "none|error", "error",
     "time", "the first step is that of -dt"},
    {"-dt_rtol", KeyType::number, "", "1e-3", "-dt_adapt error: error of a step, relative to what it moves", positive,
     "", "", "time", "root mean square over the rod"},
    {"-dt_atol", KeyType::number, "", "1e-6",
     "-dt_adapt error: and in addition, relative to the length of the rod (twists in rad)", positive, "", "", "time"},
    {"-dt_max", KeyType::number, "s", "(none)", "-dt_adapt error: largest step", positive, "", "", "time",
     "the smallest is -dt_min, which is taken whatever its error"},
    {"-dt_min", KeyType::number, "s", "(dt/1024)", "smallest step after rejections; in statics a load factor", positive,
     "", "1e-6", "time"},
    {"-load_steps", KeyType::integer, "", "(of the scene)",
     "static: the first increment of the load factor is one over this", from_one, "", "", "time",
     "steps grow to four times it where Newton needs at most 4 iterations, and halve where it fails"},
    {"-continuation", KeyType::word, "", "load",
     "static: steps of the load factor, or along the path of equilibria, through limit points", anything,
     "load|arclength", "", "time", "stable or not"},
    {"-arclength_steps", KeyType::integer, "", "200", "most steps along the path", from_one, "", "", "time",
     "the path ends before where the load factor reaches 1"},
    {"-bifurcation", KeyType::word, "", "locate",
     "static: where stability is lost: off, locate (find the critical load and go on), stop there, or switch (go on "
     "along the critical mode)",
     anything, "off|locate|stop|switch", "", "time", "all with exit code 0"},
    {"-snes_rtol",
     KeyType::number,
     "",
     "1e-6",
     "Newton's tolerance: residual over the loads of each rod",
     {0, 1, true},
     "",
     "1e-8",
     "solver"},
    {"-snes_max_it", KeyType::integer, "", "100", "Newton iterations of a step at most", from_one, "", "50", "solver",
     "ten times as many where statics have left an unstable equilibrium: the way down may be long"},
    {"-rounding_tolerance", KeyType::number, "", "1e-3",
     "where rounding stops Newton: what is left of the answer, over what the step or its loads move, at most", fraction,
     "", "1e-4", "solver"},
    {"-stretch", KeyType::word, "", "mixed", "axial force: from the strain (primal), or an unknown of its own (mixed)",
     anything, "primal|mixed", "primal", "solver"},
    {"-retraction", KeyType::word, "", "length",
     "how positions move: straight (additive), or keeping the linearised lengths of edges (length)", anything,
     "additive|length", "additive", "solver"},
    {"-hessian", KeyType::word, "", "exact",
     "exact, or without second derivatives of the strains (gauss_newton), for comparison", anything,
     "exact|gauss_newton", "gauss_newton", "solver", "slower"},
    {"-line_search", KeyType::word, "", "energy",
     "what makes a step good: an energy that falls (energy), and flattens, too (wolfe), or a residual that falls "
     "(residual), for comparison",
     anything, "energy|wolfe|residual", "wolfe", "solver"},
    {"-quasi_newton", KeyType::integer, "", "1",
     "iterations that share a factorisation, corrected by secants between; for comparison", from_one, "", "4",
     "solver"},
    {"-rod_edges", KeyType::text, "", "(of the scene)",
     "number of edges: n for all rods, or name:n with commas; the shapes are drawn again, places named by vertices "
     "stay",
     anything, "", "40", "rods"},
    {"-error_estimate", KeyType::flag, "", "false",
     "statics: solve again with half the edge length and tell the estimated error; dynamics: tell that in time, where "
     "the integrator leaves it",
     anything, "", "true", "accuracy"},
    {"-accuracy", KeyType::number, "", "(edges of the scene)",
     "largest relative error: chooses the edges of every rod, and in dynamics the steps", fraction, "", "", "accuracy"},
    {"-accuracy_of", KeyType::word, "", "position",
     "whose error: position (the largest, over the rod's length), tip (over it), or energy (elastic); in dynamics root "
     "mean square in time",
     anything, "position|tip|energy", "", "accuracy"},
    {"-output_dir", KeyType::file, "", "out", "folder for the results", anything, "", "out/run", "output"},
    {"-output_interval", KeyType::number, "s", "0", "time between frames; steps end at its multiples; 0: every step",
     not_negative, "", "0.1", "output", "adapted or not; equal steps are no longer than -dt where that is no divisor"},
    {"-checkpoint_interval", KeyType::integer, "", "0", "steps between checkpoints; 0: only at the end", not_negative,
     "", "10", "output"},
    {"-output_fields", KeyType::text, "", "all", "fields of a frame besides the position, with commas", anything, "",
     "all,curvature", "output",
     "all is director, velocity, twist_rate, axial_force and turns; what is not in the state is named, e.g. "
     "all,force,moment"},
};

/// Row of a key in the table, or the number of its rows.
constexpr std::size_t rowOf(std::string_view path) {
  std::size_t row = 0;
  while (row < std::size(keys) && keys[row].path != path) ++row;
  return row;
}

constexpr const Key *findKey(std::string_view path) {
  const std::size_t row = rowOf(path);
  return row < std::size(keys) ? &keys[row] : nullptr;
}

/// A key of the table that one reads as one of some types.
template <KeyType... types> class KeyOf {
public:
  consteval KeyOf(const char *path) : row_(rowOf(path)) {
    if (row_ == std::size(keys)) throw "this key is not in the table of keys.hpp";
    if (sizeof...(types) > 0 && !((keys[row_].type == types) || ...))
      throw "this key has another type in the table of keys.hpp";
  }
  const Key &operator*() const { return keys[row_]; }
  const Key *operator->() const { return &keys[row_]; }

private:
  std::size_t row_;
};
using AnyKey = KeyOf<>;

/// What -help prints: the options in groups.
std::string helpText();
/// The table as JSON, for scripts/docs.
std::string keysAsJson();
/// The scene language as a JSON Schema, draft 7.
std::string schemaAsJson();

} // namespace tendril
