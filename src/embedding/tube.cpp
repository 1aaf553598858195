#include "tendril/embedding/embedding.hpp"

namespace tendril {

/// Rings about the middles of all edges, with one more about each end of an open rod, and the middles of both caps.
Skin tubeAbout(const Rod &rod, const SkinRecipe::Tube &tube) {
  const int sides = tube.sides, edges = rod.edges();
  const double step = 2 * pi / sides, wider = tube.keeps_area ? std::sqrt(step / std::sin(step)) : 1;
  Rod frames = rod; // directors from which angles count
  if (!tube.follows_directors) setBishopDirectors(frames, rod.director[0]);
  Skin skin;
  auto addRing = [&](int edge, double along) {
    const Frame own = referenceFrame(rod, edge), from = referenceFrame(frames, edge);
    for (int k = 0; k < sides; ++k) {
      const Vec3 x = wider * (tube.half_axes[0] * std::cos(k * step) * from.director +
                              tube.half_axes[1] * std::sin(k * step) * from.secondDirector());
      skin.points.emplace_back().add(edge, 1, {along * own.length, x.dot(own.director), x.dot(own.secondDirector())});
    }
  };
  auto addBand = [&](int ring, int next) {
    for (int k = 0; k < sides; ++k) {
      const int after = (k + 1) % sides, a = ring * sides, b = next * sides;
      skin.triangles.push_back({a + k, a + after, b + k});
      skin.triangles.push_back({a + after, b + after, b + k});
    }
  };
  auto addCap = [&](int edge, double along, int ring, bool outwards) {
    const int middle = int(skin.points.size());
    skin.points.emplace_back().add(edge, 1, {along * rod.edge(edge).norm(), 0, 0});
    for (int k = 0; k < sides; ++k) {
      const int a = ring * sides + k, b = ring * sides + (k + 1) % sides;
      skin.triangles.push_back(outwards ? std::array{middle, a, b} : std::array{middle, b, a});
    }
  };
  if (!rod.closed) addRing(0, -0.5);
  for (int e = 0; e < edges; ++e) addRing(e, 0);
  if (!rod.closed) addRing(edges - 1, 0.5);
  const int rings = int(skin.points.size()) / sides;
  for (int ring = 0; ring + 1 < rings; ++ring) addBand(ring, ring + 1);
  if (rod.closed)
    addBand(rings - 1, 0);
  else {
    addCap(0, -0.5, 0, false);
    addCap(edges - 1, 0.5, rings - 1, true);
  }
  return skin;
}

} // namespace tendril
