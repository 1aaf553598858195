/// Bending and twisting of all cells, several at a time in the lanes of a pack.
#include "tendril/energy/joint_cell.hpp"
#include "tendril/energy/term.hpp"

namespace tendril {
namespace {

class BendTwist final : public Term {
public:
  BendTwist(const Scene &scene, const Elements &elements)
      : scene_(scene), elements_(elements), cells_(elements.cells()) {}

  /// Dissipation proportional to stiffness is a second quadratic in the same strains, docs/theory.md (14.2): stiffness
  /// k and rest r with damping ratio q = beta/dt around the strain s at the start (dampedRest) combine into stiffness k
  /// (1 + q) and rest (r + q s)/(1 + q).
  void beginStep(const State &, const Configuration &start, const Step &step, int r) override {
    const double beta = scene_.rods[r].material.stiffness_damping_coefficient;
    if (beta == 0 || elements_.rods[r].isReduced()) return;
    const double q = step.isStatic() ? 0 : beta / step.dampingDt();
    forCells(elements_, r, [&]<class T>(const LooseCell &cell, int count) {
      const std::array<T, 3> s = presentStrain<T>(elements_, start, r, cell, count);
      for (int k = 0; k < 3; ++k) {
        write(cells_[cell_stiffness + k] + cell.slot,
              T(read<T>(elements_.cells()[cell_stiffness + k] + cell.slot) * T(1 + q)));
        write(cells_[cell_rest + k] + cell.slot,
              T((read<T>(elements_.cells()[cell_rest + k] + cell.slot) +
                 T(q) * dampedRest(step, s[k], (k + 1) * strainRow(elements_) + cell.slot)) /
                T(1 + q)));
      }
    });
  }

  double energy(const Configuration &configuration, int rod) const override {
    if (elements_.rods[rod].isReduced()) return 0; // see bend.cpp
    return elements_.measure[rod] == Measure::tan ? total<Measure::tan>(configuration, rod)
                                                  : total<Measure::angle>(configuration, rod);
  }

  [[gnu::flatten]] void addEnergies(const State &, const Configuration &c, double load_factor, int r,
                                    EnergyBudget &out) const override {
    Pack bend(0.0), twist(0.0);
    EnergyBudget rod;
    forCells(elements_, r, [&]<class T>(const LooseCell &cell, int count) {
      const std::array<T, 3> s = presentStrain<T>(elements_, c, r, cell, count);
      std::array<T, 3> e;
      for (int k = 0; k < 3; ++k) {
        const T d = s[k] - read<T>(elements_.cells()[cell_rest + k] + cell.slot);
        e[k] = read<T>(elements_.cells()[cell_stiffness + k] + cell.slot) * d * d;
      }
      if constexpr (std::is_same_v<T, Pack>) {
        bend += e[0] + e[1];
        twist += e[2];
      } else {
        rod.bend += 0.5 * (e[0] + e[1]);
        rod.twist += 0.5 * e[2];
      }
    });
    rod.bend += 0.5 * reduce(bend);
    rod.twist += 0.5 * reduce(twist);
    for (const EndCouple &end : elements_.end_couples[r]) {
      const std::array<double, 3> e = endEnergy(elements_, c, end, load_factor);
      rod.bend += e[0] + e[1];
      rod.twist += e[2];
    }
    out += rod;
  }

  void addDerivatives(const Configuration &configuration, int rod, Derivatives &out,
                      HessianKind hessian) const override {
    if (elements_.rods[rod].isReduced()) return;
    elements_.measure[rod] == Measure::tan ? assemble<Measure::tan>(configuration, rod, hessian, out)
                                           : assemble<Measure::angle>(configuration, rod, hessian, out);
  }

  std::array<Vec3, 2> actionFrom(int slot, const Configuration &configuration, int rod) const override {
    return {Vec3::Zero(), momentOn(elements_, cells_, configuration, rod, slot)};
  }

private:
  const Scene &scene_;
  const Elements &elements_;
  Planes cells_; ///< constants with dissipation

  template <Measure measure> [[gnu::flatten]] double total(const Configuration &configuration, int rod) const {
    double energy = 0;
    Pack energies(0.0);
    forCells(elements_, rod, [&]<class T>(const LooseCell &cell, int count) {
      const auto [f0, f1] = cellFrames<T>(configuration, cell, count);
      const T e = cellEnergy<measure>(f0, f1, cellOf<T>(cells_, configuration, cell.slot));
      if constexpr (std::is_same_v<T, Pack>)
        energies += e;
      else
        energy += e;
    });
    return energy + reduce(energies);
  }

  /// Where the derivatives of a cell go: the planes of its vertices' gradient and of its edges' blocks, from its first
  /// edge's slot on.
  template <class T> struct Adder {
    const std::array<double *, slot_size> &gradient;
    const BlockPlanes &blocks;
    int first;
    void putGradient(int r, const T &v) const { addTo(gradient[r % slot_size] + first + r / slot_size, v); }
    void putHessian(int r, int c, const T &v) const {
      if (c < edge_size)
        addTo(blocks.own(r, c) + first, v);
      else if (r < edge_size)
        addTo(blocks.across(r, c - edge_size) + first + 1, v);
      else
        addTo(blocks.own(r - edge_size, c - edge_size) + first + 1, v);
    }
  };
  /// The Hessian alone.
  template <class T> struct HessianAdder : Adder<T> {
    void putGradient(int, const T &) const {}
  };

  /// A half cell to the frame of a junction.
  /// \param blocks null where only the gradient is wanted \param gradient or only the Hessian
  template <Measure measure>
  [[gnu::noinline]] void addJoined(const Configuration &c, const LooseCell &cell, const CellOf<double> &constants,
                                   const std::array<double *, slot_size> *gradient, const BlockPlanes *blocks) const {
    const int frame = cell.turning == 0 ? cell.frame0 : cell.frame1,
              edge = cell.turning == 0 ? cell.frame1 : cell.frame0;
    const JointCellDerivatives d =
        jointCellDerivatives<measure>(c.frameAt(cell.frame0), c.frameAt(cell.frame1), constants, cell.turning);
    for (int r = 0; gradient && r < 3; ++r) {
      (*gradient)[r][frame] += d.spin[r];
      (*gradient)[r][edge] -= d.edge[r];
      (*gradient)[r][edge + 1] += d.edge[r];
    }
    if (gradient) (*gradient)[3][edge] += d.edge[3];
    for (int r = 0; blocks && r < edge_size; ++r)
      for (int k = 0; k < edge_size; ++k) {
        if (k >= r) blocks->own(r, k)[edge] += d.edge_edge(r, k);
        if (r < 3) blocks->across(r, k)[cell.slot] += d.spin_edge(r, k);
        if (r <= k && k < 3) blocks->vertex(r, k)[frame] += d.spin_spin(r, k);
      }
  }

  template <Measure measure>
  void assemble(const Configuration &configuration, int rod, HessianKind hessian, Derivatives &out) const {
    std::array<double *, slot_size> gradient;
    for (int a = 0; a < slot_size; ++a) gradient[a] = out.equilibrium[a];
    const BlockPlanes blocks(out.blocks, elements_.rods[rod]);
    if (hessian == HessianKind::none)
      addGradients<measure>(configuration, rod, gradient);
    else if (hessian == HessianKind::gauss_newton) {
      addGradients<measure>(configuration, rod, gradient);
      addGaussNewton<measure>(configuration, rod, gradient, blocks);
    } else
      addAll<measure>(configuration, rod, gradient, blocks);
  }

  template <Measure measure>
  [[gnu::flatten, gnu::noinline]] void addGradients(const Configuration &c, int rod,
                                                    const std::array<double *, slot_size> &gradient) const {
    forCells(elements_, rod, [&]<class T>(const LooseCell &cell, int count) {
      if constexpr (std::is_same_v<T, double>)
        if (cell.turning >= 0)
          return addJoined<measure>(c, cell, cellOf<double>(cells_, c, cell.slot), &gradient, nullptr);
      const auto f = cellFrames<T>(c, cell, count);
      const std::array<T, cell_size> g = cellGradient<measure>(f[0], f[1], cellOf<T>(cells_, c, cell.slot));
      for (int r = 0; r < cell_size; ++r) addTo(gradient[r % slot_size] + cell.vertex - 1 + r / slot_size, g[r]);
    });
  }

  template <Measure measure>
  [[gnu::flatten, gnu::noinline]] void addAll(const Configuration &c, int rod,
                                              const std::array<double *, slot_size> &gradient,
                                              const BlockPlanes &blocks) const {
    forCells(elements_, rod, [&]<class T>(const LooseCell &cell, int count) {
      if constexpr (std::is_same_v<T, double>)
        if (cell.turning >= 0)
          return addJoined<measure>(c, cell, cellOf<double>(cells_, c, cell.slot), &gradient, &blocks);
      const auto f = cellFrames<T>(c, cell, count);
      cellDerivatives<measure>(f[0], f[1], cellOf<T>(cells_, c, cell.slot),
                               Adder<T>{gradient, blocks, cell.vertex - 1});
    });
  }

  /// The Hessian that cells would have if they were at rest as they are.
  template <Measure measure>
  [[gnu::flatten, gnu::noinline]] void addGaussNewton(const Configuration &c, int rod,
                                                      const std::array<double *, slot_size> &gradient,
                                                      const BlockPlanes &blocks) const {
    forCells(elements_, rod, [&]<class T>(const LooseCell &cell, int count) {
      const auto f = cellFrames<T>(c, cell, count);
      CellOf<T> constants = cellOf<T>(cells_, c, cell.slot);
      constants.rest = cellStrain<measure>(f[0], f[1], constants);
      if constexpr (std::is_same_v<T, double>)
        if (cell.turning >= 0) return addJoined<measure>(c, cell, constants, nullptr, &blocks);
      cellDerivatives<measure>(f[0], f[1], constants, HessianAdder<T>{{gradient, blocks, cell.vertex - 1}});
    });
  }
};

} // namespace

std::unique_ptr<Term> makeBendTwist(const Scene &scene, const Elements &elements) {
  return std::make_unique<BendTwist>(scene, elements);
}

} // namespace tendril
