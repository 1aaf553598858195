#pragma once
/// \file skin.hpp
/// Surfaces of triangles that rods carry: what they are made of, and how their points go with edges.

#include "tendril/geometry/mesh_distance.hpp"

#include <memory>
#include <string>

namespace tendril {

/// A point as edges behind each other carry it: the sum of weight (m + local[0]/L e + local[1] a + local[2] b), with
/// the middle m of an edge, its vector e, its length L at rest and its directors a, b. Sections stay as they are.
struct SkinPoint {
  static constexpr int most = 3;
  int edges = 0; ///< how many carry it
  std::array<int, most> edge{};
  std::array<double, most> weight{};
  std::array<Vec3, most> local{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()}; ///< [m]
  void add(int to_edge, double by, const Vec3 &at) {
    edge[std::size_t(edges)] = to_edge;
    weight[std::size_t(edges)] = by;
    local[std::size_t(edges++)] = at;
  }
};

/// Triangles are anticlockwise seen from outside.
struct Skin {
  std::vector<SkinPoint> points;
  std::vector<std::array<int, 3>> triangles;
  /// Most edges that carry one of its points.
  int width() const {
    int most = 1;
    for (const SkinPoint &p : points) most = std::max(most, p.edges);
    return most;
  }
};

/// What the skin of a rod is made of: a tube, a mesh, or both.
struct SkinRecipe {
  /// Rings of `sides` corners about the middles of edges and both ends of an open rod, which are closed by caps.
  struct Tube {
    int sides = 0; ///< 0: none
    double half_axes[2] = {0, 0};
    bool follows_directors = false; ///< otherwise frames that turn as little as they can
    bool keeps_area = false;        ///< of the section, not only its corners
  } tube;
  std::shared_ptr<const TriangleMesh> mesh; ///< about the rod as drawn; null: none
  int edges = 2;                            ///< that carry a point of the mesh
  std::string name;                         ///< of the mesh, for messages
  std::shared_ptr<const Skin> given; ///< how points of the mesh go with edges, where a file says so; null: by place
  int given_edges = 0;               ///< of the rod of which it says so
};

} // namespace tendril
