#pragma once
/// \file mesh_distance.hpp
/// Signed distance to closed triangle meshes: exact, and as a shape on a grid.

#include "tendril/geometry/shape.hpp"

#include <algorithm>
#include <array>
#include <vector>

namespace tendril {

/// Triangles by the numbers of their vertices, from 0, anticlockwise seen from outside the solid.
struct TriangleMesh {
  std::vector<Vec3> vertices;
  std::vector<std::array<int, 3>> triangles;
};

/// Exact distance to a mesh by a tree of boxes around its triangles; its sign by pseudonormals, those of vertices
/// weighted by angles (J. A. Baerentzen, H. Aanaes, *Signed distance computation using the angle weighted
/// pseudonormal*, IEEE Trans. Visualization and Computer Graphics 11, 2005).
class MeshDistance {
public:
  /// Throws std::invalid_argument that names, by numbers from 0, what is wrong with the mesh: vertices that are not
  /// finite, triangles without area, edges without a neighbour or with neighbours of the other sense, vertices that
  /// join sheets which share no edge there, and pieces that are inside out. Sheets that cross are not found.
  explicit MeshDistance(const TriangleMesh &mesh);

  /// The nearest point of the surface, the signed distance [m] to it, and the unit pseudonormal there.
  struct Nearest {
    double value;
    Vec3 point, normal;
    int triangle;
  };
  /// \param guess a triangle that is near, for speed
  Nearest nearest(const Vec3 &p, int guess = 0) const;
  /// Radius [m], up to `most`, of the largest ball in the solid that touches the surface there, by balls that shrink
  /// until nothing is in them (J. Ma, S. W. Bae, S. Choi, *3D medial axis point approximation using nearest neighbors
  /// and the normal field*, The Visual Computer 28, 2012).
  double innerRadius(const Nearest &at, double most) const;
  const Vec3 &lower() const { return nodes_[0].lower; }
  const Vec3 &upper() const { return nodes_[0].upper; }

private:
  struct Face {
    std::array<Vec3, 3> corners, inward; // from the side behind each corner, in the plane
    Vec3 normal;
    int triangle;
  };
  /// A leaf has the faces from `first` on; another node two others, at `first` and behind it.
  struct Node {
    Vec3 lower, upper;
    int first, faces;
  };
  struct Candidate {
    double squared;
    Vec3 point;
    int face, feature; ///< 0 to 2 a vertex, 3 to 5 the edge behind it, 6 the face
  };
  void split(int node, int first, int last);
  void consider(const Vec3 &p, int face, Candidate &best) const;

  std::vector<Face> faces_;                  // in the order of the leaves
  std::vector<Node> nodes_;                  // the root first
  std::vector<int> face_of_;                 // of every triangle
  std::vector<std::array<Vec3, 7>> normals_; // of every triangle, by feature
};

/// A mesh as a shape: its exact distances at the nodes of a grid (more than six cells from the surface, those of a grid
/// of four times the cell), between them the cubic spline with continuous second derivatives. Its gradient is the
/// spline's, of unit length but for the error of interpolation, and shorter or zero in the middle between two faces.
/// Outside the grid the value is a lower bound of the distance, which may be short by the size of the grid:
/// sqrt(a^2 + b^2) with the distance `a` to the grid and the value `b` where that is. Values exceed the distance by the
/// error of interpolation at most: `gridError` near the surface, a cell elsewhere.
class MeshShape final : public Shape {
public:
  /// \param fine makes what `gridError` and `curvatureRadius` tell, and refuses thin solids
  MeshShape(const MeshDistance &exact, double cell, bool fine = true);
  void distances(const double *const point[3], int count, double *out) const override;
  Distance at(const Vec3 &p) const override;
  /// Of the interpolated surface, where `gridError` is measured: about a cell at sharp edges.
  double curvatureRadius() const override { return curvature_radius_; }
  double depth() const override { return -*std::min_element(spline_.begin(), spline_.end()); }
  /// Largest difference [m] to the exact distance at the centres of cells near the surface. It is largest at edges.
  double gridError() const { return error_; }
  double cell() const { return cell_; } ///< [m]

private:
  /// A point's place: the first of its coefficients, the parts of the way, and how far it is outside the grid.
  struct Spot {
    const double *first;
    Vec3 part, away;
  };
  Spot find(const Vec3 &p) const;
  /// Of coefficients from `first` on, weighted along each axis.
  double sum(const double *first, const Eigen::Array4d &x, const Eigen::Array4d &y, const Eigen::Array4d &z) const;
  double value(const Vec3 &p) const;
  void interpolate(std::ptrdiff_t outer, int nodes, std::ptrdiff_t inner);
  void inspect(const MeshDistance &exact);

  double cell_, error_ = 0, curvature_radius_ = HUGE_VAL;
  Vec3 first_;                 // node
  std::array<int, 3> nodes_;   // along each axis
  std::ptrdiff_t step_[2];     // from coefficient to coefficient along x and y
  std::vector<double> spline_; // coefficients, one more than nodes beyond each end
};

/// Throws std::invalid_argument that says what is wrong with the mesh (see MeshDistance); which part of the solid is
/// thinner than two cells, edges sharper than about 30 degrees among them, and the cell to ask for; or that the grid
/// has too many nodes. Memory: 8 bytes a node. \param cell [m]; 0 for a 64th of the longest side
std::shared_ptr<const MeshShape> makeMesh(const TriangleMesh &mesh, double cell = 0);

} // namespace tendril
