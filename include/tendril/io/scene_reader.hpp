#pragma once
/// \file scene_reader.hpp
/// Scenes from YAML. docs/user.md describes every key.

#include "tendril/model/scene.hpp"

#include <map>

namespace tendril {

/// How to run a scene: the `simulation` block of the file, then the options.
struct RunSettings {
  std::string mode = "dynamic"; ///< dynamic | static
  double dt = 1e-2;             ///< [s]
  double t_end = 1;             ///< [s]
  int load_steps = 1;
};

struct SceneFile {
  Scene scene;
  RunSettings run;
};

/// Material parameters that -rod_<parameter> may override, with what each means.
const std::vector<std::pair<std::string, std::string>> &rodOverrides();

/// \param overrides parameter name -> text, applied to every rod's material (and `measure`)
/// \throws SceneError
SceneFile readScene(const std::string &path, const std::map<std::string, std::string> &overrides = {});

} // namespace tendril
