#include "tendril/energy/term.hpp"

#include <algorithm>

namespace tendril {

std::vector<std::unique_ptr<Term>> makeTerms(const Scene &scene, const Elements &elements, const AxialLaw &axial, bool dynamic) {
  std::vector<std::unique_ptr<Term>> terms;
  const bool heavy = !scene.gravity.isZero(0) && std::any_of(scene.rods.begin(), scene.rods.end(), [](const Rod &r) { return r.gravity; });
  terms.push_back(makeStretch(elements, axial));
  if (elements.cells.size() > 0) terms.push_back(makeBendTwist(scene, elements));
  if (heavy || !scene.forces.empty() || !scene.moments.empty()) terms.push_back(makeLoad(scene, elements));
  if (dynamic) terms.push_back(makeInertia(scene, elements));
  return terms;
}

EnergyBudget energyBudget(const Scene &scene, const Elements &elements, const State &state, double load_factor) {
  EnergyBudget budget;
  const Configuration c = configurationOf(state, scene, elements, state.time);
  for (std::size_t r = 0; r < scene.rods.size(); ++r) {
    const RodRange &rod = elements.rods[r];
    for (int v = rod.first_vertex; v < rod.first_vertex + rod.vertices; ++v) {
      budget.kinetic += 0.5 * elements.mass[v] * state.velocity[v].squaredNorm();
      if (scene.rods[r].gravity) budget.gravity -= load_factor * elements.mass[v] * scene.gravity.dot(state.position[v]);
    }
    for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) {
      const double s = c.strain[i];
      budget.stretch += 0.5 * elements.axial_stiffness[i] * s * s * elements.rest_length[i];
      budget.kinetic += 0.5 * elements.twist_mass[i] * state.twist_rate[i] * state.twist_rate[i];
    }
    for (int n = elements.rod_cells[r]; n < elements.rod_cells[r + 1]; ++n) {
      const std::array<double, 3> s = presentStrain(elements, c, int(r), n);
      for (int k = 0; k < 3; ++k) {
        const double d = s[k] - elements.cells.rest[k][n];
        (k < 2 ? budget.bend : budget.twist) += 0.5 * elements.cells.stiffness[k][n] * d * d;
      }
    }
  }
  return budget;
}

} // namespace tendril
