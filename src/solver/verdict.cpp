/// When an iterate is an answer. A residual below its tolerance is one. Rounding may keep the residual above: then the
/// iterate counts when what is left to the equilibrium, Newton's own correction K^-1 r, is little against what the
/// step, or its loads, move; else the step is lost in rounding. What rounding leaves of a residual is estimated too,
/// but only to notice early that it does not fall any more.
#include "tendril/solver/newton.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

namespace tendril {
namespace {

constexpr int patience = 3; ///< iterations without a fall of the residual

} // namespace

double excess(const Residual &r, double rtol) {
  return std::max({r.force, r.moment, r.compatibility / compatibility_rtol}) / rtol;
}

bool isAtNoise(const Residual &r, double rtol) {
  return r.force <= std::max(rtol, r.force_floor) && r.moment <= std::max(rtol, r.moment_floor) &&
         r.compatibility <= std::max(compatibility_rtol * rtol, r.compatibility_floor);
}

/// Root mean square of the displacements of a rod, and of the bodies beside it, over its length, and of its twists.
double NewtonSolver::sizeOf(int r, const Planes &increment) const {
  const Elements &elements = potential_->elements();
  const RodRange &rod = elements.rods[r];
  double positions = 0, twists = 0;
  int places = rod.vertices;
  for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) positions += increment.vector(0, s).squaredNorm();
  for (const JoinedBody &b : elements.bodies({r, r + 1})) {
    positions += increment.vector(0, b.position).squaredNorm() +
                 std::pow(elements.bodySize(b.body), 2) * increment.vector(0, b.rotation).squaredNorm();
    ++places;
  }
  for (int s = rod.first_slot; rod.twist && s < rod.edgeEnd(); ++s) twists += increment[3][s] * increment[3][s];
  const double length = potential_->length(r);
  return std::sqrt(positions / (length * length * places) + twists / rod.edges);
}

/// How far the mode in work_->increment turns the edge of a rod, or the body beside it, that it turns most [rad].
double NewtonSolver::turningOf(int r) const {
  const Elements &e = potential_->elements();
  double turning = 0;
  for (int s = e.rods[r].first_slot; s < e.rods[r].edgeEnd(); ++s) {
    for (int a = 0; a < 3; ++a)
      turning =
          std::max(turning, std::abs(work_->increment[a][s + 1] - work_->increment[a][s]) * e.inverseRestLength()[s]);
    turning = std::max(turning, std::abs(work_->increment[3][s]));
  }
  for (const JoinedBody &b : e.bodies({r, r + 1}))
    turning = std::max({turning, work_->increment.vector(0, b.rotation).norm(),
                        work_->increment.vector(0, b.position).norm() / e.bodySize(b.body)});
  return turning;
}

/// What the step has moved the vertices of a rod by so far, as sizeOf, less the mean of them all: a rod that flies has
/// not moved for that.
double NewtonSolver::movedBy(int r) const {
  const Elements &elements = potential_->elements();
  const RodRange &rod = elements.rods[r];
  const std::span<const JoinedBody> bodies = elements.bodies({r, r + 1});
  Planes &moved = work_->coordinates; // free until the iterate is written
  potential_->coordinates(moved, {r, r + 1});
  Vec3 mean = Vec3::Zero();
  for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) mean += moved.vector(0, s);
  for (const JoinedBody &b : bodies) mean += moved.vector(0, b.position);
  mean /= double(rod.vertices) + double(bodies.size());
  for (int s = rod.first_slot; s < rod.vertexEnd(); ++s) moved.setVector(0, s, moved.vector(0, s) - mean);
  for (const JoinedBody &b : bodies) moved.setVector(0, b.position, moved.vector(0, b.position) - mean);
  return sizeOf(r, moved);
}

/// What the loads would move every rod by, with the matrix factored last.
PetscErrorCode NewtonSolver::findLoadReach() {
  PetscFunctionBeginUser;
  const DofMap &dofs = potential_->dofs();
  Derivatives loads(dofs.slots(rods_));
  loads.setOrigin(dofs.rods()[rods_.begin].first_slot);
  for (int r = rods_.begin; r < rods_.end; ++r) potential_->addLoads(r, loads);
  dofs.foldJoined(rods_, loads.equilibrium);
  Planes response = dofs.makePlanes(rods_);
  PetscCall(solveLinear(loads.equilibrium, response));
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const double reach = sizeOf(r, response),
                 counted = std::min(1.0, reach); // a linear response beyond the length of the rod says nothing
    work_->load_reach[r] = counted;
    work_->load_energy[r] =
        reach > 0 ? 0.5 * dot(dofs.rods()[r], loads.equilibrium, response) * std::pow(counted / reach, 2) : 0;
  }
  PetscFunctionReturn(0);
}

/// Whether the last increment of a rod is little: against what the step or its loads move, in displacement and in
/// energy; or against the rounding of the coordinates, for a rod at rest. What presses on it must hardly change: a
/// barrier that is nearly closed turns little motions into forces. `size`: of the increment.
bool NewtonSolver::isLittle(int r, double *size) {
  const double tolerance = potential_->settings.rounding_tolerance;
  const IncrementalPotential::RodEnergy &energy = energyAtIterate(r);
  const double cost = std::abs(work_->standstill[r].energy);
  *size = sizeOf(r, work_->increment);
  constexpr double apart = 1e-8; // of exact joints, over the size of their bodies
  if (!potential_->elements().pairs({r, r + 1}).empty() && !(work_->residual[r].compatibility <= apart)) return false;
  const Scene &scene = potential_->scene();
  const bool hosts = scene.touchesBodies() && !potential_->elements().bodies({r, r + 1}).empty();
  if ((scene.touches(r) || scene.rods[r].contact.touchesMoving() || hosts) &&
      !(potential_->changeOfPressure(r, work_->increment) <= tolerance))
    return false;
  if (*size <= 256 * epsilon * std::max(1.0, energy.reach / potential_->length(r)))
    return true; // soft turns carry the rounding of many edges
  if (*size <= tolerance * movedBy(r) && cost <= tolerance * tolerance * energy.size) return true;
  if (std::isnan(work_->load_reach[r]) && findLoadReach()) return false;
  return *size <= tolerance * std::max(movedBy(r), work_->load_reach[r]) &&
         cost <= tolerance * tolerance * std::max(energy.size, work_->load_energy[r]);
}

/// What rounding may change v'K v by, with K as it is assembled.
double NewtonSolver::hessianNoise(int r, const Planes &v) const {
  const Elements &e = potential_->elements();
  return 512 * epsilon * potential_->blocks().magnitude(e.rods[r], potential_->dofs().joins(r), v);
}

/// Whether the last increment of a rod in statics costs no more energy than the rounding of its Hessian: a turn of a
/// round rod about an axis, say, of which neither the forces nor the stiffness are known.
bool NewtonSolver::isNeutral(int r) {
  if (!potential_->step().isStatic()) return false;
  potential_->derivatives({r, r + 1});
  return std::abs(work_->standstill[r].energy) <= hessianNoise(r, work_->increment);
}

NewtonSolver::Verdict NewtonSolver::judge(int r, double rtol) {
  Standstill &standstill = work_->standstill[r];
  const double now = excess(work_->residual[r], rtol);
  work_->left[r] = 0;
  // In dynamics a start guess is no answer, however well it fits: along soft directions it drifts step by step.
  const bool guess = report_.iterations == 0 && spent_ == 0 && !potential_->step().isStatic() && now > 0;
  if (now <= 1 && !guess) return Verdict::answer;
  const bool falls = now < 0.5 * standstill.best, noise = isAtNoise(work_->residual[r], rtol);
  if (!standstill.known || (falls && !noise)) {
    standstill.best = std::min(now, standstill.best);
    if (falls) standstill.iterations = 0;
    standstill.creeping = falls || !standstill.tiny ? 0 : standstill.creeping + 1;
    return potential_->step().isStatic() && !descends_ && standstill.creeping >= patience ? Verdict::saddle
                                                                                          : Verdict::going;
  }
  double size;
  const bool little = isLittle(r, &size);
  // Far from an answer residuals rise and fall as they like; without the exact Hessian they fall slowly, and
  // corrections say too little.
  if (!noise && (!little || potential_->step().hessian != HessianKind::exact)) {
    standstill.best = now;
    standstill.iterations = 0;
    return Verdict::going;
  }
  standstill.best = std::min(now, standstill.best);
  standstill.iterations = falls ? 0 : standstill.iterations + 1;
  const bool stands = standstill.iterations >= patience;
  if (!noise && !stands) return Verdict::going;
  if (little && (!standstill.partial || isBalanced(r, rtol))) {
    work_->left[r] = size;
    return Verdict::answer;
  }
  if (!stands) return Verdict::going;
  if (potential_->step().isStatic() && (standstill.partial || isNeutral(r)))
    return Verdict::answer; // for verify to judge
  lost_ = roundingMessage(r, size);
  return Verdict::lost;
}

/// An island is at an answer where all its rods are.
NewtonSolver::Verdict NewtonSolver::judge(RodSet island, double rtol) {
  Verdict worst = Verdict::answer;
  for (int r = island.begin; r < island.end; ++r) worst = std::max(worst, judge(r, rtol));
  return worst;
}

/// Whether the residual of a rod is below the tolerance, or at a noise that is little against the loads: what is asked
/// of motions that corrections leave out.
bool NewtonSolver::isBalanced(int r, double rtol) const {
  const Residual &residual = work_->residual[r];
  return excess(residual, rtol) <= 1 ||
         (isAtNoise(residual, rtol) &&
          std::max(residual.force_floor, residual.moment_floor) <= potential_->settings.rounding_tolerance);
}

/// At an equilibrium with its Hessian factored: whether what is left of every rod is little.
PetscErrorCode NewtonSolver::verify(bool *little) {
  bool regular = true;
  PetscReal rtol;
  PetscFunctionBeginUser;
  PetscCall(SNESGetTolerances(snes_, nullptr, &rtol, nullptr, nullptr, nullptr));
  const Planes &gradient = potential_->derivatives(rods_).gradient;
  PetscCall(solveLinear(gradient, work_->increment));
  if (circulatory_) PetscCall(includeCirculation(&regular));
  fill(work_->load_reach, std::nan(""));
  if (!regular) lost_ = "the derivative of the couples is singular: what is left of the answer cannot be told";
  *little = regular;
  for (int r = rods_.begin; r < rods_.end && regular; ++r) {
    double size;
    double &energy = work_->standstill[r].energy = dot(potential_->elements().rods[r], gradient, work_->increment);
    for (const JoinedBody &b : potential_->elements().bodies({r, r + 1}))
      for (const int s : {b.position, b.rotation}) energy += gradient.vector(0, s).dot(work_->increment.vector(0, s));
    const bool here = isLittle(r, &size);
    if (here) work_->left[r] = std::max(work_->left[r], size);
    if ((here || isNeutral(r)) && (work_->zero[r] == 0 || isBalanced(r, rtol))) continue;
    *little = false;
    lost_ = roundingMessage(r, size);
  }
  PetscFunctionReturn(0);
}

std::string NewtonSolver::roundingMessage(int r, double size) const {
  const Rod &rod = potential_->scene().rods[r];
  const double shortest = potential_->shortestEdge(r), longest = potential_->longestEdge(r),
               reach = work_->energy[r].reach, length = potential_->length(r);
  const int edge = int(std::find_if(potential_->elements().restLength() + potential_->elements().rods[r].first_slot,
                                    potential_->elements().restLength() + potential_->elements().rods[r].edgeEnd(),
                                    [&](double l) { return l == shortest; }) -
                       (potential_->elements().restLength() + potential_->elements().rods[r].first_slot));
  const auto [k1, k2] = rod.material.flexural_stiffness;
  const double slenderness =
      std::min(k1, k2) > 0 ? rod.material.axial_stiffness * length * length / std::min(k1, k2) : 0;
  std::ostringstream text;
  const std::string imbalance = imbalanceOf(*potential_, r, asked());
  text << std::setprecision(3) << "rod '" << rod.name << "' is lost in rounding: " << imbalance
       << (imbalance.empty() ? "" : ", and not falling any more; ") << "Newton would still move it by " << size
       << " of its length, the step moves it by " << movedBy(r) << " (-rounding_tolerance "
       << potential_->settings.rounding_tolerance << ")";
  if (longest > 100 * shortest)
    text << "; edge " << edge << " is " << shortest << " m long, the longest " << longest
         << " m: take one of its vertices away, or use edges of more even length";
  else if (slenderness > 1e15)
    text << "; its EA L^2/EI is " << slenderness
         << ": give it a smaller axial_stiffness, or lay it along an axis of the coordinates";
  else
    text << "; its " << rod.edges() << " edges are " << shortest << " m long: use fewer edges";
  if (std::max(k1, k2) > 1e12 * std::min(k1, k2) && std::min(k1, k2) > 0)
    text << "; its flexural stiffnesses are " << k1 << " and " << k2 << " N m^2: make them less different";
  if (reach > 1e3 * length) text << "; it lies " << reach << " m from the origin: move the scene nearer to it";
  return text.str();
}

/// The rod that is farthest from its equilibrium, in words.
std::string NewtonSolver::farthest() {
  const int rod = farthestRod(*potential_, rods_, asked(), &work_->active);
  if (rod >= 0 && isAtNoise(potential_->residual(rod, energyAtIterate(rod)), 0))
    return "; " + roundingMessage(rod, sizeOf(rod, work_->increment));
  return tellImbalance(*potential_, rod, asked());
}

/// The first rod that is unstable in the Hessian factored last, in words.
std::string NewtonSolver::unstableRod() const {
  for (const RodSet island : islands_)
    if (const int r = island.begin, count = work_->negative[r]; count > 0)
      return "; " + labelOf(potential_->scene().rods[r]) +
             (island.end > r + 1 ? " and " + std::to_string(island.end - r - 1) + " more" : "") +
             ": forces and moments are in balance, and " + std::to_string(count) +
             (count == 1 ? " motion lowers" : " motions lower") + " its energy";
  return "";
}

} // namespace tendril
