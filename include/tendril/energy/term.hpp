#pragma once
/// \file term.hpp
/// A term of the incremental potential: its value and its derivatives over the slots of one rod. To add an energy,
/// write one file with a class derived from Term and add one line to makeRodTerms (terms.cpp).

#include "tendril/energy/cell.hpp"
#include "tendril/geometry/box.hpp"
#include "tendril/geometry/exact_sum.hpp"
#include "tendril/state/stage.hpp"

#include <memory>

namespace tendril {

/// Which second derivatives a Hessian holds: all of them; without the compression of edges, which cannot make it
/// indefinite then; or without the second derivatives of the strains and without compression (what other codes use:
/// slower, never indefinite; for comparison). Or none, where only the gradient is wanted.
enum class HessianKind { exact, uncompressed, gauss_newton, none };

/// One step, or stage of one, to be taken: from the start state to `time`.
struct Step {
  double dt = 0;          ///< velocities are displacements over this [s]; 0 in statics
  double time = 0;        ///< at the end of the step: prescribed motions are at this time [s]
  double load_factor = 1; ///< on gravity, forces, torques and moments
  bool mixed = true;      ///< axial force as its own unknown, condensed edge by edge
  HessianKind hessian = HessianKind::exact;
  /// Statics whose Hessian tells small motions: exact joints are as stiff between updates of their forces as in
  /// dynamics, and nothing keeps bodies from turning that are free to.
  bool small_motions = false;
  const StageRule *rule = nullptr; ///< of the stage, with the same dt; IncrementalPotential::beginStep takes
                                   ///< backward Euler where a step in time has none
  const Configuration *twist_reference =
      nullptr; ///< frames from which twist is measured (carryFrames); null: those of the start
  double dampingDt() const { return rule ? rule->damping_dt : dt; }
  bool isStatic() const { return dt == 0; }
};

/// First and second derivatives by x, y, z and twist of each slot (see DofMap). Terms add to `equilibrium`, where the
/// stretching force is the independent axial force; `gradient`, of the potential itself, differs by the forces that
/// stretch adds there.
struct Derivatives {
  Planes gradient, equilibrium;
  EdgeBlocks blocks; ///< of the Hessian, over edge variables
  explicit Derivatives(int slots, bool joins = false)
      : gradient(slot_size, slots), equilibrium(slot_size, slots), blocks(slots, joins) {}
  void setOrigin(int first_slot) {
    gradient.setOrigin(first_slot);
    equilibrium.setOrigin(first_slot);
    blocks.setOrigin(first_slot);
  }
};

/// Stored and kinetic energies of a state, by name [J]; centrifugal potential counts as gravity.
struct EnergyBudget {
  double kinetic = 0, stretch = 0, bend = 0, twist = 0, gravity = 0, constraint = 0, contact = 0, body_kinetic = 0;
  double total() const;
  EnergyBudget &operator+=(const EnergyBudget &other);
};
inline constexpr double EnergyBudget::*named_energies[] = {
    &EnergyBudget::kinetic, &EnergyBudget::stretch,    &EnergyBudget::bend,    &EnergyBudget::twist,
    &EnergyBudget::gravity, &EnergyBudget::constraint, &EnergyBudget::contact, &EnergyBudget::body_kinetic};
inline double EnergyBudget::total() const {
  double sum = 0;
  for (const auto energy : named_energies) sum += this->*energy;
  return sum;
}
inline EnergyBudget &EnergyBudget::operator+=(const EnergyBudget &other) {
  for (const auto energy : named_energies) this->*energy += other.*energy;
  return *this;
}
/// Those of rods that may be on several ranks.
struct EnergySums {
  std::array<ExactSum, std::size(named_energies)> sums;
  void add(const EnergyBudget &budget) {
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k].add(budget.*named_energies[k]);
  }
  EnergyBudget value() const {
    EnergyBudget budget;
    for (std::size_t k = 0; k < sums.size(); ++k) budget.*named_energies[k] = sums[k].value();
    return budget;
  }
};

class Term {
public:
  virtual ~Term() = default;
  /// Called for every rod before the iterations of a step. `start` stays in place until the next.
  virtual void beginStep(const State & /*state*/, const Configuration & /*start*/, const Step & /*step*/, int /*rod*/) {
  }
  /// Called whenever the iterate of a rod has moved.
  virtual void moveIterate(const Configuration & /*iterate*/, int /*rod*/) {}
  /// Called when the load factor changes within a step.
  virtual void setLoadFactor(double /*factor*/) {}
  /// What the derivative of its gradient by the spin of a body has beyond a symmetric matrix, as the vector c of c x
  /// spin [N m].
  virtual Vec3 circulation(const JoinedBody & /*body*/, const Configuration & /*configuration*/) const {
    return Vec3::Zero();
  }
  /// Whether it is the scene's loads.
  virtual bool isLoad() const { return false; }
  /// Whether its Hessian couples the coordinates of one vertex other than through edges: see
  /// BandedSystem::coupled_positions.
  virtual bool couplesPositions() const { return false; }
  /// Whether its Hessian couples the position of a vertex with the edge behind it.
  virtual bool joinsPositions() const { return false; }
  /// [J], up to a constant of the step. Not finite where the configuration is impossible.
  virtual double energy(const Configuration &configuration, int rod) const = 0;
  /// Adds gradient and Hessian, pulled back by the retraction at the configuration.
  virtual void addDerivatives(const Configuration &configuration, int rod, Derivatives &out,
                              HessianKind hessian = HessianKind::exact) const = 0;
  /// Adds what of it a state stores, without dissipation, under its names.
  virtual void addEnergies(const State & /*state*/, const Configuration & /*of the state*/, double /*load_factor*/,
                           int /*rod*/, EnergyBudget & /*out*/) const {}
  /// Whether it is an energy of strains, whose rounding is that of edges.
  virtual bool roundsAsStrains() const { return true; }
  /// Part of the straight way between two configurations that a rod can go, 1 where nothing is in its way.
  virtual double freeFraction(const Configuration & /*from*/, const Configuration & /*to*/, int /*rod*/) const {
    return 1;
  }
  /// Smallest distance between the surfaces of a rod and of obstacles [m]; infinite where there are none.
  virtual double smallestGap(const Configuration & /*configuration*/, int /*rod*/) const { return HUGE_VAL; }
  /// Sum over a rod's samples in contact of the force that presses on each, and of by how much a small motion changes
  /// it, to first order [N].
  virtual std::array<double, 2> pressure(const Configuration & /*configuration*/, const Planes & /*increment*/,
                                         int /*rod*/) const {
    return {0, 0};
  }
  /// Adds by how much its gradient changes when obstacles go on to a time and the rod stays, to first order.
  virtual void addObstacleMotion(const Configuration & /*iterate*/, double /*time*/, int /*rod*/,
                                 Planes & /*out*/) const {}
  /// What an obstacle does to a rod: force [N] and moment about its origin [N m].
  virtual std::array<Vec3, 2> actionOfObstacle(int /*collider*/, const Configuration & /*configuration*/,
                                               int /*rod*/) const {
    return {Vec3::Zero(), Vec3::Zero()};
  }
  /// Takes what it took from before for constant anew from the iterate. \return by which part that changes its forces
  virtual double renew(const Configuration & /*iterate*/, int /*rod*/) { return 0; }
  /// Adds pairs of edges and bodies that may touch in a step, in which these go about so far from its start; the number
  /// of a pair is its place in the list.
  /// \param way of vertices, and of bodies with their spins
  /// \param room how much farther they may go than they are expected to, 1 where nothing else is known
  virtual void findTouching(const State & /*state*/, const Configuration & /*start*/, const Planes & /*way*/,
                            const Step & /*step*/, double /*room*/, std::vector<TouchingPair> & /*pairs*/) {}
  /// Adds boxes: where a rod, and each body beside it, may touch others in the step for which it has looked for pairs.
  virtual void addRooms(int /*rod*/, std::vector<Box> & /*rooms*/) const {}
  /// Whether a pair that it has found touches, or might after a motion by the width of its law.
  virtual bool nearlyTouch(const TouchingPair & /*pair*/, const Configuration & /*configuration*/) const {
    return false;
  }
  /// How often a trial of any of some rods has been kept from leaving the room in which all that may touch is known.
  virtual int timesBounded(RodSet /*rods*/) const { return 0; }
  /// Adds derivatives of what acts between the rods of an island, to both of the gradients; those of each rod alone are
  /// there, and copies have been added to what they stand for.
  virtual void addBetween(const Configuration & /*configuration*/, RodSet /*island*/, Derivatives & /*out*/,
                          HessianKind /*hessian*/) const {}
  /// What a state remembers of it beside the configuration, after the step.
  virtual void commit(State & /*state*/, const Configuration & /*configuration*/, int /*rod*/) const {}
  /// How far rounding blurs the energy, beyond that of its value and of strains [J]. \param blur of an edge over its
  /// length
  virtual double noise(const Configuration & /*configuration*/, int /*rod*/, double /*blur*/) const { return 0; }
  /// How far rounding blurs its forces on a rod and on the bodies beside it, beyond that of strains [N].
  virtual double forceNoise(const Configuration & /*configuration*/, int /*rod*/) const { return 0; }
  /// Forces that are unknowns of their own, as they are at a trial: what the linearised constraints ask for.
  virtual void setTrialForces(const Configuration & /*iterate*/, const Planes & /*increment*/, double /*scale*/,
                              int /*rod*/, Configuration & /*trial*/) const {}
  /// Adds the forces of exact constraints by what a trial has changed them by beyond what an increment does to first
  /// order. \return that at most, over the size of what they hold
  virtual double addExcess(const Configuration & /*iterate*/, const Planes & /*increment*/, double /*scale*/,
                           const Configuration & /*trial*/, int /*rod*/, Planes & /*force*/) const {
    return 0;
  }
  /// Gives exact joints the forces that carry the bodies which they place, so that these have no part in the gradient
  /// but along what their joints leave free. \param gradient at the iterate, which receives the forces \return whether
  /// a rod has any
  virtual bool carry(int /*rod*/, const Planes & /*gradient*/, Configuration & /*iterate*/) { return false; }
  /// What of the energy of a rod stands for exact constraints that are not met [J].
  virtual double violation(const Configuration & /*configuration*/, int /*rod*/) const { return 0; }
  /// By how much exact constraints beside a rod are missed at most, over the size of what they hold.
  virtual double mismatch(const Configuration & /*configuration*/, int /*rod*/) const { return 0; }
  /// What holds a rod from a slot of its own, the frame of a support or the target of a constraint, does to it:
  /// derivatives of the energy by moving it [N], and by turning it about axes fixed in space [N m].
  virtual std::array<Vec3, 2> actionFrom(int /*slot*/, const Configuration & /*configuration*/, int /*rod*/) const {
    return {Vec3::Zero(), Vec3::Zero()};
  }
};

/// Moment of the half cells beside a frame by turning it [N m]. \param cells their constants, as Elements::cells()
Vec3 momentOn(const Elements &elements, const Planes &cells, const Configuration &configuration, int rod, int frame);

/// Strain around which dissipation by stiffness pulls, s of docs/theory.md (14.2): that at the start, with what the
/// stage remembers.
template <class T> T dampedRest(const Step &step, const T &start, std::size_t index) {
  T rest = start;
  if (step.rule)
    for (const StageRule::PastStrains &past : step.rule->damping_past)
      rest += T(past.weight) * (start - read<T>(past.strains + index));
  return rest;
}

/// Axial force of every edge as a linear law of its strain over one step: stiffness (strain - rest), dissipation
/// included. Over slots.
class AxialLaw {
public:
  AxialLaw(const Scene &scene, const Elements &elements);
  void beginStep(const Configuration &start, const Step &step, int rod);
  const double *stiffness() const { return planes_[0]; } ///< [N]
  const double *rest() const { return planes_[1]; }

private:
  const Scene &scene_;
  const Elements &elements_;
  Planes planes_;
  bool moved_ = false; ///< some step had rest strains of its own
};

/// The terms of the rods themselves that the scene needs, in a fixed order; stretch is the first.
std::vector<std::unique_ptr<Term>> makeRodTerms(const Scene &scene, const Elements &elements, const AxialLaw &axial,
                                                bool dynamic);

std::unique_ptr<Term> makeBendTwist(const Scene &, const Elements &);
std::unique_ptr<Term> makeBend(const Scene &, const Elements &);
std::unique_ptr<Term> makeStretch(const Elements &, const AxialLaw &);
std::unique_ptr<Term> makeInertia(const Scene &, const Elements &);
std::unique_ptr<Term> makeLoad(const Scene &, const Elements &);
std::unique_ptr<Term> makeBodyMotion(const Scene &, const Elements &, bool dynamic);

/// What an end couple stores in the half edge beyond the last cell, by bending about the first and second director and
/// by twist [J]. That half turns by moment x compliance, so the couple does twice this work at the end of the rod; the
/// balance of forces is the same with or without it.
std::array<double, 3> endEnergy(const Elements &elements, const Configuration &configuration, const EndCouple &end,
                                double load_factor);

/// How that half pulls at its edge by the law `seed`, whose bending depends on the stretch, docs/theory.md (6.2).
struct EndPull {
  double force = 0;           ///< along the tangent, of a tension [N]
  double by_length = 0;       ///< its derivatives by the length of the edge [N/m]
  Vec3 by_spin{Vec3::Zero()}; ///< and by its spin [N]
};
EndPull endPull(const Elements &elements, const Frame &frame, const EndCouple &end, double load_factor);

} // namespace tendril
