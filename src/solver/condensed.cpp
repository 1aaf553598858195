#include "tendril/solver/condensed.hpp"

#include "tendril/solver/factor_type.hpp"
#include "tendril/solver/substitution.hpp"

#include <algorithm>

namespace tendril {
namespace {

template <class T> T *valuesAs(double *p) { return reinterpret_cast<T *>(p); }

} // namespace

// condensed_packs.cpp and condensed_runs.cpp: they take long to compile.
extern template void CondensedFactor::factorGroup<Pack>(const Group &, const BandedSystem &);
extern template void CondensedFactor::factorGroup<double>(const Group &, const BandedSystem &);

CondensedFactor::CondensedFactor(const DofMap &dofs, RodSet rods, BandedWorkspace &workspace)
    : dofs_(dofs), rods_(rods), workspace_(workspace) {
  cut();
  std::vector<int> row, column;
  group(row, column);
  entries_.resize(row.size());
  separators_.resize(unknown_.size());
  schur_ = makeSchur(int(unknown_.size()), std::move(row), std::move(column));
}

void CondensedFactor::factor(const BandedSystem &system) {
  negative_ = zero_ = 0;
  for (const Group &group : groups_)
    if (group.packed)
      factorGroup<Pack>(group, system);
    else
      factorGroup<double>(group, system);
  std::size_t next = own_entries_;
  auto ownBlock = [&](const RodRange &rod, int slot) {
    Mat3 block;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) {
        block(r, c) =
            system.blocks->entry(rod, EdgeBlocks::vertex(std::min(r, c), std::max(r, c)))[slot - rod.first_slot];
        if (r == c) block(r, c) += (*system.shift)[rods_.begin] * (*system.metric)[r][slot];
      }
    return block;
  };
  auto add = [&](const auto &block) {
    for (int r = 0; r < block.rows(); ++r)
      for (int c = 0; c < block.cols(); ++c) entries_[next++] = block(r, c);
  };
  for (const Run &run : runs_) {
    const RodRange &rod = dofs_.rods()[run.rod];
    if (!run.to_separator || run.begin + run.edges != rod.edges || run.far[0] < 0) continue;
    const Mat3 block = ownBlock(rod, rod.slot(rod.edges));
    if (!run.far_point) {
      add(block);
      continue;
    }
    Eigen::Matrix<double, 3, 6> by; // of the body
    by << Mat3::Identity(), -crossMatrix<double>(armOf(run.far_point));
    add((by.transpose() * block * by).eval());
  }
  for (const Run &run : runs_)
    for (const JoinedEdge *frame : {run.near_frame, run.far_frame})
      if (frame) add(ownBlock(dofs_.rods()[run.rod], frame->frame));
  for (const BodyPair &p : dofs_.pairs(rods_))
    for (int r = 0; r < p.variables(); ++r)
      for (int c = 0; c < p.variables(); ++c) {
        const RodRange &rod = dofs_.rods()[p.rod];
        const auto [plane, slot] = EdgeBlocks::pair(std::min(r, c), std::max(r, c));
        entries_[next++] = system.blocks->entry(rod, plane)[p.first + slot - rod.first_slot];
      }
  for (const JoinedBody &b : dofs_.bodies(rods_))
    for (const int slot : {b.position, b.rotation}) add(ownBlock(dofs_.rods()[b.rod], slot));
  regular_ = unknown_.empty() || schur_->factor(entries_);
  if (!unknown_.empty()) negative_ += schur_->negative;
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
  const T *const vertex = valuesAs<T>(&records_[group.record]), *const records = vertex + bordered_vertex_record;
  T near[state_size], far[state_size];
  T *const values = valuesAs<T>(&values_[group.value]);
  auto go = [&]<Border border>() {
    Substitution<T, border>({0, first.edges, first.from_through}, first.held, records, vertex)
        .toFirst(values, near, far);
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
    auto turn = [&](const JoinedVertex *point, const Places &places, const T *force) {
      if (!point) return;
      const Vec3 moment = armOf(point).cross(Vec3(lane(force[0]), lane(force[1]), lane(force[2])));
      for (int a = 0; a < 3; ++a) separators_[places[state_size + a]] += moment[a];
    };
    turn(run.near_point, run.near, near);
    turn(run.far_point, run.far, far);
  }
}

template <class T> void CondensedFactor::solveFrom(const Group &group, PetscScalar *x) {
  const Run &first = runs_[group.run[0]];
  const T *const vertex = valuesAs<T>(&records_[group.record]), *const records = vertex + bordered_vertex_record;
  T near[state_size], far[state_size];
  T *const values = valuesAs<T>(&values_[group.value]);
  auto ends = [&](const Places Run::*places, const JoinedVertex *Run::*point, T(&to)[state_size]) {
    for (int k = 0; k < state_size; ++k) {
      auto of_lane = [&](int l) {
        const Run &run = runs_[group.run[l]];
        const Places &at = run.*places;
        if (at[k] < 0) return 0.0;
        double value = separators_[at[k]];
        if (k >= 3 || !(run.*point)) return value;
        const Vec3 arm = armOf(run.*point);
        const int b = (k + 1) % 3, c = (k + 2) % 3; // spin x arm
        return value + separators_[at[state_size + b]] * arm[c] - separators_[at[state_size + c]] * arm[b];
      };
      if constexpr (std::is_same_v<T, Pack>)
        to[k] = Pack([&](auto l) { return of_lane(int(l)); });
      else
        to[k] = of_lane(0);
    }
  };
  ends(&Run::near, &Run::near_point, near);
  ends(&Run::far, &Run::far_point, far);
  for (int r = 0; r < 3 && !first.from_separator; ++r) {
    near[r] = values[slot_size * (first.edges + 1) + r];
    for (int c = 0; c < state_size && first.to_separator; ++c)
      near[r] -= vertex[vertex_record + r * state_size + c] * far[c];
  }
  auto go = [&]<Border border>() {
    Substitution<T, border>({0, first.edges, first.from_through}, first.held, records, vertex)
        .fromFirst(near, far, values);
  };
  first.to_separator ? go.template operator()<Border::separator>() : go.template operator()<Border::none>();
  eachValue<T>(group, [&](double &value, PetscInt u) {
    if (u >= 0) x[u] = value;
  });
}

PetscErrorCode registerCondensed() { return FactorType<CondensedFactor>::add(); }

PetscErrorCode CondensedFactor::view(PetscViewer viewer) const {
  PetscFunctionBegin;
  PetscCall(PetscViewerASCIIPrintf(viewer,
                                   "  %d runs of rods between %d unknowns of junctions: their Schur complement is %s\n",
                                   int(runs_.size()), int(unknown_.size()), schur_->kind()));
  PetscFunctionReturn(0);
}

} // namespace tendril
