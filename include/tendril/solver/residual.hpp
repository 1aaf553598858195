#pragma once
/// \file residual.hpp
/// How far an iterate is from an answer: the forces, moments and strains of a rod that are out of balance, in units of
/// its own loads, and what rounding leaves of them.

#include "tendril/energy/term.hpp"

namespace tendril {

/// Sizes of a rod at rest.
struct RodScale {
  double length = 0, shortest_edge = 0, longest_edge = 0; ///< [m]
  double bending = 0;                                     ///< sum of the stiffnesses of its cells [N m]
  double pinning = 0, turning = 0;                        ///< sums of the stiffnesses of its constraints [N/m], [N m]
  double load = 0;                                        ///< its loads, and its share of bodies' [N], or 0
  double force = 0;                                       ///< what measures its residual in the present step [N]
};
std::vector<RodScale> rodScales(const Scene &scene, const Elements &elements);

/// The force that measures a rod's residual: its loads. A rod without any is measured by the force that deforms it,
/// the smallest of EI/L^2, GJ/L^2 and 1e-4 EA, or, where that is smaller, by the force that would stop it within the
/// step.
double forceScale(const Scene &scene, const Elements &elements, const Step &step, const State &start,
                  const RodScale &scale, int rod);

/// Rounding of an edge relative to its length: that of the edge itself, and that of the second word of positions.
double edgeError(double reach, double edge);

/// Residual relative to the load scale, and the strain error of the axial forces.
struct Residual {
  double force = 0, moment = 0;                                      ///< 1 is the rod's load scale
  double compatibility = 0;                                          ///< largest |strain - S/k|
  double force_floor = 0, moment_floor = 0, compatibility_floor = 0; ///< what rounding leaves, same units
  void include(const Residual &other); ///< the larger of each; not a number is the largest
  bool isFinite() const { return std::isfinite(force) && std::isfinite(moment); }
};
inline constexpr double Residual::*residual_parts[] = {&Residual::force,         &Residual::moment,
                                                       &Residual::compatibility, &Residual::force_floor,
                                                       &Residual::moment_floor,  &Residual::compatibility_floor};

/// \param out_of_balance forces and moments at the slots of the rod
/// \param reach, steepness see IncrementalPotential::RodEnergy
Residual residualOf(const Elements &elements, const Material &material, const Step &step, const AxialLaw &axial,
                    const Configuration &iterate, const Planes &out_of_balance, const RodScale &scale, double reach,
                    double steepness, int rod);
/// Of a body: forces by its loads or by those of its rod, couples by these times its size or arms.
/// \param unit of the rod [N] \param load of the body [N]
void includeBody(const Elements &elements, const JoinedBody &body, const Step &step, const Configuration &start,
                 const Configuration &iterate, const Planes &out_of_balance, double unit, double load,
                 Residual *residual);
/// Weight of a body, with what pulls on it [N].
double bodyLoad(const Scene &scene, const Elements &elements, int body);

} // namespace tendril
