#pragma once
/// \file contact.hpp
/// What obstacles do to rods at their samples.

#include "tendril/contact/obstacles.hpp"

namespace tendril {

/// Whether a rod is touched at its surface, by its skin or by friction, whose frames that turns; cables have none.
bool carriesSurface(const Rod &rod);

/// Stiffness of the barrier of a rod [N/m]: ten times its weight per length, or where it has more to bear as much as
/// keeps surfaces within the barrier; a power of four. \param force to bear [N] \param pressure on the sample that is
/// pressed most [N/m] \param on_surface whether its skin touches, of which a strip bears all
double barrierStiffness(const Scene &scene, const Elements &elements, double force, double pressure, bool is_static,
                        int rod, bool on_surface = false);

/// A sample in contact, in the axes of the world.
struct ContactPoint {
  EdgePoint rod;  ///< where it is
  Vec3 normal;    ///< gradient of the distance: out of the obstacle, of length 1 but where it is interpolated
  Vec3 force;     ///< on the rod [N]
  Mat3 stiffness; ///< second derivatives of the energy by its place: by the law, ... [N/m]
  Mat3 curvature; ///< ... and by the turning of the normal
};
ContactPoint contactPoint(const Scene &scene, const RodContacts &rod, const Samples &samples, int k);

/// A sample in contact at a state.
struct ContactReading {
  int rod, collider, edge;
  EdgePoint point; ///< where it is
  double gap;      ///< between surfaces [m]
  Vec3 place;      ///< of the sample, on the axis of the rod or on its skin [m]
  Vec3 normal;     ///< out of the obstacle
  Vec3 force;      ///< of the normal law, on the rod [N]
  Vec3 friction;   ///< and what else the obstacle does, friction and damping, in the step that led to the state [N]
};
/// \param c of the state
std::vector<ContactReading> contactReadings(const Scene &scene, const Elements &elements, const State &state,
                                            const Configuration &c);
/// (nv) Their forces, shared by the vertices of each edge [N].
std::vector<Vec3> contactForces(const Elements &elements, const std::vector<ContactReading> &readings);
/// What each obstacle does to the rods: force [N], and moment about its position [N m]. \param time of the state [s]
void colliderActions(const Scene &scene, const std::vector<ContactReading> &readings, double time,
                     std::vector<Vec3> *force, std::vector<Vec3> *moment);

/// Where a rod comes nearest to an obstacle.
struct Touch {
  int rod = -1, collider = -1;
  double gap = HUGE_VAL; ///< between surfaces [m]
  double arc = 0;        ///< along the rod at rest [m]
};
/// Where two rods, or a rod and itself, come nearest to each other.
struct Meeting {
  int rod, to_rod;
  double gap;         ///< between surfaces [m]
  double arc, to_arc; ///< along the rods at rest [m]
};
/// Edges of rods that are closer than their law lets them come, the deepest first. \param within so much of that [m]
std::vector<Meeting> overlapsOfRods(const Scene &scene, const Elements &elements, const Configuration &c,
                                    double within = 0);
/// The least gap of each body and obstacle near it; `rod` is the body's number.
std::vector<Touch> tightestOfBodies(const Scene &scene, const Elements &elements, const Configuration &c);
/// That of each rod and obstacle near it, the least gap first.
std::vector<Touch> tightest(const Scene &scene, const Elements &elements, const Configuration &c);

} // namespace tendril
