#include "tendril/energy/term.hpp"

#include <algorithm>

namespace tendril {

std::vector<std::unique_ptr<Term>> makeTerms(const Scene &scene, const Elements &elements, const AxialLaw &axial, bool dynamic) {
  std::vector<std::unique_ptr<Term>> terms;
  const bool heavy = !scene.gravity.isZero(0) && std::any_of(scene.rods.begin(), scene.rods.end(), [](const Rod &r) { return r.gravity; });
  terms.push_back(makeStretch(elements, axial));
  if (!elements.cell_slot.empty()) terms.push_back(makeBendTwist(scene, elements));
  if (heavy || !scene.forces.empty() || !scene.moments.empty()) terms.push_back(makeLoad(scene, elements));
  if (dynamic) terms.push_back(makeInertia(scene, elements));
  return terms;
}

EnergyBudget energyBudget(const Scene &scene, const Elements &elements, const State &state, const Configuration &c, double load_factor) {
  EnergyBudget budget;
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const RodRange &rod = elements.rods[r];
    for (int i = 0; i < rod.vertices; ++i) {
      const int v = rod.first_vertex + i;
      const double mass = elements.mass()[rod.slot(i)];
      budget.kinetic += 0.5 * mass * state.velocity[v].squaredNorm();
      if (scene.rods[r].gravity) budget.gravity -= load_factor * mass * scene.gravity.dot(state.position[v]);
    }
    for (int i = 0; i < rod.edges; ++i) {
      const int slot = rod.slot(i);
      const double s = c[Configuration::strain][slot], rate = state.twist_rate[rod.first_edge + i];
      budget.stretch += 0.5 * elements.axialStiffness()[slot] * s * s * elements.restLength()[slot];
      budget.kinetic += 0.5 * elements.twistMass()[slot] * rate * rate;
    }
    forCells(elements, int(r), [&]<class T>(const LooseCell &cell, int count) {
      const std::array<T, 3> s = presentStrain<T>(elements, c, int(r), cell, count);
      for (int k = 0; k < 3; ++k) {
        const T d = s[k] - read<T>(elements.cells()[cell_rest + k] + cell.slot);
        (k < 2 ? budget.bend : budget.twist) += sum(T(T(0.5) * read<T>(elements.cells()[cell_stiffness + k] + cell.slot) * d * d));
      }
    });
  }
  return budget;
}

EnergyBudget energyBudget(const Scene &scene, const Elements &elements, const State &state, double load_factor) {
  return energyBudget(scene, elements, state, configurationOf(state, scene, elements, state.time), load_factor);
}

} // namespace tendril
