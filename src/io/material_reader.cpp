#include "tendril/io/material_reader.hpp"

namespace tendril {
namespace {

/// Values of a material block: from the file, replaced by the command line.
class MaterialReader {
public:
  MaterialReader(YamlMap &map, const Overrides &overrides) : map_(map), overrides_(overrides) {}

  bool has(const std::string &key) { return map_.has(key) || overrides_.count(key) > 0; }

  double notNegative(const std::string &key) { return value(key).notNegative(); }
  double positive(const std::string &key) { return value(key).positive(); }
  double poisson() {
    const YamlValue v = value("poisson");
    const double p = v.number();
    if (p <= -1 || p > 0.5) v.fail("'poisson' must lie in (-1, 0.5], found " + v.text());
    return p;
  }

  std::array<double, 2> pair(const std::string &key) {
    const YamlValue v = value(key);
    if (v.isScalar()) {
      const double k = v.notNegative();
      return {k, k};
    }
    const std::vector<double> list = v.numbers(2);
    if (list[0] < 0 || list[1] < 0) v.fail("'" + key + "' must not be negative, found [" + std::to_string(list[0]) + ", " + std::to_string(list[1]) + "]");
    return {list[0], list[1]};
  }

  const YamlValue &block() const { return map_.value(); }

private:
  YamlMap &map_;
  const Overrides &overrides_;

  YamlValue value(const std::string &key) {
    map_.has(key);
    const auto found = overrides_.find(key);
    if (found == overrides_.end()) return map_.at(key);
    const std::string option = "option -rod_" + key;
    try {
      return {YAML::Load(found->second), option, key};
    } catch (const YAML::Exception &) {
      throw SceneError(option + ": '" + found->second + "' is neither a number nor a list like [1,2]");
    }
  }
};

Material readSection(MaterialReader &in) {
  Section section{};
  const int shapes = int(in.has("radius")) + int(in.has("radii")) + int(in.has("width") || in.has("height"));
  if (shapes != 1)
    in.block().fail("a homogeneous section needs one of 'radius', 'radii: [along the first director, along the second]', or 'width' and 'height'");
  if (in.has("radius"))
    section = {SectionShape::circle, {in.positive("radius"), 0}};
  else if (in.has("radii")) {
    section = {SectionShape::ellipse, in.pair("radii")};
    if (section.size[0] == 0 || section.size[1] == 0) in.block().fail("'radii' must be greater than zero");
  } else
    section = {SectionShape::rectangle, {in.positive("width"), in.positive("height")}};
  const double young = in.positive("young");
  if (in.has("poisson") == in.has("shear"))
    in.block().fail(std::string("a homogeneous section needs 'poisson' or 'shear', found ") + (in.has("shear") ? "both" : "none"));
  double shear;
  if (in.has("shear"))
    shear = in.positive("shear");
  else {
    shear = young / (2 * (1 + in.poisson()));
  }
  return homogeneousMaterial(section, young, shear, in.positive("density"));
}

} // namespace

Material readMaterial(YamlMap &map, const Overrides &overrides) {
  MaterialReader in(map, overrides);
  Material m;
  bool section = false;
  for (const char *key : {"radius", "radii", "width", "height", "young", "poisson", "shear", "density"}) section = in.has(key) || section;
  if (section) m = readSection(in);
  // The stiffness parameters; beside a section they replace what follows from it.
  if (in.has("linear_density")) m.linear_density = in.positive("linear_density");
  if (in.has("linear_rotational_inertia")) m.linear_rotational_inertia = in.notNegative("linear_rotational_inertia");
  if (in.has("axial_stiffness")) m.axial_stiffness = in.positive("axial_stiffness");
  if (in.has("torsional_stiffness")) m.torsional_stiffness = in.notNegative("torsional_stiffness");
  if (in.has("flexural_stiffness")) m.flexural_stiffness = in.pair("flexural_stiffness");
  if (in.has("mass_damping_coefficient")) m.mass_damping_coefficient = in.notNegative("mass_damping_coefficient");
  if (in.has("stiffness_damping_coefficient")) m.stiffness_damping_coefficient = in.notNegative("stiffness_damping_coefficient");
  map.finish();
  // Sections of 1e-100 or 1e100 m leave the range of numbers.
  for (const double v : {m.linear_density, m.axial_stiffness, 1 + m.linear_rotational_inertia, 1 + m.torsional_stiffness, 1 + m.flexural_stiffness[0],
                         1 + m.flexural_stiffness[1]})
    if (!(v > 0 && std::isfinite(v))) in.block().fail("the material's stiffness or density comes out as zero or infinite; check its numbers (SI units)");
  return m;
}

const std::vector<std::pair<std::string, std::string>> &rodOverrides() {
  static const std::vector<std::pair<std::string, std::string>> list{{"radius", "radius of a circular section [m]"},
                                                                     {"radii", "semi-axes of an elliptic section, e.g. [2e-3,1e-3] [m]"},
                                                                     {"width", "width of a rectangular section, along the first director [m]"},
                                                                     {"height", "height of a rectangular section, along the second director [m]"},
                                                                     {"young", "Young's modulus [Pa]"},
                                                                     {"poisson", "Poisson's ratio"},
                                                                     {"shear", "shear modulus [Pa]"},
                                                                     {"density", "density [kg/m^3]"},
                                                                     {"linear_density", "mass per length [kg/m]"},
                                                                     {"linear_rotational_inertia", "rotational inertia about the axis per length [kg m]"},
                                                                     {"axial_stiffness", "EA [N]"},
                                                                     {"torsional_stiffness", "GJ [N m^2]"},
                                                                     {"flexural_stiffness", "EI, one number or [kb1,kb2] [N m^2]"},
                                                                     {"mass_damping_coefficient", "dissipation proportional to mass [1/s]"},
                                                                     {"stiffness_damping_coefficient", "dissipation proportional to stiffness [s]"},
                                                                     {"measure", "strain measure: tan or angle"}};
  return list;
}

} // namespace tendril
