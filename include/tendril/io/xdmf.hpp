#pragma once
/// \file xdmf.hpp
/// The XDMF file by which ParaView reads a trajectory: its frames as slabs of the HDF5 datasets.

#include <string>
#include <vector>

namespace tendril {

/// A dataset /state/<name> (frames, rows, components) at the points or cells of a block. ParaView knows scalars and
/// vectors of three: two and four components become as many scalars, <name>_1, <name>_2 ...
struct XdmfField {
  std::string name;
  int rows = 0, components = 1;
  bool of_cells = false;
};

/// A grid whose points move and whose cells stay.
struct XdmfBlock {
  std::string name;
  std::string cell_type; ///< attributes of its topology, from the value of TopologyType on
  std::string cells;     ///< dataset of whole numbers
  std::string cells_shape;
  /// ParaView keeps points that it has read under the name of their geometry: blocks with points of their own need one.
  std::string geometry;
  XdmfField position = {};
  bool has_radius = false; ///< at points, /reference/radius
  std::vector<XdmfField> fields = {};
};

/// \throws WriteError
void writeXdmf(const std::string &path, const std::vector<XdmfBlock> &blocks, const std::vector<double> &times);

} // namespace tendril
