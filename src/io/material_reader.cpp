#include "tendril/io/material_reader.hpp"

#include <algorithm>
#include <sstream>

namespace tendril {
namespace {

/// Values of a material block: from the file, replaced by the command line.
class MaterialReader {
public:
  MaterialReader(YamlMap &map, const Overrides &overrides) : map_(map), overrides_(overrides) {}

  bool isOverridden(AnyKey key) const { return overrides_.count(std::string(key->name())) > 0; }
  bool has(const Key &key) { return map_.has(key) || overrides_.count(std::string(key.name())) > 0; }
  bool has(AnyKey key) { return has(*key); }
  double number(KeyOf<KeyType::number> key) { return value(*key).number(*key); }
  std::array<double, 2> pair(KeyOf<KeyType::pair> key) { return value(*key).pair(*key); }

  const YamlValue &block() const { return map_.value(); }

private:
  YamlMap &map_;
  const Overrides &overrides_;

  YamlValue value(const Key &key) {
    map_.has(key);
    const auto found = overrides_.find(std::string(key.name()));
    if (found == overrides_.end()) return map_.at(key);
    const std::string option = "option -rod_" + found->first;
    try {
      return {YAML::Load(found->second), option, found->first};
    } catch (const YAML::Exception &) {
      throw SceneError(option + ": '" + found->second + "' is neither a number nor a list like [1,2]");
    }
  }
};

Material readSection(MaterialReader &in) {
  Section section{};
  // A section by options takes the place of another one in the file.
  const bool by_radius = in.isOverridden("rods[].material.radius"), by_radii = in.isOverridden("rods[].material.radii"),
             by_sides = in.isOverridden("rods[].material.width") || in.isOverridden("rods[].material.height");
  const bool any = by_radius || by_radii || by_sides;
  const bool circle = in.has("rods[].material.radius") && (!any || by_radius),
             ellipse = in.has("rods[].material.radii") && (!any || by_radii),
             rectangle = (in.has("rods[].material.width") || in.has("rods[].material.height")) && (!any || by_sides);
  if (int(circle) + int(ellipse) + int(rectangle) != 1)
    in.block().fail("a homogeneous section needs one of 'radius', 'radii: [along the first director, along the "
                    "second]', or 'width' and 'height'");
  if (circle)
    section = {SectionShape::circle, {in.number("rods[].material.radius"), 0}};
  else if (ellipse)
    section = {SectionShape::ellipse, in.pair("rods[].material.radii")};
  else
    section = {SectionShape::rectangle, {in.number("rods[].material.width"), in.number("rods[].material.height")}};
  const double young = in.number("rods[].material.young");
  const bool poisson = in.has("rods[].material.poisson"), given = in.has("rods[].material.shear");
  if (poisson == given)
    in.block().fail(std::string("a homogeneous section needs 'poisson' or 'shear', found ") +
                    (given ? "both" : "none"));
  const double shear =
      given ? in.number("rods[].material.shear") : young / (2 * (1 + in.number("rods[].material.poisson")));
  return homogeneousMaterial(section, young, shear, in.number("rods[].material.density"));
}

} // namespace

MaterialRead readMaterial(YamlMap &rod, const Overrides &overrides) {
  const std::vector<const Key *> rows = rodOverrides();
  const bool by_options = std::any_of(rows.begin(), rows.end(), [&](const Key *key) {
    return key->parent() == "rods[].material" && overrides.count(std::string(key->name())) > 0;
  });
  const bool written = rod.has("rods[].material") || !by_options;
  const YamlValue block =
      written ? rod.at("rods[].material") : YamlValue(YAML::Load("{}"), rod.value().file(), "material");
  if (!block.isMap()) rod.word("rods[].material");
  YamlMap map(block.isMap() ? block : YamlValue(YAML::Load("{}"), block.file(), "material"), "rods[].material");
  MaterialReader in(map, overrides);
  MaterialRead out;
  Material &m = out.material;
  bool section = false;
  for (const AnyKey key :
       {AnyKey("rods[].material.radius"), AnyKey("rods[].material.radii"), AnyKey("rods[].material.width"),
        AnyKey("rods[].material.height"), AnyKey("rods[].material.young"), AnyKey("rods[].material.poisson"),
        AnyKey("rods[].material.shear"), AnyKey("rods[].material.density")})
    section = in.has(key) || section;
  if (section) m = readSection(in);
  // The stiffness parameters; beside a section they replace what follows from it.
  std::ostringstream defaults;
  auto tell = [&](const Key &key, double value) {
    if (!section) defaults << (defaults.tellp() > 0 ? ", " : "") << key.name() << " " << value << " " << key.unit;
  };
  auto replace = [&](KeyOf<KeyType::number> key, double &value, bool counts = true) {
    if (in.has(*key))
      value = in.number(key);
    else if (counts)
      tell(*key, value);
  };
  const KeyOf<KeyType::pair> flexural("rods[].material.flexural_stiffness");
  if (in.has(*flexural))
    m.flexural_stiffness = in.pair(flexural);
  else
    tell(*flexural, m.flexural_stiffness[0]);
  const bool twists = !m.isCable();
  replace("rods[].material.linear_density", m.linear_density);
  replace("rods[].material.linear_rotational_inertia", m.linear_rotational_inertia, twists);
  replace("rods[].material.axial_stiffness", m.axial_stiffness);
  replace("rods[].material.torsional_stiffness", m.torsional_stiffness, twists);
  if (const std::string values = defaults.str(); !values.empty())
    out.defaults =
        (block.isMap() ? "warning: the material is not complete, by default: " : "default material: ") + values;
  m.mass_damping_coefficient = in.number("rods[].material.mass_damping_coefficient");
  m.stiffness_damping_coefficient = in.number("rods[].material.stiffness_damping_coefficient");
  map.finish();
  // Sections of 1e-100 or 1e100 m leave the range of numbers.
  const double bending = section && !in.has(*flexural) ? 0 : 1; // where stiffnesses are given, they may be zero
  for (const double v :
       {m.linear_density, m.axial_stiffness, 1 + m.linear_rotational_inertia, 1 + m.torsional_stiffness,
        bending + m.flexural_stiffness[0], bending + m.flexural_stiffness[1]})
    if (!(v > 0 && std::isfinite(v)))
      in.block().fail(
          "the material's stiffness or density comes out as zero or infinite; check its numbers (SI units)");
  if (twists && m.torsional_stiffness == 0 && m.linear_rotational_inertia == 0)
    in.block().fail("'torsional_stiffness' and 'linear_rotational_inertia' are both zero: nothing resists turning "
                    "about the axis; give one of them");
  return out;
}

std::vector<const Key *> rodOverrides() {
  std::vector<const Key *> rows;
  for (const Key &key : keys)
    if (const std::string_view path = key.path;
        key.parent() == "rods[].material" || path == "rods[].measure" || path == "rods[].energy")
      rows.push_back(&key);
  return rows;
}

} // namespace tendril
