#pragma once
/// \file rod_range.hpp
/// Numbering of one rod, and sets of rods.

#include "tendril/geometry/planes.hpp"

#include <array>

namespace tendril {

/// Numbering of one rod.
struct RodRange {
  int first_vertex, vertices;
  int first_edge, edges;
  int first_slot; ///< of vertex 0; a multiple of the lanes
  int slots;      ///< from this rod's first slot to the next rod's
  bool twist;     ///< false for a cable
  bool closed;

  int slot(int i) const { return first_slot + i; }
  int vertexEnd() const { return first_slot + vertices; }
  int edgeEnd() const { return first_slot + edges; }
};

/// Rods that follow each other in the scene, [begin, end).
struct RodSet {
  int begin, end;
};

/// Unknowns of a slot: x, y, z, twist.
inline constexpr int slot_size = 4;

} // namespace tendril
