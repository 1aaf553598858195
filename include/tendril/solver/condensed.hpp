#pragma once
/// \file condensed.hpp
/// LDL^T of the Hessian of rods that junctions join. Junctions cut rods into runs. Each run is eliminated by the kernel
/// of `banded`, towards the separator where it begins, with the one where it ends for a border; what is left is the
/// Schur complement over the positions and frames of the junctions: dense for few unknowns, by LAPACK's symmetric
/// indefinite factorisation (Bunch and Kaufman 1977), or sparse for many, by PETSc's Cholesky ordered by approximate
/// minimum degree. Negative pivots of the runs and of the Schur complement add up to those of the whole (Haynsworth
/// 1968). Registered with PETSc as the solver type `condensed` for Cholesky.

#include "tendril/solver/banded.hpp"
#include "tendril/solver/pivots.hpp"
#include "tendril/solver/schur.hpp"

#include <map>

namespace tendril {

class CondensedFactor {
public:
  static constexpr const char *name = "condensed";
  CondensedFactor(const DofMap &dofs, RodSet rods, BandedWorkspace &workspace);
  /// Whether it can factor some rods: where one that bends runs through a junction without a frame, the next vertex
  /// must be neither held nor in a junction.
  static bool suits(const DofMap &dofs, RodSet rods);
  /// Whether it is cheaper than MUMPS: a rod that runs through couples all of its junctions.
  static bool pays(const DofMap &dofs, RodSet rods);

  void factor(const BandedSystem &system);
  /// By the unknowns of the rods; x may be b.
  void solve(const PetscScalar *b, PetscScalar *x);
  bool isRegular() const { return regular_; }
  int negative() const { return negative_; }
  int zero() const { return zero_; }
  std::size_t numbers() const { return records_.size(); }
  std::size_t bytes() const { return (records_.size() + values_.size()) * sizeof(double); }
  PetscErrorCode view(PetscViewer viewer) const;

private:
  /// Among the separators' unknowns, or -1; behind those of the state the spin of a body that has the vertex.
  static constexpr int places_size = state_size + 3;
  using Places = std::array<int, places_size>;
  /// Edges of a rod between two cuts.
  struct Run {
    int rod, begin, edges;
    bool from_separator, to_separator;
    bool from_through, to_through; ///< whether the rod runs on there, with its first edge and twist for unknowns
    Places near, far;
    const JoinedEdge *near_frame = nullptr, *far_frame = nullptr;   ///< to which its first and last edge are tied
    const JoinedVertex *near_point = nullptr, *far_point = nullptr; ///< of a body
    std::vector<char> held;                                         ///< of its vertices
  };
  /// Runs factored together, as in BandedFactor.
  struct Group {
    std::array<int, lanes> run;
    int count;
    bool packed;
    std::size_t record, value;    ///< where its factor and its values begin
    std::array<int, lanes> entry; ///< where its part of the Schur complement begins
  };
  const DofMap &dofs_;
  RodSet rods_;
  BandedWorkspace &workspace_;
  std::vector<Run> runs_;
  std::vector<Group> groups_;
  std::vector<int> unknown_; ///< of each separator's unknown, among those of the rods; -1: an edge's vector
  AlignedVector records_, values_;
  std::vector<double> entries_, separators_; ///< of the Schur complement; of a right-hand side or solution
  std::size_t own_entries_ = 0;              ///< where those begin that separators have by themselves
  std::unique_ptr<Schur> schur_;
  bool regular_ = true;
  int negative_ = 0, zero_ = 0;

  /// Of separators' unknowns, the first of those that a slot has: of junctions, and of edges that run through.
  struct Numbers {
    std::map<int, int> junction, edge;
  };
  std::map<int, int> numberJunctions();
  std::map<int, int> numberEdgesThrough();
  Places placesOf(const JoinedVertex &j, const JoinedEdge *edge, const Numbers &numbers) const;
  Run makeRun(int rod, int begin, int end, const JoinedVertex *near, const JoinedVertex *far,
              const Numbers &numbers) const;
  void cut();
  void addGroup(const int *run, int count, bool packed, std::size_t &records, std::size_t &values,
                std::vector<int> &rows, std::vector<int> &columns);
  void addOwnEntries(std::vector<int> &rows, std::vector<int> &columns) const;
  void group(std::vector<int> &rows, std::vector<int> &columns);
  template <class T> void factorGroup(const Group &group, const BandedSystem &system);
  template <class T> using Block = T[state_size][state_size];
  Vec3 armOf(const JoinedVertex *point) const { return point ? dofs_.arm(*point) : Vec3(Vec3::Zero()); }
  template <class T>
  void addEntries(const Group &group, const Block<T> &near, const Block<T> &between, const Block<T> &far);
  template <class T>
  void addBodyEntries(const Run &run, const Block<T> &near, const Block<T> &between, const Block<T> &far, int lane,
                      double *to);
  template <class T> void solveTo(const Group &group, const PetscScalar *b);
  template <class T> void solveFrom(const Group &group, PetscScalar *x);
  template <class T, class Visit> void eachValue(const Group &group, Visit visit);
};

} // namespace tendril
