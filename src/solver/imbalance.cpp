#include "tendril/solver/imbalance.hpp"

#include "tendril/energy/joint.hpp"
#include "tendril/solver/newton.hpp"

#include <cmath>
#include <iomanip>
#include <sstream>

namespace tendril {
namespace {

using Residual = Residual;

/// Where `value(k)` is largest; the first that is not finite counts as that.
template <class Value> int largestOf(int count, Value value) {
  int worst = 0;
  double most = -1;
  for (int k = 0; k < count; ++k) {
    const double here = value(k);
    if (!std::isfinite(here)) return k;
    if (here > most) most = here, worst = k;
  }
  return worst;
}

/// Rounding is not asked for here.
Residual residualOf(IncrementalPotential &potential, int rod) { return potential.residual(rod, {}); }

} // namespace

std::string labelOf(const Rod &rod) {
  return "rod '" + rod.name + "' (" + std::to_string(rod.edges()) + (rod.edges() == 1 ? " edge)" : " edges)");
}

std::string imbalanceOf(IncrementalPotential &potential, int r, const Asked &asked) {
  const RodRange &rod = potential.elements().rods[r];
  const Residual residual = residualOf(potential, r);
  const Planes &force = potential.gradient(r).equilibrium;
  const double *freedom = potential.elements().freedom(), scale = potential.forceScale(r);
  std::ostringstream text;
  text << std::setprecision(4);
  auto say = [&](const std::string &what, double value, const std::string &of, double tolerance,
                 const std::string &option, const char *place, int where) {
    if (value <= tolerance) return;
    text << (text.str().empty() ? "" : ", ") << what;
    if (std::isfinite(value)) {
      text << " by " << value << of << " (asked: " << tolerance << ", " << option;
      if (asked.sharper != 1) text << " x " << asked.sharper;
      text << "), most";
    } else
      text << ", not finite";
    text << " at " << place << " " << where;
  };
  std::ostringstream load, moment;
  load << std::setprecision(4) << " of " << (potential.hasLoad(r) ? "its load of " : "") << scale << " N"
       << (potential.hasLoad(r) ? "" : ", which deforms it,");
  moment << std::setprecision(4) << " of " << scale * potential.length(r) << " N m, "
         << (potential.hasLoad(r) ? "its load" : "that") << " times its length,";
  say("forces out of balance", residual.force, load.str(), asked.rtol, "-snes_rtol", "vertex",
      largestOf(rod.vertices, [&](int i) { return freedom[rod.slot(i)] * force.vector(0, rod.slot(i)).norm(); }));
  say("moments out of balance", residual.moment, moment.str(), asked.rtol, "-snes_rtol", "edge",
      largestOf(rod.edges, [&](int i) { return std::abs(force[3][rod.slot(i)]); }));
  const Configuration &c = potential.iterate();
  say("strains of -stretch mixed off", residual.compatibility, "", compatibility_rtol * asked.rtol,
      "1e-4 of -snes_rtol", "edge", largestOf(rod.edges, [&](int i) {
        const int s = rod.slot(i);
        return std::abs(c[Configuration::strain][s] - potential.axial().rest()[s] -
                        c[Configuration::axial_force][s] / potential.axial().stiffness()[s]);
      }));
  return text.str();
}

int farthestRod(IncrementalPotential &potential, RodSet rods, const Asked &asked, const std::vector<char> *active) {
  int farthest = -1;
  double most = -1;
  for (int r = rods.begin; r < rods.end; ++r) {
    if (active && !(*active)[r]) continue;
    const Residual residual = residualOf(potential, r);
    if (!residual.isFinite()) return r;
    if (const double here = excess(residual, asked.rtol); here > most) most = here, farthest = r;
  }
  return farthest;
}

/// The body beside a rod that is farthest out of balance, where none of the rod's own is farther; and the exact joint
/// that is farthest off. Empty where it is the rod.
static std::string tellBodies(IncrementalPotential &potential, int r, const Asked &asked) {
  const Elements &elements = potential.elements();
  const Scene &scene = potential.scene();
  std::ostringstream text;
  text << std::setprecision(3);
  const Residual all = residualOf(potential, r);
  double most = 0;
  for (const JoinedBody &b : elements.bodies({r, r + 1})) {
    Residual own;
    includeBody(elements, b, potential.step(), potential.start(), potential.iterate(),
                potential.gradient(r).equilibrium, potential.forceScale(r), bodyLoad(scene, elements, b.body), &own);
    const double here = std::max(own.force, own.moment);
    if (here <= most || here < 0.999 * std::max(all.force, all.moment) || here <= asked.rtol) continue;
    most = here;
    text.str("");
    text << "; body '" << scene.bodies[b.body].name << "': forces and moments out of balance by " << here
         << " of its load, or of what deforms its rod (asked: " << asked.rtol << ", -snes_rtol)";
  }
  double apart = 0;
  const Joint *off = nullptr;
  for (const BodyPair &p : elements.pairs({r, r + 1})) {
    if (p.joint < 0 || !scene.joints[p.joint].isExact()) continue;
    const JointPlace place = placeOf(scene.joints[p.joint], p, elements, potential.iterate());
    const Rows values = jointValues(scene.joints[p.joint], place);
    const double here = values.head<coordinate_row>().cwiseAbs().maxCoeff();
    if (here > apart) apart = here, off = &scene.joints[p.joint];
  }
  if (off && apart > 1e-6 * elements.bodySize(off->child))
    text << "; joint '" << off->name << "' is off by " << apart << " m or rad";
  return text.str();
}

std::string tellImbalance(IncrementalPotential &potential, int rod, const Asked &asked) {
  if (rod >= 0)
    if (const std::string of_bodies = tellBodies(potential, rod, asked); !of_bodies.empty()) return of_bodies;
  const std::string what = rod < 0 ? "" : imbalanceOf(potential, rod, asked);
  return what.empty() ? "" : "; " + labelOf(potential.scene().rods[rod]) + ": " + what;
}

} // namespace tendril
