#pragma once
/// \file dof_map.hpp
/// Where the unknowns are. Three numberings:
///   vertices and edges   of the whole scene, rod after rod, in scene order, as files have them;
///   slots                of the arrays the element loops stream through: vertex i, edge i and the cell at vertex i of a rod share its slot
///                        first_slot + i. Behind a ring come copies of its first two vertices and first edge; around an open rod there is room for
///                        the frames that clamps hold. Element loops know neither ends nor rings;
///   unknowns             of PETSc's global vector: x, y, z and twist of each slot that neither is a copy nor is held by a support.

#include "tendril/geometry/planes.hpp"
#include "tendril/layout/petsc.hpp"
#include "tendril/model/scene.hpp"

#include <array>

namespace tendril {

/// Numbering of one rod.
struct RodRange {
  int first_vertex, vertices;
  int first_edge, edges;
  int first_slot; ///< of vertex 0; a multiple of the lanes
  int slots;      ///< from this rod's first slot to the next rod's
  bool twist;     ///< false for a cable
  bool closed;

  int slot(int i) const { return first_slot + i; }
  int vertexEnd() const { return first_slot + vertices; }
  int edgeEnd() const { return first_slot + edges; }
};

/// Rods that follow each other in the scene, [begin, end).
struct RodSet {
  int begin, end;
};

/// Unknowns of a slot: x, y, z, twist.
inline constexpr int slot_size = 4;
/// Couplings of an unknown to those after it, itself included: the 11 unknowns of a cell.
inline constexpr int band_width = cell_size;
/// Entries of the band in the rows of one slot.
inline constexpr int slot_entries = slot_size * band_width;

/// Upper band of symmetric matrices of all rods: entry (a, k) of slot s couples unknown a of the slot with the k-th after it. Each of the
/// 44 entries is a plane over the slots of a rod.
class Band {
public:
  Band() = default;
  /// Of all rods, or of as many neighbours as so many slots hold.
  explicit Band(int slots) : data_(std::size_t(slot_entries) * slots + 4 * lanes, 0.0) {}
  /// Moves the window to the rods from this slot on (see Planes).
  void setOrigin(int first_slot) { origin_ = first_slot; }
  double *entry(const RodRange &rod, int a, int k) { return data_.data() + offset(rod, a, k); }
  const double *entry(const RodRange &rod, int a, int k) const { return data_.data() + offset(rod, a, k); }
  const double *data() const { return data_.data(); }
  void clear(const RodRange &rod);
  /// Becomes other - this.
  void subtractFrom(const Band &other);
  /// y += A x for one rod, copies behind a ring included in x and in y.
  void multiply(const RodRange &rod, const Planes &x, Planes &y) const;

  /// Where the plane of an entry begins in data().
  std::size_t offset(const RodRange &rod, int a, int k) const {
    return lanes + std::size_t(slot_entries) * (rod.first_slot - origin_) + std::size_t(a * band_width + k) * rod.slots;
  }

private:
  int origin_ = 0;
  AlignedVector data_;
};

class DofMap {
public:
  PetscErrorCode setUp(const Scene &scene);

  const std::vector<RodRange> &rods() const { return rods_; }
  int vertices() const { return vertices_; }
  int edges() const { return edges_; }
  int slots() const { return slots_; }
  PetscInt unknowns() const { return unknowns_; }
  /// Unknown of a slot's x, y, z (a = 0, 1, 2) or twist (3), or -1 where it is held or does not exist.
  PetscInt unknown(int slot, int a) const { return unknown_[std::size_t(slot_size) * slot + a]; }
  bool isHeld(int vertex) const { return held_[vertex]; }
  Planes makePlanes() const { return Planes(slot_size, slots_); }

  DM dm() const { return dm_; }
  /// Matrix of PETSc's own type over the unknowns, preallocated for the band of every rod.
  PetscErrorCode createMatrix(Mat *matrix);
  /// Puts the band of all rods into the matrix, both triangles.
  PetscErrorCode fillMatrix(const Band &band, Mat matrix);

  /// Copies of the first vertices and edge of a closed rod behind its last.
  void copyBehindRing(const RodRange &rod, Planes &increment) const;
  /// Adds what was summed into the copies behind a ring to the slots they stand for.
  void fold(const RodRange &rod, Planes &sums) const;
  void fold(const RodRange &rod, Band &band) const;

  /// Unknowns of some rods are numbered one after the other.
  PetscInt firstUnknown(RodSet rods) const { return unknown_begin_[rods.begin]; }
  PetscInt unknowns(RodSet rods) const { return unknown_begin_[rods.end] - unknown_begin_[rods.begin]; }
  RodSet all() const { return {0, int(rods_.size())}; }
  /// Slots from the first rod's first to the one behind the last rod's room.
  int slots(RodSet rods) const { return rods_[rods.end - 1].first_slot + rods_[rods.end - 1].slots - rods_[rods.begin].first_slot; }

  /// out = values of the unknowns of some rods; of these, rods not `wanted` (by scene order) get zero.
  PetscErrorCode gather(const Planes &values, RodSet rods, Vec out, const std::vector<char> *wanted = nullptr) const;
  /// Values of the rods' slots from unknowns: zero where held, copies behind rings included.
  PetscErrorCode scatter(Vec in, RodSet rods, Planes &values) const;

private:
  std::vector<RodRange> rods_;
  int vertices_ = 0, edges_ = 0, slots_ = 0;
  PetscInt unknowns_ = 0;
  std::vector<bool> held_;
  std::vector<PetscInt> unknown_, unknown_begin_;
  std::vector<std::size_t> source_; ///< entries of the matrix in its own order: where their value is in the band
  std::vector<double> entries_;
  OwnedDM dm_;

  PetscErrorCode createSection(PetscSection *section) const;
};

} // namespace tendril
