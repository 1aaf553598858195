#pragma once
/// \file body.hpp
/// Rigid bodies, their mass properties, and what ties rods to them.

#include "tendril/geometry/mesh_distance.hpp"
#include "tendril/model/contact.hpp"

#include <memory>
#include <string>
#include <vector>

namespace tendril {

/// Mass, centre of mass and inertia about it, in axes fixed in space.
struct MassProperties {
  double mass = 0;             ///< [kg]
  Vec3 centre = Vec3::Zero();  ///< [m]
  Mat3 inertia = Mat3::Zero(); ///< [kg m^2]
  /// Adds those of another body: the inertias about the common centre (Steiner's theorem).
  void add(const MassProperties &other);
  /// Those after a rotation about the origin and a translation.
  MassProperties moved(const Mat3 &rotation, const Vec3 &translation) const;
};

/// A rigid body as drawn. Its axes are those of the world at the start, turned by `rotation` before.
struct Body {
  std::string name, layer;
  MassProperties own; ///< where it is drawn; vertices of rods that are tied to it come on top (Elements::bodyMass)
  Vec3 position = Vec3::Zero();         ///< of its origin [m]
  Mat3 rotation = Mat3::Identity();     ///< from its own axes to those of the world
  Vec3 velocity = Vec3::Zero();         ///< of its centre of mass [m/s]
  Vec3 angular_velocity = Vec3::Zero(); ///< [rad/s]
  bool gravity = true;
  Vec3 force = Vec3::Zero();  ///< dead, on its centre of mass [N]
  Vec3 torque = Vec3::Zero(); ///< fixed in space [N m]
  std::string shape = "none"; ///< box, sphere, capsule, cylinder, mesh or none
  Vec3 size = Vec3::Zero();   ///< of a box its edges; else radius, length along z
  std::shared_ptr<const TriangleMesh> mesh;
  double cell = 0;                    ///< of the grid of its distances, 0: a 64th of its longest side [m]
  std::shared_ptr<const Shape> solid; ///< of that shape in its own axes, where rods or bodies touch it; else null
  /// With obstacles, rods and other bodies: `on`, a barrier of `distance` and a force of `stiffness` at each sample of
  /// its surface [N] (0: by the loads), friction and damping.
  ContactSettings contact = ContactSettings::none();
  Motion motion; ///< of one that goes as it is told, about its origin
  int rod = 0;   ///< the first that is tied to it, or any: they are solved together (Scene::hostBodies)
};

/// A vertex of a rod that is a point of a body. A weld ties the edges beside it to the frame of the body by half cells,
/// stress-free as drawn; a pin lets the rod turn.
struct Attachment {
  std::string name;
  int rod, vertex, body;
  bool weld;
  Frame frame;                                        ///< of a weld at an end: where the rod leaves the body; length 1
  bool tangent_given = false, director_given = false; ///< by the scene, otherwise as drawn
};

/// Of solids of constant density about the origin, the axis along z (bodies of revolution: the usual formulas).
MassProperties boxMass(const Vec3 &size, double density);
MassProperties sphereMass(double radius, double density);
MassProperties cylinderMass(double radius, double length, double density);
/// \param length of the cylinder between its half spheres
MassProperties capsuleMass(double radius, double length, double density);
/// Of the solid within a closed surface, by the divergence theorem: sums over the tetrahedra from its triangles to the
/// origin. The mass is negative where the surface is inside out.
MassProperties meshMass(const TriangleMesh &mesh, double density);

/// What is wrong with an inertia: it must be positive, and none of its principal moments more than the sum of the two
/// others. Empty where nothing is.
std::string flawOf(const Mat3 &inertia);

} // namespace tendril
