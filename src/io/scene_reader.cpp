#include "tendril/io/scene_reader.hpp"

#include "tendril/geometry/rotation.hpp"
#include "tendril/io/body_reader.hpp"
#include "tendril/io/collider_reader.hpp"
#include "tendril/io/include_reader.hpp"
#include "tendril/io/junction_reader.hpp"
#include "tendril/io/polyline_reader.hpp"
#include "tendril/io/rod_reader.hpp"
#include "tendril/io/support_reader.hpp"
#include "tendril/io/tendon_reader.hpp"
#include "tendril/io/text.hpp"
#include "tendril/io/yaml.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

namespace tendril {
namespace {

void readRun(const YamlValue &value, RunSettings &run) {
  YamlMap map(value, "simulation");
  run.mode = map.word("simulation.mode");
  run.dt = map.number("simulation.dt");
  run.t_end = map.number("simulation.t_end");
  run.load_steps = map.integer("simulation.load_steps");
  map.finish();
}

std::string contentOf(const std::filesystem::path &path, const std::string &mistake) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw SceneError(path.string() + mistake);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The meshes of things that have some, or their skins.
void keepMeshes(const YamlValue &things, SceneSource &source) {
  for (const YamlValue &thing : things.items()) {
    const YAML::Node node = thing.node(); // of a constant node [] makes nothing
    const YAML::Node skin = node["skin"], holder = skin && skin.IsMap() ? skin : node, mesh = holder["mesh"];
    if (mesh && mesh.IsMap() && mesh["file"])
      source.paths.push_back((std::filesystem::path(things.file()).parent_path() / mesh["file"].Scalar()).string());
  }
}

/// The polyline files of the rods; HDF5 files are no text.
void keepFiles(const YamlValue &rods, SceneSource &source) {
  for (const YamlValue &rod : rods.items()) {
    const YAML::Node node = rod.node()["file"];
    if (!node) continue;
    const std::string path = node.Scalar();
    const std::filesystem::path place = std::filesystem::path(rods.file()).parent_path() / path;
    source.paths.push_back(place.string());
    const bool seen =
        std::any_of(source.files.begin(), source.files.end(), [&](const auto &file) { return file.first == path; });
    if (!seen && isTextPolyline(place.string()))
      source.files.emplace_back(path, contentOf(place, ": cannot be read again"));
  }
}

using Includes = std::vector<std::string>;

/// Reads a file. \return the map that it is
YamlMap openScene(const std::string &path, SceneFile &out) {
  if (std::filesystem::is_directory(path)) throw SceneError(path + ": is a folder; give a scene file with -scene");
  out.source.text = readText(path, ": cannot be opened; give an existing scene file with -scene");
  const std::vector<YAML::Node> documents = loadYaml(out.source.text, path);
  if (documents.empty() || documents[0].IsNull())
    throw SceneError(path + ":1: is empty; a scene needs at least 'rods'");
  if (documents.size() > 1)
    throw SceneError(path + ":" + std::to_string(documents[1].Mark().line + 1) +
                     ": a second document begins here; a scene is one");
  return YamlMap(YamlValue(documents[0], path, "scene"));
}

void readIncludes(YamlMap &map, const Overrides &overrides, Includes &within, SceneFile &out);

/// All of a file but what follows from the whole scene. \param within files that include it
void readBlocks(YamlMap &map, const Overrides &overrides, Includes &within, SceneFile &out) {
  out.scene.gravity = map.vector("gravity");
  readRun(map.has("simulation") ? map.at("simulation") : YamlValue(YAML::Load("{}"), map.value().file(), "simulation"),
          out.run);
  RodBlocks sums;
  sums.contact = readContact(map);
  out.source.paths.push_back(map.value().file());
  if (map.has("include")) readIncludes(map, overrides, within, out);
  if (map.has("rods"))
    for (const YamlValue &v : map.at("rods").items()) readRod(v, overrides, out, sums);
  for (const auto &[values, names] : sums.defaults)
    out.notes.push_back(values + " (rod '" + names[0] + "'" +
                        (names.size() > 1 ? " and " + std::to_string(names.size() - 1) + " more" : "") + ")");
  if (map.has("bodies"))
    for (const YamlValue &v : map.at("bodies").items()) readBody(v, sums.contact, out);
  if (out.scene.rods.empty() && out.scene.bodies.empty())
    (map.has("rods") ? map.at("rods") : map.value())
        .fail("a scene needs at least one rod, in 'rods', or body that is free, in 'bodies'");
  if (map.has("joints"))
    for (const YamlValue &v : map.at("joints").items()) readJoint(v, out);
  if (map.has("tendons"))
    for (const YamlValue &v : map.at("tendons").items()) readTendon(v, out);
  if (map.has("supports"))
    for (const YamlValue &v : map.at("supports").items()) readSupport(v, out);
  if (map.has("constraints"))
    for (const YamlValue &v : map.at("constraints").items()) readConstraint(v, out);
  if (map.has("junctions"))
    for (const YamlValue &v : map.at("junctions").items()) readJunction(v, out);
  if (map.has("loads"))
    for (const YamlValue &v : map.at("loads").items()) readLoad(v, out);
  if (map.has("colliders"))
    for (const YamlValue &v : map.at("colliders").items()) readCollider(v, out.scene);
  readIgnored(map, out);
  if (map.has("rods")) {
    keepFiles(map.at("rods"), out.source);
    keepMeshes(map.at("rods"), out.source);
  }
  if (map.has("colliders")) keepMeshes(map.at("colliders"), out.source);
  if (map.has("bodies")) keepMeshes(map.at("bodies"), out.source);
}

void readIncludes(YamlMap &map, const Overrides &overrides, Includes &within, SceneFile &out) {
  for (const YamlValue &value : map.at("include").items()) {
    YamlMap block(value, "include");
    const YamlValue file = block.at("include[].file");
    const std::string path = (std::filesystem::path(file.file()).parent_path() / file.text()).string(),
                      name = std::filesystem::weakly_canonical(path).string(),
                      prefix = block.has("include[].prefix") ? block.at("include[].prefix").text() : "";
    if (std::find(within.begin(), within.end(), name) != within.end())
      file.fail("'" + file.text() + "' includes itself, by way of what it includes");
    if (!std::filesystem::is_regular_file(path)) file.fail(path + " is no file; 'file' names a scene beside this one");
    if (prefix != inOneLine(prefix)) block.at("include[].prefix").fail("'prefix' must be in one line");
    SceneFile part;
    YamlMap whole = openScene(path, part);
    within.push_back(name);
    readBlocks(whole, overrides, within, part);
    within.pop_back();
    if (whole.has("rotation"))
      whole.at("rotation").fail("a scene that others include cannot turn; write 'rotation' into the outer one");
    whole.finish();
    place(part.scene, part.drawings, rotationBy(block.vector("include[].rotation")),
          block.vector("include[].translation"));
    part.source.files.emplace_back(file.text(), part.source.text);
    block.finish();
    append(std::move(part), prefix, value, out);
  }
}

} // namespace

SceneFile readScene(const std::string &path, const Overrides &overrides) {
  SceneFile out;
  YamlMap map = openScene(path, out);
  Includes within{std::filesystem::weakly_canonical(path).string()};
  readBlocks(map, overrides, within, out);
  Scene &scene = out.scene;
  if (map.has("rotation")) {
    YamlMap rotation(map.at("rotation"), "rotation");
    scene.rotation.angular_velocity = rotation.vector("rotation.angular_velocity");
    scene.rotation.centre = rotation.vector("rotation.centre");
    rotation.finish();
  }
  if (!scene.bodies.empty() && !scene.rotation.angular_velocity.isZero(0))
    map.at("rotation").fail("a frame that turns has no forces on 'bodies' yet; take 'rotation' or the bodies away");
  const bool touches = !scene.colliders.empty() || scene.touchesMoving();
  const YamlValue of_contact = map.has("contact")     ? map.at("contact")
                               : map.has("colliders") ? map.at("colliders")
                               : map.has("rods")      ? map.at("rods")
                                                      : map.value();
  if (touches) completeContact(of_contact, overrides, scene);
  if (map.has("contact") && !touches)
    map.at("contact").fail("'contact' has nothing to act on: rods touch 'colliders', each other with 'contact: {rods: "
                           "all}', and bodies with 'contact: {bodies: true}'; add one of these, or take it away");
  for (const auto &[name, value] : overrides)
    if (name.rfind("contact_", 0) == 0 && !touches)
      throw SceneError("option -" + name +
                       ": the scene has no 'colliders' that rods could touch, nor do they touch each other ('contact: "
                       "{rods: all}') or bodies ('contact: {bodies: true}')");
  const auto feels = [](const auto &of) { return of.contact.touchesBodies(); };
  for (const Body &body : scene.held_bodies)
    if (feels(body) && (std::any_of(scene.rods.begin(), scene.rods.end(), feels) ||
                        std::any_of(scene.bodies.begin(), scene.bodies.end(), feels)))
      out.notes.push_back("warning: body '" + body.name +
                          "' is fixed or goes by its motion, and what touches bodies passes through it; write it as a "
                          "collider");
  map.finish();
  carryBodies(out);
  scene.hostBodies();
  return out;
}

} // namespace tendril
