#pragma once
/// \file scene_reader.hpp
/// Scenes from YAML. docs/user.md describes every key.

#include "tendril/io/material_reader.hpp"
#include "tendril/model/redraw.hpp"

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
  std::vector<Drawing> drawings; ///< per rod
  RunSettings run;
};

/// \throws SceneError
SceneFile readScene(const std::string &path, const Overrides &overrides = {});

} // namespace tendril
