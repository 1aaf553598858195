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
  /// Slots behind the last vertex that loops over it may touch: copies of a ring's first two, and a pack.
  static constexpr int behind = 2 + lanes;
  /// Where the frames and cells of supports along the rod begin.
  int looseSlot() const { return vertexEnd() + behind; }
};

/// Rods that follow each other in the scene, [begin, end).
struct RodSet {
  int begin, end;
};

/// Unknowns of a slot: x, y, z, twist.
inline constexpr int slot_size = 4;

/// Scalar product over the slots of a rod. Of copies behind a ring one of both must be zero.
inline double dot(const RodRange &rod, const Planes &a, const Planes &b) {
  Pack sum(0.0);
  for (int k = 0; k < slot_size; ++k)
    for (int s = rod.first_slot; s < rod.vertexEnd(); s += lanes) sum += read<Pack>(a[k] + s) * read<Pack>(b[k] + s);
  return reduce(sum);
}

} // namespace tendril
