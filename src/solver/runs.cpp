/// How `condensed` cuts rods into runs, and which it factors together.
#include "tendril/solver/condensed.hpp"

#include <algorithm>
#include <numeric>
#include <span>
#include <tuple>

namespace tendril {

/// Whether a rod that bends runs through a junction without a frame.
static bool runsThrough(const DofMap &dofs, const JoinedVertex &j) {
  const RodRange &rod = dofs.rods()[j.rod];
  if (!rod.bends || j.vertex == 0 || j.vertex == rod.edges) return false;
  const auto edges = dofs.joinedEdges({j.rod, j.rod + 1});
  return std::none_of(edges.begin(), edges.end(), [&](const JoinedEdge &e) { return e.vertex == j.vertex; });
}

bool CondensedFactor::suits(const DofMap &dofs, RodSet rods) {
  for (int r = rods.begin; r < rods.end; ++r)
    if (dofs.rods()[r].closed) return false;
  for (const JoinedEdge &j : dofs.joinedEdges(rods))
    if (j.vertex < 0) return false;
  for (const JoinedVertex &j : dofs.joinedVertices(rods)) {
    if (!j.isVertex()) return false;
    if (!runsThrough(dofs, j)) continue;
    if (dofs.isHeld(dofs.rods()[j.rod].first_vertex + j.vertex + 1)) return false;
    for (const JoinedVertex &other : dofs.joinedVertices({j.rod, j.rod + 1}))
      if (other.vertex == j.vertex + 1) return false;
  }
  return true;
}

bool CondensedFactor::pays(const DofMap &dofs, RodSet rods) {
  constexpr int most = 800; // nets of scissors, docs/performance.md
  const auto joined = dofs.joinedVertices(rods);
  return std::count_if(joined.begin(), joined.end(),
                       [&](const JoinedVertex &j) { return j.isVertex() && runsThrough(dofs, j); }) <= most;
}

/// Numbers the unknowns of the junctions: the first of three, or -1, by the slot that has them.
std::map<int, int> CondensedFactor::numberJunctions() {
  const PetscInt first = dofs_.firstUnknown(rods_);
  std::map<int, int> number;
  for (const JoinedVertex &j : dofs_.joinedVertices(rods_)) number.try_emplace(j.first_slot, 0);
  for (const JoinedEdge &j : dofs_.joinedEdges(rods_)) number.try_emplace(j.first_frame, 0);
  for (const JoinedBody &b : dofs_.bodies(rods_))
    for (const int slot : {b.position, b.rotation}) number.try_emplace(slot, 0);
  for (auto &[slot, begin] : number) {
    begin = dofs_.unknown(slot, 0) < 0 ? -1 : int(unknown_.size());
    for (int a = 0; a < 3 && begin >= 0; ++a) unknown_.push_back(int(dofs_.unknown(slot, a) - first));
  }
  return number;
}

/// Numbers the vector and the twist of an edge that a rod runs through with, by its slot.
std::map<int, int> CondensedFactor::numberEdgesThrough() {
  std::map<int, int> number;
  for (const JoinedVertex &j : dofs_.joinedVertices(rods_)) {
    if (!runsThrough(dofs_, j)) continue;
    number[j.slot] = int(unknown_.size());
    unknown_.insert(unknown_.end(), 3, -1);
    if (dofs_.rods()[j.rod].twist) unknown_.push_back(int(dofs_.unknown(j.slot, 3) - dofs_.firstUnknown(rods_)));
  }
  return number;
}

/// Where the variables of a cut are. \param edge that is tied to a frame there, or null
CondensedFactor::Places CondensedFactor::placesOf(const JoinedVertex &j, const JoinedEdge *edge,
                                                  const Numbers &numbers) const {
  Places p;
  p.fill(-1);
  for (int a = 0; a < 3; ++a) {
    if (const int begin = numbers.junction.at(j.first_slot); begin >= 0) p[a] = begin + a;
    if (edge) p[edge_at + a] = numbers.junction.at(edge->first_frame) + a;
    if (j.isOnBody()) p[state_size + a] = numbers.junction.at(j.first_frame) + a;
  }
  if (const auto through = numbers.edge.find(j.slot); through != numbers.edge.end())
    for (int c = 0; c < edge_size; ++c)
      if (dofs_.rods()[j.rod].has(c)) p[edge_at + c] = through->second + c;
  return p;
}

/// The edges of a rod from one cut, or end, to the next.
CondensedFactor::Run CondensedFactor::makeRun(int rod, int begin, int end, const JoinedVertex *near,
                                              const JoinedVertex *far, const Numbers &numbers) const {
  auto frameOf = [&](int edge, int vertex) -> const JoinedEdge * {
    for (const JoinedEdge &j : dofs_.joinedEdges({rod, rod + 1}))
      if (j.edge == edge && j.vertex == vertex) return &j;
    return nullptr;
  };
  Run run{rod,
          begin,
          end - begin,
          near != nullptr,
          far != nullptr,
          near && runsThrough(dofs_, *near),
          far && runsThrough(dofs_, *far),
          {},
          {},
          nullptr,
          nullptr,
          near && near->isOnBody() ? near : nullptr,
          far && far->isOnBody() ? far : nullptr,
          {}};
  run.near.fill(-1);
  run.far.fill(-1);
  if (near) run.near_frame = frameOf(begin, begin);
  if (near) run.near = placesOf(*near, run.near_frame, numbers);
  if (far) run.far_frame = frameOf(end - 1, end);
  if (far) run.far = placesOf(*far, run.far_frame, numbers);
  for (int v = begin; v <= end; ++v) run.held.push_back(dofs_.isHeld(dofs_.rods()[rod].first_vertex + v));
  if (near) run.held.front() = false; // what a separator is held by is left out of it
  if (far) run.held.back() = false;
  return run;
}

/// Numbers the unknowns of the junctions, and cuts the rods there.
void CondensedFactor::cut() {
  Numbers numbers;
  numbers.junction = numberJunctions();
  numbers.edge = numberEdgesThrough();
  for (int r = rods_.begin; r < rods_.end; ++r) {
    std::vector<const JoinedVertex *> cuts;
    for (const JoinedVertex &j : dofs_.joinedVertices({r, r + 1})) cuts.push_back(&j);
    std::sort(cuts.begin(), cuts.end(),
              [](const JoinedVertex *a, const JoinedVertex *b) { return a->vertex < b->vertex; });
    const JoinedVertex *near = nullptr;
    int begin = 0;
    auto add = [&](int end, const JoinedVertex *far) {
      if (begin != end) runs_.push_back(makeRun(r, begin, end, near, far, numbers));
    };
    for (const JoinedVertex *c : cuts) {
      add(c->vertex, c);
      near = c;
      begin = c->vertex;
    }
    add(dofs_.rods()[r].edges, nullptr);
  }
}

/// What rows and columns have between them, in order, but for those that are none.
static void addBlock(std::span<const int> row, std::span<const int> column, std::vector<int> &rows,
                     std::vector<int> &columns) {
  for (const int r : row)
    for (const int c : column)
      if (r >= 0 && c >= 0) {
        rows.push_back(r);
        columns.push_back(c);
      }
}

/// Those that three unknowns have between them.
static void addOwn(std::array<int, 3> place, std::vector<int> &rows, std::vector<int> &columns) {
  for (const int r : place)
    for (const int c : place) {
      rows.push_back(r);
      columns.push_back(c);
    }
}

/// Makes a group of runs. \param records, values where its own begin, and then where they end
void CondensedFactor::addGroup(const int *run, int count, bool packed, std::size_t &records, std::size_t &values,
                               std::vector<int> &rows, std::vector<int> &columns) {
  Group g{};
  g.count = count;
  g.packed = packed;
  for (int l = 0; l < lanes; ++l) g.run[l] = run[l < count ? l : 0];
  const Run &one = runs_[run[0]];
  const std::size_t wide = packed ? lanes : 1;
  auto perEdge = [&]<class T>(T) { return one.to_separator ? Record<T>::bordered : Record<T>::plain; };
  g.record = records;
  g.value = values;
  records += wide * (bordered_vertex_record + one.edges * std::size_t(packed ? perEdge(Pack()) : perEdge(0.0)));
  // Behind, the first vertex while separators are solved for; packs begin at their multiples.
  values += wide * ((slot_size * (one.edges + 2) + lanes - 1) / lanes * lanes);
  for (int l = 0; l < count; ++l) {
    const Run &of = runs_[run[l]];
    g.entry[l] = int(rows.size());
    for (const Places *row : {&of.near, &of.far})
      for (const Places *column : {&of.near, &of.far}) addBlock(*row, *column, rows, columns);
  }
  groups_.push_back(g);
}

/// Where what separators have by themselves goes: last vertices, frames, pairs of bodies and bodies.
void CondensedFactor::addOwnEntries(std::vector<int> &rows, std::vector<int> &columns) const {
  const PetscInt first_unknown = dofs_.firstUnknown(rods_);
  auto numberOf = [&](PetscInt unknown) {
    return int(std::find(unknown_.begin(), unknown_.end(), int(unknown - first_unknown)) - unknown_.begin());
  };
  for (const Run &run : runs_) {
    if (!run.to_separator || run.begin + run.edges != dofs_.rods()[run.rod].edges || run.far[0] < 0) continue;
    Places places = run.far;
    std::fill_n(places.begin() + 3, state_size - 3, -1);
    addBlock(places, places, rows, columns);
  }
  for (const Run &run : runs_)
    for (const auto &[frame, places] : {std::pair(run.near_frame, &run.near), std::pair(run.far_frame, &run.far)})
      if (frame) addOwn({(*places)[edge_at], (*places)[edge_at + 1], (*places)[edge_at + 2]}, rows, columns);
  for (const BodyPair &p : dofs_.pairs(rods_))
    for (int r = 0; r < p.variables(); ++r)
      for (int c = 0; c < p.variables(); ++c) {
        const auto [slot, a] = p.place(r);
        const auto [other, b] = p.place(c);
        rows.push_back(numberOf(dofs_.unknown(slot, a)));
        columns.push_back(numberOf(dofs_.unknown(other, b)));
      }
  for (const JoinedBody &b : dofs_.bodies(rods_))
    for (const int slot : {b.position, b.rotation}) {
      const int first = numberOf(dofs_.unknown(slot, 0));
      addOwn({first, first + 1, first + 2}, rows, columns);
    }
}

/// Runs of one shape together, a pack of them where that is cheaper, and where their parts of the Schur complement go.
void CondensedFactor::group(std::vector<int> &rows, std::vector<int> &columns) {
  constexpr int worth_a_pack = 3;
  std::vector<int> order(runs_.size());
  std::iota(order.begin(), order.end(), 0);
  auto shape = [&](int k) {
    const Run &run = runs_[k];
    return std::tie(run.edges, run.from_separator, run.to_separator, run.from_through, run.to_through, run.held);
  };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return shape(a) < shape(b); });
  std::size_t records = 0, values = 0;
  for (std::size_t k = 0; k < order.size();) {
    std::size_t end = k;
    while (end < order.size() && end < k + lanes && shape(order[end]) == shape(order[k])) ++end;
    if (end - k >= worth_a_pack)
      addGroup(&order[k], int(end - k), true, records, values, rows, columns);
    else
      for (std::size_t i = k; i < end; ++i) addGroup(&order[i], 1, false, records, values, rows, columns);
    k = end;
  }
  records_.resize(records);
  values_.resize(values);
  own_entries_ = rows.size();
  addOwnEntries(rows, columns);
}

} // namespace tendril
