#pragma once
/// \file imbalance.hpp
/// What keeps an iterate from being an answer, in words: for the messages of all that fails.

#include "tendril/solver/incremental_potential.hpp"

#include <string>

namespace tendril {

/// Of -snes_rtol, what is asked of the strain errors of axial forces as unknowns.
constexpr double compatibility_rtol = 1e-4;

/// What is asked for, without units.
struct Asked {
  double rtol = 0;    ///< of the load, and of the load times the length
  double sharper = 1; ///< what of -snes_rtol that is: it is made sharper where an answer has to be sure
};

/// "rod 'spring' (128 edges)"
std::string labelOf(const Rod &rod);

/// What of a rod is above its tolerance at the potential's iterate: forces, moments, strains, each with its value, what
/// is asked for, and where it is largest: "forces out of balance by 0.012 of its load of 9.81 N (asked: 1e-06,
/// -snes_rtol), most at vertex 17". Empty where nothing is.
std::string imbalanceOf(IncrementalPotential &potential, int rod, const Asked &asked);

/// The rod whose residual is farthest above its tolerance. \param active per rod: whether it counts; -1 where none does
int farthestRod(IncrementalPotential &potential, RodSet rods, const Asked &asked,
                const std::vector<char> *active = nullptr);

/// To be added to why something failed: "; rod 'spring' (128 edges): forces ..." of that rod, or nothing.
std::string tellImbalance(IncrementalPotential &potential, int rod, const Asked &asked);

} // namespace tendril
