#pragma once
/// \file summary.hpp
/// What the last state of a run comes to, in a few numbers: a block of the log, and /summary of the trajectory.

#include "tendril/energy/derived.hpp"
#include "tendril/io/hdf5.hpp"

namespace tendril {

struct Summary {
  /// The largest of its kind, and where: a vertex or an edge of a rod; rod -1 where there is none.
  struct Extreme {
    double value = 0;
    int rod = -1, at = 0;
    void include(double other, int r, int i) {
      if (other > value) *this = {other, r, i};
    }
  };
  double time = 0;                           ///< in statics the load factor
  double mass = 0;                           ///< [kg]
  Vec3 centre_of_mass = Vec3::Zero();        ///< [m]
  Extreme displacement;                      ///< from the place as drawn [m]
  Extreme tension, compression;              ///< internal force along the tangent [N]
  Extreme angle;                             ///< turning or twist between the edges at a vertex, cables left out [rad]
  std::vector<Vec3> force, moment;           ///< (ns) what each support does to its rod, see RodActions [N], [N m]
  std::vector<ConstraintReading> constraint; ///< (nc)
  std::vector<JointReading> joint;           ///< (nj)
  Vec3 total_force = Vec3::Zero(),
       total_moment = Vec3::Zero(); ///< of all supports, constraints and joints to the world, the moment about the
                                    ///< origin [N], [N m]
};

/// \param load_factor on the loads of the scene
Summary summarize(const Scene &scene, const Elements &elements, const State &state, double load_factor, bool dynamic);
/// A few lines; supports one by one where they are few.
std::vector<std::string> describe(const Summary &summary, const Scene &scene);
/// Attributes of /summary, which has to be there. Before the end of a run they are those of no state, nan and -1: a
/// file that grows takes no new ones.
void writeSummary(Hdf5File &file, const Summary &summary);
Summary emptySummary(const Scene &scene);
/// Supports that are told one by one, where there are no more than that.
inline constexpr std::size_t most_supports_told = 4;

} // namespace tendril
