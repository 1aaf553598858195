#pragma once
/// \file mesh_reader.hpp
/// Triangle meshes from files.

#include "tendril/geometry/mesh_distance.hpp"

#include <string>

namespace tendril {

/// Reads the surface of a file, by its extension in letters of either case: .obj, its `v` and `f` lines; .off; .ply of
/// version 1.0, text or binary; .stl, text or binary. Faces of more than three corners become fans; corners at the same
/// place become one vertex, and what no face names is left out. \throws SceneError with file and line, or row
TriangleMesh readMesh(const std::string &path);

} // namespace tendril
