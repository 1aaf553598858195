#pragma once
/// \file stencil_term.hpp
/// Terms made of stencils: each acts on a few sites, with a value and small dense derivatives of its own. What loops
/// over them and takes them into the matrix is here, once. To add a coupling, write a file with a class as Stencil
/// below and its maker, declare that in couplings.hpp, and enter it in the list of couplings.cpp.

#include "tendril/energy/term.hpp"

#include <algorithm>

namespace tendril {

/// Where a stencil acts: on a vertex (its position, 3 variables), an edge (its vector and twist, 4 variables), a vertex
/// and what a tie has it tied to (their difference, 3 variables), or an edge and the frame of a body (4 and its spin,
/// 3).
enum class SiteKind { vertex, edge, tie, edge_to_frame };
constexpr int sizeOf(SiteKind kind) {
  return kind == SiteKind::edge_to_frame ? edge_size + 3 : kind == SiteKind::edge ? edge_size : 3;
}

/// Derivatives of one stencil over the variables of its sites, one site after the other.
template <int n> struct Local {
  Eigen::Matrix<double, n, 1> gradient = Eigen::Matrix<double, n, 1>::Zero();
  Eigen::Matrix<double, n, n> hessian = Eigen::Matrix<double, n, n>::Zero();
};

/// Adds what one site has with itself to the derivatives of its rod. \param first of its variables
/// \param slot of the site \param target slot of the copy that a tie has
template <SiteKind kind, int n>
void addSite(const Local<n> &local, int first, int slot, const BlockPlanes *blocks, Derivatives &out, int target = -1) {
  for (int a = 0; a < 3; ++a) {
    const double g = local.gradient[first + a];
    if constexpr (kind == SiteKind::edge) out.equilibrium[a][slot + 1] += g;
    if constexpr (kind == SiteKind::tie) out.equilibrium[a][target] -= g;
    out.equilibrium[a][slot] += kind == SiteKind::edge ? -g : g;
  }
  if constexpr (kind == SiteKind::edge) out.equilibrium[3][slot] += local.gradient[first + 3];
  if (!blocks) return;
  const int at = kind == SiteKind::tie ? target : slot;
  for (int a = 0; a < sizeOf(kind); ++a)
    for (int b = a; b < sizeOf(kind); ++b)
      (kind == SiteKind::edge ? blocks->own(a, b) : blocks->vertex(a, b))[at] += local.hessian(first + a, first + b);
}

/// The same of an edge with a frame of a body. \param frame, cell slots of the frame, and of what both have between
/// them
inline void addEdgeToFrame(const Local<edge_size + 3> &local, int slot, int frame, int cell, const BlockPlanes *blocks,
                           Derivatives &out) {
  Local<edge_size> edge;
  edge.gradient = local.gradient.head<4>();
  edge.hessian = local.hessian.topLeftCorner<4, 4>();
  addSite<SiteKind::edge>(edge, 0, slot, blocks, out);
  for (int a = 0; a < 3; ++a) out.equilibrium[a][frame] += local.gradient[edge_size + a];
  for (int a = 0; a < 3 && blocks; ++a) {
    for (int b = a; b < 3; ++b) blocks->vertex(a, b)[frame] += local.hessian(edge_size + a, edge_size + b);
    for (int c = 0; c < edge_size; ++c) blocks->across(a, c)[cell] += local.hessian(edge_size + a, c);
  }
}

/// A term made of stencils that act on one site each: they stand in the blocks of their rod, which stays on its own
/// but for ties. A Stencil has
///   static constexpr SiteKind site;  int rod, slot;
///   void begin(const Configuration &start, const Step &step);   before the iterations of a step
///   void moveIterate(const Configuration &iterate);             whenever it has moved
///   double value(const Configuration &c) const;                 [J], +inf where it must not be
///   void derivatives(const Configuration &c, HessianKind kind, Local<sizeOf(site)> &out) const;
///   double stored(const Configuration &c) const;                what of the value a state keeps [J]
///   double noise(const Configuration &c, double blur) const;    see Term
///   int target;  std::array<Vec3, 2> action(const Configuration &c) const;   see Term::actionFrom
/// and the class names the energy that it adds to.
template <class Stencil, double EnergyBudget::*energy_name> class StencilTerm final : public Term {
public:
  /// \param stencils those of a rod in the order of their targets
  StencilTerm(std::vector<Stencil> stencils, const Elements &elements)
      : elements_(elements), of_(elements.rods.size()) {
    for (Stencil &s : stencils) of_[s.rod].push_back(std::move(s));
  }

  void beginStep(const State &, const Configuration &start, const Step &step, int rod) override {
    for (Stencil &s : of_[rod]) s.begin(start, step);
  }
  void moveIterate(const Configuration &iterate, int rod) override {
    for (Stencil &s : of_[rod]) s.moveIterate(iterate);
  }
  bool couplesPositions() const override { return Stencil::site == SiteKind::vertex; }
  double energy(const Configuration &c, int rod) const override {
    double sum = 0;
    for (const Stencil &s : of_[rod]) sum += s.value(c);
    return sum;
  }
  double noise(const Configuration &c, int rod, double blur) const override {
    double sum = 0;
    for (const Stencil &s : of_[rod]) sum += s.noise(c, blur);
    return sum;
  }
  void addEnergies(const State &, const Configuration &c, double, int rod, EnergyBudget &out) const override {
    for (const Stencil &s : of_[rod]) out.*energy_name += s.stored(c);
  }
  void addDerivatives(const Configuration &c, int rod, Derivatives &out, HessianKind kind) const override {
    if (of_[rod].empty()) return;
    const BlockPlanes blocks(out.blocks, elements_.rods[rod]);
    for (const Stencil &s : of_[rod]) {
      Local<sizeOf(Stencil::site)> local;
      s.derivatives(c, kind, local);
      const BlockPlanes *const to = kind == HessianKind::none ? nullptr : &blocks;
      if constexpr (Stencil::site == SiteKind::edge_to_frame)
        addEdgeToFrame(local, s.slot, s.target, s.cell, to, out);
      else
        addSite<Stencil::site>(local, 0, s.slot, to, out, s.target);
    }
  }
  std::array<Vec3, 2> actionFrom(int slot, const Configuration &c, int rod) const override {
    const auto found = std::lower_bound(of_[rod].begin(), of_[rod].end(), slot,
                                        [](const Stencil &s, int wanted) { return s.target < wanted; });
    if (found != of_[rod].end() && found->target == slot) return found->action(c);
    return {Vec3::Zero(), Vec3::Zero()};
  }

private:
  const Elements &elements_;
  std::vector<std::vector<Stencil>> of_; ///< per rod
};

} // namespace tendril
