/// Bending of rods without twists (RodModel), several cells at a time in the lanes of a pack.
#include "tendril/energy/bend.hpp"
#include "tendril/energy/term.hpp"

namespace tendril {
namespace {

using C = Configuration;

/// The coordinates of a rod's plane, so that turning the first to the second is right-handed about the third.
std::array<int, 2> coordinatesOf(const RodRange &rod) { return {(rod.flat + 1) % 3, (rod.flat + 2) % 3}; }

/// The two edges of a cell, or of a pack of `count` cells; lanes without a cell are straight.
template <class T, int n>
EdgePair<T, n> edgesOf(const C &c, const LooseCell &cell, int count, const std::array<int, n> &axis) {
  EdgePair<T, n> e;
  for (int k = 0; k < n; ++k) {
    const double *tangent = c[C::Plane(C::tangent + axis[k])];
    e.t0[k] = read<T>(tangent + cell.frame0);
    e.t1[k] = read<T>(tangent + cell.frame1);
  }
  e.l0 = read<T>(c[C::length] + cell.frame0);
  e.l1 = read<T>(c[C::length] + cell.frame1);
  if constexpr (std::is_same_v<T, Pack>)
    if (count < lanes) {
      const Pack::mask_type live = firstLanes(count);
      for (int k = 0; k < n; ++k) e.t1[k] = select(live, e.t1[k], e.t0[k]);
      e.l1 = select(live, e.l1, e.l0);
    }
  return e;
}

class Bend final : public Term {
public:
  Bend(const Scene &scene, const Elements &elements)
      : scene_(scene), elements_(elements), law_(4, elements.slots + lanes) {
    const C drawn = configurationOf(initialState(scene, elements), scene, elements, 0);
    for (int r = 0; r < int(elements.rods.size()); ++r) {
      const RodRange &rod = elements.rods[r];
      if (!rod.isReduced()) continue;
      if (rod.flat >= 0)
        for (const LooseCell &cell : cellsOf(elements, r)) align(drawn, rod, cell);
      setLaw(
          r, [&](int k, int slot) { return elements.cells()[cell_rest + k][slot]; }, 0);
    }
  }

  /// Dissipation is a second quadratic, as in BendTwist: docs/theory.md (14.2).
  void beginStep(const State &, const Configuration &start, const Step &step, int r) override {
    const double beta = scene_.rods[r].material.stiffness_damping_coefficient;
    if (!elements_.rods[r].isReduced() || beta == 0) return;
    const double q = step.isStatic() ? 0 : beta / step.dampingDt();
    std::vector<std::array<double, 3>> past(elements_.rods[r].slots);
    for (const LooseCell &cell : cellsOf(elements_, r)) {
      std::array<double, 3> s = presentStrain<double>(elements_, start, r, cell);
      for (int k = 0; k < 2; ++k) s[k] = dampedRest(step, s[k], (k + 1) * strainRow(elements_) + cell.slot);
      past[cell.slot - elements_.rods[r].first_slot] = s;
    }
    setLaw(
        r,
        [&](int k, int slot) {
          return (elements_.cells()[cell_rest + k][slot] + q * past[slot - elements_.rods[r].first_slot][k]) / (1 + q);
        },
        q);
  }

  double energy(const Configuration &c, int r) const override {
    double sum = 0;
    withKind(r, [&]<Measure measure, int n>() { sum = total<measure, n>(c, r); });
    return sum;
  }

  void addDerivatives(const Configuration &c, int r, Derivatives &out, HessianKind hessian) const override {
    withKind(r, [&]<Measure measure, int n>() {
      if (hessian == HessianKind::gauss_newton)
        assemble<measure, n, false>(c, r, true, out);
      else
        assemble<measure, n, true>(c, r, hessian != HessianKind::none, out);
    });
  }

private:
  enum Plane : int { stiffness, rest, first, second }; ///< the last two: the normal of the plane along mean directors
  const Scene &scene_;
  const Elements &elements_;
  Planes law_;

  /// Directors stand still against the normal of the plane.
  void align(const C &drawn, const RodRange &rod, const LooseCell &cell) {
    const CellGeometry<double> g = cellGeometry(drawn.frameAt(cell.frame0), drawn.frameAt(cell.frame1),
                                                cellOf<double>(elements_.cells(), drawn, cell.slot));
    law_[first][cell.slot] = g.d1[rod.flat];
    law_[second][cell.slot] = g.d2[rod.flat];
  }

  /// 1/2 sum k_a (n_a y - r_a)^2 over the two directors, but for a constant, with n_a the normal along each: 1/2 k
  /// (y - r)^2, k = sum k_a n_a^2, r = sum k_a n_a r_a/k, docs/theory.md (5.1).
  template <class Rest> void setLaw(int r, const Rest &rest_of, double q) {
    for (const LooseCell &cell : cellsOf(elements_, r)) {
      const int s = cell.slot;
      const double k[] = {elements_.cells()[cell_stiffness][s], elements_.cells()[cell_stiffness + 1][s]};
      double sum = 0, moment = 0;
      for (int a = 0; a < 2; ++a) {
        const double normal = law_[Plane(first + a)][s];
        sum += k[a] * normal * normal;
        moment += k[a] * normal * rest_of(a, s);
      }
      if (elements_.rods[r].flat < 0) sum = k[0], moment = 0;
      law_[stiffness][s] = sum * (1 + q);
      law_[rest][s] = sum > 0 ? moment / sum : 0;
    }
  }

  template <class Visit> void withKind(int r, const Visit &visit) const {
    const RodRange &rod = elements_.rods[r];
    if (!rod.isReduced()) return;
    if (elements_.measure[r] == Measure::tan)
      rod.flat >= 0 ? visit.template operator()<Measure::tan, 2>() : visit.template operator()<Measure::tan, 3>();
    else
      rod.flat >= 0 ? visit.template operator()<Measure::angle, 2>() : visit.template operator()<Measure::angle, 3>();
  }

  template <int n> std::array<int, n> axes(int r) const {
    if constexpr (n == 2)
      return coordinatesOf(elements_.rods[r]);
    else
      return {0, 1, 2};
  }

  template <class T> BendOf<T> lawOf(int slot) const {
    const Planes &cells = elements_.cells();
    return {read<T>(law_[stiffness] + slot),
            read<T>(law_[rest] + slot),
            read<T>(cells[cell_base] + slot),
            {read<T>(cells[cell_weight] + slot), read<T>(cells[cell_weight + 1] + slot)},
            {read<T>(cells[cell_free] + slot), read<T>(cells[cell_free + 1] + slot)}};
  }

  template <Measure measure, int n> [[gnu::flatten, gnu::noinline]] double total(const C &c, int r) const {
    double energy = 0;
    Pack energies(0.0);
    const std::array<int, n> axis = axes<n>(r);
    forCells(elements_, r, [&]<class T>(const LooseCell &cell, int count) {
      const T e = bendEnergy<measure>(edgesOf<T, n>(c, cell, count, axis), lawOf<T>(cell.slot));
      if constexpr (std::is_same_v<T, Pack>)
        energies += e;
      else
        energy += e;
    });
    return energy + reduce(energies);
  }

  template <Measure measure, int n, bool exact>
  [[gnu::flatten, gnu::noinline]] void assemble(const C &c, int r, bool hessian, Derivatives &out) const {
    const std::array<int, n> axis = axes<n>(r);
    const BlockPlanes blocks(out.blocks, elements_.rods[r]);
    std::array<double *, n> gradient;
    for (int k = 0; k < n; ++k) gradient[k] = out.equilibrium[axis[k]];
    auto own = [&](int a, int b) { return blocks.own(std::min(axis[a], axis[b]), std::max(axis[a], axis[b])); };
    forCells(elements_, r, [&]<class T>(const LooseCell &cell, int count) {
      const BendDerivatives<T, n> d =
          bendDerivatives<measure, exact>(edgesOf<T, n>(c, cell, count, axis), lawOf<T>(cell.slot));
      const int s = cell.vertex - 1;
      // What belongs to the first vertex or edge before what belongs to the second: see cellDerivatives.
      for (int a = 0; a < n; ++a) addTo(gradient[a] + s, T(-d.first[a]));
      for (int a = 0; a < n && hessian; ++a)
        for (int b = 0; b < n; ++b) {
          if (a <= b) addTo(own(a, b) + s, d.own0(a, b));
          addTo(blocks.across(axis[a], axis[b]) + s + 1, d.mixed(a, b));
        }
      for (int a = 0; a < n; ++a) addTo(gradient[a] + s + 1, T(d.first[a] - d.second[a]));
      for (int a = 0; a < n && hessian; ++a)
        for (int b = a; b < n; ++b) addTo(own(a, b) + s + 1, d.own1(a, b));
      for (int a = 0; a < n; ++a) addTo(gradient[a] + s + 2, d.second[a]);
    });
  }
};

} // namespace

std::unique_ptr<Term> makeBend(const Scene &scene, const Elements &elements) {
  return std::make_unique<Bend>(scene, elements);
}

} // namespace tendril
