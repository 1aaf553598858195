#pragma once
/// \file polyline_reader.hpp
/// Polylines from files.

#include "tendril/model/polyline.hpp"

#include <string>

namespace tendril {

/// Reads all polylines of a file, by its extension:
///   .csv .txt  one point per line, three numbers separated by commas or blanks; `#` begins a comment, an empty line
///   ends a polyline; .obj       `v` vertices and `l` elements; those that share vertices are one polyline, closed
///   where it ends where it began; .h5 .hdf5 .json  with directors and skins, see readShapes.
/// \throws SceneError with file and line
std::vector<Polyline> readPolylines(const std::string &path);

/// Whether a polyline file is text, by its extension: any but HDF5.
bool isTextPolyline(const std::string &path);

} // namespace tendril
