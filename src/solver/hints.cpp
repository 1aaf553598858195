#include "tendril/solver/hints.hpp"

#include "tendril/energy/tendon.hpp"

#include "tendril/contact/contact.hpp"
#include "tendril/contact/touching_bodies.hpp"
#include "tendril/energy/constraint.hpp"
#include "tendril/solver/imbalance.hpp"

#include <iomanip>
#include <sstream>

namespace tendril {

std::string nearBarrier(const IncrementalPotential &potential, RodSet rods) {
  const Elements &e = potential.elements();
  const Configuration &c = potential.iterate();
  struct Worst {
    double angle = 0;
    int rod = 0;
    void include(double other, int r) {
      if (other > angle) angle = other, rod = r;
    }
  } twist, turning;
  for (int r = rods.begin; r < rods.end; ++r)
    forCells(e, r, [&]<class T>(const LooseCell &cell, int count) {
      for (int l = 0; l < count; ++l) {
        if (e.measure[r] == Measure::tan) twist.include(std::abs(c[Configuration::twist][cell.slot + l]), r);
        turning.include(std::acos(std::clamp(c.frameAt(cell.frame0 + l).tangent.dot(c.frameAt(cell.frame1 + l).tangent),
                                             -1.0, 1.0)),
                        r);
      }
    });
  constexpr double near = 150, degrees = 180 / pi;
  std::string hint;
  auto told = [&](const Worst &worst) {
    return "; neighbouring edges of " + labelOf(potential.scene().rods[worst.rod]) + " are ";
  };
  if (twist.angle * degrees > near)
    hint += told(twist) + "twisted by " + std::to_string(int(twist.angle * degrees)) +
            " degrees, and measure tan has a barrier at 180: use more edges, or measure: angle";
  if (turning.angle * degrees > near)
    hint += told(turning) + "folded by " + std::to_string(int(turning.angle * degrees)) +
            " degrees of at most 180: use more edges";
  for (int r = rods.begin; r < rods.end; ++r)
    for (const int k : e.constraintsOf(r)) {
      const Constraint &constraint = potential.scene().constraints[k];
      if (constraint.isPin() || constraint.measure == Constraint::Measure::sine) continue;
      const double angle = deviation(e, constraint, e.constraint_slot[k], c).norm() * degrees;
      if (angle > near)
        hint += "; constraint '" + constraint.name + "' is turned by " + std::to_string(int(angle)) +
                " degrees of at most 180 from its edge: make it stiffer, or take measure: sine";
    }
  return hint;
}

std::string nearObstacle(const IncrementalPotential &potential, RodSet rods) {
  const Scene &scene = potential.scene();
  std::ostringstream hint;
  for (const Touch &t : tightest(scene, potential.elements(), potential.iterate())) {
    const ContactSettings &contact = scene.rods[t.rod].contact;
    if (t.rod < rods.begin || t.rod >= rods.end || !(t.gap < (contact.isBarrier() ? -0.25 * contact.distance : 0)))
      continue;
    hint << std::setprecision(3) << "; rod '" << scene.rods[t.rod].name << "' is pressed against collider '"
         << scene.colliders[t.collider].name << "' at arc length " << t.arc << " m, the gap is " << t.gap << " m: ";
    if (contact.isBarrier())
      hint << "is it held between obstacles, or driven into one? Shorter steps help against impacts";
    else
      hint << "the stiffness of its penalty, " << contact.stiffness << " N/m^2, is too small for what presses it there";
    break;
  }
  return hint.str();
}

std::string nearRod(const IncrementalPotential &potential, RodSet rods) {
  const Scene &scene = potential.scene();
  std::ostringstream hint;
  if (!potential.touches()) return {};
  double within = HUGE_VAL; // a quarter of the barrier
  for (int r = rods.begin; r < rods.end; ++r)
    if (const ContactSettings &c = scene.rods[r].contact; c.touchesRods() && c.isBarrier())
      within = std::min(within, 0.25 * c.distance);
  for (const Meeting &m :
       overlapsOfRods(scene, potential.elements(), potential.iterate(), std::isfinite(within) ? within : 0)) {
    if (m.rod < rods.begin || m.rod >= rods.end) continue;
    hint << std::setprecision(3) << "; rod '" << scene.rods[m.rod].name << "' at arc length " << m.arc
         << " m is pressed against " << (m.rod == m.to_rod ? "itself" : "rod '" + scene.rods[m.to_rod].name + "'")
         << " at " << m.to_arc << " m, the gap is " << m.gap << " m: shorter steps help against impacts";
    break;
  }
  for (const BodyMeeting &m : tightestAmongBodies(scene, potential.elements(), potential.iterate())) {
    const int rod = m.rod < 0 ? scene.bodies[m.other].rod : m.rod;
    if (rod < rods.begin || rod >= rods.end || !(m.gap < m.wall + 0.25 * m.width)) continue;
    hint << std::setprecision(3) << "; "
         << (m.rod < 0 ? "body '" + scene.bodies[m.other].name : "rod '" + scene.rods[m.rod].name)
         << "' is pressed against body '" << scene.bodies[m.body].name << "', the gap is " << m.gap
         << " m: shorter steps help against impacts";
    break;
  }
  return hint.str();
}

std::string tightTendon(const IncrementalPotential &potential, RodSet rods) {
  constexpr double near = 0.01;
  const Scene &scene = potential.scene();
  for (int k = 0; k < int(scene.tendons.size()); ++k) {
    const Tendon &t = scene.tendons[k];
    if (t.rod < rods.begin || t.rod >= rods.end) continue;
    if (const double gap = TendonPath(scene, potential.elements(), k).clearance(potential.iterate()); gap < near)
      return "; a point of tendon '" + t.name + "' comes to the surface that it winds round, which it cannot pass";
  }
  return {};
}

std::string fastBody(const IncrementalPotential &potential, RodSet rods) {
  std::ostringstream hint;
  for (const JoinedBody &b : potential.elements().bodies(rods)) {
    const double turned = potential.iterate().positionAt(b.rotation).norm();
    if (!(turned > 1)) continue;
    hint << std::setprecision(3) << "; body '" << potential.scene().bodies[b.body].name << "' is turned by " << turned
         << " rad in it, too far for one step: take shorter ones";
    break;
  }
  return hint.str();
}

/// Words on the rod of the energy `seed` that bends most sharply, more than `sharpest`, with its edges shorter than
/// `longest`: without axial force its stretch r obeys r^2 = 1 - 2 B kappa^2/EA, with kappa the turning per reference
/// length, and the moment B r^2 kappa is largest where B kappa^2 = EA/6, the unit of the sharpness, and r^2 = 2/3.
/// Empty where none does.
static std::string sharpestBend(const IncrementalPotential &potential, RodSet rods, const Configuration &c,
                                double sharpest, double longest) {
  const Elements &e = potential.elements();
  constexpr double near = 0.88; // of the limit; where it is passed the moment falls again
  std::ostringstream hint;
  for (int r = rods.begin; r < rods.end; ++r) {
    const Rod &rod = potential.scene().rods[r];
    if (rod.energy != Energy::seed) continue;
    forCells(e, r, [&]<class T>(const LooseCell &cells, int count) {
      for (int l = 0; l < count; ++l) {
        const LooseCell cell{cells.slot + l, cells.frame0 + l, cells.frame1 + l, cells.vertex + l};
        const CellOf<double> k = cellOf<double>(e.cells(), c, cell.slot);
        const double stretch = cellGeometry(c.frameAt(cell.frame0), c.frameAt(cell.frame1), k).stretch;
        const std::array<double, 3> s = presentStrain<double>(e, c, r, cell);
        const Eigen::Vector2d strain(s[0] - k.rest[0], s[1] - k.rest[1]),
            force(k.stiffness[0] * strain[0], k.stiffness[1] * strain[1]);
        const double bending =
            force.squaredNorm() / force.dot(strain) * e.cellLength()[cell.slot]; // B about the axis of bending
        const double sharpness = 6 * force.squaredNorm() / (bending * stretch * stretch * rod.material.axial_stiffness);
        if (!(sharpness > sharpest && stretch < longest)) continue;
        sharpest = sharpness;
        const double moment = stretch * force.norm(),
                     limit = 2.0 / 3 * std::sqrt(rod.material.axial_stiffness * bending / 6);
        hint.str("");
        hint << std::setprecision(4) << "; rod '" << rod.name
             << (moment > near * limit ? "' bends under a moment of "
                                       : "' has given way to bending, its moment is down to ")
             << moment
             << " N m, and its 'energy: seed', which couples bending with stretch, bears at most (2/3) sqrt(EA EI/6) = "
             << limit << " N m without tension; 'energy: classical' has no limit";
      }
    });
  }
  return hint.str();
}

std::string limitOfLaw(const IncrementalPotential &potential, RodSet rods, const Configuration &c, double sharpest,
                       double longest, double shortest) {
  std::string bent = sharpestBend(potential, rods, c, sharpest, longest);
  if (!bent.empty()) return bent;
  const Elements &e = potential.elements();
  std::ostringstream words;
  for (int r = rods.begin; r < rods.end; ++r) {
    const Rod &rod = potential.scene().rods[r];
    double stretch = shortest;
    for (int s = e.rods[r].first_slot; s < e.rods[r].edgeEnd(); ++s)
      stretch = std::min(stretch, c[Configuration::length][s] * e.inverseRestLength()[s]);
    if (rod.energy != Energy::seed || stretch == shortest) continue;
    words << std::setprecision(4) << "; an edge of rod '" << rod.name << "' is down to " << stretch
          << " of its length, and its 'energy: seed' bears at most 0.192 EA = "
          << rod.material.axial_stiffness / (3 * std::sqrt(3.0))
          << " N of compression; 'energy: classical' has no limit";
    break;
  }
  return words.str();
}

} // namespace tendril
