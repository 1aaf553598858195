#pragma once
/// \file mesh_reader.hpp
/// Triangle meshes from files.

#include "tendril/geometry/mesh_distance.hpp"

#include <string>

namespace tendril {

/// Reads the surface of a file, by its extension: .obj, its `v` and `f` lines, faces of more than three corners as
/// fans; .stl, text or binary, corners at the same place as one vertex. \throws SceneError with file and line
TriangleMesh readMesh(const std::string &path);

} // namespace tendril
