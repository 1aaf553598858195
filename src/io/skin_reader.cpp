#include "tendril/io/skin_reader.hpp"

#include "tendril/embedding/embedding.hpp"
#include "tendril/geometry/rotation.hpp"
#include "tendril/io/mesh_reader.hpp"

#include <filesystem>
#include <stdexcept>

namespace tendril {
namespace {

SkinRecipe::Tube readTube(const YamlValue &value, const Material &material) {
  YamlMap map(value, "rods[].skin.tube");
  SkinRecipe::Tube tube;
  tube.sides = map.integer("rods[].skin.tube.sides");
  tube.keeps_area = map.word("rods[].skin.tube.area") == "preserved";
  const bool by_radius = map.has("rods[].skin.tube.radius"), by_axes = map.has("rods[].skin.tube.half_axes");
  std::array<double, 2> axes{0, 0};
  if (by_radius && by_axes) value.fail("a tube has a 'radius' or 'half_axes', not both");
  if (by_radius)
    axes.fill(map.number("rods[].skin.tube.radius"));
  else if (by_axes)
    axes = map.pair("rods[].skin.tube.half_axes");
  else if (material.section)
    axes = material.section->halfAxes();
  else
    value.fail("the rod has no section that tells the radius of its tube; give it a 'radius'");
  tube.half_axes[0] = axes[0];
  tube.half_axes[1] = axes[1];
  tube.follows_directors = axes[0] != axes[1];
  if (map.has("rods[].skin.tube.frames")) {
    const bool natural = map.word("rods[].skin.tube.frames") == "natural";
    if (natural && tube.follows_directors)
      map.at("rods[].skin.tube.frames")
          .fail(
              "half axes that differ go with the directors of the rod; write 'frames: directors', or give a 'radius'");
    tube.follows_directors = !natural;
  }
  map.finish();
  return tube;
}

void readMeshOf(const YamlValue &value, SkinRecipe *skin) {
  YamlMap map(value, "rods[].skin.mesh");
  const YamlValue file = map.at("rods[].skin.mesh.file");
  const std::string path = (std::filesystem::path(file.file()).parent_path() / file.text()).string();
  TriangleMesh mesh;
  try {
    mesh = readMesh(path);
  } catch (const SceneError &e) {
    file.fail(e.what());
  }
  const double scale = map.number("rods[].skin.mesh.scale");
  const Vec3 turn = map.vector("rods[].skin.mesh.rotation"), shift = map.vector("rods[].skin.mesh.translation");
  const Mat3 rotation = rotationBy(turn);
  for (Vec3 &x : mesh.vertices) x = rotation * (scale * x) + shift;
  skin->edges = map.integer("rods[].skin.mesh.edges");
  skin->name = file.text();
  skin->mesh = std::make_shared<TriangleMesh>(std::move(mesh));
  map.finish();
}

/// Least radius of the polyline of a rod at its vertices [m].
double leastRadius(const Rod &rod) {
  double least = HUGE_VAL;
  for (int v = 0; v < rod.vertices(); ++v) {
    const int a = rod.edgeBefore(v), b = rod.edgeAfter(v);
    if (a < 0 || b < 0) continue;
    const Vec3 from = rod.edge(a), to = rod.edge(b);
    const double bend = std::atan2(from.cross(to).norm(), from.dot(to));
    if (bend > 0) least = std::min(least, 0.25 * (from.norm() + to.norm()) / std::tan(0.5 * bend));
  }
  return least;
}

/// What pictures show and users may not expect. \param at file and line
void tellOfSkin(const std::string &at, const Rod &rod, SceneFile &out) {
  const std::string place = "warning: " + at + ": the skin of rod '" + rod.name + "' ";
  const double widest = std::max(rod.skin->tube.half_axes[0], rod.skin->tube.half_axes[1]), least = leastRadius(rod);
  if (widest > 0.5 * least)
    out.notes.push_back(place + "is wider than half the radius of its tightest bend, " + shortText(least) +
                        " m, and may overlap itself");
  if (!rod.skin->mesh) return;
  const Skin skin = skinOf(rod);
  if (const double turn = widestTurn(rod, skin) * 180 / pi; turn > 30)
    out.notes.push_back(place + "shrinks where edges turn by " + shortText(turn) +
                        " degrees, by the cosine of half of that; take more edges");
  try {
    checkClosed(rod, skin);
  } catch (const std::invalid_argument &e) {
    out.notes.push_back(place + "encloses no solid: " + e.what() +
                        "; pictures have it, 'contact: {on: surface}' refuses it");
  }
  if (const double far = farthestOverMedian(skin); far > 10)
    out.notes.push_back(place + "has points " + shortText(far) +
                        " times as far from it as most: is the mesh where the rod is?");
}

} // namespace

SkinRecipe readSkin(YamlMap &rod, int shapes, const Material &material) {
  SkinRecipe skin;
  if (!rod.has("rods[].skin")) return skin;
  const YamlValue value = rod.at("rods[].skin");
  YamlMap map(value, "rods[].skin");
  if (map.has("rods[].skin.tube")) skin.tube = readTube(map.at("rods[].skin.tube"), material);
  if (map.has("rods[].skin.mesh")) readMeshOf(map.at("rods[].skin.mesh"), &skin);
  map.finish();
  if (skin.tube.sides == 0 && !skin.mesh)
    value.fail("a skin is a tube, a mesh, or both: write {tube: {sides: 12}} or {mesh: {file: ...}}");
  if (skin.mesh && shapes > 1)
    value.fail("a mesh goes with one rod, and the file has " + std::to_string(shapes) +
               "; write a file and a block for each");
  return skin;
}

void giveSkin(const YamlMap &map, const std::shared_ptr<const Skin> &skin, Rod &rod, SceneFile &out) {
  auto recipe = std::make_shared<SkinRecipe>();
  auto mesh = std::make_shared<TriangleMesh>();
  for (const SkinPoint &point : skin->points) mesh->vertices.push_back(placeOf(rod, point));
  mesh->triangles = skin->triangles;
  recipe->mesh = mesh;
  recipe->edges = std::max(2, skin->width()); // as points between its corners go with edges
  recipe->given = skin;
  recipe->given_edges = rod.edges();
  rod.skin = recipe;
  tellOfSkin(map.value().place(), rod, out);
}

void putSkin(YamlMap &map, const SkinRecipe &recipe, const Vec3 &shift, Rod &rod, SceneFile &out) {
  if (recipe.tube.sides == 0 && !recipe.mesh) return;
  auto own = std::make_shared<SkinRecipe>(recipe);
  if (own->mesh && !shift.isZero(0)) {
    auto mesh = std::make_shared<TriangleMesh>(*own->mesh);
    for (Vec3 &x : mesh->vertices) x += shift;
    own->mesh = mesh;
  }
  rod.skin = own;
  tellOfSkin(map.at("rods[].skin").place(), rod, out);
}

} // namespace tendril
