#pragma once
/// \file state_access.hpp
/// Reading and writing the state of rods between steps (docs/library.md). A State is plain arrays whose parts belong
/// together: second words of positions, directors normal to their edges, whole turns, axial forces, what the integrator
/// remembers. Here they stay together.

#include "tendril/dynamics/simulation.hpp"

namespace tendril {

/// The state of one rod of a simulation. What is written is checked first: a SceneError names the rod and what is
/// wrong, and nothing has changed then. Writing what was read changes nothing, to the bit. Any other write makes the
/// run begin anew from there: in dynamics the integrator, since what it remembers is of another motion; in statics the
/// load factor, state.time, which becomes 0, since what was written is no equilibrium.
class RodAccess {
public:
  /// \param rod by scene order, from 0
  /// \throws SceneError where there is no such rod, or the simulation is not set up
  RodAccess(Simulation &simulation, int rod);
  /// \param name of one rod, as trajectories have it: that of the scene, with .0, .1 ... for the polylines of a file
  /// and #0, #1 ... for copies
  RodAccess(Simulation &simulation, const std::string &name);

  int vertices() const { return range_.vertices; }
  int edges() const { return range_.edges; }

  std::vector<Vec3> positions() const;     ///< (nv) [m]
  std::vector<Vec3> directors() const;     ///< (ne) first directors
  std::vector<Vec3> velocities() const;    ///< (nv) [m/s]
  std::vector<double> twistRates() const;  ///< (ne) [rad/s]
  std::vector<double> axialForces() const; ///< (ne) [N]
  /// (nv) Angle from the frame of the edge before a vertex to that of the edge after it, whole turns included; at an
  /// end from or to the frame of what holds its twist, or 0 [rad].
  std::vector<double> twists() const;

  /// Moves the vertices. Directors go with their edges by minimal rotation, whole turns by continuity of the twist
  /// angles; axial forces become those of the new strains; velocities stay. \param x (nv) [m]; held vertices stay where
  /// they are, edges have a length and do not fold back
  void setPositions(const std::vector<Vec3> &x);
  /// Turns each first director about its edge, by less than half a turn, to where it is given.
  /// \param d (ne) of unit length and normal to their edges within 1e-3; made so exactly. Measure `tan` takes twists
  /// below half a turn
  void setDirectors(const std::vector<Vec3> &d);
  /// Turns the directors so that the twist angles become these. Edge 0 stays where the twist of vertex 0 is free.
  /// \param angle (nv) [rad]; of measure `tan` below half a turn. Angles of free ends mean nothing. Where both ends are
  /// held, the last follows from the others up to whole turns, on a ring that of vertex 0, and must be that within 1e-6
  void setTwists(const std::vector<double> &angle);
  /// \param v (nv) [m/s]; held vertices keep the velocity of their support
  void setVelocities(const std::vector<Vec3> &v);
  /// \param rate (ne) [rad/s]
  void setTwistRates(const std::vector<double> &rate);
  /// Velocities and twist rates to zero.
  void stop();
  /// The rod as at the start of the run. Held vertices are where they were then, too: with supports that move, set
  /// state.time back as well.
  void reset();

private:
  const Scene &scene_;
  const Elements &elements_;
  State &state_;
  bool dynamic_;
  int index_;
  const RodRange &range_;
  std::vector<LooseCell> cells_;          ///< in scene order
  std::vector<const Support *> supports_; ///< of this rod

  const Rod &rod() const { return scene_.rods[index_]; }
  [[noreturn]] void fail(const std::string &what) const;
  void checkCount(std::size_t given, int wanted, const char *what) const;
  bool holds(int vertex, bool (Support::*what)() const) const;
  bool isOnBody(int vertex) const;
  Frame edgeFrame(const State &state, int edge) const;
  Frame frameAt(const State &state, int slot) const;
  int vertexOf(const LooseCell &cell) const;
  /// Twist angles of the cells with whole turns.
  std::vector<double> cellTwists(const State &state) const;
  std::vector<double> atVertices(const std::vector<double> &cell_twists) const;
  /// Whole turns that bring the cells closest to their twist angles before, edges turned by these angles since.
  void setTurns(State &next, std::vector<double> twists, const std::vector<double> &by) const;
  void accept(State &&next);
};

} // namespace tendril
