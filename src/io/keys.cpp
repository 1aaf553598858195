#include "tendril/io/keys.hpp"

#include "tendril/io/material_reader.hpp"
#include "tendril/io/yaml.hpp"

#include <cmath>
#include <sstream>

namespace tendril {
namespace {

std::string inQuotes(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + '"';
}

std::string numberText(double value) {
  std::ostringstream s;
  s.precision(17);
  s << value;
  return s.str();
}

const char *typeName(KeyType type) {
  switch (type) {
  case KeyType::number:
    return "number";
  case KeyType::integer:
    return "whole number";
  case KeyType::flag:
    return "true or false";
  case KeyType::word:
    return "word";
  case KeyType::text:
    return "text";
  case KeyType::file:
    return "file";
  case KeyType::vector:
    return "three numbers";
  case KeyType::pair:
    return "one or two numbers";
  case KeyType::vectors:
    return "list of vectors";
  case KeyType::inertia:
    return "three or six numbers";
  case KeyType::index:
    return "number from 0, or last";
  case KeyType::rod:
    return "name, number or all";
  case KeyType::rows:
    return "rows of numbers";
  case KeyType::range:
    return "two numbers";
  case KeyType::profile:
    return "rows of two numbers";
  case KeyType::list:
    return "list";
  case KeyType::map:
    return "map";
  case KeyType::word_or_map:
    return "word or map";
  }
  return "";
}

// ---- help

constexpr int width = 116, column = 34;

/// One option: its name and value, then its meaning, broken at blanks.
void addOption(std::ostringstream &out, const std::string &name, const Key &key) {
  std::string head = "  -" + name;
  const std::string choices = key.choices;
  if (!choices.empty())
    head += " " + choices;
  else if (key.type != KeyType::flag)
    head += key.type == KeyType::vector ? " x,y,z"
            : key.type == KeyType::file ? " PATH"
            : key.type == KeyType::text ? " TEXT"
            : key.type == KeyType::pair ? " N[,N]"
                                        : " N";
  std::string tail = key.meaning;
  if (*key.unit) tail += std::string(" [") + key.unit + "]";
  if (key.isOption() && !key.isRequired())
    tail += key.hasFallback() ? std::string(" (default ") + key.fallback + ")" : std::string(" ") + key.fallback;
  std::istringstream words(tail);
  std::string line = head.size() < column ? head + std::string(column - head.size(), ' ') : head + "  ";
  bool first = true;
  for (std::string word; words >> word; first = false) {
    if (line.size() + word.size() + 1 > width) {
      out << line << "\n";
      line = std::string(column, ' ');
      first = true;
    }
    line += (first ? "" : " ") + word;
  }
  out << line << "\n";
}

// ---- schema

constexpr const char *three_numbers = R"({"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3})";

std::string boundsText(const Key &key) {
  std::string text;
  if (std::isfinite(key.bounds.least))
    text +=
        std::string(key.bounds.above ? ", \"exclusiveMinimum\": " : ", \"minimum\": ") + numberText(key.bounds.least);
  if (std::isfinite(key.bounds.most))
    text +=
        std::string(key.bounds.below ? ", \"exclusiveMaximum\": " : ", \"maximum\": ") + numberText(key.bounds.most);
  return text;
}

constexpr const char *rules_of_scene =
    R"("anyOf": [{"required": ["rods"]}, {"required": ["bodies"]}, {"required": ["include"]}],
 "if": {"required": ["contact"]}, "then": {"anyOf": [{"required": ["colliders"]}, {"required": ["include"]},
 {"properties": {"contact": {"anyOf": [{"required": ["rods"], "properties": {"rods": {"enum": ["others", "all"]}}}, {"required": ["bodies"], "properties": {"bodies": {"const": true}}}]}}},
 {"required": ["rods"], "properties": {"rods": {"contains": {"required": ["contact"],
  "properties": {"contact": {"type": "object", "anyOf": [{"required": ["rods"], "properties": {"rods": {"enum": ["others", "all"]}}}, {"required": ["bodies"], "properties": {"bodies": {"const": true}}}]}}}}}},
 {"required": ["bodies"], "properties": {"bodies": {"contains": {"required": ["contact"],
  "properties": {"contact": {"type": "object", "required": ["bodies"], "properties": {"bodies": {"const": true}}}}}}}}]})";

constexpr const char *rules_of_material = R"("anyOf": [
 {"required": ["young", "density"],
  "allOf": [
   {"oneOf": [{"required": ["radius"]}, {"required": ["radii"]}, {"anyOf": [{"required": ["width"]}, {"required": ["height"]}]}]},
   {"oneOf": [{"required": ["poisson"]}, {"required": ["shear"]}]}],
  "dependencies": {"width": ["height"], "height": ["width"]}},
 {"not": {"anyOf": [{"required": ["radius"]}, {"required": ["radii"]}, {"required": ["width"]}, {"required": ["height"]}, {"required": ["young"]},
   {"required": ["poisson"]}, {"required": ["shear"]}, {"required": ["density"]}]}}])";

constexpr const char *rules_of_constraint =
    R"("if": {"anyOf": [{"required": ["body"], "not": {"required": ["stiffness"]}}, {"properties": {"type": {"const": "weld"}}}]},
 "then": {"required": ["body", "vertex"], "properties": {"type": {"enum": ["pin", "weld"]}},
  "not": {"anyOf": [{"required": ["to"]}, {"required": ["stiffness"]}, {"required": ["motion"]}, {"required": ["point"]}, {"required": ["closest"]},
   {"required": ["edge"]}, {"required": ["measure"]}, {"required": ["saturation"]}, {"required": ["damping"]}, {"required": ["update_old_target"]}]},
  "if": {"properties": {"type": {"const": "pin"}}}, "then": {"not": {"anyOf": [{"required": ["tangent"]}, {"required": ["director"]}]}}},
 "else": {"required": ["stiffness"], "dependencies": {"body": {"not": {"anyOf": [{"required": ["to"]}, {"required": ["motion"]}, {"required": ["update_old_target"]}]}}},
 "if": {"properties": {"type": {"const": "pin"}}},
 "then": {"oneOf": [{"required": ["vertex"], "properties": {"closest": {"const": false}}}, {"required": ["closest", "point"], "properties": {"closest": {"const": true}}}],
  "not": {"anyOf": [{"required": ["edge"]}, {"required": ["tangent"]}, {"required": ["director"]}, {"required": ["measure"]}]}},
 "else": {"required": ["edge"], "not": {"anyOf": [{"required": ["vertex"]}, {"required": ["closest"]}, {"required": ["point"]}]}}})";

constexpr const char *rules_of_body = R"("oneOf": [
 {"oneOf": [{"required": ["box"]}, {"required": ["sphere"]}, {"required": ["capsule"]}, {"required": ["cylinder"]}, {"required": ["mesh"]}],
  "allOf": [{"oneOf": [{"required": ["density"]}, {"required": ["mass"]}]}]},
 {"required": ["mass", "inertia"], "not": {"anyOf": [{"required": ["density"]}, {"required": ["box"]}, {"required": ["sphere"]}, {"required": ["capsule"]},
  {"required": ["cylinder"]}, {"required": ["mesh"]}]}}],
 "dependencies": {"centre": ["inertia"]},
 "if": {"anyOf": [{"required": ["motion"]}, {"required": ["fixed"], "properties": {"fixed": {"const": true}}}]},
 "then": {"not": {"anyOf": [{"required": ["velocity"]}, {"required": ["angular_velocity"]}, {"required": ["force"]}, {"required": ["torque"]},
  {"required": ["fixed", "motion"], "properties": {"fixed": {"const": true}}}]}})";

/// What keys of one block ask of each other. The reader says the same, in words.
std::string rulesOf(std::string_view block) {
  if (block.empty()) return rules_of_scene;
  if (block == "rods[]")
    return R"("oneOf": [{"required": ["line"]}, {"required": ["ring"]}, {"required": ["helix"]}, {"required": ["points"]}, {"required": ["file"]}])";
  if (block == "rods[].material") return rules_of_material;
  if (block == "supports[]")
    return R"("if": {"properties": {"type": {"const": "pin"}}},
 "then": {"not": {"anyOf": [{"required": ["tangent"]}, {"required": ["director"]}]}})";
  if (block == "constraints[]") return rules_of_constraint;
  if (block == "bodies[]") return rules_of_body;
  if (block == "supports[].motion" || block == "constraints[].motion" || block == "colliders[].motion" ||
      block == "bodies[].motion")
    return R"("oneOf": [{"required": ["table"]}, {"anyOf": [{"required": ["velocity"]}, {"required": ["angular_velocity"]}, {"required": ["amplitude"]}]}],
 "dependencies": {"amplitude": ["period"], "period": ["amplitude"]})";
  if (block == "tendons[].path[]")
    return R"("oneOf": [{"required": ["body"]}, {"required": ["rod"]}, {"required": ["joint"]}, {"required": ["cylinder"]}, {"required": ["sphere"]}],
 "dependencies": {"vertex": ["rod"], "edge": ["rod"], "offset": ["edge"], "coefficient": ["joint"], "axis": ["cylinder"], "side": ["cylinder"]},
 "not": {"anyOf": [{"required": ["vertex", "edge"]}, {"required": ["joint", "friction"]}]})";
  if (block == "tendons[]")
    return R"("not": {"anyOf": [{"required": ["displacement", "force"]}, {"required": ["displacement", "mckibben"]}, {"required": ["force", "mckibben"]}]})";
  if (block == "tendons[].displacement")
    return R"("if": {"required": ["rigid"], "properties": {"rigid": {"const": true}}},
 "then": {"not": {"anyOf": [{"required": ["stiffness"]}, {"required": ["damping"]}]}}, "else": {"required": ["stiffness"]})";
  if (block == "tendons[].force") return R"("oneOf": [{"required": ["tension"]}, {"required": ["table"]}])";
  if (block == "tendons[].mckibben") return R"("oneOf": [{"required": ["pressure"]}, {"required": ["table"]}])";
  if (block == "contact")
    return R"("if": {"required": ["radius"], "properties": {"radius": {"const": 0}}},
 "then": {"required": ["law"], "properties": {"law": {"const": "penalty"}}})";
  if (block == "colliders[]")
    return R"("oneOf": [{"required": ["plane"]}, {"required": ["sphere"]}, {"required": ["capsule"]}, {"required": ["cylinder"]}, {"required": ["box"]}, {"required": ["tube"]}, {"required": ["mesh"]}])";
  if (block == "loads[]")
    return R"("oneOf": [
 {"required": ["vertex"], "anyOf": [{"required": ["force"]}, {"required": ["mass"]}], "not": {"anyOf": [{"required": ["edge"]}, {"required": ["torque"]}, {"required": ["moment"]}]}},
 {"required": ["edge"], "anyOf": [{"required": ["torque"]}, {"required": ["moment"]}],
  "not": {"anyOf": [{"required": ["vertex"]}, {"required": ["force"]}]}}], "dependencies": {"axes": ["force"]})";
  return {};
}

std::string enumSchema(const Key &key) {
  std::string all;
  for (const std::string &choice : choicesOf(key)) all += (all.empty() ? "" : ", ") + inQuotes(choice);
  return "\"enum\": [" + all + "]";
}

std::string blockSchema(const std::string &block);

std::string valueSchema(const Key &key) {
  const std::string path = key.path;
  switch (key.type) {
  case KeyType::number:
    return "\"type\": \"number\"" + boundsText(key);
  case KeyType::integer:
    return "\"type\": \"integer\"" + boundsText(key);
  case KeyType::flag:
    return "\"type\": \"boolean\"";
  case KeyType::text:
  case KeyType::file:
    return "\"type\": [\"string\", \"number\"]"; // YAML takes a word of digits for a number
  case KeyType::rod:
    return "\"type\": [\"string\", \"integer\"]";
  case KeyType::vector:
    return std::string(three_numbers).substr(1, std::string(three_numbers).size() - 2);
  case KeyType::vectors:
    return std::string("\"type\": \"array\", \"minItems\": 1, \"items\": ") + three_numbers;
  case KeyType::pair: {
    const std::string one = "{\"type\": \"number\"" + boundsText(key) + "}";
    return "\"anyOf\": [" + one + ", {\"type\": \"array\", \"items\": " + one + ", \"minItems\": 2, \"maxItems\": 2}]";
  }
  case KeyType::inertia:
    return R"("type": "array", "items": {"type": "number"}, "anyOf": [{"minItems": 3, "maxItems": 3}, {"minItems": 6, "maxItems": 6}])";
  case KeyType::index:
    return "\"anyOf\": [{\"type\": \"integer\", \"minimum\": 0}, {\"const\": \"last\"}]";
  case KeyType::range:
    return R"("type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2)";
  case KeyType::profile:
    return R"("type": "array", "minItems": 1, "items": {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2})";
  case KeyType::rows:
    return R"("type": "array", "minItems": 1, "items": {"type": "array", "items": {"type": "number"},
 "oneOf": [{"minItems": 4, "maxItems": 4}, {"minItems": 7, "maxItems": 7}]})";
  case KeyType::word:
    return enumSchema(key);
  case KeyType::list:
    return "\"type\": \"array\", \"items\": {" + blockSchema(path + "[]") + "}" +
           (key.isRequired() ? ", \"minItems\": 1" : "");
  case KeyType::map:
    return blockSchema(path);
  case KeyType::word_or_map:
    return "\"anyOf\": [{" + enumSchema(key) + "}, {" + blockSchema(path) + "}]";
  }
  return {};
}

std::string blockSchema(const std::string &block) {
  std::string properties, required;
  for (const Key &key : keys) {
    if (key.isOption() || key.parent() != block) continue;
    const std::string name = inQuotes(key.name());
    std::string about = key.meaning;
    if (*key.unit) about += std::string(" [") + key.unit + "]";
    if (!properties.empty()) properties += ",\n";
    properties += " " + name + ": {\"description\": " + inQuotes(about) + ", " + valueSchema(key);
    const bool plain = key.type == KeyType::number || key.type == KeyType::integer || key.type == KeyType::flag ||
                       key.type == KeyType::vector || key.type == KeyType::pair;
    if (key.hasFallback())
      properties += ", \"default\": " + (plain ? std::string(key.fallback) : inQuotes(key.fallback));
    properties += "}";
    if (key.isRequired()) required += (required.empty() ? "" : ", ") + name;
  }
  std::string out = "\"type\": \"object\", \"additionalProperties\": false, \"properties\": {\n" + properties + "}";
  if (!required.empty()) out += ",\n \"required\": [" + required + "]";
  if (const std::string rules = rulesOf(block); !rules.empty()) out += ",\n " + rules;
  return out;
}

} // namespace

std::string helpText() {
  std::ostringstream out;
  out << "tendril: elastic rods. Runs a scene and writes a trajectory.\n"
         "  tendril data/scenes/helix.yaml -dt 5e-3 -t_end 2 -output_dir out/helix\n"
         "  tendril --help | --version\n";
  const std::pair<const char *, const char *> groups[] = {{"scene", "Scene"},       {"time", "Time, or load"},
                                                          {"solver", "Solver"},     {"rods", "Rods: for all of them"},
                                                          {"accuracy", "Accuracy"}, {"output", "Output"}};
  for (const auto &[group, title] : groups) {
    out << title << "\n";
    if (std::string_view(group) == "rods")
      for (const Key *key : rodOverrides()) addOption(out, "rod_" + std::string(key->name()), *key);
    for (const Key &key : keys)
      if (key.isOption() && std::string_view(key.group) == group) addOption(out, std::string(key.name()), key);
  }
  out << "PETSc's -snes_*, -ksp_*, -pc_*, -mat_*, -log_view, -options_file work, too; tendril -scene FILE -help lists "
         "them.\n";
  return out.str();
}

std::string keysAsJson() {
  std::string out = "[";
  for (const Key &key : keys) {
    if (out.size() > 1) out += ",\n ";
    out += "{\"path\": " + inQuotes(key.path) + ", \"type\": " + inQuotes(typeName(key.type)) +
           ", \"unit\": " + inQuotes(key.unit) + ", \"fallback\": " + inQuotes(key.fallback) +
           ", \"meaning\": " + inQuotes(key.meaning) + ", \"choices\": " + inQuotes(key.choices) +
           ", \"example\": " + inQuotes(key.example) + ", \"group\": " + inQuotes(key.group) +
           ", \"more\": " + inQuotes(key.more);
    if (std::isfinite(key.bounds.least))
      out += ", \"least\": " + numberText(key.bounds.least) + ", \"above\": " + (key.bounds.above ? "true" : "false");
    if (std::isfinite(key.bounds.most))
      out += ", \"most\": " + numberText(key.bounds.most) + ", \"below\": " + (key.bounds.below ? "true" : "false");
    out += "}";
  }
  return out + "]\n";
}

std::string schemaAsJson() {
  return "{\"$schema\": \"http://json-schema.org/draft-07/schema#\", \"title\": \"A scene of tendril\", " +
         blockSchema("") + "}\n";
}

} // namespace tendril
