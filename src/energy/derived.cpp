// GCC 12 warns of AVX-512 loads of eight numbers from Eigen's vectors of three, which are never made.
#pragma GCC diagnostic ignored "-Warray-bounds"
#include "tendril/energy/derived.hpp"

#include "tendril/energy/edge.hpp"

namespace tendril {
namespace {

/// A cell as this file sees it: the only place that knows how Elements store cells.
struct CellView {
  int frame0, frame1;
  double length; ///< Lbar [m]
  CellOf<double> constants;
};

CellView cellAt(const Elements &elements, const State &state, int n) {
  const CellArrays &cells = elements.cells;
  CellView c{cells.frame0[n], cells.frame1[n], cells.length[n], {}};
  for (int k = 0; k < 3; ++k) {
    c.constants.stiffness[k] = cells.stiffness[k][n];
    c.constants.rest[k] = cells.rest[k][n];
  }
  for (int k = 0; k < 2; ++k) {
    c.constants.weight[k] = cells.weight[k][n];
    c.constants.free[k] = cells.free[k][n];
  }
  c.constants.turns = state.turns[n];
  c.constants.sign = std::remainder(std::round(state.turns[n] / (2 * pi)), 2.0) == 0 ? 1.0 : -1.0;
  return c;
}

/// Where a cell lies: its vertex, whether it is the half cell of the edge before or behind it, and whether a rod ends there.
struct CellPlace {
  enum Kind { full, before, behind } kind;
  int vertex;
  bool at_end;
};

CellPlace placeOf(const Elements &elements, const RodRange &rod, const CellView &c) {
  const int edges = int(elements.vertex0.size());
  if (c.frame0 >= edges) return {CellPlace::behind, elements.vertex0[c.frame1], !rod.closed && c.frame1 == rod.first_edge};
  if (c.frame1 >= edges) return {CellPlace::before, elements.vertex1[c.frame0], !rod.closed && c.frame0 == rod.first_edge + rod.edges - 1};
  return {CellPlace::full, elements.vertex1[c.frame0], false};
}

std::vector<Frame> framesOf(const Scene &scene, const Elements &elements, const State &state, double motion_time) {
  std::vector<Frame> frames(elements.frames);
  for (std::size_t i = 0; i < state.director.size(); ++i) {
    const Vec3 e = state.position[elements.vertex1[i]] - state.position[elements.vertex0[i]];
    const double length = e.norm();
    frames[i] = {e / length, state.director[i], length};
  }
  for (std::size_t s = 0; s < scene.supports.size(); ++s)
    if (elements.support_frame[s] >= 0) frames[elements.support_frame[s]] = supportFrame(scene.supports[s], motion_time);
  return frames;
}

/// Calls visit(cell, its place, measure of its rod) for the cells of every rod.
template <class Visit> void eachCell(const Elements &elements, const State &state, Visit visit) {
  for (std::size_t r = 0; r < elements.rods.size(); ++r)
    for (int n = elements.rod_cells[r]; n < elements.rod_cells[r + 1]; ++n) {
      const CellView c = cellAt(elements, state, n);
      visit(c, placeOf(elements, elements.rods[r], c), elements.measure[r]);
    }
}

} // namespace

RodStrains rodStrains(const Scene &scene, const Elements &elements, const State &state, double motion_time) {
  const std::vector<Frame> frames = framesOf(scene, elements, state, motion_time);
  const std::size_t nv = state.position.size();
  RodStrains out{std::vector<Eigen::Vector2d>(nv, Eigen::Vector2d::Zero()), std::vector<double>(nv, 0.0), std::vector<double>(nv, 0.0)};
  std::vector<double> length(nv, 0.0);
  for (std::size_t i = 0; i < state.director.size(); ++i) {
    const double strain = axialStrain(frames[i].length, elements.inverse_rest_length[i]), half = 0.5 * elements.rest_length[i];
    for (const int v : {elements.vertex0[i], elements.vertex1[i]}) {
      out.strain_energy_density[v] += 0.5 * elements.axial_stiffness[i] * strain * strain * half;
      length[v] += half;
    }
  }
  eachCell(elements, state, [&](const CellView &c, const CellPlace &place, Measure measure) {
    const Frame &f0 = frames[c.frame0], &f1 = frames[c.frame1];
    const CellOf<double> &k = c.constants;
    const std::array<double, 3> s = measure == Measure::tan ? cellStrain<Measure::tan>(f0, f1, k) : cellStrain<Measure::angle>(f0, f1, k);
    for (int a = 0; a < 3; ++a) out.strain_energy_density[place.vertex] += 0.5 * k.stiffness[a] * (s[a] - k.rest[a]) * (s[a] - k.rest[a]);
    const bool bends = k.stiffness[0] != 0 || k.stiffness[1] != 0; // half cells that hold the twist only do not
    if (place.kind != CellPlace::full && !place.at_end && (place.kind == CellPlace::before || !bends)) return;
    if (bends) out.curvature[place.vertex] = Eigen::Vector2d(s[0], s[1]) / c.length;
    out.twist[place.vertex] = s[2] / c.length;
  });
  for (std::size_t v = 0; v < nv; ++v) out.strain_energy_density[v] /= length[v];
  return out;
}

RodActions rodActions(const Scene &scene, const Elements &elements, const State &state, double motion_time, double load_factor) {
  const std::vector<Frame> frames = framesOf(scene, elements, state, motion_time);
  RodActions out{std::vector<Vec3>(state.director.size()), std::vector<Vec3>(state.position.size(), Vec3::Zero())};
  for (std::size_t r = 0; r < elements.rods.size(); ++r) {
    const RodRange &rod = elements.rods[r];
    for (int i = rod.first_edge; i < rod.first_edge + rod.edges; ++i) {
      // The axial force of the state is more exact than that of the strain, but holds dissipation while the edge moves.
      const bool damped =
          scene.rods[r].material.stiffness_damping_coefficient != 0 && state.velocity[elements.vertex0[i]] != state.velocity[elements.vertex1[i]];
      const double axial = damped ? elements.axial_stiffness[i] * axialStrain(frames[i].length, elements.inverse_rest_length[i]) : state.axial_force[i];
      out.force[i] = stretchGradient(frames[i], axial, elements.inverse_rest_length[i]);
    }
  }
  // A couple acts by a pair of forces on the ends of its edge, which is not a force in the rod.
  for (const EdgeMoment &m : scene.moments) {
    const int i = elements.rods[m.rod].first_edge + m.edge;
    out.force[i] -= load_factor / frames[i].length * m.moment.cross(frames[i].tangent);
  }
  eachCell(elements, state, [&](const CellView &c, const CellPlace &place, Measure measure) {
    const Frame &f0 = frames[c.frame0], &f1 = frames[c.frame1];
    CellDerivatives<double> d;
    measure == Measure::tan ? cellDerivatives<Measure::tan>(f0, f1, c.constants, d) : cellDerivatives<Measure::angle>(f0, f1, c.constants, d);
    const Vec3 by_edge0 = -Eigen::Map<const Vec3>(&d.gradient[0]), by_edge1 = Eigen::Map<const Vec3>(&d.gradient[8]);
    if (place.kind != CellPlace::behind) out.force[c.frame0] += by_edge0;
    if (place.kind != CellPlace::before) out.force[c.frame1] += by_edge1;
    // Derivative of the energy by turning the second frame or, which is the same, the first one backwards.
    if (place.kind != CellPlace::before)
      out.moment[place.vertex] += f1.length * f1.tangent.cross(by_edge1) + d.gradient[7] * f1.tangent;
    else if (place.at_end)
      out.moment[place.vertex] -= f0.length * f0.tangent.cross(by_edge0) + d.gradient[3] * f0.tangent;
  });
  return out;
}

} // namespace tendril
