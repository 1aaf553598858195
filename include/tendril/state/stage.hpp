#pragma once
/// \file stage.hpp
/// How displacements, velocities and accelerations hang together in one stage of a time step: all that an integrator
/// tells the incremental potential.

#include "tendril/layout/rod_range.hpp"
#include "tendril/state/retraction.hpp"

namespace tendril {

/// Vertices and edges of rods that follow each other, [begin, end) in the order of the scene, and the bodies beside.
struct Piece {
  int vertex, vertex_end, edge, edge_end;
  std::span<const JoinedBody> bodies;
  Piece(const Elements &elements, RodSet rods)
      : vertex(elements.rods[rods.begin].first_vertex), vertex_end(vertex), edge(elements.rods[rods.begin].first_edge),
        edge_end(edge), bodies(elements.bodies(rods)) {
    const RodRange &last = elements.rods[rods.end - 1];
    vertex_end = last.first_vertex + last.vertices;
    edge_end = last.first_edge + last.edges;
  }
};

/// Sum of rates with weights.
class Combination {
public:
  Combination &add(double weight, const Rates &rates) {
    parts_.push_back({weight, &rates.vertex, &rates.edge, &rates.body});
    return *this;
  }
  /// The velocities of a state.
  Combination &add(double weight, const State &state) {
    parts_.push_back({weight, &state.velocity, &state.twist_rate, &state.body_rate});
    return *this;
  }
  bool empty() const { return parts_.empty(); }
  Vec3 atVertex(int v) const {
    Vec3 sum = Vec3::Zero();
    for (const Part &p : parts_) sum += p.weight * (*p.vertex)[v];
    return sum;
  }
  double atEdge(int e) const {
    double sum = 0;
    for (const Part &p : parts_) sum += p.weight * (*p.edge)[e];
    return sum;
  }
  BodyRate ofBody(int b) const {
    BodyRate sum;
    for (const Part &p : parts_) sum.add(p.weight, (*p.body)[b]);
    return sum;
  }
  struct Part {
    double weight;
    const std::vector<Vec3> *vertex;
    const std::vector<double> *edge;
    const std::vector<BodyRate> *body;
  };
  const std::vector<Part> &parts() const { return parts_; }
  /// Adds a multiple of it to what is there, or puts it there.
  void addTo(double factor, const Piece &piece, Rates &out) const {
    for (const Part &p : parts_) add(factor * p.weight, p, piece, out.vertex, out.edge, out.body, true);
  }
  void assignTo(const Piece &piece, Rates &out) const { assignTo(piece, out.vertex, out.edge, out.body); }
  void assignTo(const Piece &piece, State &out) const { assignTo(piece, out.velocity, out.twist_rate, out.body_rate); }

private:
  std::vector<Part> parts_;

  void assignTo(const Piece &piece, std::vector<Vec3> &vertex, std::vector<double> &edge,
                std::vector<BodyRate> &body) const {
    for (std::size_t k = 0; k < parts_.size(); ++k) add(parts_[k].weight, parts_[k], piece, vertex, edge, body, k > 0);
  }
  static void add(double weight, const Part &part, const Piece &piece, std::vector<Vec3> &vertex,
                  std::vector<double> &edge, std::vector<BodyRate> &body, bool to_what_is_there) {
    for (const JoinedBody &b : piece.bodies)
      body[b.body] = (to_what_is_there ? body[b.body] : BodyRate()).add(weight, (*part.body)[b.body]);
    for (int v = piece.vertex; v < piece.vertex_end; ++v)
      vertex[v] = to_what_is_there ? Vec3(vertex[v] + weight * (*part.vertex)[v]) : Vec3(weight * (*part.vertex)[v]);
    for (int e = piece.edge; e < piece.edge_end; ++e)
      edge[e] = to_what_is_there ? edge[e] + weight * (*part.edge)[e] : weight * (*part.edge)[e];
  }
};

/// With d the displacements and spins since the start of the step, docs/theory.md (15.1):
///   velocity v = d/dt + `velocity`,   acceleration = (mass v + `acceleration`)/dt,   strain rate = (strain - its value
///   at the start)/damping_dt,
/// where the start's strain s gets weight (s - strains) on top for each of `damping_past`.
struct StageRule {
  double fraction = 1; ///< of the step: forces balance, and supports are, at that time
  double dt = 0;       ///< [s]
  double mass = 1;
  Combination velocity, acceleration; ///< [m/s]
  double damping_dt = 0;              ///< [s]
  struct PastStrains {
    double weight;
    const double *strains; ///< as strainsOf
  };
  std::vector<PastStrains> damping_past;
  bool tangent_rates = false; ///< strain rates are those of the velocities (strainsBehind) instead
  Combination guess;          ///< of d, to start Newton from [m]
  Combination halfway; ///< of d, half-way in time to the guess: frames follow the curve through both (carryFrames);
                       ///< empty: a great circle [m]
  RetractionKind lengths = RetractionKind::kept; ///< how edges get longer along the guess
  bool carries_frames = true; ///< whether twist is measured from frames carried along the guess, or those of the start
  bool wants_accelerations = true; ///< whether the method goes on with those of this stage
  const Rates *half = nullptr;     ///< displacements to the middle of the step: axial forces come from the mean of the
                                   ///< strains at both its ends (AxialLaw)
  bool keeps_energy = false;       ///< spins and momenta of bodies are those that keep their energy (SpinStage)
};

/// Frames of a rod from which a stage measures twist: those of the start, carried to where the guess leads. Twist
/// inertia then acts on positions by the small turn from there; from the start itself, that would be an error of first
/// order in the step. Between a curve on the sphere of tangents and its chord lies 4/3 of the triangle with the curve's
/// middle, but for terms of fifth order in the step, docs/theory.md (15.11); by that angle frames turn on top where
/// `halfway` is known.
void carryFrames(const StageRule &rule, const Elements &elements, int rod, const Configuration &from,
                 Configuration &reference);

/// Backward Euler over a step of length dt [s]: v = d/dt, a = (v - v_n)/dt. Its velocities are the chords of steps, so
/// that Newton starts where lengths go on as in the last step; frames are those of the start, at its order.
StageRule backwardEuler(const State &start, double dt);

/// What a stage found.
struct StageRates {
  Rates displacement, velocity, acceleration; ///< accelerations where the rule wants them
  std::vector<double> strains;                ///< as in State; only where something dissipates by them
};

} // namespace tendril
