#include "tendril/energy/cell.hpp"

namespace tendril {

std::vector<double> strainsOf(const Elements &elements, const Configuration &c) {
  const std::size_t row = strainRow(elements);
  std::vector<double> strains(4 * row, 0.0);
  for (const int s : elements.edge_slot) strains[s] = c[Configuration::strain][s];
  for (int r = 0; r < int(elements.rods.size()); ++r)
    forCells(elements, r, [&]<class T>(const LooseCell &cell, int count) {
      const std::array<T, 3> s = presentStrain<T>(elements, c, r, cell, count);
      for (int k = 0; k < 3; ++k) write(strains.data() + (k + 1) * row + cell.slot, s[k]);
    });
  return strains;
}

} // namespace tendril
