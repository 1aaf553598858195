#include "tendril/io/option_files.hpp"

#include "tendril/io/keys.hpp"
#include "tendril/io/text.hpp"
#include "tendril/io/yaml.hpp"

#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace tendril {
namespace {

bool isYaml(const std::string &file) { return file.ends_with(".yaml") || file.ends_with(".yml"); }

bool isOption(const std::string &word) {
  return word.size() > 1 && word[0] == '-' && (std::isalpha(static_cast<unsigned char>(word[1])) || word[1] == '-');
}

struct Given {
  int line;
  std::string value; ///< of a list the first
};
using Places = std::map<std::string, Given>;

/// Whether a text holds a word, at whose sides neither letters nor digits stand; capitals count as small letters.
bool holdsWord(std::string text, std::string word) {
  for (std::string *s : {&text, &word})
    for (char &c : *s) c = char(std::tolower(static_cast<unsigned char>(c)));
  auto inWord = [&](std::size_t k) {
    return k < text.size() && (std::isalnum(static_cast<unsigned char>(text[k])) || text[k] == '_');
  };
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1))
    if (!inWord(at + word.size()) && (at == 0 || !inWord(at - 1))) return true;
  return false;
}

/// Maps within maps join their keys by underscores.
void collect(const YamlValue &value, const std::string &prefix, Places &places) {
  YamlMap check(value);
  for (const auto &entry : value.node()) {
    const YAML::Node key_node = entry.first, node = entry.second;
    const YamlValue key(key_node, value.file(), "options");
    const std::string word = key.text();
    if (word.empty() || !std::isalpha(static_cast<unsigned char>(word[0])))
      key.fail("'" + word + "' is no name of an option; write names without their dash");
    const std::string name = prefix + word;
    if (node.IsMap()) {
      collect(YamlValue(node, value.file(), name), name + "_", places);
      continue;
    }
    if (name.rfind("options_file", 0) == 0)
      key.fail("a file of options names no other; give each with its own -options_file");
    if (node.IsSequence())
      for (const YAML::Node &item : node)
        if (!item.IsScalar())
          key.fail("'" + name + "' is a list of more than values, which no option takes (a scene is given by -scene)");
    const YAML::Node scalar = node.IsSequence() && node.size() > 0 ? YAML::Node(node[0]) : YAML::Node(node);
    const auto [first, fresh] =
        places.emplace(name, Given{key_node.Mark().line + 1, scalar.IsScalar() ? scalar.Scalar() : ""});
    if (!fresh)
      key.fail("the option '" + name + "' stands here a second time (first in line " +
               std::to_string(first->second.line) + "); keep one of the two");
  }
}

} // namespace

void OptionFiles::readYaml(const std::string &file) {
  const std::vector<YAML::Node> documents = loadYaml(readText(file, ": cannot be opened"), file);
  Places places;
  for (const YAML::Node &document : documents) {
    if (document.IsNull()) continue;
    collect(YamlValue(document, file, "options"), "", places);
  }
  for (const auto &[name, given] : places) {
    places_[name] = file + ":" + std::to_string(given.line);
    values_[name] = given.value;
  }
}

/// PETSc's older format: an option and its value a line.
void OptionFiles::readPlain(const std::string &file) {
  std::ifstream in(file);
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    std::istringstream words(line);
    std::string word;
    if (!(words >> word) || std::string("#%!").find(word[0]) != std::string::npos) continue;
    const std::string place = file + ":" + std::to_string(number);
    if (!isOption(word))
      throw SceneError(place + ": '" + word +
                       "' is no option; options begin with -, and files in YAML are named *.yaml");
    std::string value, rest;
    if (words >> value >> rest && value[0] != '"' && rest[0] != '#')
      throw SceneError(place + ": '" + rest + "' is too much; write an option and its value a line");
    places_[word.substr(1)] = place;
    values_[word.substr(1)] = value;
  }
}

void OptionFiles::read(int argc, char **argv) {
  std::vector<std::string> words; // in PETSc's order
  if (const char *variable = std::getenv("PETSC_OPTIONS")) {
    std::istringstream in(variable);
    for (std::string word; in >> word;) words.push_back(word);
  }
  words.insert(words.end(), argv + 1, argv + argc);
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string option = words[i];
    if (!isOption(option)) continue;
    if (option != "-options_file" && option != "-options_file_yaml") {
      places_.erase(option.substr(1)); // the last one counts
      values_[option.substr(1)] = i + 1 < words.size() && !isOption(words[i + 1]) ? words[i + 1] : "";
      continue;
    }
    if (i + 1 == words.size() || isOption(words[i + 1])) throw SceneError("option " + option + ": needs a file");
    const std::string file = words[++i];
    if (file.find('$') != std::string::npos) continue; // a variable, which PETSc replaces
    const std::string named = "option " + option + ": '" + file;
    if (std::filesystem::is_directory(file)) throw SceneError(named + "' is a folder; give a file");
    if (!std::ifstream(file))
      throw SceneError(named + "' cannot be opened; its path begins in the folder where tendril is started");
    files_.push_back(file);
    if (option == "-options_file_yaml" || isYaml(file))
      readYaml(file);
    else
      readPlain(file);
  }
}

std::string OptionFiles::place(const std::string &option) const {
  const auto found = places_.find(option);
  return found == places_.end() ? "" : found->second;
}

/// The options whose value, or what a colon divides off it, a message of PETSc tells; not numbers, which may be any.
/// With their places.
std::string OptionFiles::toldIn(const std::string &message) const {
  std::string text;
  for (const auto &[name, value] : values_) {
    std::istringstream parts(value);
    bool told = false;
    for (std::string part; std::getline(parts, part, ':');) {
      char *end = nullptr;
      if (part.empty() || (std::strtod(part.c_str(), &end), *end == 0)) continue;
      told = told || holdsWord(message, part);
    }
    if (!told || findKey("-" + name)) continue; // ours say what is wrong themselves
    const std::string where = place(name);
    text += (text.empty() ? "option -" : " or -") + name + (where.empty() ? "" : " (" + where + ")");
  }
  return text;
}

std::string OptionFiles::locate(const std::string &message) const {
  constexpr const char *start = "option -";
  if (message.rfind(start, 0) == 0) {
    const std::string name = message.substr(std::string(start).size());
    const std::string where = place(name.substr(0, name.find(':')));
    return where.empty() ? message : where + ": " + message;
  }
  const bool of_petsc = message.rfind("setting up the solvers", 0) == 0 || message.rfind("command line", 0) == 0 ||
                        message.rfind("solving", 0) == 0;
  if (!of_petsc) return message;
  if (const std::string told = toldIn(message); !told.empty()) return told + ": " + message;
  if (files_.empty()) return message;
  std::string text = message + " (options are also read from ";
  for (const std::string &file : files_) text += (&file == &files_[0] ? "" : ", ") + file;
  return text + ")";
}

} // namespace tendril
