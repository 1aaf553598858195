#include "tendril/solver/condensed.hpp"

#include "tendril/solver/elimination.hpp"
#include "tendril/solver/factor_type.hpp"
#include "tendril/solver/substitution.hpp"

#include <petscblaslapack.h>

#include <Eigen/Dense>

#include <algorithm>
#include <map>
#include <numeric>
#include <tuple>

namespace tendril {
namespace {

template <class T> T *as(double *p) { return reinterpret_cast<T *>(p); }

/// By LAPACK, with pivoting.
class DenseSchur final : public Schur {
public:
  DenseSchur(int size, std::vector<int> rows, std::vector<int> columns)
      : rows_(std::move(rows)), columns_(std::move(columns)), matrix_(size, size), pivots_(size) {}

  bool factor(const std::vector<double> &values) override {
    PetscBLASInt n = PetscBLASInt(pivots_.size()), length = 64 * n, info;
    work_.resize(length);
    matrix_.setZero();
    for (std::size_t k = 0; k < values.size(); ++k) matrix_(rows_[k], columns_[k]) += values[k];
    LAPACKsytrf_("L", &n, matrix_.data(), &n, pivots_.data(), work_.data(), &length, &info);
    negative = 0;
    for (PetscBLASInt k = 0; k < n; ++k)
      if (pivots_[k] > 0)
        negative += matrix_(k, k) < 0;
      else { // a block of two has one of each sign
        ++negative;
        ++k;
      }
    return info == 0;
  }
  void solve(std::vector<double> &x) override {
    PetscBLASInt n = PetscBLASInt(pivots_.size()), one = 1, info;
    LAPACKsytrs_("L", &n, &one, matrix_.data(), &n, pivots_.data(), x.data(), &n, &info);
  }
  const char *kind() const override { return "dense, LAPACK"; }

private:
  std::vector<int> rows_, columns_;
  Eigen::MatrixXd matrix_;
  std::vector<PetscBLASInt> pivots_;
  std::vector<double> work_;
};

/// By PETSc, without pivoting.
class SparseSchur final : public Schur {
public:
  SparseSchur(int size, const std::vector<int> &rows, const std::vector<int> &columns) : size_(size) {
    (void)make(std::vector<PetscInt>(rows.begin(), rows.end()), std::vector<PetscInt>(columns.begin(), columns.end()));
  }
  bool factor(const std::vector<double> &values) override {
    bool regular = false;
    return factorWith(values, &regular) == 0 && regular;
  }
  void solve(std::vector<double> &x) override { (void)solveWith(x); }
  const char *kind() const override { return "sparse, PETSc's Cholesky by minimum degree"; }

private:
  PetscInt size_;
  OwnedMat matrix_, factor_;
  OwnedVec right_, solution_;

  PetscErrorCode make(std::vector<PetscInt> rows, std::vector<PetscInt> columns) {
    IS row, column;
    MatFactorInfo info;
    PetscFunctionBegin;
    PetscCall(MatCreate(PETSC_COMM_SELF, matrix_.out()));
    PetscCall(MatSetSizes(matrix_, size_, size_, size_, size_));
    PetscCall(MatSetType(matrix_, MATSEQAIJ));
    PetscCall(MatSetOption(matrix_, MAT_SYMMETRIC, PETSC_TRUE));
    PetscCall(MatSetPreallocationCOO(matrix_, PetscCount(rows.size()), rows.data(), columns.data()));
    const std::vector<double> none(rows.size(), 0.0);
    PetscCall(MatSetValuesCOO(matrix_, none.data(), INSERT_VALUES));
    PetscCall(MatGetFactor(matrix_, MATSOLVERPETSC, MAT_FACTOR_CHOLESKY, factor_.out()));
    PetscCall(MatGetOrdering(matrix_, MATORDERINGAMD, &row, &column));
    PetscCall(MatFactorInfoInitialize(&info));
    PetscCall(MatCholeskyFactorSymbolic(factor_, matrix_, row, &info));
    PetscCall(ISDestroy(&row));
    PetscCall(ISDestroy(&column));
    PetscCall(MatCreateVecs(matrix_, right_.out(), solution_.out()));
    PetscFunctionReturn(0);
  }
  PetscErrorCode factorWith(const std::vector<double> &values, bool *regular) {
    MatFactorInfo info;
    MatFactorError error;
    PetscInt minus, none, plus;
    PetscFunctionBegin;
    PetscCall(MatSetValuesCOO(matrix_, values.data(), INSERT_VALUES));
    PetscCall(MatFactorInfoInitialize(&info));
    info.zeropivot = 1e-250;
    PetscCall(MatFactorClearError(factor_));
    PetscCall(MatCholeskyFactorNumeric(factor_, matrix_, &info));
    PetscCall(MatFactorGetError(factor_, &error));
    *regular = error == MAT_FACTOR_NOERROR;
    if (!*regular) PetscFunctionReturn(0);
    PetscCall(MatGetInertia(factor_, &minus, &none, &plus));
    negative = int(minus);
    PetscFunctionReturn(0);
  }
  PetscErrorCode solveWith(std::vector<double> &x) {
    const double *out;
    PetscFunctionBegin;
    PetscCall(VecPlaceArray(right_, x.data()));
    PetscCall(MatSolve(factor_, right_, solution_));
    PetscCall(VecResetArray(right_));
    PetscCall(VecGetArrayRead(solution_, &out));
    std::copy_n(out, x.size(), x.begin());
    PetscCall(VecRestoreArrayRead(solution_, &out));
    PetscFunctionReturn(0);
  }
};

constexpr int most_dense = 200; ///< unknowns of a Schur complement

} // namespace

/// Whether a rod that bends runs through a junction without a frame.
static bool runsThrough(const DofMap &dofs, const JoinedVertex &j) {
  const RodRange &rod = dofs.rods()[j.rod];
  if (!rod.twist || j.vertex == 0 || j.vertex == rod.edges) return false;
  const auto edges = dofs.joinedEdges({j.rod, j.rod + 1});
  return std::none_of(edges.begin(), edges.end(), [&](const JoinedEdge &e) { return e.vertex == j.vertex; });
}

bool CondensedFactor::suits(const DofMap &dofs, RodSet rods) {
  for (int r = rods.begin; r < rods.end; ++r)
    if (dofs.rods()[r].closed) return false;
  for (const JoinedVertex &j : dofs.joinedVertices(rods)) {
    if (!runsThrough(dofs, j)) continue;
    if (dofs.isHeld(dofs.rods()[j.rod].first_vertex + j.vertex + 1)) return false;
    for (const JoinedVertex &other : dofs.joinedVertices({j.rod, j.rod + 1}))
      if (other.vertex == j.vertex + 1) return false;
  }
  return true;
}

CondensedFactor::CondensedFactor(const DofMap &dofs, RodSet rods, BandedWorkspace &workspace)
    : dofs_(dofs), rods_(rods), workspace_(workspace) {
  cut();
  std::vector<int> row, column;
  group(row, column);
  entries_.resize(row.size());
  separators_.resize(unknown_.size());
  if (int(unknown_.size()) <= most_dense)
    schur_ = std::make_unique<DenseSchur>(int(unknown_.size()), std::move(row), std::move(column));
  else
    schur_ = std::make_unique<SparseSchur>(int(unknown_.size()), row, column);
}

/// Numbers the unknowns of the junctions, and cuts the rods there.
void CondensedFactor::cut() {
  const PetscInt first = dofs_.firstUnknown(rods_);
  std::map<int, int> number; // of the first of three unknowns, by the slot that has them
  for (const JoinedVertex &j : dofs_.joinedVertices(rods_)) number.try_emplace(j.first_slot, 0);
  for (const JoinedEdge &j : dofs_.joinedEdges(rods_)) number.try_emplace(j.first_frame, 0);
  for (auto &[slot, begin] : number) {
    begin = dofs_.unknown(slot, 0) < 0 ? -1 : int(unknown_.size());
    for (int a = 0; a < 3 && begin >= 0; ++a) unknown_.push_back(int(dofs_.unknown(slot, a) - first));
  }
  std::map<int, int> edge_number; // of the vector and the twist of an edge that a rod runs through with, by its slot
  for (const JoinedVertex &j : dofs_.joinedVertices(rods_)) {
    if (!runsThrough(dofs_, j)) continue;
    edge_number[j.slot] = int(unknown_.size());
    unknown_.insert(unknown_.end(), 3, -1);
    unknown_.push_back(int(dofs_.unknown(j.slot, 3) - first));
  }
  auto places = [&](const JoinedVertex &j, const JoinedEdge *edge) {
    Places p;
    p.fill(-1);
    for (int a = 0; a < 3; ++a) {
      if (const int begin = number.at(j.first_slot); begin >= 0) p[a] = begin + a;
      if (edge) p[edge_at + a] = number.at(edge->first_frame) + a;
    }
    if (const auto through = edge_number.find(j.slot); through != edge_number.end())
      for (int c = 0; c < edge_size; ++c) p[edge_at + c] = through->second + c;
    return p;
  };
  for (int r = rods_.begin; r < rods_.end; ++r) {
    const RodRange &rod = dofs_.rods()[r];
    std::vector<const JoinedVertex *> cuts;
    for (const JoinedVertex &j : dofs_.joinedVertices({r, r + 1})) cuts.push_back(&j);
    std::sort(cuts.begin(), cuts.end(),
              [](const JoinedVertex *a, const JoinedVertex *b) { return a->vertex < b->vertex; });
    auto frameOf = [&](int edge, int vertex) -> const JoinedEdge * {
      for (const JoinedEdge &j : dofs_.joinedEdges({r, r + 1}))
        if (j.edge == edge && j.vertex == vertex) return &j;
      return nullptr;
    };
    const JoinedVertex *near = nullptr;
    auto add = [&](int begin, int end, const JoinedVertex *far) {
      if (begin == end) return;
      Run run{r,  begin, end - begin, near != nullptr, far != nullptr, near && runsThrough(dofs_, *near),
              far && runsThrough(dofs_, *far), {}, {}, nullptr, nullptr, {}};
      run.near.fill(-1);
      run.far.fill(-1);
      if (near) run.near_frame = frameOf(begin, begin);
      if (near) run.near = places(*near, run.near_frame);
      if (far) run.far_frame = frameOf(end - 1, end);
      if (far) run.far = places(*far, run.far_frame);
      for (int v = begin; v <= end; ++v) run.held.push_back(dofs_.isHeld(rod.first_vertex + v));
      if (near) run.held.front() = false; // what a separator is held by is left out of it
      if (far) run.held.back() = false;
      runs_.push_back(std::move(run));
    };
    int begin = 0;
    for (const JoinedVertex *c : cuts) {
      add(begin, c->vertex, c);
      near = c;
      begin = c->vertex;
    }
    add(begin, rod.edges, nullptr);
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
  auto block = [&](const Places &row, const Places &column) {
    for (int r = 0; r < state_size; ++r)
      for (int c = 0; c < state_size; ++c)
        if (row[r] >= 0 && column[c] >= 0) {
          rows.push_back(row[r]);
          columns.push_back(column[c]);
        }
  };
  std::size_t records = 0, values = 0;
  auto close = [&](const int *run, int count, bool packed) {
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
      block(of.near, of.near);
      block(of.near, of.far);
      block(of.far, of.near);
      block(of.far, of.far);
    }
    groups_.push_back(g);
  };
  for (std::size_t k = 0; k < order.size();) {
    std::size_t end = k;
    while (end < order.size() && end < k + lanes && shape(order[end]) == shape(order[k])) ++end;
    if (end - k >= worth_a_pack)
      close(&order[k], int(end - k), true);
    else
      for (std::size_t i = k; i < end; ++i) close(&order[i], 1, false);
    k = end;
  }
  records_.resize(records);
  values_.resize(values);
  own_entries_ = rows.size();
  for (const Run &run : runs_) // what separators have by themselves: last vertices ...
    if (run.to_separator && run.begin + run.edges == dofs_.rods()[run.rod].edges)
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3 && run.far[r] >= 0; ++c) {
          rows.push_back(run.far[r]);
          columns.push_back(run.far[c]);
        }
  for (const Run &run : runs_) // ... and frames
    for (const auto &[frame, places] : {std::pair(run.near_frame, &run.near), std::pair(run.far_frame, &run.far)})
      for (int r = 0; r < 3 && frame; ++r)
        for (int c = 0; c < 3; ++c) {
          rows.push_back((*places)[edge_at + r]);
          columns.push_back((*places)[edge_at + c]);
        }
}

void CondensedFactor::factor(const BandedSystem &system) {
  negative_ = zero_ = 0;
  for (const Group &group : groups_)
    if (group.packed)
      factorGroup<Pack>(group, system);
    else
      factorGroup<double>(group, system);
  std::size_t next = own_entries_;
  auto add = [&](const RodRange &rod, int slot) {
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        double v = system.blocks->entry(rod, EdgeBlocks::vertex(std::min(r, c), std::max(r, c)))[slot - rod.first_slot];
        if (r == c) v += (*system.shift)[rods_.begin] * (*system.metric)[r][slot];
        entries_[next++] = v;
      }
  };
  for (const Run &run : runs_) {
    const RodRange &rod = dofs_.rods()[run.rod];
    if (run.to_separator && run.begin + run.edges == rod.edges && run.far[0] >= 0) add(rod, rod.slot(rod.edges));
  }
  for (const Run &run : runs_)
    for (const JoinedEdge *frame : {run.near_frame, run.far_frame})
      if (frame) add(dofs_.rods()[run.rod], frame->frame);
  regular_ = unknown_.empty() || schur_->factor(entries_);
  if (!unknown_.empty()) negative_ += schur_->negative;
}

template <class T>
void CondensedFactor::addEntries(const Group &group, const Block<T> &near, const Block<T> &between,
                                 const Block<T> &far) {
  for (int l = 0; l < group.count; ++l) {
    const Run &run = runs_[group.run[l]];
    double *to = entries_.data() + group.entry[l];
    auto put = [&](const Places &row, const Places &column, auto value) {
      for (int r = 0; r < state_size; ++r)
        for (int c = 0; c < state_size; ++c)
          if (row[r] >= 0 && column[c] >= 0) {
            if constexpr (std::is_same_v<T, Pack>)
              *to++ = value(r, c)[l];
            else
              *to++ = value(r, c);
          }
    };
    put(run.near, run.near, [&](int r, int c) { return near[std::min(r, c)][std::max(r, c)]; });
    put(run.near, run.far, [&](int r, int c) { return between[r][c]; });
    put(run.far, run.near, [&](int r, int c) { return between[c][r]; });
    put(run.far, run.far, [&](int r, int c) { return far[std::min(r, c)][std::max(r, c)]; });
  }
}

template <class T> void CondensedFactor::factorGroup(const Group &group, const BandedSystem &system) {
  const Run &first = runs_[group.run[0]];
  const int end = first.edges;
  std::array<const double *, lanes> source{}, mass{}, spin{}, edge{};
  std::array<std::ptrdiff_t, lanes> stride{};
  std::array<bool, lanes> cable{};
  std::array<std::array<const double *, lanes>, 2> tie{}; // of the first and the last edge to frames
  const double shift = (*system.shift)[rods_.begin];
  constexpr int width = std::is_same_v<T, Pack> ? lanes : 1;
  for (int l = 0; l < width; ++l) {
    const Run &run = runs_[group.run[l]];
    const RodRange &rod = dofs_.rods()[run.rod];
    source[l] = system.blocks->entry(rod, 0) + run.begin;
    stride[l] = rod.slots;
    mass[l] = (*system.metric)[0] + rod.slot(run.begin);
    spin[l] = (*system.metric)[3] + rod.slot(run.begin);
    edge[l] = system.edge_metric ? system.edge_metric + rod.slot(run.begin) : nullptr;
    cable[l] = !rod.twist;
    for (const int k : {0, 1})
      if (const JoinedEdge *frame = k == 0 ? run.near_frame : run.far_frame)
        tie[k][l] = system.blocks->entry(rod, 0) + (frame->cell - rod.first_slot);
  }
  auto make = [&](auto of_lane) {
    if constexpr (std::is_same_v<T, Pack>)
      return Pack([&](auto lane) { return of_lane(int(lane)); });
    else
      return of_lane(0);
  };
  auto isAcross = [](int plane) { return plane >= EdgeBlocks::across(0, 0) && plane < EdgeBlocks::vertex(0, 0); };
  auto atEnds = [&](int plane, int i) {
    return isAcross(plane) && ((i == 0 && first.from_separator && !first.from_through) ||
                               (i == end && first.to_separator && !first.to_through));
  };
  auto fromTie = [&](int plane, int i) {
    const int row = (plane - edge_pairs) / edge_size, column = (plane - edge_pairs) % edge_size,
              turn = i == 0 ? row : column, variable = i == 0 ? column : row;
    return make([&](int l) {
      const double *from = tie[i == 0 ? 0 : 1][l];
      return from && turn < 3 ? from[EdgeBlocks::across(turn, variable) * stride[l]] : 0.0;
    });
  };
  auto plain = [&](int plane, int i) {
    if (atEnds(plane, i)) return fromTie(plane, i);
    return make([&](int l) { return source[l][plane * stride[l] + i]; });
  };
  auto rare = [&](int plane, int i) { // with shifts, and cables, whose twist is no unknown
    if (atEnds(plane, i)) return fromTie(plane, i);
    return make([&](int l) {
      double v = source[l][plane * stride[l] + i];
      if (plane == EdgeBlocks::own(3, 3))
        v += cable[l] ? 1.0 : shift * spin[l][i];
      else if (plane == EdgeBlocks::vertex(0, 0) || plane == EdgeBlocks::vertex(1, 1) ||
               plane == EdgeBlocks::vertex(2, 2))
        v += shift * mass[l][i];
      else if (edge[l] && i < end &&
               (plane == EdgeBlocks::own(0, 0) || plane == EdgeBlocks::own(1, 1) || plane == EdgeBlocks::own(2, 2)))
        v += shift * edge[l][i];
      return v;
    });
  };
  T *const vertex = as<T>(&records_[group.record]), *const records = vertex + bordered_vertex_record;
  T negative(0.0), zero(0.0);
  auto eliminate = [&]<Border border, bool joins>(const auto &read) {
    Elimination<T, border, joins, std::decay_t<decltype(read)>> elimination({0, end, first.from_through}, first.held, read, records);
    Block<T> near{}, between{}, far{};
    if (first.from_separator)
      elimination.runTo(near, between, far, vertex);
    else
      elimination.run(far, vertex);
    addEntries<T>(group, near, between, far);
    negative = elimination.negative;
    zero = elimination.zero;
  };
  const bool is_rare = shift != 0 || std::any_of(cable.begin(), cable.begin() + width, [](bool c) { return c; });
  auto choose = [&]<Border border>() {
    if (system.blocks->joins())
      eliminate.template operator()<border, true>(rare);
    else if (is_rare)
      eliminate.template operator()<border, false>(rare);
    else
      eliminate.template operator()<border, false>(plain);
  };
  first.to_separator ? choose.template operator()<Border::separator>() : choose.template operator()<Border::none>();
  for (int l = 0; l < group.count; ++l)
    if constexpr (std::is_same_v<T, Pack>) {
      negative_ += int(negative[l]);
      zero_ += int(zero[l]);
    } else {
      negative_ += int(negative);
      zero_ += int(zero);
    }
}

/// Calls visit(value, unknown) for all values of a group's slots; the unknown is -1 where a separator has it, or none.
template <class T, class Visit> void CondensedFactor::eachValue(const Group &group, Visit visit) {
  constexpr int step = sizeof(T) / sizeof(double);
  const PetscInt first = dofs_.firstUnknown(rods_);
  for (int l = 0; l < group.count; ++l) {
    const Run &run = runs_[group.run[l]];
    const RodRange &rod = dofs_.rods()[run.rod];
    double *v = &values_[group.value] + l;
    for (int i = 0; i <= run.edges; ++i) {
      const bool separated = (i == 0 && run.from_separator) || (i == run.edges && run.to_separator);
      for (int a = 0; a < slot_size; ++a, v += step) {
        const bool none = a < 3 ? separated : i == run.edges || (i == 0 && run.from_through);
        const PetscInt u = none ? -1 : dofs_.unknown(rod.slot(run.begin + i), a);
        visit(*v, u < 0 ? -1 : u - first);
      }
    }
  }
}

void CondensedFactor::solve(const PetscScalar *b, PetscScalar *x) {
  const PetscInt unknowns = dofs_.unknowns(rods_);
  if (x == b) {
    workspace_.copy.assign(b, b + unknowns);
    b = workspace_.copy.data();
  }
  for (std::size_t k = 0; k < unknown_.size(); ++k) separators_[k] = unknown_[k] < 0 ? 0 : b[unknown_[k]];
  for (const Group &group : groups_) group.packed ? solveTo<Pack>(group, b) : solveTo<double>(group, b);
  if (!unknown_.empty()) schur_->solve(separators_);
  for (std::size_t k = 0; k < unknown_.size(); ++k)
    if (unknown_[k] >= 0) x[unknown_[k]] = separators_[k];
  for (const Group &group : groups_) group.packed ? solveFrom<Pack>(group, x) : solveFrom<double>(group, x);
}

/// What runs add to the right-hand side of the separators.
template <class T> void CondensedFactor::solveTo(const Group &group, const PetscScalar *b) {
  const Run &first = runs_[group.run[0]];
  eachValue<T>(group, [&](double &value, PetscInt u) { value = u < 0 ? 0 : b[u]; });
  const T *const vertex = as<T>(&records_[group.record]), *const records = vertex + bordered_vertex_record;
  T near[state_size], far[state_size];
  T *const values = as<T>(&values_[group.value]);
  auto go = [&]<Border border>() {
    Substitution<T, border>({0, first.edges, first.from_through}, first.held, records, vertex).toFirst(values, near, far);
  };
  first.to_separator ? go.template operator()<Border::separator>() : go.template operator()<Border::none>();
  if (!first.from_separator) {
    if (first.held[0]) std::fill_n(near, 3, T(0.0));
    if (first.to_separator)
      for (int c = 0; c < state_size; ++c)
        for (int r = 0; r < 3; ++r) far[c] -= vertex[vertex_record + r * state_size + c] * near[r];
    if (!first.held[0]) solveSmall<3>(vertex, vertex + 3, near);
    std::copy_n(near, 3, values + slot_size * (first.edges + 1));
  }
  for (int l = 0; l < group.count; ++l) {
    const Run &run = runs_[group.run[l]];
    auto lane = [&](const T &v) {
      if constexpr (std::is_same_v<T, Pack>)
        return double(v[l]);
      else
        return v;
    };
    for (int k = 0; k < state_size; ++k) {
      if (run.near[k] >= 0) separators_[run.near[k]] += lane(near[k]);
      if (run.far[k] >= 0) separators_[run.far[k]] += lane(far[k]);
    }
  }
}

template <class T> void CondensedFactor::solveFrom(const Group &group, PetscScalar *x) {
  const Run &first = runs_[group.run[0]];
  const T *const vertex = as<T>(&records_[group.record]), *const records = vertex + bordered_vertex_record;
  T near[state_size], far[state_size];
  T *const values = as<T>(&values_[group.value]);
  auto ends = [&](const Places Run::*places, T (&to)[state_size]) {
    for (int k = 0; k < state_size; ++k) {
      auto of_lane = [&](int l) {
        const int place = (runs_[group.run[l]].*places)[k];
        return place < 0 ? 0.0 : separators_[place];
      };
      if constexpr (std::is_same_v<T, Pack>)
        to[k] = Pack([&](auto l) { return of_lane(int(l)); });
      else
        to[k] = of_lane(0);
    }
  };
  ends(&Run::near, near);
  ends(&Run::far, far);
  for (int r = 0; r < 3 && !first.from_separator; ++r) {
    near[r] = values[slot_size * (first.edges + 1) + r];
    for (int c = 0; c < state_size && first.to_separator; ++c)
      near[r] -= vertex[vertex_record + r * state_size + c] * far[c];
  }
  auto go = [&]<Border border>() {
    Substitution<T, border>({0, first.edges, first.from_through}, first.held, records, vertex).fromFirst(near, far, values);
  };
  first.to_separator ? go.template operator()<Border::separator>() : go.template operator()<Border::none>();
  eachValue<T>(group, [&](double &value, PetscInt u) {
    if (u >= 0) x[u] = value;
  });
}

PetscErrorCode registerCondensed() { return FactorType<CondensedFactor>::add(); }
bool canCondense(const DofMap &dofs, RodSet rods) { return CondensedFactor::suits(dofs, rods); }

PetscErrorCode CondensedFactor::view(PetscViewer viewer) const {
  PetscFunctionBegin;
  PetscCall(PetscViewerASCIIPrintf(viewer, "  %d runs of rods between %d unknowns of junctions: their Schur complement is %s\n",
                                   int(runs_.size()), int(unknown_.size()), schur_->kind()));
  PetscFunctionReturn(0);
}

} // namespace tendril
