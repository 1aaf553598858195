#pragma once
/// \file same_vertices.hpp
/// Which vertices a junction makes one.

#include "tendril/layout/elements.hpp"

namespace tendril {

/// Calls visit(rod, vertex) for all vertices that are one point with a vertex; for itself where nothing joins it.
template <class Visit> void forSameVertices(const Elements &elements, int rod, int vertex, Visit visit) {
  const auto of_rod = elements.joinedVertices({rod, rod + 1});
  const auto own =
      std::find_if(of_rod.begin(), of_rod.end(), [&](const JoinedVertex &j) { return j.vertex == vertex; });
  if (own == of_rod.end() || own->isOnBody()) return visit(rod, vertex);
  for (const JoinedVertex &j : elements.joinedVertices({0, int(elements.rods.size())}))
    if (j.junction == own->junction) visit(j.rod, j.vertex);
}

/// Mass of a vertex, with those of all that are one point with it [kg].
inline double massWithSame(const Elements &elements, int rod, int vertex) {
  double mass = 0;
  forSameVertices(elements, rod, vertex, [&](int r, int v) { mass += elements.mass()[elements.rods[r].slot(v)]; });
  return mass;
}

} // namespace tendril
