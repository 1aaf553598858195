/// Scenes from YAML. Numbers are taken over exactly unless a tolerance is given. Mistakes are in
/// tests/apps/bad_input.py.
#include "tendril/io/scene_reader.hpp"

#include "support/files.hpp"

#include <cmath>

namespace tendril::test {
namespace {

const std::string bare = "line: {from: [0, 0, 0], to: [1, 0, 0], edges: 4}", line = bare + ", material: default";

SceneFile read(const std::string &text, const std::map<std::string, std::string> &overrides = {}) {
  const Folder folder;
  return readScene(folder.write("scene.yaml", text), overrides);
}

/// The only rod of a scene whose rod block is `text`, and the default material where it says none.
Rod readRod(const std::string &text, const std::map<std::string, std::string> &overrides = {}) {
  const bool has = text.find("material:") != std::string::npos;
  return read("rods: [{" + text + (has ? "}]" : ", material: default}]"), overrides).scene.rods.at(0);
}

TEST(SceneReader, DefaultsAreTheStiffnessParametersOfAThinRod) {
  const SceneFile file = read("rods: [{" + line + "}]\n");
  const Scene &scene = file.scene;
  ASSERT_EQ(scene.rods.size(), 1u);
  const Rod &rod = scene.rods[0];
  const Material &m = rod.material;
  EXPECT_EQ(rod.name, "rod0");
  EXPECT_EQ(rod.vertices(), 5);
  EXPECT_FALSE(rod.closed);
  EXPECT_TRUE(rod.gravity);
  EXPECT_EQ(rod.measure, Measure::tan);
  EXPECT_EQ(rod.energy, Energy::seed);
  EXPECT_EQ(rod.natural, Rod::Natural::as_drawn);
  EXPECT_EQ(scene.gravity, Vec3(0, -9.81, 0));
  EXPECT_EQ(m.linear_density, 1e-1);
  EXPECT_EQ(m.linear_rotational_inertia, 1e-6);
  EXPECT_EQ(m.axial_stiffness, 1e2);
  EXPECT_EQ(m.torsional_stiffness, 5e-4);
  EXPECT_EQ(m.flexural_stiffness, (std::array<double, 2>{5e-4, 5e-4}));
  EXPECT_EQ(m.mass_damping_coefficient, 0);
  EXPECT_EQ(m.stiffness_damping_coefficient, 0);
  EXPECT_EQ(file.run.mode, "dynamic");
  EXPECT_TRUE(scene.supports.empty() && scene.forces.empty() && scene.moments.empty());
}

TEST(SceneReader, KeepsTheTextOfTheSceneAndOfTheFilesThatItNames) {
  const Folder folder;
  const std::string points = "0 0 0\n1 0 0\n";
  folder.write("line.csv", points);
  const std::string text = "rods:\n  - {file: line.csv, material: default}\n  - {file: line.csv, material: default, "
                           "copies: {count: 2, offset: [0, 1, 0]}}\n  - {" +
                           line + "}\n";
  const SceneSource source = readScene(folder.write("scene.yaml", text)).source;
  EXPECT_EQ(source.text, text);
  ASSERT_EQ(source.files.size(), 1u);
  EXPECT_EQ(source.files[0], (std::pair<std::string, std::string>("line.csv", points)));
}

TEST(SceneReader, SimulationBlock) {
  const RunSettings run =
      read("simulation: {mode: static, dt: 0.25, t_end: 3, load_steps: 7}\nrods: [{" + line + "}]\n").run;
  EXPECT_EQ(run.mode, "static");
  EXPECT_EQ(run.dt, 0.25);
  EXPECT_EQ(run.t_end, 3);
  EXPECT_EQ(run.load_steps, 7);
}

TEST(SceneReader, PlacesShapes) {
  // Scaled, then turned by a quarter about z, then moved.
  const Rod rod = readRod("points: [[0, 0, 0], [1, 0, 0], [1, 2, 0]], place: {scale: 0.5, rotation: [0, 0, "
                          "1.5707963267948966], translation: [0, 0, 3]}");
  EXPECT_LT((rod.position[1] - Vec3(0, 0.5, 3)).norm(), 1e-15);
  EXPECT_LT((rod.position[2] - Vec3(-1, 0.5, 3)).norm(), 1e-15);
  const Rod helix = readRod("helix: {length: 1, radius: 0.1, turns: 2, edges: 32}, place: {translation: [0, 1, 0]}");
  EXPECT_EQ(helix.position[0],
            readRod("helix: {length: 1, radius: 0.1, turns: 2, edges: 32}").position[0] + Vec3(0, 1, 0));
}

TEST(SceneReader, SectionsOfEveryShape) {
  const std::string elastic = "young: 1e6, poisson: 0.25, density: 1000";
  const Material circle = readRod(bare + ", material: {radius: 0.01, " + elastic + "}").material;
  EXPECT_DOUBLE_EQ(circle.axial_stiffness, 1e6 * pi * 1e-4);
  EXPECT_DOUBLE_EQ(circle.torsional_stiffness, 1e6 / 2.5 * pi * 1e-8 / 2); // G = E/(2 (1 + nu))
  const Material ellipse = readRod(bare + ", material: {radii: [0.02, 0.01], " + elastic + "}").material;
  EXPECT_DOUBLE_EQ(ellipse.flexural_stiffness[1] / ellipse.flexural_stiffness[0],
                   4); // stiffer in the plane of the long axis
  const Material strip =
      readRod(bare + ", material: {width: 0.02, height: 0.01, young: 1e6, shear: 5e5, density: 1000}").material;
  EXPECT_DOUBLE_EQ(strip.flexural_stiffness[0], 1e6 * 0.02 * 1e-6 / 12);
  EXPECT_DOUBLE_EQ(strip.linear_density, 0.2);
}

TEST(SceneReader, StiffnessParametersReplaceThoseOfTheSection) {
  const Material m = readRod(bare + ", material: {radius: 0.01, young: 1e6, poisson: 0.5, density: 1000, "
                                    "axial_stiffness: 5, flexural_stiffness: [1, 2], "
                                    "stiffness_damping_coefficient: 0.1}")
                         .material;
  EXPECT_EQ(m.axial_stiffness, 5);
  EXPECT_EQ(m.flexural_stiffness, (std::array<double, 2>{1, 2}));
  EXPECT_EQ(m.stiffness_damping_coefficient, 0.1);
  EXPECT_DOUBLE_EQ(m.linear_density, 1000 * pi * 1e-4);
  EXPECT_TRUE(readRod(bare + ", material: {flexural_stiffness: 0}").material.isCable());
}

TEST(SceneReader, OverridesReachEveryRod) {
  const std::string text = "rods:\n  - {" + bare +
                           ", material: {radius: 0.01, young: 1e6, poisson: 0.5, density: 1000}}\n  - {" + bare +
                           ", measure: tan, material: {radius: 0.02, young: 1e6, poisson: 0.5, density: 1000}}\n";
  const Scene plain = read(text).scene, changed = read(text, {{"young", "2e6"},
                                                              {"flexural_stiffness", "[3,4]"},
                                                              {"measure", "angle"},
                                                              {"energy", "classical"}})
                                                      .scene;
  for (int r = 0; r < 2; ++r) {
    EXPECT_DOUBLE_EQ(changed.rods[r].material.axial_stiffness, 2 * plain.rods[r].material.axial_stiffness);
    EXPECT_EQ(changed.rods[r].material.flexural_stiffness, (std::array<double, 2>{3, 4}));
    EXPECT_EQ(changed.rods[r].measure, Measure::angle);
    EXPECT_EQ(changed.rods[r].energy, Energy::classical);
  }
  EXPECT_EQ(read("rods: [{" + bare + "}]\n", {{"axial_stiffness", "7"}}).scene.rods[0].material.axial_stiffness,
            7); // a rod without a material
}

TEST(SceneReader, NaturalShapes) {
  EXPECT_EQ(readRod(line + ", natural: as_drawn").natural, Rod::Natural::as_drawn);
  const Rod straight = readRod("ring: {radius: 1, edges: 8}, natural: straight");
  EXPECT_EQ(straight.natural, Rod::Natural::given);
  EXPECT_EQ(straight.natural_strain, Vec3::Zero());
  const Rod curved = readRod(line + ", natural: {curvature: [1, 2], twist: 3}");
  EXPECT_EQ(curved.natural, Rod::Natural::given);
  EXPECT_EQ(curved.natural_strain, Vec3(1, 2, 3));
  EXPECT_EQ(readRod(line + ", natural: {twist: 3}").natural_strain, Vec3(0, 0, 3));
}

TEST(SceneReader, ShapesAndDirectors) {
  const Rod ring = readRod("ring: {center: [0, 0, 1], normal: [0, 0, 2], radius: 0.5, edges: 12}, turns: -2");
  EXPECT_TRUE(ring.closed);
  EXPECT_EQ(ring.edges(), 12);
  EXPECT_EQ(ring.initial_turns, -2);
  const Rod points =
      readRod("points: [[0, 0, 0], [1, 0, 0], [1, 1, 0]], closed: true, gravity: false, velocity: [1, 2, 3]");
  EXPECT_TRUE(points.closed);
  EXPECT_FALSE(points.gravity);
  EXPECT_EQ(points.initial_velocity, Vec3(1, 2, 3));
  EXPECT_EQ(readRod(line + ", director: [0, 0, 3]").director[3], Vec3(0, 0, 1));
  const Rod each = readRod("points: [[0, 0, 0], [1, 0, 0], [2, 0, 0]], directors: [[0, 2, 0], [0, 0, -1]]");
  EXPECT_EQ(each.director, (std::vector<Vec3>{{0, 1, 0}, {0, 0, -1}}));
}

TEST(SceneReader, CopiesAndFilesMakeSeveralRods) {
  const Folder folder;
  folder.write("two.csv", "0 0 0\n1 0 0\n\n0 1 0\n1 1 0\n2 1 0\n");
  const Scene scene =
      readScene(folder.write(
                    "scene.yaml",
                    "rods:\n  - {name: a, file: two.csv, material: default, copies: {count: 3, offset: [0, 0, 2]}}\n  "
                    "- {name: b, " +
                        line +
                        "}\n"
                        "supports:\n  - {rod: a, vertex: last, type: pin}\n  - {rod: b, vertex: 0, type: pin}\n"
                        "loads:\n  - {rod: all, vertex: 0, force: [0, 0, 1]}\n  - {rod: a.1, edge: last, torque: 2}\n"))
          .scene;
  ASSERT_EQ(scene.rods.size(), 7u);
  EXPECT_EQ(scene.rods[3].name, "a.1#1");
  EXPECT_EQ(scene.rods[3].vertices(), 3);
  EXPECT_EQ(scene.rods[5].position[0], Vec3(0, 1, 4));
  ASSERT_EQ(scene.supports.size(), 7u); // all six of a, one of b
  EXPECT_EQ(scene.supports[0].vertex, 1);
  EXPECT_EQ(scene.supports[1].vertex, 2);
  EXPECT_EQ(scene.supports[6].rod, 6);
  EXPECT_EQ(scene.forces.size(), 7u);
  ASSERT_EQ(scene.moments.size(), 3u); // the copies of one polyline
  EXPECT_EQ(scene.moments[0].rod, 1);
  EXPECT_EQ(scene.moments[0].edge, 1);
}

TEST(SceneReader, SupportsAndMotions) {
  const Scene scene =
      read("rods: [{" + line +
           "}]\nsupports:\n"
           "  - {vertex: 0, type: clamp, tangent: [0, 2, 0], director: [0, 0, 1], motion: {velocity: [1, 0, 0], "
           "angular_velocity: [0, 1, 0]}}\n"
           "  - {vertex: 2, type: pin, motion: {table: [[0, 0, 0, 0], [1, 0, 0, 2]]}}\n"
           "  - {vertex: 4, type: fix_twist, motion: {table: [[0, 0, 0, 0, 0, 0, 0], [1, 0, 0, 0, 3, 0, 0]]}}\n")
          .scene;
  ASSERT_EQ(scene.supports.size(), 3u);
  EXPECT_EQ(scene.supports[0].kind, Support::Kind::clamp);
  EXPECT_EQ(scene.supports[0].frame.tangent, Vec3(0, 1, 0));
  EXPECT_EQ(scene.supports[0].frame.director, Vec3(0, 0, 1));
  EXPECT_EQ(scene.supports[0].motion.displacementAt(2), Vec3(2, 0, 0));
  EXPECT_EQ(scene.supports[1].kind, Support::Kind::pin);
  EXPECT_EQ(scene.supports[1].motion.displacementAt(0.5), Vec3(0, 0, 1));
  EXPECT_EQ(scene.supports[2].kind, Support::Kind::fix_twist);
  const Mat3 turned = Eigen::AngleAxisd(1.5, Vec3::UnitX()).toRotationMatrix();
  EXPECT_LT((scene.supports[2].motion.rotationAt(0.5) - turned).norm(), 1e-15); // one rotation matrix
}

TEST(SceneReader, Loads) {
  const Scene scene =
      read("rods: [{" + line +
           "}]\nloads:\n  - {vertex: last, force: [1, 2, 3]}\n  - {edge: 1, torque: 4, moment: [0, 5, 0]}\n")
          .scene;
  ASSERT_EQ(scene.forces.size(), 1u);
  EXPECT_EQ(scene.forces[0].vertex, 4);
  EXPECT_EQ(scene.forces[0].force, Vec3(1, 2, 3));
  ASSERT_EQ(scene.moments.size(), 1u);
  EXPECT_EQ(scene.moments[0].edge, 1);
  EXPECT_EQ(scene.moments[0].torque, 4);
  EXPECT_EQ(scene.moments[0].moment, Vec3(0, 5, 0));
}

TEST(SceneReader, ErrorsNameTheirLine) {
  EXPECT_TRUE(says(messageOf([] {
                     read("gravity: [0, 0, 0]\nrods:\n  - name: a\n    " + bare +
                          "\n    material: default\n    colour: red\n");
                   }),
                   "scene.yaml:6: unknown key 'colour'"));
  EXPECT_TRUE(says(messageOf([] {
                     read("rods: [{" + line + "}]\n", {{"linear_density", "heavy"}});
                   }),
                   "option -rod_linear_density: "));
}

/// Lines told at the start.
std::vector<std::string> notesOf(const std::string &text, const Overrides &overrides = {}) {
  return read(text, overrides).notes;
}

TEST(SceneReader, TellsEveryDefaultOfAMaterialOnce) {
  const auto given = notesOf("rods: [{" + bare + ", material: default}, {" + bare + ", material: default}]");
  ASSERT_EQ(given.size(), 1u);
  EXPECT_EQ(given[0], "default material: flexural_stiffness 0.0005 N m^2, linear_density 0.1 kg/m, "
                      "linear_rotational_inertia 1e-06 kg m, axial_stiffness 100 N, "
                      "torsional_stiffness 0.0005 N m^2 (rod 'rod0' and 1 more)");
  const auto part = notesOf("rods: [{name: a, " + bare +
                            ", material: {linear_density: 1, axial_stiffness: 1e6, flexural_stiffness: 1}}]");
  ASSERT_EQ(part.size(), 1u);
  EXPECT_EQ(part[0], "warning: the material is not complete, by default: linear_rotational_inertia 1e-06 kg m, "
                     "torsional_stiffness 0.0005 N m^2 (rod 'a')");
  // Nothing is left to guess: a section, a cable that does not twist, all five; by the scene or by options.
  EXPECT_TRUE(
      notesOf("rods: [{" + bare + ", material: {radius: 0.01, young: 1e6, poisson: 0.5, density: 1000}}]").empty());
  EXPECT_TRUE(
      notesOf("rods: [{" + bare + ", material: {axial_stiffness: 5, linear_density: 1, flexural_stiffness: 0}}]")
          .empty());
  EXPECT_TRUE(
      notesOf("rods: [{" + bare + "}]", {{"radius", "0.01"}, {"young", "1e6"}, {"poisson", "0.5"}, {"density", "1000"}})
          .empty());
  EXPECT_TRUE(says(messageOf([] { read("rods: [{" + bare + "}]"); }),
                   "scene.yaml:1: 'rods[0]' needs the key 'material' (a map, or default)"));
  EXPECT_TRUE(says(messageOf([] { read("rods: [{" + bare + ", material: steel}]"); }),
                   "'material' must be one of default; found 'steel'"));
}

TEST(SceneReader, WarnsOfForcesOnHeldVerticesAndOfMotionsThatBeginElsewhere) {
  const std::string rod =
      "rods: [{name: a, " + bare + ", material: {radius: 0.01, young: 1e6, poisson: 0.5, density: 1000}}]\n";
  const auto held = notesOf(
      rod +
      "supports: [{vertex: 0, type: pin}]\nloads: [{vertex: 0, force: [0, 0, 1]}, {vertex: 1, force: [0, 0, 1]}]\n");
  ASSERT_EQ(held.size(), 1u);
  EXPECT_TRUE(says(held[0], "scene.yaml:3: the force acts on vertex 0 of rod 'a', which a support holds"));
  EXPECT_TRUE(
      notesOf(rod + "supports: [{vertex: 0, type: fix_twist}]\nloads: [{vertex: 0, force: [0, 0, 1]}]\n").empty());
  const auto jumps = notesOf(
      rod + "supports: [{vertex: 0, type: clamp, motion: {table: [[1, 0, 0, 3, 0, 2, 0], [2, 0, 0, 0, 0, 0, 0]]}}]\n");
  ASSERT_EQ(jumps.size(), 1u); // at rest before its first time
  EXPECT_TRUE(says(jumps[0], "scene.yaml:2: the motion begins 3 m and 2 rad away from rod 'a' as drawn"));
  EXPECT_TRUE(
      notesOf(rod + "supports: [{vertex: 0, type: pin, motion: {table: [[-1, 0, 0, -1], [1, 0, 0, 1]]}}]\n").empty());
}

TEST(SceneReader, WholeNumbersMayBeLargeOrHaveAnExponent) {
  const auto edges = [](const std::string &n) {
    return "rods: [{line: {from: [0, 0, 0], to: [1, 0, 0], edges: " + n + "}, material: default}]";
  };
  EXPECT_EQ(read(edges("1e2")).scene.rods[0].edges(), 100);
  for (const char *n : {"1e12", "1000000000000", "20000000", ".inf"})
    EXPECT_TRUE(says(messageOf([&] { read(edges(n)); }), "'edges' is too large")) << n;
  for (const char *n : {"4.5", "1e-3", ".nan"})
    EXPECT_TRUE(says(messageOf([&] { read(edges(n)); }), "must be a whole number")) << n;
}

TEST(SceneReader, EndsWhereYamlWouldNot) {
  for (const char *text : {",", "[1],", "{a: 1},", "---\n,", "a: 1\n--- ,\n"})
    EXPECT_TRUE(says(messageOf([&] { read(text); }), "not valid YAML")) << text;
  std::string deep, wide = "a0: &a0 [1]\n"; // every alias twice the one before: 2^40 values in 40 lines
  for (int k = 0; k < 1000; ++k) deep += k < 500 ? '[' : ']';
  for (int k = 0; k < 40; ++k)
    wide += "a" + std::to_string(k + 1) + ": &a" + std::to_string(k + 1) + " [*a" + std::to_string(k) + ", *a" +
            std::to_string(k) + "]\n";
  EXPECT_TRUE(says(messageOf([&] { read(deep); }), "more than 32 maps and lists"));
  EXPECT_TRUE(says(messageOf([&] { read(wide); }), "5 million values"));
  EXPECT_TRUE(says(messageOf([] { read("a: &a {b: *a}"); }), "an alias of what it stands in"));
  EXPECT_EQ(read("rods:\n  - {" + bare + ", material: &m {radius: 0.01, young: 1e6, poisson: 0.5, density: 1}}\n  - {" +
                 bare + ", material: *m}\n")
                .scene.rods.size(),
            2u);
}

/// Bodies without names are counted as they stand in the file; what is tied to one that stays, supports hold.
TEST(SceneReader, BodiesAreFreeOrHeld) {
  const std::string ball = "sphere: {radius: 0.1}, density: 10";
  const Scene scene = read("rods: [{" + line + "}]\nbodies: [{" + ball + ", fixed: true}, {" + ball +
                           "}]\nconstraints: [{type: weld, vertex: 0, body: 0}, {type: pin, vertex: 4, body: body1}]\n")
                          .scene;
  ASSERT_EQ(scene.held_bodies.size(), 1u);
  ASSERT_EQ(scene.bodies.size(), 1u);
  EXPECT_EQ(scene.held_bodies[0].name, "body0");
  EXPECT_EQ(scene.bodies[0].name, "body1");
  ASSERT_EQ(scene.supports.size(), 1u);
  EXPECT_EQ(scene.supports[0].kind, Support::Kind::clamp);
  ASSERT_EQ(scene.attachments.size(), 1u);
  EXPECT_FALSE(scene.attachments[0].weld);
  EXPECT_EQ(scene.attachments[0].vertex, 4);
}

TEST(SceneReader, ReadsTextOnly) {
  EXPECT_EQ(read("\xEF\xBB\xBFrods: [{name: \xC3\xA9, " + line + "}]").scene.rods[0].name,
            "\xC3\xA9"); // behind a byte order mark
  EXPECT_TRUE(says(messageOf([] { read("# one\nn\xE4me: 1\n"); }), "scene.yaml:2: the byte 0xE4 is no text"));
  EXPECT_TRUE(says(messageOf([] { read(std::string("a: 1\n\0", 6)); }), "scene.yaml:2: the byte 0x00 is no text"));
}

} // namespace
} // namespace tendril::test
