#include "tendril/energy/term.hpp"

#include <algorithm>

namespace tendril {

std::vector<std::unique_ptr<Term>> makeTerms(const Scene &scene, const Elements &elements, const AxialLaw &axial,
                                             bool dynamic) {
  std::vector<std::unique_ptr<Term>> terms;
  const bool heavy = !scene.gravity.isZero(0) &&
                     std::any_of(scene.rods.begin(), scene.rods.end(), [](const Rod &r) { return r.gravity; });
  terms.push_back(makeStretch(elements, axial));
  if (!elements.cell_slot.empty()) terms.push_back(makeBendTwist(scene, elements));
  if (heavy || !scene.rotation.angular_velocity.isZero(0) || !scene.forces.empty() || !scene.moments.empty())
    terms.push_back(makeLoad(scene, elements));
  if (dynamic) terms.push_back(makeInertia(scene, elements));
  return terms;
}

Vec3 momentOn(const Elements &elements, const Planes &cells, const Configuration &c, int rod, int frame) {
  Vec3 sum = Vec3::Zero();
  for (const LooseCell &cell : heldCells(elements, rod, frame)) {
    const Frame f0 = c.frameAt(cell.frame0), f1 = c.frameAt(cell.frame1);
    const CellOf<double> k = cellOf<double>(cells, c, cell.slot);
    const auto gradient = elements.measure[rod] == Measure::tan ? cellGradient<Measure::tan>(f0, f1, k)
                                                                : cellGradient<Measure::angle>(f0, f1, k);
    const Vec3 moment = cellMoment(f0, f1, k, gradient);
    sum += cell.frame1 == frame ? moment : Vec3(-moment);
  }
  return sum;
}

std::array<double, 3> endEnergy(const Elements &elements, const Configuration &c, const EndCouple &end,
                                double load_factor) {
  const Frame f = c.frameAt(end.edge);
  const Vec3 moment = load_factor * (end.moment + end.torque * f.tangent);
  // Bending strains are curvatures multiplied by the stretch, moments their derivatives by the curvature.
  double stretch = 1;
  if (end.cell >= 0)
    stretch = cellGeometry(c.frameAt(end.cell - 1), c.frameAt(end.cell), readCell<double>(elements.cells(), end.cell))
                  .stretch;
  const std::array<double, 3> m{moment.dot(f.director) / stretch, moment.dot(f.secondDirector()) / stretch,
                                moment.dot(f.tangent)};
  return {0.5 * end.compliance[0] * m[0] * m[0], 0.5 * end.compliance[1] * m[1] * m[1],
          0.5 * end.compliance[2] * m[2] * m[2]};
}

[[gnu::flatten]] EnergyBudget energyBudget(const Scene &scene, const Elements &elements, const State &state,
                                           const Configuration &c, double load_factor, int r) {
  EnergyBudget budget;
  const RodRange &rod = elements.rods[r];
  double kinetic = 0, gravity = 0;
  for (int i = 0; i < rod.vertices; ++i) {
    const int v = rod.first_vertex + i;
    const double mass = elements.mass()[rod.slot(i)];
    kinetic += mass * state.velocity[v].squaredNorm();
    gravity += mass * scene.gravity.dot(state.position[v]);
  }
  for (int i = 0; i < rod.edges; ++i)
    kinetic +=
        elements.twistMass()[rod.slot(i)] * state.twist_rate[rod.first_edge + i] * state.twist_rate[rod.first_edge + i];
  budget.kinetic = 0.5 * kinetic;
  budget.gravity = scene.rods[r].gravity ? -load_factor * gravity : 0;
  if (!scene.rotation.angular_velocity.isZero(0))
    for (int i = 0; i < rod.vertices; ++i) {
      const Vec3 away = state.position[rod.first_vertex + i] - scene.rotation.centre;
      budget.gravity -= 0.5 * load_factor * elements.mass()[rod.slot(i)] * away.dot(scene.rotation.matrix() * away);
    }
  Pack stretch(0.0), bend(0.0), twist(0.0);
  for (int s = rod.first_slot; s < rod.edgeEnd(); s += lanes) {
    const Pack strain = read<Pack>(c[Configuration::strain] + s);
    stretch += read<Pack>(elements.axialStiffness() + s) * strain * strain * read<Pack>(elements.restLength() + s);
  }
  forCells(elements, r, [&]<class T>(const LooseCell &cell, int count) {
    const std::array<T, 3> s = presentStrain<T>(elements, c, r, cell, count);
    std::array<T, 3> e;
    for (int k = 0; k < 3; ++k) {
      const T d = s[k] - read<T>(elements.cells()[cell_rest + k] + cell.slot);
      e[k] = read<T>(elements.cells()[cell_stiffness + k] + cell.slot) * d * d;
    }
    if constexpr (std::is_same_v<T, Pack>) {
      bend += e[0] + e[1];
      twist += e[2];
    } else {
      budget.bend += 0.5 * (e[0] + e[1]);
      budget.twist += 0.5 * e[2];
    }
  });
  budget.stretch = 0.5 * reduce(stretch);
  budget.bend += 0.5 * reduce(bend);
  budget.twist += 0.5 * reduce(twist);
  for (const EndCouple &end : elements.end_couples[r]) {
    const std::array<double, 3> e = endEnergy(elements, c, end, load_factor);
    budget.bend += e[0] + e[1];
    budget.twist += e[2];
  }
  return budget;
}

EnergyBudget &EnergyBudget::operator+=(const EnergyBudget &other) {
  kinetic += other.kinetic;
  stretch += other.stretch;
  bend += other.bend;
  twist += other.twist;
  gravity += other.gravity;
  return *this;
}

EnergyBudget energyBudget(const Scene &scene, const Elements &elements, const State &state, const Configuration &c,
                          double load_factor) {
  EnergyBudget budget;
  for (int r = 0; r < int(elements.rods.size()); ++r) budget += energyBudget(scene, elements, state, c, load_factor, r);
  return budget;
}

EnergyBudget energyBudget(const Scene &scene, const Elements &elements, const State &state, double load_factor) {
  return energyBudget(scene, elements, state, configurationOf(state, scene, elements, state.time), load_factor);
}

} // namespace tendril
