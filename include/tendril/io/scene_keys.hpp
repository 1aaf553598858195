#pragma once
/// \file scene_keys.hpp
/// The keys of a scene.

#include "tendril/io/key.hpp"
#include "tendril/model/skin.hpp"

namespace tendril {

// clang-format off
/// How rods touch obstacles: in a block of the scene, and in one of each rod.
#define TENDRIL_CONTACT_KEYS(block)                                                                                    \
  {block ".on", KeyType::word, "", "axis",                                                                             \
   "where it touches obstacles and bodies: about points of its axis, by its radius, or at points of its skin",         \
   anything, "axis|surface", "surface"},                                                                               \
  {block ".rods", KeyType::word, "", "none",                                                                           \
   "which other rods it touches, of those that touch it: none, others, or all, itself, too", anything,                 \
   "none|others|all", "all"},                                                                                          \
  {block ".bodies", KeyType::flag, "", "false", "whether it touches bodies that touch rods", anything, "", "true"},     \
  {block ".law", KeyType::word, "", "barrier", "barrier: never gives way; penalty: a spring over the depth", anything, \
   "barrier|penalty", "penalty"},                                                                                      \
  {block ".collider", KeyType::word, "", "capsules",                                                                   \
   "what other rods feel of it: its edges, or spheres of its radius about points; those only with law: penalty",       \
   anything, "capsules|point_cloud", "point_cloud"},                                                                   \
  {block ".cloud", KeyType::word, "", "vertices",                                                                      \
   "points of a point cloud: the vertices, or so many Gauss points of each edge", anything, "vertices|1|2|3", "2"},    \
  {block ".exclusion_ratio", KeyType::number, "", "1.5",                                                               \
   "points of one rod nearer than so many radii, and the threshold, as drawn, do not touch: more than 1", positive, "", \
   "2"},                                                                                                               \
  {block ".radius", KeyType::number, "m", "(of the section)",                                                          \
   "of the rod, where it touches; 0 only with law: penalty", not_negative, "", "0.01"},                                \
  {block ".distance", KeyType::number, "m", "(a fifth of the radius)",                                                 \
   "width of the barrier: surfaces that touch are at most half of it apart, or overlap by that", positive, "",         \
   "1e-3"},                                                                                                            \
  {block ".stiffness", KeyType::number, "N/m, N/m^2", "(barrier: by the loads; penalty: 1e9)",                         \
   "of a barrier, force per length; of a penalty, that over the depth; on: surface, both per area", positive, "",      \
   "100"},                                                                                                             \
  {block ".threshold", KeyType::number, "m", "1e-3", "of a penalty: distance at which it begins", anything, "",        \
   "2e-3"},                                                                                                            \
  {block ".smoothing", KeyType::number, "m", "5e-3",                                                                   \
   "of a penalty: half of the depth over which its stiffness rises", positive, "", "2e-3"},                            \
  {block ".friction", KeyType::number, "", "0", "coefficient of Coulomb's law", not_negative, "", "0.3"},              \
  {block ".friction_at", KeyType::word, "", "surface",                                                                 \
   "where friction acts: at the surface, where it turns the rod, or at its centreline", anything,                      \
   "surface|centreline", "centreline"},                                                                                \
  {block ".stick", KeyType::word, "", "(anchored in statics, else creep)",                                             \
   "what does not slide slips a little in every step, or is drawn back to where it began to stick", anything,          \
   "creep|anchored", "anchored"},                                                                                      \
  {block ".fall_off_velocity", KeyType::number, "m/s", "0.01",                                                         \
   "below which friction falls off to zero: what counts as sticking", positive, "", "1e-3"},                           \
  {block ".slip_length", KeyType::number, "m", "(a thousandth of the radius)",                                         \
   "the same of a way: in statics, and from the anchor of what sticks", positive, "", "1e-5"},                         \
  {block ".tangential_damping", KeyType::number, "s/m", "0",                                                           \
   "viscous friction: of the normal force, by the velocity along the surface", not_negative, "", "0.1"},               \
  {block ".normal_damping", KeyType::number, "s/m", "0",                                                               \
   "Hunt and Crossley's: of the normal force, by the velocity normal to the surface", not_negative, "", "0.1"},        \
  {block ".quadrature", KeyType::word, "", "auto",                                                                     \
   "points of an edge that touch: as the obstacle's curvature asks, or so many Gauss points; on: surface 1, 3 or 6 "    \
   "of each triangle, or its corners",                                                                                 \
   anything, "auto|1|2|3|6|corners", "3"}
// clang-format on

inline constexpr Key scene_keys[] = {
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
    {"include", KeyType::list, "", "(none)",
     "scenes within this one: all of them but gravity, simulation and rotation, as if it were written here before all "
     "else"},
    {"include[].file", KeyType::file, "", "required", "a scene, beside this one", anything, "", "part.yaml"},
    {"include[].prefix", KeyType::text, "", "(none)", "stands before all its names and layers", anything, "", "left."},
    {"include[].rotation", KeyType::vector, "rad", "[0, 0, 0]",
     "rotation vector that turns it about the origin, before it is moved", anything, "", "[0, 0, 0.5]"},
    {"include[].translation", KeyType::vector, "m", "[0, 0, 0]", "by which it is moved", anything, "", "[0, 0, 1]"},
    {"rods", KeyType::list, "", "(bodies, or those of include)",
     "the rods; each block is one, or several of a file or of copies"},
    {"rods[].name", KeyType::text, "", "(rod0, rod1, ...)",
     "by which supports and loads find it; stands for all rods of its block, name.1 and name#2 for one", anything, "",
     "spring"},
    {"rods[].layer", KeyType::text, "", "(none)", "by which 'contact.ignore' finds it, with others", anything, "",
     "strands"},
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
     "that share a vertex are one rod, closed when it ends where it began), .h5 or .json "
     "(position (n, 3), rod_vertex_offsets (rods + 1), closed (rods), directors and skins); the path is relative to "
     "the scene"},
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
    {"rods[].model", KeyType::word, "", "full",
     "unknowns: full, positions and twist; torsion_free, no twist; planar, two coordinates; cable, neither bends nor "
     "twists; auto, the fewest that are proven to do",
     anything, "full|torsion_free|planar|cable|auto", "auto"},
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
    {"rods[].skin", KeyType::map, "", "(none)",
     "a surface of triangles that goes with the rod: in pictures, and where 'contact: {on: surface}' touches"},
    {"rods[].skin.tube", KeyType::map, "", "(none)", "a tube about the rod, with caps at its ends"},
    {"rods[].skin.tube.sides", KeyType::integer, "", "12", "of its section", {3, 10000}, "", "8"},
    {"rods[].skin.tube.radius", KeyType::number, "m", "(of the section)", "of its corners", positive, "", "0.01"},
    {"rods[].skin.tube.half_axes", KeyType::pair, "m", "(of the section)",
     "in place of the radius: of an ellipse, along the first and the second director", positive, "", "[0.01, 0.02]"},
    {"rods[].skin.tube.frames", KeyType::word, "", "(directors where half axes differ, else natural)",
     "from where its corners count: frames that turn as little as they can, or the directors", anything,
     "natural|directors", "directors"},
    {"rods[].skin.tube.area", KeyType::word, "", "inscribed",
     "its corners are on the section, or farther out so that its polygon has the area of the section", anything,
     "inscribed|preserved", "preserved"},
    {"rods[].skin.mesh", KeyType::map, "", "(none)", "triangles about the rod as it is drawn, beside a tube or alone"},
    {"rods[].skin.mesh.file", KeyType::file, "", "required", "an .obj, .off, .ply or .stl file, beside the scene"},
    {"rods[].skin.mesh.scale", KeyType::number, "", "1", "factor of all coordinates", positive, "", "1e-3"},
    {"rods[].skin.mesh.rotation", KeyType::vector, "rad", "[0, 0, 0]", "rotation vector: axis times angle", anything,
     "", "[0, 0, 1.5708]"},
    {"rods[].skin.mesh.translation", KeyType::vector, "m", "[0, 0, 0]", "added last", anything, "", "[0, 0, 1]"},
    {"rods[].skin.mesh.edges",
     KeyType::integer,
     "",
     "2",
     "that carry a point: the nearest, or as many along the rod between whose middles it changes over",
     {1, SkinPoint::most},
     "",
     "3"},
    {"rods[].contact", KeyType::word_or_map, "", "(as the scene)",
     "how it touches obstacles and rods; none: not at all", anything, "none", "none"},
    TENDRIL_CONTACT_KEYS("rods[].contact"),
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
    {"supports[].motion.amplitude", KeyType::vector, "m", "[0, 0, 0]",
     "how far it swings out and back in a period, from rest to rest: by amplitude (1 - cos(2 pi t/period))/2", anything,
     "", "[0.1, 0, 0]"},
    {"supports[].motion.period", KeyType::number, "s", "(with amplitude)", "of an amplitude", positive, "", "2"},
    {"supports[].motion.table", KeyType::rows, "s, m, rad", "(velocities)",
     "rows of [time, dx, dy, dz] or [time, dx, dy, dz, rx, ry, rz], the last three a rotation vector; linear between "
     "rows, at rest outside",
     anything, "", "[[0, 0, 0, 0], [1, 0.1, 0, 0]]"},
    {"constraints", KeyType::list, "", "(none)",
     "springs and dampers between rods and the world, or two vertices, and exact ties of vertices to bodies"},
    {"constraints[].name", KeyType::text, "", "(constraint0, constraint1, ...)",
     "for files and messages; on several rods name#0, name#1, ...", anything, "", "anchor"},
    {"constraints[].type", KeyType::word, "", "required",
     "pin: draws a vertex to a point or to another vertex, or with 'body' makes it a point of that body; rotation: "
     "turns the frame of an edge to a given one; weld: makes a vertex a point of a body that the edges beside it turn "
     "with",
     anything, "pin|rotation|weld", "pin"},
    {"constraints[].body", KeyType::text, "", "(of a weld: required)",
     "which body, by its name or number from 0: a vertex is tied to it exactly, or with a stiffness by a spring",
     anything, "", "cube"},
    {"constraints[].to", KeyType::word_or_map, "", "world", "where the other end is: the world, or a vertex", anything,
     "world", "world"},
    {"constraints[].to.rod", KeyType::rod, "", "(the only one)", "which rod; it may be the same", anything, "", "1"},
    {"constraints[].to.vertex", KeyType::index, "", "(or closest)", "which vertex", not_negative, "", "0"},
    {"constraints[].to.closest", KeyType::flag, "", "false",
     "the vertex drawn nearest to the first, in place of 'vertex'", anything, "", "true"},
    {"constraints[].rod", KeyType::rod, "", "(the only one)", "which rod", anything, "", "0"},
    {"constraints[].vertex", KeyType::index, "", "(of a pin or weld: required)", "which vertex", not_negative, "",
     "last"},
    {"constraints[].closest", KeyType::flag, "", "false",
     "of a pin to the world: the vertex nearest to 'point', in place of 'vertex'", anything, "", "false"},
    {"constraints[].point", KeyType::vector, "m", "(as drawn)",
     "of a pin: where it draws the vertex to, in the world or, as drawn, of a body", anything, "", "[0, 0, 0.1]"},
    {"constraints[].edge", KeyType::index, "", "(of a rotation: required)", "which edge", not_negative, "", "last"},
    {"constraints[].tangent", KeyType::vector, "", "(as drawn)",
     "of a rotation: where it turns the edge; of a weld at an end of the rod: that of the rod at the body, from vertex "
     "to vertex; of any length"},
    {"constraints[].director", KeyType::vector, "", "(as drawn)",
     "of a rotation: where it turns the first director; of a weld at an end of the rod: the first director at the "
     "body; normal to the tangent, of any length"},
    {"constraints[].stiffness", KeyType::number, "N/m, N m", "(required without body)",
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
    {"constraints[].motion.amplitude", KeyType::vector, "m", "[0, 0, 0]",
     "how far it swings out and back in a period, from rest to rest: by amplitude (1 - cos(2 pi t/period))/2", anything,
     "", "[0.1, 0, 0]"},
    {"constraints[].motion.period", KeyType::number, "s", "(with amplitude)", "of an amplitude", positive, "", "2"},
    {"constraints[].motion.table", KeyType::rows, "s, m, rad", "(velocities)", "rows as those of supports", anything,
     "", "[[0, 0, 0, 0], [1, 0.1, 0, 0]]"},
    {"junctions", KeyType::list, "", "(none)", "vertices of rods that are one point"},
    {"junctions[].name", KeyType::text, "", "(junction0, junction1, ...)",
     "for files and messages; of shared points name#0, name#1, ...", anything, "", "crown"},
    {"junctions[].type", KeyType::word, "", "required",
     "rigid: all edges there keep their angles to each other; ball, scissor: each rod runs through and turns freely",
     anything, "rigid|ball|scissor", "rigid"},
    {"junctions[].members", KeyType::list, "", "(or shared)", "the vertices"},
    {"junctions[].members[].rod", KeyType::rod, "", "(the only one)", "which rod", anything, "", "0"},
    {"junctions[].members[].vertex", KeyType::index, "", "required", "which vertex", not_negative, "", "last"},
    {"junctions[].members[].group", KeyType::integer, "", "(none)",
     "of a ball: members with the same number keep their angles to each other", not_negative, "", "0"},
    {"junctions[].shared", KeyType::flag, "", "false", "all points at which vertices of rods lie, in place of members",
     anything, "", "false"},
    {"junctions[].rod", KeyType::rod, "", "(all)", "of shared points: of which rods", anything, "", "all"},
    {"junctions[].within", KeyType::number, "m", "1e-9", "how far apart what is joined may be drawn", not_negative, "",
     "1e-6"},
    {"loads", KeyType::list, "", "(none)", "loads; in statics they grow with the load factor"},
    {"loads[].rod", KeyType::rod, "", "(the only one)", "which rod", anything, "", "0"},
    {"loads[].vertex", KeyType::index, "", "(with force or mass: required)", "where the force acts, or the mass is",
     not_negative, "", "last"},
    {"loads[].force", KeyType::vector, "N", "(another load)", "force on a vertex", anything, "", "[0, 0, 1e-3]"},
    {"loads[].axes", KeyType::word, "", "world",
     "of a force: fixed in space, or turning with the rod (a follower force): along the first and the second "
     "director and the tangent",
     anything, "world|material", "material"},
    {"loads[].mass", KeyType::number, "kg", "(another load)",
     "point mass on a vertex: its inertia, and its weight where gravity acts on the rod", positive, "", "0.1"},
    {"loads[].edge", KeyType::index, "", "(with couples: required)", "where the couple acts", not_negative, "", "last"},
    {"loads[].torque", KeyType::number, "N m", "(another load)", "couple about the present tangent of the edge",
     anything, "", "1e-4"},
    {"loads[].moment", KeyType::vector, "N m", "(another load)", "couple of fixed direction", anything, "",
     "[0, 0, 1e-4]"},
    {"colliders", KeyType::list, "", "(none)", "obstacles that rods and bodies touch"},
    {"colliders[].name", KeyType::text, "", "(collider0, collider1, ...)", "for files and messages", anything, "",
     "floor"},
    {"colliders[].layer", KeyType::text, "", "(none)", "by which 'contact.ignore' finds it, with others", anything, "",
     "ground"},
    {"colliders[].plane", KeyType::map, "", "(another shape)", "a plane; all behind it is solid"},
    {"colliders[].plane.normal", KeyType::vector, "", "[0, 1, 0]", "out of the solid, of any length", anything, "",
     "[0, 0, 1]"},
    {"colliders[].sphere", KeyType::map, "", "(another shape)", "a ball about the position"},
    {"colliders[].sphere.radius", KeyType::number, "m", "required", "its radius", positive, "", "0.1"},
    {"colliders[].capsule", KeyType::map, "", "(another shape)", "a cylinder with half spheres as ends"},
    {"colliders[].capsule.radius", KeyType::number, "m", "required", "of cylinder and ends", positive, "", "0.05"},
    {"colliders[].capsule.length", KeyType::number, "m", "required", "of the cylinder between its ends", positive, "",
     "0.3"},
    {"colliders[].capsule.axis", KeyType::vector, "", "[0, 0, 1]", "of any length", anything, "", "[0, 1, 0]"},
    {"colliders[].cylinder", KeyType::map, "", "(another shape)", "with flat ends, its middle at the position"},
    {"colliders[].cylinder.radius", KeyType::number, "m", "required", "its radius", positive, "", "0.1"},
    {"colliders[].cylinder.length", KeyType::number, "m", "(endless)", "its length", positive, "", "0.5"},
    {"colliders[].cylinder.axis", KeyType::vector, "", "[0, 0, 1]", "of any length", anything, "", "[0, 1, 0]"},
    {"colliders[].box", KeyType::map, "", "(another shape)", "its middle at the position"},
    {"colliders[].box.size", KeyType::vector, "m", "required", "its edges along its own x, y, z", positive, "",
     "[1, 0.1, 1]"},
    {"colliders[].tube", KeyType::map, "", "(another shape)", "a pipe, its middle at the position: rods lie within"},
    {"colliders[].tube.bore", KeyType::number, "m", "required", "its inner radius", positive, "", "0.02"},
    {"colliders[].tube.outer", KeyType::number, "m", "(all around is solid)", "its outer radius", positive, "", "0.03"},
    {"colliders[].tube.length", KeyType::number, "m", "(endless)", "its length", positive, "", "0.5"},
    {"colliders[].tube.axis", KeyType::vector, "", "[0, 0, 1]", "of any length", anything, "", "[1, 0, 0]"},
    {"colliders[].mesh", KeyType::map, "", "(another shape)",
     "a closed surface of triangles, by a grid of its distances"},
    {"colliders[].mesh.file", KeyType::file, "", "required", "an .obj, .off, .ply or .stl file, beside the scene"},
    {"colliders[].mesh.scale", KeyType::number, "", "1", "factor on its coordinates", positive, "", "1e-3"},
    {"colliders[].mesh.cell", KeyType::number, "m", "(a 64th of its longest side)", "edge of the cells of the grid",
     positive, "", "2e-3"},
    {"colliders[].position", KeyType::vector, "m", "[0, 0, 0]", "of its middle, or of a point of the plane", anything,
     "", "[0, 0, 1]"},
    {"colliders[].rotation", KeyType::vector, "rad", "[0, 0, 0]", "rotation vector that turns it before it is moved",
     anything, "", "[0, 0, 0.5]"},
    {"colliders[].friction", KeyType::number, "", "(that of the rod)",
     "its coefficient; between it and a rod the geometric mean of both acts", not_negative, "", "0.5"},
    {"colliders[].motion", KeyType::map, "", "(none)", "how it moves; in statics time is the load factor, 0 to 1"},
    {"colliders[].motion.velocity", KeyType::vector, "m/s", "[0, 0, 0]", "of its position", anything, "",
     "[0.1, 0, 0]"},
    {"colliders[].motion.angular_velocity", KeyType::vector, "rad/s", "[0, 0, 0]", "about its position", anything, "",
     "[1, 0, 0]"},
    {"colliders[].motion.amplitude", KeyType::vector, "m", "[0, 0, 0]",
     "how far it swings out and back in a period, from rest to rest: by amplitude (1 - cos(2 pi t/period))/2", anything,
     "", "[0.1, 0, 0]"},
    {"colliders[].motion.period", KeyType::number, "s", "(with amplitude)", "of an amplitude", positive, "", "2"},
    {"colliders[].motion.table", KeyType::rows, "s, m, rad", "(velocities)", "rows as those of supports", anything, "",
     "[[0, 0, 0, 0], [1, 0.1, 0, 0]]"},
    {"contact", KeyType::map, "", "(defaults)",
     "how all rods touch obstacles, each other and bodies; each rod may have keys of its own"},
    TENDRIL_CONTACT_KEYS("contact"),
    {"contact.ignore", KeyType::list, "", "(none)",
     "pairs that pass through each other: two of rods, to_rods, bodies, to_bodies and colliders"},
    {"contact.ignore[].rods", KeyType::text, "", "(none)", "name or layer of rods, or all", anything, "", "strands"},
    {"contact.ignore[].to_rods", KeyType::text, "", "(none)", "of rods that these pass through", anything, "", "all"},
    {"contact.ignore[].bodies", KeyType::text, "", "(none)", "name or layer of bodies", anything, "", "bob"},
    {"contact.ignore[].to_bodies", KeyType::text, "", "(none)", "of bodies that these pass through", anything, "",
     "bob"},
    {"contact.ignore[].colliders", KeyType::text, "", "(none)", "name or layer of colliders", anything, "", "floor"},
};

} // namespace tendril
