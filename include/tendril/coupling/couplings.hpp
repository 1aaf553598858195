#pragma once
/// \file couplings.hpp
/// The list of all couplings, and all terms of a scene.

#include "tendril/coupling/stencil_term.hpp"

namespace tendril {

/// The terms that the scene needs, those of the rods first.
std::vector<std::unique_ptr<Term>> makeTerms(const Scene &scene, const Elements &elements, const AxialLaw &axial,
                                             bool dynamic);

/// Those of constraints of one kind; null where the scene has none.
std::unique_ptr<Term> makePins(const Scene &, const Elements &);
std::unique_ptr<Term> makeTies(const Scene &, const Elements &);
std::unique_ptr<Term> makeRotations(const Scene &, const Elements &);
std::unique_ptr<Term> makeRotationsToBodies(const Scene &, const Elements &);
/// Those between bodies; null where the scene has none.
std::unique_ptr<Term> makeJoints(const Scene &, const Elements &);
/// Tendons with what pulls on them; null where there are none.
std::unique_ptr<Term> makeTendons(const Scene &, const Elements &);
/// Those of bodies with obstacles; null where there are none.
std::unique_ptr<Term> makeBodyContact(const Scene &, const Elements &);
/// That of rods with obstacles; null where there are none.
std::unique_ptr<Term> makeContact(const Scene &, const Elements &);
/// That of rods with each other and themselves; null where they do not touch.
std::unique_ptr<Term> makeRodContact(const Scene &, const Elements &);
/// Of bodies with rods and with each other.
std::unique_ptr<Term> makeContactOfBodies(const Scene &, const Elements &);

/// The energies of a state, from the terms of its scene (for tests and single questions: makes them anew).
EnergyBudget energyBudget(const Scene &scene, const Elements &elements, const State &state,
                          const Configuration &configuration, double load_factor, int rod);
/// Of all rods.
EnergyBudget energyBudget(const Scene &scene, const Elements &elements, const State &state, double load_factor);

} // namespace tendril
