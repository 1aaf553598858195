#include "tendril/dynamics/prolong.hpp"

#include "tendril/model/remesh.hpp"

#include <algorithm>

namespace tendril {
namespace {

/// Twist per length on either half of each edge of a rod, from the cells at its ends [rad/m].
struct TwistRates {
  std::vector<double> before, after;
};

TwistRates twistRates(const Elements &elements, const Configuration &c, int r) {
  const RodRange &rod = elements.rods[r];
  const double none = std::nan("");
  TwistRates rates{std::vector<double>(rod.edges, none), std::vector<double>(rod.edges, none)};
  for (const LooseCell &cell : cellsOf(elements, r)) {
    const double rate = c[Configuration::twist][cell.slot] / elements.cellLength()[cell.slot];
    if (const int e = edgeAt(rod, cell.frame0); e >= 0) rates.after[e] = rate;
    if (const int e = edgeAt(rod, cell.frame1); e >= 0) rates.before[e] = rate;
  }
  for (int e = 0; e < rod.edges; ++e) { // free ends have no cell
    if (std::isnan(rates.before[e])) rates.before[e] = std::isnan(rates.after[e]) ? 0 : rates.after[e];
    if (std::isnan(rates.after[e])) rates.after[e] = rates.before[e];
  }
  return rates;
}

/// Whole turns of the fine cells: those that bring the twist of their frames closest to the coarse one.
void setTurns(const std::vector<TwistRates> &rates, const Scene &fine, const Elements &elements, State &state) {
  const Configuration c = configurationOf(state, fine, elements, state.time);
  for (int r = 0; r < int(fine.rods.size()); ++r) {
    if (fine.rods[r].measure != Measure::angle) continue;
    const auto &[before, after] = rates[r];
    auto middle = [&](int edge) { return 0.5 * (before[edge] + after[edge]); };
    const std::vector<LooseCell> cells = cellsOf(elements, r);
    for (std::size_t n = 0; n < cells.size(); ++n) {
      const LooseCell &cell = cells[n];
      const int slot = cell.slot;
      const int j = edgeAt(elements.rods[r], cell.frame0), k = edgeAt(elements.rods[r], cell.frame1);
      const double rate = j >= 0       ? (j % 2 == 0 ? middle(j / 2) : after[j / 2])
                          : k % 2 == 0 ? before[k / 2]
                                       : middle(k / 2);
      state.winding[elements.rod_cells[r] + n] =
          2 * pi * std::round((rate * elements.cellLength()[slot] - c[Configuration::twist][slot]) / (2 * pi));
    }
  }
}

} // namespace

State prolonged(const State &state, const Scene &scene, const Elements &elements, const Scene &fine,
                const Elements &fine_elements) {
  State out;
  out.time = state.time;
  out.step = state.step;
  out.junction_axes = state.junction_axes;
  const Configuration c = configurationOf(state, scene, elements, state.time);
  std::vector<TwistRates> rates;
  for (int r = 0; r < int(scene.rods.size()); ++r) {
    const RodRange &range = elements.rods[r];
    rates.push_back(range.twist
                        ? twistRates(elements, c, r)
                        : TwistRates{std::vector<double>(range.edges, 0.0), std::vector<double>(range.edges, 0.0)});
    Rod present = scene.rods[r];
    std::copy_n(state.position.begin() + range.first_vertex, range.vertices, present.position.begin());
    const Curve curve = curveThrough(present);
    present.position.clear();
    // Edges are cut where they are at rest, graded ones off their middle.
    const Rod &halves = fine.rods[r];
    auto firstPart = [&](int i) {
      const double a = halves.edge(2 * i).norm(), b = halves.edge(2 * i + 1).norm();
      return a / (a + b);
    };
    for (int i = 0; i < halves.vertices(); ++i)
      present.position.push_back(curve((i / 2 + (i % 2 == 0 ? 0 : firstPart(i / 2))) / range.edges));
    out.position.insert(out.position.end(), present.position.begin(), present.position.end());
    for (int i = 0; i < range.edges; ++i) {
      const Frame f = c.frameAt(range.slot(i));
      const double half = 0.5 * elements.restLength()[range.slot(i)],
                   first = firstPart(i); // middles move by half the other part
      for (const auto &[child, turn] : {std::pair(2 * i, (first - 1) * half * rates[r].before[i]),
                                        std::pair(2 * i + 1, first * half * rates[r].after[i])}) {
        const Vec3 t = present.edge(child).normalized();
        out.director.push_back(
            orthonormalised(rotateAbout<double>(transport<double>(f.director, f.tangent, t), t, turn), t));
        out.axial_force.push_back(state.axial_force[range.first_edge + i]);
      }
    }
  }
  for (int b = 0; b < int(scene.bodies.size()); ++b) { // halves of edges weigh less at the bodies' vertices
    const Mat3 turned = rotationOf(state, elements.body(b).group);
    out.body_position.push_back(state.body_position[b] +
                                turned * (fine_elements.bodyMass(b).centre - elements.bodyMass(b).centre));
    out.body_position_low.push_back(state.body_position_low[b]);
    out.body_rate.push_back({});
  }
  out.joints = state.joints;
  out.tendon_memory = state.tendon_memory;
  out.position_low.assign(out.position.size(), Vec3::Zero());
  out.velocity.assign(out.position.size(), Vec3::Zero());
  out.twist_rate.assign(out.director.size(), 0.0);
  out.winding.assign(fine_elements.cell_slot.size(), 0.0);
  setTurns(rates, fine, fine_elements, out);
  return out;
}

} // namespace tendril
