/// Matrices of PETSc's own types over the unknowns of rods.
#include "tendril/layout/dof_map.hpp"

namespace tendril {
namespace {

/// An unknown that an edge variable is made of, or the position of a vertex: e_i = x_{i+1} - x_i; with the component of
/// an arm that it is multiplied by, three times the number of the arm and the axis, or -1.
struct Part {
  PetscInt unknown;
  bool minus;
  int factor = -1;
};

/// Collects the entries that the blocks of some rods have in their matrix.
class PatternBuilder {
public:
  PatternBuilder(const DofMap &dofs, RodSet rods, bool joins, DofMap::Pattern &pattern)
      : dofs_(dofs), pattern_(pattern), blocks_(0, joins), first_(dofs.firstUnknown(rods)),
        copies_(dofs.firstSlots(rods)) {
    blocks_.setOrigin(dofs.rods()[rods.begin].first_slot);
    for (const JoinedVertex &j : dofs.joinedVertices(rods))
      if (j.isOnBody()) on_body_[j.slot] = &j;
  }
  /// All that a rod has, with what is beside it, but for edges that touch.
  void addRod(int r) {
    addEdges(dofs_.rods()[r]);
    addVertices(dofs_.rods()[r]);
    addJoinedEdges(r);
    addBodies(r);
    addTies(r);
  }
  void addTouching(const TouchingPair &p);

private:
  using Parts = std::vector<Part>;
  const DofMap &dofs_;
  DofMap::Pattern &pattern_;
  EdgeBlocks blocks_; ///< for its window
  PetscInt first_;
  std::unordered_map<int, int> copies_;
  std::unordered_map<int, const JoinedVertex *> on_body_; ///< by their slots

  /// Unknown of a slot, or of the one that it is a copy of.
  PetscInt shared(int slot, int a) const {
    const auto found = copies_.find(slot);
    return dofs_.unknown(found == copies_.end() ? slot : found->second, a);
  }
  void addPosition(Parts &parts, int slot, int a, bool minus) const;
  Parts position(int slot, int a) const {
    Parts parts;
    addPosition(parts, slot, a, false);
    return parts;
  }
  Parts edge(const RodRange &rod, int i, int r) const;
  Parts tied(const Tie &t, int a) const;
  void coupleFrom(std::ptrdiff_t source, const Parts &left, const Parts &right, bool once);
  /// \param once whether both are the same variable, whose entry has no other across the diagonal
  void couple(const RodRange &rod, const Parts &left, const Parts &right, int plane, int i, bool once) {
    coupleFrom(std::ptrdiff_t(blocks_.offset(rod, plane)) + i, left, right, once);
  }
  void addEdges(const RodRange &rod);
  void addVertices(const RodRange &rod);
  void addJoinedEdges(int r);
  void addBodies(int r);
  void addTies(int r);
};

/// Adds the coordinate of a vertex: that of a point of a body moves by the spin x arm, too.
void PatternBuilder::addPosition(Parts &parts, int slot, int a, bool minus) const {
  parts.push_back({shared(slot, a), minus});
  const auto found = on_body_.find(slot);
  if (found == on_body_.end()) return;
  const int b = (a + 1) % 3, c = (a + 2) % 3, arm = 3 * found->second->number;
  parts.push_back({dofs_.unknown(found->second->first_frame, b), minus, arm + c});
  parts.push_back({dofs_.unknown(found->second->first_frame, c), !minus, arm + b});
}

/// Variable of an edge: a component of its vector, or its twist.
PatternBuilder::Parts PatternBuilder::edge(const RodRange &rod, int i, int r) const {
  auto slot = [&](int i) { return rod.slot(rod.closed ? i % rod.vertices : i); };
  if (r == 3) return {{dofs_.unknown(slot(i), 3), false}};
  Parts parts;
  addPosition(parts, slot(i), r, true);
  addPosition(parts, slot(i + 1), r, false);
  return parts;
}

/// Component of what lies between the two points of a tie.
PatternBuilder::Parts PatternBuilder::tied(const Tie &t, int a) const {
  Parts parts;
  addPosition(parts, t.slot, a, false);
  addPosition(parts, t.of, a, true);
  return parts;
}

void PatternBuilder::coupleFrom(std::ptrdiff_t source, const Parts &left, const Parts &right, bool once) {
  for (const Part &a : left)
    for (const Part &b : right) {
      if (a.unknown < 0 || b.unknown < 0) continue;
      for (const bool mirrored : {false, true}) {
        if (mirrored && once) continue;
        pattern_.row.push_back((mirrored ? b.unknown : a.unknown) - first_);
        pattern_.column.push_back((mirrored ? a.unknown : b.unknown) - first_);
        pattern_.source.push_back(a.minus == b.minus ? source : ~source);
        if (!on_body_.empty()) pattern_.factor.push_back({a.factor, b.factor});
      }
    }
}

/// What edges have with themselves and with the edges before them.
void PatternBuilder::addEdges(const RodRange &rod) {
  for (int i = 0; i < rod.edges; ++i)
    for (int r = 0; r < edge_size; ++r)
      for (int c = r; c < edge_size; ++c)
        couple(rod, edge(rod, i, r), edge(rod, i, c), EdgeBlocks::own(r, c), i, r == c);
  for (int i = 1; i < rod.edges + (rod.closed ? 1 : 0); ++i)
    for (int r = 0; r < edge_size; ++r)
      for (int c = 0; c < edge_size; ++c)
        couple(rod, edge(rod, i - 1, r), edge(rod, i, c), EdgeBlocks::across(r, c), i, false);
}

/// What vertices have with the edges behind them, and with themselves.
void PatternBuilder::addVertices(const RodRange &rod) {
  auto vertex = [&](int i, int a) { return position(rod.slot(i), a); };
  for (int i = 0; i < rod.edges && blocks_.joins(); ++i)
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < edge_size; ++c)
        couple(rod, vertex(i, r), edge(rod, i, c), EdgeBlocks::joined(r, c), i, false);
  for (int i = 0; i < rod.vertices; ++i)
    for (int r = 0; r < 3; ++r)
      for (int c = r; c < 3; ++c) couple(rod, vertex(i, r), vertex(i, c), EdgeBlocks::vertex(r, c), i, r == c);
}

/// What the spins of joined frames have with themselves, and with the edges that are tied to them.
void PatternBuilder::addJoinedEdges(int r) {
  const RodRange &rod = dofs_.rods()[r];
  for (const JoinedEdge &j : dofs_.joinedEdges({r, r + 1})) {
    auto spin = [&](int a) { return Parts{{shared(j.frame, a), false}}; };
    for (int a = 0; a < 3; ++a) {
      for (int c = a; c < 3; ++c)
        couple(rod, spin(a), spin(c), EdgeBlocks::vertex(a, c), j.frame - rod.first_slot, a == c);
      for (int c = 0; c < edge_size; ++c)
        couple(rod, spin(a), edge(rod, j.edge, c), EdgeBlocks::across(a, c), j.cell - rod.first_slot, false);
    }
  }
}

/// What bodies have with themselves, and pairs of them.
void PatternBuilder::addBodies(int r) {
  const RodRange &rod = dofs_.rods()[r];
  for (const JoinedBody &b : dofs_.bodies({r, r + 1}))
    for (const int s : {b.position, b.rotation})
      for (int a = 0; a < 3; ++a)
        for (int c = a; c < 3; ++c)
          couple(rod, {{dofs_.unknown(s, a), false}}, {{dofs_.unknown(s, c), false}}, EdgeBlocks::vertex(a, c),
                 s - rod.first_slot, a == c);
  for (const BodyPair &p : dofs_.pairs({r, r + 1})) {
    auto of = [&](int variable) {
      const auto [slot, a] = p.place(variable);
      return Parts{{dofs_.unknown(slot, a), false}};
    };
    for (int i = 0; i < p.variables(); ++i)
      for (int j = i; j < p.variables(); ++j) {
        const auto [plane, at] = EdgeBlocks::pair(i, j);
        couple(rod, of(i), of(j), plane, p.first + at - rod.first_slot, i == j);
      }
  }
}

void PatternBuilder::addTies(int r) {
  const RodRange &rod = dofs_.rods()[r];
  for (const Tie &t : dofs_.ties({r, r + 1}))
    for (int a = 0; a < 3; ++a)
      for (int c = a; c < 3; ++c)
        couple(rod, tied(t, a), tied(t, c), EdgeBlocks::vertex(a, c), t.copy - rod.first_slot, a == c);
}

/// What two edges that touch have with each other.
void PatternBuilder::addTouching(const TouchingPair &p) {
  const int variables = pattern_.turns ? TouchingPair::variables : 6;
  auto parts = [&](int side, int variable) {
    const auto [slot, a] = p.place(side, variable);
    return a == 3 ? Parts{{dofs_.unknown(slot, 3), false}} : position(slot, a);
  };
  for (int i = 0; i < variables; ++i)
    for (int j = 0; j < variables; ++j)
      coupleFrom(EdgeBlocks::touching_place + EdgeBlocks::touching_size * p.number + TouchingPair::variables * i + j,
                 parts(0, i), parts(1, j), false);
}

} // namespace

std::unordered_map<int, int> DofMap::firstSlots(RodSet rods) const {
  std::unordered_map<int, int> first;
  for (const JoinedVertex &j : joinedVertices(rods)) first[j.slot] = j.first_slot;
  for (const JoinedEdge &j : joinedEdges(rods)) first[j.frame] = j.first_frame;
  return first;
}

PetscErrorCode DofMap::createMatrix(RodSet rods, bool joins, Mat *matrix, Pattern *pattern) const {
  PetscFunctionBeginUser;
  pattern->row.resize(pattern->lasting);
  pattern->column.resize(pattern->lasting);
  pattern->source.resize(pattern->lasting);
  if (!pattern->factor.empty()) pattern->factor.resize(pattern->lasting);
  PatternBuilder builder(*this, rods, joins, *pattern);
  for (int r = rods.begin; r < rods.end && pattern->lasting == 0; ++r) builder.addRod(r);
  pattern->lasting = pattern->source.size();
  for (const int place : pattern->touching) builder.addTouching(touching_.items[std::size_t(place)]);
  PetscCall(MatCreate(PETSC_COMM_SELF, matrix));
  PetscCall(MatSetSizes(*matrix, unknowns(rods), unknowns(rods), PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetType(*matrix, MATAIJ));
  PetscCall(MatSetFromOptions(*matrix));
  PetscCall(MatSetOption(*matrix, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(*matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  std::vector<PetscInt> rows = pattern->row, columns = pattern->column; // PETSc sorts them
  PetscCall(MatSetPreallocationCOO(*matrix, PetscCount(rows.size()), rows.data(), columns.data()));
  pattern->entries.resize(pattern->source.size());
  PetscFunctionReturn(0);
}

PetscErrorCode DofMap::fillMatrix(const EdgeBlocks &blocks, Pattern &pattern, Mat matrix) const {
  PetscFunctionBeginUser;
  for (std::size_t n = 0; n < pattern.source.size(); ++n) {
    const std::ptrdiff_t from = pattern.source[n];
    pattern.entries[n] = from >= 0 ? blocks.at(from) : -blocks.at(~from);
  }
  for (std::size_t n = 0; n < pattern.factor.size(); ++n)
    for (const int f : pattern.factor[n])
      if (f >= 0) pattern.entries[n] *= arms_[std::size_t(f / 3)][f % 3];
  PetscCall(MatSetValuesCOO(matrix, pattern.entries.data(), INSERT_VALUES));
  PetscFunctionReturn(0);
}

} // namespace tendril
