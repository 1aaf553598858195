#include "tendril/solver/coarse.hpp"

#include "tendril/model/remesh.hpp"
#include "tendril/solver/activity.hpp"
#include "tendril/solver/step_solver.hpp"

#include <algorithm>

namespace tendril {
namespace {

using C = Configuration;

constexpr int stride = 4;
constexpr double most_turning = 0.25; // of a coarse edge against the next [rad]

/// Vertices of a rod that a coarser one keeps, in order; behind those of a closed rod the number of all.
std::vector<int> keptVertices(const IncrementalPotential &fine, int r) {
  const Scene &scene = fine.scene();
  const Rod &rod = scene.rods[r];
  const RodRange &range = fine.elements().rods[r];
  std::vector<char> stays(rod.edges() + 1, false);
  stays.front() = stays.back() = true;
  for (const Support &s : scene.supports)
    if (s.rod == r) stays[s.vertex] = true;
  for (const Constraint &c : scene.constraints)
    if (c.rod == r && c.isPin()) stays[c.at] = true;
  for (const NodalForce &f : scene.forces)
    if (f.rod == r) stays[f.vertex] = true;
  for (const FollowerForce &f : scene.followers)
    if (f.rod == r) stays[f.vertex] = true;
  auto between = [](const Frame &a, const Frame &b) {
    return std::acos(std::clamp(a.tangent.dot(b.tangent), -1.0, 1.0)) + std::abs(halfAngleBetween(a, b).angle());
  };
  const bool coarsens = rod.edges() > fine_edges;
  std::vector<int> kept{0};
  double turning = 0;
  Frame before = referenceFrame(rod, 0);
  for (int v = 1; v <= rod.edges(); ++v) {
    if (v == rod.edges()) {
      kept.push_back(v);
      break;
    }
    const Frame drawn = referenceFrame(rod, v);
    const double here = std::max(between(before, drawn),
                                 between(fine.start().frameAt(range.slot(v - 1)), fine.start().frameAt(range.slot(v))));
    before = drawn;
    turning += here;
    if (coarsens && !stays[v] && v - kept.back() < stride && turning <= most_turning && !isCorner(rod, v)) continue;
    kept.push_back(v);
    turning = 0;
  }
  return kept;
}

/// Director of a coarse edge: that in the middle of the fine edges it stands for.
Vec3 directorOn(const Frame &f, const Vec3 &tangent) {
  return orthonormalised(transport<double>(f.director, f.tangent, tangent), tangent);
}

struct Coarse {
  RodSet rods;
  std::vector<std::vector<int>> kept; ///< per rod
  Scene scene;
  bool worth = false; ///< whether there are clearly fewer edges, and whole turns need not be counted

  Coarse(const IncrementalPotential &fine, RodSet set) : rods(set) {
    const Scene &from = fine.scene();
    const Configuration &start = fine.start();
    int before = 0, after = 0;
    bool turns = false;
    scene.gravity = from.gravity;
    scene.rotation = from.rotation;
    for (int r = rods.begin; r < rods.end; ++r) {
      for (const LooseCell &cell : cellsOf(fine.elements(), r))
        turns = turns || std::abs(start[C::twist][cell.slot]) > 1;
      const std::vector<int> &keep = kept.emplace_back(keptVertices(fine, r));
      const Rod &rod = from.rods[r];
      Rod &coarse = scene.rods.emplace_back(rod);
      before += rod.edges();
      after += int(keep.size()) - 1;
      coarse.measure = Measure::angle; // without barriers
      coarse.position.clear();
      coarse.director.clear();
      for (std::size_t k = 0; k + (rod.closed ? 1 : 0) < keep.size(); ++k)
        coarse.position.push_back(rod.position[keep[k]]);
      for (int e = 0; e < coarse.edges(); ++e)
        coarse.director.push_back(directorOn(referenceFrame(rod, middle(r, e)), coarse.edge(e).normalized()));
    }
    worth = !turns && 2 * after < before;
    auto at = [&](int r, int vertex) { // the last kept vertex up to this one, which begins the edge there
      const std::vector<int> &keep = kept[r - rods.begin];
      return int(std::upper_bound(keep.begin(), keep.end(), vertex) - keep.begin()) - 1;
    };
    auto isHere = [&](int r) { return r >= rods.begin && r < rods.end; };
    for (Support s : from.supports)
      if (isHere(s.rod)) {
        s.vertex = at(s.rod, s.vertex);
        s.rod -= rods.begin;
        scene.supports.push_back(s);
      }
    for (Constraint c : from.constraints)
      if (isHere(c.rod)) {
        c.at = at(c.rod, c.at);
        c.rod -= rods.begin;
        scene.constraints.push_back(c);
      }
    for (const NodalForce &f : from.forces)
      if (isHere(f.rod)) scene.forces.push_back({f.rod - rods.begin, at(f.rod, f.vertex), f.force, f.mass});
    for (const FollowerForce &f : from.followers)
      if (isHere(f.rod)) scene.followers.push_back({f.rod - rods.begin, at(f.rod, f.vertex), f.force});
    for (const EdgeMoment &m : from.moments)
      if (isHere(m.rod)) scene.moments.push_back({m.rod - rods.begin, at(m.rod, m.edge), m.torque, m.moment});
  }

  /// Fine edge in the middle of a coarse one.
  int middle(int r, int edge) const {
    const std::vector<int> &keep = kept[r - rods.begin];
    return (keep[edge] + keep[edge + 1] - 1) / 2;
  }

  State stateOf(const IncrementalPotential &fine, const State &start, const Elements &elements) const {
    State state;
    state.time = start.time;
    state.step = start.step;
    for (int r = rods.begin; r < rods.end; ++r) {
      const RodRange &range = fine.elements().rods[r];
      const Rod &coarse = scene.rods[r - rods.begin];
      const std::vector<int> &keep = kept[r - rods.begin];
      auto at = [&](int k) { return range.first_vertex + keep[k % coarse.vertices()]; };
      for (int k = 0; k < coarse.vertices(); ++k) {
        state.position.push_back(start.position[at(k)]);
        state.position_low.push_back(start.position_low[at(k)]);
      }
      for (int e = 0; e < coarse.edges(); ++e) {
        const Vec3 tangent = (start.position[at(e + 1)] - start.position[at(e)]).normalized();
        state.director.push_back(directorOn(fine.start().frameAt(range.slot(middle(r, e))), tangent));
        double force = 0;
        for (int k = keep[e]; k < keep[e + 1]; ++k)
          force += start.axial_force[range.first_edge + k] / (keep[e + 1] - keep[e]);
        state.axial_force.push_back(force);
      }
    }
    state.velocity.assign(state.position.size(), Vec3::Zero());
    state.twist_rate.assign(state.director.size(), 0.0);
    state.winding.assign(elements.cell_slot.size(), 0.0);
    return state;
  }

  /// Vertices move as those of the curve through the coarse ones; spins and axial forces are linear between the middles
  /// of coarse edges.
  void prolong(const IncrementalPotential &fine, const IncrementalPotential &solved, Guess *guess) const {
    guess->unknowns = fine.dofs().makePlanes();
    guess->axial_force = Planes(1, fine.dofs().slots());
    const double *rest = fine.elements().restLength();
    for (int r = rods.begin; r < rods.end; ++r) {
      const RodRange &range = fine.elements().rods[r], &from = solved.elements().rods[r - rods.begin];
      const std::vector<int> &keep = kept[r - rods.begin];
      Rod shape = scene.rods[r - rods.begin];
      auto curveOf = [&](const Configuration &c) {
        for (int k = 0; k < from.vertices; ++k) shape.position[k] = c.positionAt(from.slot(k));
        return curveThrough(shape);
      };
      const Curve old = curveOf(solved.start()), now = curveOf(solved.iterate());
      std::vector<double> place(range.edges + 1, 0.0); // along the fine rod [m]
      for (int i = 0; i < range.edges; ++i) place[i + 1] = place[i] + rest[range.slot(i)];
      for (int e = 0; e < from.edges; ++e)
        for (int v = keep[e]; v < keep[e + 1]; ++v) {
          const double s = (e + (place[v] - place[keep[e]]) / (place[keep[e + 1]] - place[keep[e]])) / from.edges;
          guess->unknowns.setVector(0, range.slot(v),
                                    v == keep[e] ? solved.iterate().displacementAt(from.slot(e), solved.start())
                                                 : Vec3(now(s) - old(s)));
        }
      if (!range.closed)
        guess->unknowns.setVector(0, range.slot(range.edges),
                                  solved.iterate().displacementAt(from.slot(from.edges), solved.start()));
      std::vector<double> spin(from.edges);
      for (int e = 0; from.twist && e < from.edges; e += lanes) {
        const Pack spun = spinOver(solved.start(), solved.iterate(), from.slot(e));
        for (int l = 0; l < std::min(lanes, from.edges - e); ++l) spin[e + l] = spun[l];
      }
      const int n = from.edges;
      auto middleOf = [&](int e) { // of a coarse edge, those beyond the end of a ring too
        const int turns = e < 0 ? -1 : e >= n ? 1 : 0, k = e - turns * n;
        return turns * place.back() + 0.5 * (place[keep[k]] + place[keep[k + 1]]);
      };
      for (int i = 0, e = range.closed ? -1 : 0; i < range.edges; ++i) {
        const double s = 0.5 * (place[i] + place[i + 1]);
        while (e < (range.closed ? n - 1 : n - 2) && middleOf(e + 1) <= s) ++e;
        const int a = (e + n) % n, b = (e + 1) % n;
        const double t = n > 1 ? (s - middleOf(e)) / (middleOf(e + 1) - middleOf(e)) : 0;
        guess->unknowns[3][range.slot(i)] = (1 - t) * spin[a] + t * spin[b];
        guess->axial_force[0][range.slot(i)] = (1 - t) * solved.iterate()[C::axial_force][from.slot(a)] +
                                               t * solved.iterate()[C::axial_force][from.slot(b)];
      }
    }
  }
};

} // namespace

PetscErrorCode solveCoarse(const IncrementalPotential &fine, const State &start, RodSet rods, Guess *guess,
                           NewtonReport *report) {
  PetscFunctionBeginUser;
  *report = {};
  Coarse coarse(fine, rods);
  if (!coarse.worth) PetscFunctionReturn(0);
  const Doing here([&](std::ostream &out) {
    out << "with fewer edges, " << coarse.scene.rods[0].edges() << " of rod '" << coarse.scene.rods[0].name << "'";
  });
  DofMap dofs;
  PetscCall(dofs.setUp(coarse.scene));
  const Elements elements(coarse.scene, dofs);
  IncrementalPotential potential(coarse.scene, dofs, elements, false);
  potential.settings = fine.settings;
  StepSolver solver;
  PetscCall(solver.setUp(potential));
  solver.coarse_first = true;
  PetscCall(solver.solve(coarse.stateOf(fine, start, elements), fine.step(), report));
  if (report->converged) coarse.prolong(fine, potential, guess);
  PetscFunctionReturn(0);
}

} // namespace tendril
