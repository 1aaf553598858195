#include "tendril/coupling/couplings.hpp"

namespace tendril {
namespace {

/// All couplings. A new one needs its maker here, declared in couplings.hpp, and nothing else.
constexpr std::unique_ptr<Term> (*couplings[])(const Scene &, const Elements &) = {
    makePins,    makeTies,        makeRotations, makeRotationsToBodies, makeJoints,
    makeTendons, makeBodyContact, makeContact,   makeRodContact,        makeContactOfBodies};

} // namespace

std::vector<std::unique_ptr<Term>> makeTerms(const Scene &scene, const Elements &elements, const AxialLaw &axial,
                                             bool dynamic) {
  std::vector<std::unique_ptr<Term>> terms = makeRodTerms(scene, elements, axial, dynamic);
  for (const auto make : couplings)
    if (std::unique_ptr<Term> term = make(scene, elements)) terms.push_back(std::move(term));
  return terms;
}

EnergyBudget energyBudget(const Scene &scene, const Elements &elements, const State &state, const Configuration &c,
                          double load_factor, int r) {
  const AxialLaw axial(scene, elements);
  EnergyBudget budget;
  for (const auto &term : makeTerms(scene, elements, axial, true)) term->addEnergies(state, c, load_factor, r, budget);
  return budget;
}

EnergyBudget energyBudget(const Scene &scene, const Elements &elements, const State &state, double load_factor) {
  const AxialLaw axial(scene, elements);
  const Configuration c = configurationOf(state, scene, elements, state.time);
  EnergyBudget budget;
  for (const auto &term : makeTerms(scene, elements, axial, true))
    for (int r = 0; r < int(elements.rods.size()); ++r) term->addEnergies(state, c, load_factor, r, budget);
  return budget;
}

} // namespace tendril
