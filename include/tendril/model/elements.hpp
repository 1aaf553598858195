#pragma once
/// \file elements.hpp
/// The scene cut into elements: edges (stretch, twist inertia), vertices (mass) and cells (bending and twist), as arrays the element loops
/// stream through. Built once; constant afterwards.

#include "tendril/layout/dof_map.hpp"

namespace tendril {

/// Cells of the whole scene, rod after rod. A cell joins two frames; frames below the number of edges are those of edges, the others belong
/// to supports. The arrays are padded by one pack so that a loop may read beyond the last cell.
struct CellArrays {
  std::vector<int> frame0, frame1;
  std::vector<int> row; ///< first of the 11 rows
  std::array<std::vector<double>, 3> stiffness, rest;
  std::array<std::vector<double>, 2> weight, free;
  std::vector<double> length; ///< reference length of the cell, Lbar [m]

  int size() const { return int(length.size()); }
  void pad();
};

struct Elements {
  std::vector<RodRange> rods;
  std::vector<int> rod_cells;   ///< offsets (nr + 1)
  std::vector<Measure> measure; ///< per rod

  std::vector<int> vertex0, vertex1, edge_row;                                       ///< per edge; rows of its vertices begin at edge_row and edge_row + stride
  std::vector<double> rest_length, inverse_rest_length, axial_stiffness, twist_mass; ///< per edge; twist_mass r_L L [kg m^2]
  std::vector<double> mass;                                                          ///< per vertex [kg]
  std::vector<int> vertex_row;                                                       ///< per vertex
  CellArrays cells;

  std::vector<int> support_frame; ///< frame of each support, or -1
  int frames = 0;                 ///< edges and support frames

  Elements(const Scene &scene, const DofMap &dofs);
};

} // namespace tendril
