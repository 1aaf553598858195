#pragma once
/// \file work.hpp
/// Work that loads and supports do in a step: what energies lose beyond it is dissipation. docs/theory.md tells the
/// quadratures.

#include "tendril/energy/term.hpp"
#include "tendril/layout/team.hpp"

namespace tendril {

/// [J]
struct Work {
  double loads = 0, supports = 0, obstacles = 0;
  double total() const { return loads + supports + obstacles; }
  Work &operator+=(const Work &other) {
    loads += other.loads;
    supports += other.supports;
    obstacles += other.obstacles;
    return *this;
  }
};

/// Work, docs/theory.md (28.2), of a couple fixed in space and a torque about the tangent along the shortest way
/// between two tangents, with a spin on the way [J]. Exact where the edge turns about one axis; else off by the third
/// power of the turning.
double coupleWork(const Vec3 &moment, double torque, const Vec3 &from, const Vec3 &to, double spin);

/// Work of forces, couples and tensions that are given between two configurations of one step, the load factor going
/// from one value to another at a steady rate. A weight that grows adds to the potential that energies have of it: that
/// counts here [J].
void addWorkOfLoads(const Scene &scene, const Elements &elements, const Configuration &start, const Configuration &end,
                    double factor_start, double factor_end, ExactSum &sum);

/// Work of rods that may be on several ranks.
struct WorkSums {
  ExactSum loads, supports, obstacles;
  Work value() const { return {loads.value(), supports.value(), obstacles.value()}; }
  void tally(Tally &tally) { tally.sum(loads).sum(supports).sum(obstacles); }
};

/// What holders do to their rods: force [N], then moment [N m] about the vertex, or the origin of the obstacle, of
/// each. The inertia of a held vertex itself is not in it: what it takes is the change of its kinetic energy.
using HolderActions = std::vector<Vec3>;
/// A support, a constraint or an obstacle that moves, with one of the rods that it acts on.
struct Holder {
  int rod;
  const Motion *motion;
  int index;                              ///< among its kind
  const Support *support = nullptr;       ///< or null
  const Constraint *constraint = nullptr; ///< or null
  const Collider *collider = nullptr;     ///< or null
  const Joint *joint = nullptr;           ///< or null: by its parent, or by its drive
  bool drives = false;
  const Tendon *tendon = nullptr; ///< or null: by the target of its actuator, or by a point ...
  int place = 0;                  ///< ... which is this one of its slots
};
/// Supports, constraints, joints and tendons in one numbering, in this order.
std::vector<Holder> movingHolders(const Scene &scene);
/// Obstacles with each rod that may touch them.
std::vector<Holder> movingObstacles(const Scene &scene);
/// Work of what a holder does, constant between two times, by the way and the turning of what it holds, or its own [J].
double workOf(const Holder &holder, const std::array<Vec3, 2> &action, const Elements &elements,
              const Configuration &start, const Configuration &end, double from, double to);

/// Work of loads and supports between two equilibria at the load factors that are their times, by the trapezoidal rule.
void addStaticWork(const Scene &scene, const Elements &elements, const State &before, const State &after,
                   const Configuration &start, const Configuration &end, WorkSums &work);
/// The same, where no configurations are at hand and no couple has turned its edge by more than half a turn.
void addStaticWork(const Scene &scene, const Elements &elements, const State &before, const State &after,
                   WorkSums &work);

/// Of the kinetic energy of a state what obstacles that move may have given: of each vertex what it has less when seen
/// from one of them, at most [J].
void addCarriedEnergy(const Scene &scene, const Elements &elements, const State &state, ExactSum &sum);

} // namespace tendril
