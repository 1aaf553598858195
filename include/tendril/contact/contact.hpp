#pragma once
/// \file contact.hpp
/// What obstacles do to rods at their samples.

#include "tendril/contact/obstacles.hpp"

namespace tendril {

/// A sample in contact, in the axes of the world.
struct ContactPoint {
  double at;      ///< part of its edge
  Vec3 normal;    ///< out of the obstacle
  Vec3 force;     ///< on the rod [N]
  Mat3 stiffness; ///< second derivatives of the energy by its place: by the law, ... [N/m]
  Mat3 curvature; ///< ... and by the turning of the normal
};
ContactPoint contactPoint(const Scene &scene, const RodContacts &rod, const Samples &samples, int k);

/// (nv) What obstacles do to the rods at a state [N]. \param c of the state
std::vector<Vec3> contactForces(const Scene &scene, const Elements &elements, const State &state,
                                const Configuration &c);

/// Where a rod comes nearest to an obstacle.
struct Touch {
  int rod = -1, collider = -1;
  double gap = HUGE_VAL; ///< between surfaces [m]
  double arc = 0;        ///< along the rod at rest [m]
};
/// That of each rod and obstacle near it, the least gap first.
std::vector<Touch> tightest(const Scene &scene, const Elements &elements, const Configuration &c);

} // namespace tendril
