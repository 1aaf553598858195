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

} // namespace

std::unordered_map<int, int> DofMap::firstSlots(RodSet rods) const {
  std::unordered_map<int, int> first;
  for (const JoinedVertex &j : joinedVertices(rods)) first[j.slot] = j.first_slot;
  for (const JoinedEdge &j : joinedEdges(rods)) first[j.frame] = j.first_frame;
  return first;
}

PetscErrorCode DofMap::createMatrix(RodSet rods, bool joins, Mat *matrix, Pattern *pattern) const {
  PetscFunctionBeginUser;
  std::vector<PetscInt> &row = pattern->row, &column = pattern->column;
  std::vector<std::ptrdiff_t> &source_of = pattern->source;
  row.resize(pattern->lasting);
  column.resize(pattern->lasting);
  source_of.resize(pattern->lasting);
  if (!pattern->factor.empty()) pattern->factor.resize(pattern->lasting);
  EdgeBlocks blocks(0, joins); // for its window
  blocks.setOrigin(rods_[rods.begin].first_slot);
  const PetscInt first = firstUnknown(rods);
  const std::unordered_map<int, int> copies = firstSlots(rods);
  auto shared = [&](int slot, int a) {
    const auto found = copies.find(slot);
    return unknown(found == copies.end() ? slot : found->second, a);
  };
  std::unordered_map<int, const JoinedVertex *> on_body;
  for (const JoinedVertex &j : joinedVertices(rods))
    if (j.isOnBody()) on_body[j.slot] = &j;
  /// Adds the coordinate of a vertex: that of a point of a body moves by the spin x arm, too.
  auto addPosition = [&](std::vector<Part> &parts, int slot, int a, bool minus) {
    parts.push_back({shared(slot, a), minus});
    const auto found = on_body.find(slot);
    if (found == on_body.end()) return;
    const int b = (a + 1) % 3, c = (a + 2) % 3, arm = 3 * found->second->number;
    parts.push_back({unknown(found->second->first_frame, b), minus, arm + c});
    parts.push_back({unknown(found->second->first_frame, c), !minus, arm + b});
  };
  auto coupleFrom = [&](std::ptrdiff_t source, const std::vector<Part> &left, const std::vector<Part> &right,
                        bool once) {
    for (const Part &a : left)
      for (const Part &b : right) {
        if (a.unknown < 0 || b.unknown < 0) continue;
        for (const bool mirrored : {false, true}) {
          if (mirrored && once) continue;
          row.push_back((mirrored ? b.unknown : a.unknown) - first);
          column.push_back((mirrored ? a.unknown : b.unknown) - first);
          source_of.push_back(a.minus == b.minus ? source : ~source);
          if (!on_body.empty()) pattern->factor.push_back({a.factor, b.factor});
        }
      }
  };
  for (int r = rods.begin; r < rods.end && pattern->lasting == 0; ++r) {
    const RodRange &rod = rods_[r];
    auto slot = [&](int i) { return rod.slot(rod.closed ? i % rod.vertices : i); };
    auto edge = [&](int i, int r) {
      std::vector<Part> parts;
      if (r == 3)
        parts = {{unknown(slot(i), 3), false}};
      else {
        addPosition(parts, slot(i), r, true);
        addPosition(parts, slot(i + 1), r, false);
      }
      return parts;
    };
    auto position = [&](int i, int r) {
      std::vector<Part> parts;
      addPosition(parts, slot(i), r, false);
      return parts;
    };
    auto couple = [&](const std::vector<Part> &left, const std::vector<Part> &right, int plane, int i, bool once) {
      coupleFrom(std::ptrdiff_t(blocks.offset(rod, plane)) + i, left, right, once);
    };
    for (int i = 0; i < rod.edges; ++i)
      for (int r = 0; r < edge_size; ++r)
        for (int c = r; c < edge_size; ++c) couple(edge(i, r), edge(i, c), EdgeBlocks::own(r, c), i, r == c);
    for (int i = 1; i < rod.edges + (rod.closed ? 1 : 0); ++i)
      for (int r = 0; r < edge_size; ++r)
        for (int c = 0; c < edge_size; ++c) couple(edge(i - 1, r), edge(i, c), EdgeBlocks::across(r, c), i, false);
    for (int i = 0; i < rod.edges && joins; ++i)
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < edge_size; ++c) couple(position(i, r), edge(i, c), EdgeBlocks::joined(r, c), i, false);
    for (int i = 0; i < rod.vertices; ++i)
      for (int r = 0; r < 3; ++r)
        for (int c = r; c < 3; ++c) couple(position(i, r), position(i, c), EdgeBlocks::vertex(r, c), i, r == c);
    for (const JoinedEdge &j : joinedEdges({r, r + 1})) {
      auto spin = [&](int a) { return std::vector<Part>{{shared(j.frame, a), false}}; };
      for (int a = 0; a < 3; ++a) {
        for (int c = a; c < 3; ++c)
          couple(spin(a), spin(c), EdgeBlocks::vertex(a, c), j.frame - rod.first_slot, a == c);
        for (int c = 0; c < edge_size; ++c)
          couple(spin(a), edge(j.edge, c), EdgeBlocks::across(a, c), j.cell - rod.first_slot, false);
      }
    }
    for (const JoinedBody &b : bodies({r, r + 1}))
      for (const int s : {b.position, b.rotation})
        for (int a = 0; a < 3; ++a)
          for (int c = a; c < 3; ++c)
            couple({{unknown(s, a), false}}, {{unknown(s, c), false}}, EdgeBlocks::vertex(a, c), s - rod.first_slot,
                   a == c);
    for (const BodyPair &p : pairs({r, r + 1}))
      for (int i = 0; i < p.variables(); ++i)
        for (int j = i; j < p.variables(); ++j) {
          const auto [plane, at] = EdgeBlocks::pair(i, j);
          auto of = [&](int variable) {
            const auto [slot, a] = p.place(variable);
            return std::vector<Part>{{unknown(slot, a), false}};
          };
          couple(of(i), of(j), plane, p.first + at - rod.first_slot, i == j);
        }
    for (const Tie &t : ties({r, r + 1})) {
      auto difference = [&](int a) {
        std::vector<Part> parts;
        addPosition(parts, t.slot, a, false);
        addPosition(parts, t.of, a, true);
        return parts;
      };
      for (int a = 0; a < 3; ++a)
        for (int c = a; c < 3; ++c)
          couple(difference(a), difference(c), EdgeBlocks::vertex(a, c), t.copy - rod.first_slot, a == c);
    }
  }
  pattern->lasting = source_of.size();
  for (const int place : pattern->touching) {
    const TouchingPair &p = touching_.items[std::size_t(place)];
    const int variables = pattern->turns ? TouchingPair::variables : 6;
    auto parts = [&](int side, int variable) {
      const auto [slot, a] = p.place(side, variable);
      std::vector<Part> parts;
      if (a == 3)
        parts = {{unknown(slot, 3), false}};
      else
        addPosition(parts, slot, a, false);
      return parts;
    };
    for (int i = 0; i < variables; ++i)
      for (int j = 0; j < variables; ++j)
        coupleFrom(EdgeBlocks::touching_place + EdgeBlocks::touching_size * p.number + TouchingPair::variables * i + j,
                   parts(0, i), parts(1, j), false);
  }
  PetscCall(MatCreate(PETSC_COMM_SELF, matrix));
  PetscCall(MatSetSizes(*matrix, unknowns(rods), unknowns(rods), PETSC_DETERMINE, PETSC_DETERMINE));
  PetscCall(MatSetType(*matrix, MATAIJ));
  PetscCall(MatSetFromOptions(*matrix));
  PetscCall(MatSetOption(*matrix, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(*matrix, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  std::vector<PetscInt> rows = row, columns = column; // PETSc sorts them
  PetscCall(MatSetPreallocationCOO(*matrix, PetscCount(rows.size()), rows.data(), columns.data()));
  pattern->entries.resize(source_of.size());
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
