#pragma once
/// \file polyline_reader.hpp
/// Polylines from files.

#include "tendril/geometry/scalar.hpp"

#include <string>
#include <vector>

namespace tendril {

struct Polyline {
  std::vector<Vec3> points; ///< [m]; the first is not repeated at the end of a closed one
  bool closed = false;
};

/// Reads all polylines of a file, by its extension:
///   .csv .txt  one point per line, three numbers separated by commas or blanks; `#` begins a comment, an empty line ends a polyline;
///   .obj       `v` vertices and `l` elements, one polyline each; one that ends where it began is closed;
///   .h5 .hdf5  dataset `position` (n,3), and optionally `rod_vertex_offsets` (nr+1) and `closed` (nr).
/// \throws SceneError with file and line
std::vector<Polyline> readPolylines(const std::string &path);

} // namespace tendril
