#pragma once
/// \file scene_reader.hpp
/// Scenes from YAML. docs/user.md describes every key.

#include "tendril/io/material_reader.hpp"
#include "tendril/io/rod_names.hpp"
#include "tendril/model/remesh.hpp"

#include <map>
#include <set>

namespace tendril {

/// How to run a scene: the `simulation` block of the file, then the options.
struct RunSettings {
  std::string mode = "dynamic"; ///< dynamic | static
  double dt = 1e-2;             ///< [s]
  double t_end = 1;             ///< [s]
  int load_steps = 1;
};

/// What a scene was read from.
struct SceneSource {
  std::string text;
  std::vector<std::pair<std::string, std::string>>
      files;                      ///< path as written and content of each text file that it names
  std::vector<std::string> paths; ///< of all files it was read from
  /// The text, and path and content of all files, as one.
  std::string all() const {
    std::string sum = text;
    for (const auto &[path, content] : files) sum += '\0' + path + '\0' + content;
    return sum;
  }
};

struct SceneFile {
  Scene scene;
  SceneSource source;
  RodNames names;
  std::set<std::string> constraint_names;
  std::set<std::string> joint_names;
  int constraint_blocks = 0, junction_blocks = 0, joint_blocks = 0;
  std::map<std::pair<int, int>, std::string> joined; ///< vertices in junctions, by rod and number: which
  /// Numbers of supports by the rods and vertices that they hold.
  std::map<std::pair<int, int>, std::vector<int>> supports_at;
  /// A body of the file: its number among those that are free, or among those that are held.
  struct BodyPlace {
    bool held;
    int index;
  };
  std::vector<BodyPlace> bodies;           ///< in the order of the file
  std::map<std::string, int> body_numbers; ///< by names
  const Body &bodyAt(BodyPlace at) const { return (at.held ? scene.held_bodies : scene.bodies)[at.index]; }
  /// Constraints that tie vertices to bodies, by rod and vertex.
  std::map<std::pair<int, int>, std::string> attached;
  std::vector<Drawing> drawings; ///< per rod
  int ignored_pairs = 0;         ///< of rods and bodies that pass through each other by `ignore`
  RunSettings run;
  std::vector<std::string> notes; ///< to be told at the start: defaults of materials, and warnings
};

/// \throws SceneError
SceneFile readScene(const std::string &path, const Overrides &overrides = {});

} // namespace tendril
