#pragma once
/// \file shape_file.hpp
/// Shapes of rods with their directors and skins, in HDF5 or JSON.

#include "tendril/model/polyline.hpp"
#include "tendril/model/scene.hpp"

#include <string>

namespace tendril {

/// Reads the rods of a file by its extension, .h5, .hdf5 or .json. Both have the same tables under the same names:
///   position (n, 3) [m]; for several rods rod_vertex_offsets (nr + 1); closed (nr), 0 or 1; director (edges, 3);
///   skins/ point_offsets and triangle_offsets (nr + 1, for several rods), triangles (nt, 3), edge (np, K), weight
///   (np, K), local (np, K, 3), as SkinPoint has them, points, triangles and edges counted within their rod.
/// In JSON a table is a list of rows, and `skins` an object. \throws SceneError that names the table and the row
std::vector<Polyline> readShapes(const std::string &path);
/// Writes the rods of a scene as drawn so that readShapes gives the same bits. \throws WriteError
void writeShapes(const std::string &path, const Scene &scene);

/// What -output_shapes names must be a file of that kind, in a folder that is there, and none that the run reads or
/// that stands for its results. Empty is right. \throws SceneError
void checkShapesPath(const std::string &path, const std::vector<std::string> &inputs, const std::string &output_dir);

/// Tables of skins, those of several rods behind each other.
struct SkinTables {
  std::vector<int> point_offsets{0}, triangle_offsets{0}, triangles, edge;
  std::vector<double> weight, local;
  int width = 1; ///< edges of a point
  explicit SkinTables(const std::vector<Rod> &rods);
  bool empty() const { return triangles.empty(); }
};
void write(class Hdf5File &file, const SkinTables &skins);

} // namespace tendril
