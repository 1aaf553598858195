#include "tendril/energy/widest_angle.hpp"

#include <algorithm>
#include <cmath>

namespace tendril {

void WidestAngle::include(const Scene &scene, const Elements &elements, const State &state) {
  for (int r = 0; r < int(scene.rods.size()); ++r) {
    if (scene.rods[r].material.isCable() || (scene.rods[r].measure != Measure::tan && !every_measure)) continue;
    const RodRange &range = elements.rods[r];
    auto frameOf = [&](int i) {
      const Vec3 edge =
          state.position[range.first_vertex + (i + 1) % range.vertices] - state.position[range.first_vertex + i];
      const double length = edge.norm();
      return Frame{edge / length, state.director[range.first_edge + i], length};
    };
    auto isCorner = [&](int vertex) { // which a junction keeps
      const auto joined = elements.joinedEdges({r, r + 1});
      return std::any_of(joined.begin(), joined.end(), [&](const JoinedEdge &j) { return j.vertex == vertex; });
    };
    double bound = 1 + 2 * std::cos(angle);
    Frame before = frameOf(range.closed ? range.edges - 1 : 0);
    for (int i = range.closed ? 0 : 1; i < range.edges; ++i) {
      const Frame f = frameOf(i);
      // 1 + 2 cos of the whole rotation between the frames, which is no less than turning and twist: most vertices end
      // here.
      const double tangents = before.tangent.dot(f.tangent), directors = before.director.dot(f.director);
      const double trace =
          tangents + directors + tangents * directors - before.tangent.dot(f.director) * before.director.dot(f.tangent);
      if (trace < bound && !isCorner(i)) {
        const double turning = std::acos(std::clamp(tangents, -1.0, 1.0)),
                     twist = std::abs(halfAngleBetween(before, f).angle());
        if (std::max(turning, twist) > angle) *this = {std::max(turning, twist), r, i, state.time, every_measure};
        bound = 1 + 2 * std::cos(angle);
      }
      before = f;
    }
  }
}

} // namespace tendril
