#include "tendril/energy/cell.hpp"
#include "tendril/energy/joint.hpp"
#include "tendril/energy/tendon.hpp"

#include "tendril/energy/constraint.hpp"

namespace tendril {

std::vector<double> strainsOf(const Scene &scene, const Elements &elements, const Configuration &c) {
  const std::size_t row = strainRow(elements);
  std::vector<double> strains(4 * row, 0.0);
  for (const int s : elements.edge_slot) strains[s] = c[Configuration::strain][s];
  for (int r = 0; r < int(elements.rods.size()); ++r)
    forCells(elements, r, [&]<class T>(const LooseCell &cell, int count) {
      const std::array<T, 3> s = presentStrain<T>(elements, c, r, cell, count);
      for (int k = 0; k < 3; ++k) write(strains.data() + (k + 1) * row + cell.slot, s[k]);
    });
  for (std::size_t n = 0; n < scene.constraints.size(); ++n) {
    const Constraint &constraint = scene.constraints[n];
    const int slot = elements.constraint_slot[n];
    const Mat3 m = dampedStrain(elements, constraint, slot, elements.length(constraint.rod), c);
    for (int j = 0; j < constraint.slots(); ++j)
      for (int k = 0; k < 3; ++k) strains[(k + 1) * row + slot + j] = m(k, j);
  }
  for (std::size_t n = 0; n < scene.joints.size(); ++n) {
    const BodyPair &pair = elements.pairOf(int(n));
    const Rows rows = dampedRows(scene.joints[n], placeOf(scene.joints[n], pair, elements, c));
    for (int k = 0; k < joint_rows; ++k) strains[std::size_t(pair.first + k)] = rows[k];
  }
  for (std::size_t n = 0; n < scene.tendons.size(); ++n)
    if (scene.tendons[n].dissipates()) {
      const TendonPath path(scene, elements, int(n));
      strains[std::size_t(path.slot())] = path.displacement(c);
    }
  return strains;
}

} // namespace tendril
