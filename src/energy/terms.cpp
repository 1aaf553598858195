#include "tendril/energy/term.hpp"

#include <algorithm>

namespace tendril {

std::vector<std::unique_ptr<Term>> makeRodTerms(const Scene &scene, const Elements &elements, const AxialLaw &axial,
                                                bool dynamic) {
  std::vector<std::unique_ptr<Term>> terms;
  const bool heavy = !scene.gravity.isZero(0) &&
                     std::any_of(scene.rods.begin(), scene.rods.end(), [](const Rod &r) { return r.gravity; });
  terms.push_back(makeStretch(elements, axial));
  if (!elements.cell_slot.empty()) terms.push_back(makeBendTwist(scene, elements));
  if (std::any_of(elements.rods.begin(), elements.rods.end(), [](const RodRange &r) { return r.isReduced(); }))
    terms.push_back(makeBend(scene, elements));
  if (heavy || !scene.rotation.angular_velocity.isZero(0) || !scene.forces.empty() || !scene.followers.empty() ||
      !scene.moments.empty())
    terms.push_back(makeLoad(scene, elements));
  if (dynamic) terms.push_back(makeInertia(scene, elements));
  if (!scene.bodies.empty()) terms.push_back(makeBodyMotion(scene, elements, dynamic));
  return terms;
}

Vec3 momentOn(const Elements &elements, const Planes &cells, const Configuration &c, int rod, int frame) {
  Vec3 sum = Vec3::Zero();
  for (const LooseCell &cell : heldCells(elements, rod, frame)) {
    const auto [f, k] = presentCell<double>(elements, cells, c, rod, cell);
    const auto gradient = elements.measure[rod] == Measure::tan ? cellGradient<Measure::tan>(f[0], f[1], k)
                                                                : cellGradient<Measure::angle>(f[0], f[1], k);
    const Vec3 moment = cellMoment(f[0], f[1], k, gradient);
    sum += cell.frame1 == frame ? moment : Vec3(-moment);
  }
  return sum;
}

std::array<double, 3> endEnergy(const Elements &elements, const Configuration &c, const EndCouple &end,
                                double load_factor) {
  const Frame f = c.frameAt(end.edge);
  const Vec3 moment = load_factor * (end.moment + end.torque * f.tangent);
  // Bending strains are curvatures multiplied by the stretch, moments their derivatives by the curvature.
  const double stretch = end.stretches ? f.length * elements.inverseRestLength()[end.edge] : 1;
  const std::array<double, 3> m{moment.dot(f.director) / stretch, moment.dot(f.secondDirector()) / stretch,
                                moment.dot(f.tangent)};
  return {0.5 * end.compliance[0] * m[0] * m[0], 0.5 * end.compliance[1] * m[1] * m[1],
          0.5 * end.compliance[2] * m[2] * m[2]};
}

EndPull endPull(const Elements &elements, const Frame &f, const EndCouple &end, double load_factor) {
  EndPull pull;
  if (!end.stretches) return pull;
  const double inverse = elements.inverseRestLength()[end.edge], stretch = f.length * inverse,
               square = stretch * stretch;
  const Vec3 moment = load_factor * end.moment;
  for (const int a : {0, 1}) {
    const Vec3 director = a == 0 ? f.director : f.secondDirector();
    const double m = moment.dot(director), bent = end.compliance[a] * m / stretch;
    pull.force += (bent + end.rest[a]) * m / square * inverse;
    pull.by_length -= (3 * bent + 2 * end.rest[a]) * m / (square * stretch) * inverse * inverse;
    pull.by_spin += (2 * bent + end.rest[a]) / square * inverse * director.cross(moment);
  }
  return pull;
}

} // namespace tendril
