#pragma once
/// \file polyline_reader.hpp
/// Polylines from files.

#include "tendril/geometry/scalar.hpp"

#include <functional>
#include <string>
#include <vector>

namespace tendril {

/// A curve over [0, 1]: vertex i of a polyline of n edges along it stands at i/n.
using Curve = std::function<Vec3(double)>;

struct Polyline {
  std::vector<Vec3> points; ///< [m]; the first is not repeated at the end of a closed one
  bool closed = false;
  Curve curve; ///< that the points were taken from; empty where there are only points
};

/// Reads all polylines of a file, by its extension:
///   .csv .txt  one point per line, three numbers separated by commas or blanks; `#` begins a comment, an empty line ends a polyline;
///   .obj       `v` vertices and `l` elements; those that share vertices are one polyline, closed where it ends where it began;
///   .h5 .hdf5  dataset `position` (n,3), and optionally `rod_vertex_offsets` (nr+1) and `closed` (nr).
/// \throws SceneError with file and line
std::vector<Polyline> readPolylines(const std::string &path);

/// Whether a polyline file is text, by its extension: any but HDF5.
bool isTextPolyline(const std::string &path);

} // namespace tendril
