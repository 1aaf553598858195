#pragma once
/// \file cell.hpp
/// Cells of a rod as the kernels of bend_twist.hpp want them: constants, whole turns and strains, one at a time or a
/// pack.

#include "tendril/energy/bend_twist.hpp"
#include "tendril/state/state.hpp"

namespace tendril {

/// Constants of the cell (or pack of cells) at a slot, without turns.
template <class T> CellOf<T> readCell(const Planes &cells, int slot) {
  CellOf<T> c;
  for (int k = 0; k < 3; ++k) {
    c.stiffness[k] = read<T>(cells[cell_stiffness + k] + slot);
    c.rest[k] = read<T>(cells[cell_rest + k] + slot);
  }
  for (int k = 0; k < 2; ++k) {
    c.weight[k] = read<T>(cells[cell_weight + k] + slot);
    c.free[k] = read<T>(cells[cell_free + k] + slot);
  }
  c.base = read<T>(cells[cell_base] + slot);
  c.winding = T(0.0);
  c.sign = T(1.0);
  return c;
}

/// Constants of a cell with its whole turns.
template <class T> CellOf<T> cellOf(const Planes &cells, const Configuration &c, int slot) {
  using std::floor;
  CellOf<T> cell = readCell<T>(cells, slot);
  cell.winding = read<T>(c[Configuration::winding] + slot);
  const T half = floor(cell.winding * T(0.5 / pi) + T(0.5)) * T(0.5);
  cell.sign = T(1.0) - T(4.0) * (half - floor(half)); // -1 when their number is odd
  return cell;
}

/// Frames and constants of a cell (or a pack of `count` cells) as its energy wants them. Of a rod in space whose twists
/// are no unknowns the second director goes with the first by (1.1) of docs/theory.md: held ones may have turned ahead
/// of those that follow at the end of a step. \param cells constants, as Elements::cells()
template <class T>
std::pair<std::array<FrameOf<T>, 2>, CellOf<T>> presentCell(const Elements &elements, const Planes &cells,
                                                            const Configuration &c, int rod, const LooseCell &cell,
                                                            int count = 1) {
  std::array<FrameOf<T>, 2> f = cellFrames<T>(c, cell, count);
  const RodRange &range = elements.rods[rod];
  if (!range.isReduced() || range.flat >= 0) return {f, cellOf<T>(cells, c, cell.slot)};
  f[1].director = transport<T>(f[0].director, f[0].tangent, f[1].tangent);
  return {f, readCell<T>(cells, cell.slot)};
}

/// Present strains of a cell (or a pack of `count` cells), integrated over it [rad]: docs/theory.md (3.2), (3.4),
/// without the rest.
template <class T>
std::array<T, 3> presentStrain(const Elements &elements, const Configuration &configuration, int rod,
                               const LooseCell &cell, int count = 1) {
  const auto [f, constants] = presentCell<T>(elements, elements.cells(), configuration, rod, cell, count);
  return elements.measure[rod] == Measure::tan ? cellStrain<Measure::tan>(f[0], f[1], constants)
                                               : cellStrain<Measure::angle>(f[0], f[1], constants);
}

/// Strains of a configuration: a row over slots of the edges' axial ones, and three of the cells', each with room for a
/// pack behind. Those that constraints damp (dampedStrain) are in the rows of the cells, by columns at their slots.
std::vector<double> strainsOf(const Scene &scene, const Elements &elements, const Configuration &c);
inline std::size_t strainRow(const Elements &elements) { return std::size_t(elements.slots) + lanes; }

} // namespace tendril
