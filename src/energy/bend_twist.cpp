/// Bending and twisting of all cells, several at a time in the lanes of a pack.
#include "tendril/energy/term.hpp"

namespace tendril {
namespace {

constexpr int lanes = int(Pack::size());

Pack load(const double *p) { return Pack(p, std::experimental::element_aligned); }

FrameOf<Pack> gatherFrames(const Frame *frames, const int *index) {
  FrameOf<Pack> f;
  for (int k = 0; k < 3; ++k) {
    f.tangent[k] = Pack([&](auto lane) { return frames[index[lane]].tangent[k]; });
    f.director[k] = Pack([&](auto lane) { return frames[index[lane]].director[k]; });
  }
  f.length = Pack([&](auto lane) { return frames[index[lane]].length; });
  return f;
}

/// Adds one lane of a cell's derivatives into the rows.
void addLane(const double (*gradient)[lanes], const double (*hessian)[lanes], int lane, int row, Rows &rows) {
  double *g = rows.gradient.data() + row;
  for (int r = 0; r < cell_size; ++r) g[r] += gradient[r][lane];
  double *band = rows.band.data() + std::size_t(row) * DofMap::band;
  for (int r = 0, k = 0; r < cell_size; ++r, band += DofMap::band)
    for (int c = 0; c < cell_size - r; ++c, ++k) band[c] += hessian[k][lane];
}

class BendTwist final : public Term {
public:
  BendTwist(const Scene &scene, const Elements &elements) : scene_(scene), elements_(elements), stiffness_(elements.cells.stiffness), rest_(elements.cells.rest) {}

  /// Dissipation proportional to stiffness is a second quadratic in the same strains: stiffness k and rest r with damping ratio
  /// q = beta/dt around the strain s at the start combine into stiffness k (1 + q) and rest (r + q s)/(1 + q).
  void beginStep(const State &, const Configuration &start, const Step &step) override {
    const CellArrays &cells = elements_.cells;
    for (std::size_t r = 0; r < scene_.rods.size(); ++r) {
      const double beta = scene_.rods[r].material.stiffness_damping_coefficient;
      if (beta == 0) continue;
      const double q = step.isStatic() ? 0 : beta / step.dt;
      for (int c = elements_.rod_cells[r]; c < elements_.rod_cells[r + 1]; ++c) {
        const std::array<double, 3> s = presentStrain(elements_, start, int(r), c);
        for (int k = 0; k < 3; ++k) {
          stiffness_[k][c] = cells.stiffness[k][c] * (1 + q);
          rest_[k][c] = (cells.rest[k][c] + q * s[k]) / (1 + q);
        }
      }
    }
  }

  double energy(const Configuration &configuration, int rod) const override {
    return elements_.measure[rod] == Measure::tan ? sum<Measure::tan>(configuration, rod) : sum<Measure::angle>(configuration, rod);
  }

  void addDerivatives(const Configuration &configuration, int rod, Rows &rows, HessianKind hessian) const override {
    elements_.measure[rod] == Measure::tan ? assemble<Measure::tan>(configuration, rod, hessian, rows)
                                           : assemble<Measure::angle>(configuration, rod, hessian, rows);
  }

private:
  const Scene &scene_;
  const Elements &elements_;
  std::array<std::vector<double>, 3> stiffness_, rest_; ///< with dissipation

  template <Measure measure> CellOf<Pack> loadCells(const Configuration &configuration, int c) const {
    const CellArrays &cells = elements_.cells;
    CellOf<Pack> cell;
    for (int k = 0; k < 3; ++k) {
      cell.stiffness[k] = load(&stiffness_[k][c]);
      cell.rest[k] = load(&rest_[k][c]);
    }
    for (int k = 0; k < 2; ++k) {
      cell.weight[k] = load(&cells.weight[k][c]);
      cell.free[k] = load(&cells.free[k][c]);
    }
    cell.turns = Pack(0.0);
    cell.sign = Pack(1.0);
    if constexpr (measure == Measure::angle) {
      const int last = int(configuration.turns.size()) - 1;
      cell.turns = Pack([&](auto lane) { return configuration.turns[std::min(c + int(lane), last)]; });
      cell.sign = Pack([&](auto lane) { return std::remainder(std::round(cell.turns[lane] / (2 * pi)), 2.0) == 0 ? 1.0 : -1.0; });
    }
    return cell;
  }

  template <Measure measure> double sum(const Configuration &configuration, int rod) const {
    const CellArrays &cells = elements_.cells;
    Pack total(0.0);
    const int end = elements_.rod_cells[rod + 1];
    for (int c = elements_.rod_cells[rod]; c < end; c += lanes) {
      const FrameOf<Pack> f0 = gatherFrames(configuration.frame.data(), &cells.frame0[c]), f1 = gatherFrames(configuration.frame.data(), &cells.frame1[c]);
      Pack e = cellEnergy<measure>(f0, f1, loadCells<measure>(configuration, c));
      if (c + lanes > end) where(Pack([](auto lane) { return double(lane); }) >= Pack(double(end - c)), e) = Pack(0.0);
      total += e;
    }
    return reduce(total);
  }

  template <Measure measure> void assemble(const Configuration &configuration, int rod, HessianKind hessian_kind, Rows &rows) const {
    const CellArrays &cells = elements_.cells;
    const int end = elements_.rod_cells[rod + 1];
    alignas(64) double gradient[cell_size][lanes], hessian[cell_pairs][lanes];
    for (int c = elements_.rod_cells[rod]; c < end; c += lanes) {
      const FrameOf<Pack> f0 = gatherFrames(configuration.frame.data(), &cells.frame0[c]), f1 = gatherFrames(configuration.frame.data(), &cells.frame1[c]);
      CellDerivatives<Pack> d;
      CellOf<Pack> cell = loadCells<measure>(configuration, c);
      cellDerivatives<measure>(f0, f1, cell, d);
      if (hessian_kind == HessianKind::gauss_newton) { // the Hessian the cell would have if it were at rest as it is
        const std::array<Pack, cell_size> gradient_now = d.gradient;
        cell.rest = cellStrain<measure>(f0, f1, cell);
        cellDerivatives<measure>(f0, f1, cell, d);
        d.gradient = gradient_now;
      }
      for (int k = 0; k < cell_size; ++k) d.gradient[k].copy_to(gradient[k], std::experimental::vector_aligned);
      for (int k = 0; k < cell_pairs; ++k) d.hessian[k].copy_to(hessian[k], std::experimental::vector_aligned);
      for (int lane = 0; lane < std::min(lanes, end - c); ++lane) addLane(gradient, hessian, lane, cells.row[c + lane], rows);
    }
  }
};

} // namespace

std::array<double, 3> presentStrain(const Elements &elements, const Configuration &configuration, int rod, int c) {
  const CellArrays &cells = elements.cells;
  CellOf<double> cell{};
  cell.weight = {cells.weight[0][c], cells.weight[1][c]};
  cell.turns = configuration.turns[c];
  cell.sign = std::remainder(std::round(cell.turns / (2 * pi)), 2.0) == 0 ? 1.0 : -1.0;
  const Frame &f0 = configuration.frame[cells.frame0[c]], &f1 = configuration.frame[cells.frame1[c]];
  return elements.measure[rod] == Measure::tan ? cellStrain<Measure::tan>(f0, f1, cell) : cellStrain<Measure::angle>(f0, f1, cell);
}

std::unique_ptr<Term> makeBendTwist(const Scene &scene, const Elements &elements) { return std::make_unique<BendTwist>(scene, elements); }

} // namespace tendril
