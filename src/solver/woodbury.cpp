#include "tendril/solver/woodbury.hpp"

#include "tendril/solver/factor_type.hpp"

#include <Eigen/Dense>

#include <algorithm>

namespace tendril {
namespace {

/// Ties that the rod has that has most.
int mostTies(const DofMap &dofs, RodSet rods) {
  std::unordered_map<int, int> count;
  int most = 0;
  for (const Tie &t : dofs.ties(rods))
    for (const int r : {t.rod, t.to_rod}) most = std::max(most, ++count[r]);
  return most;
}

} // namespace

WoodburyFactor::WoodburyFactor(const DofMap &dofs, RodSet rods, BandedWorkspace &workspace) : dofs_(dofs), rods_(rods) {
  const bool separate = dofs.joinedVertices(rods).empty();
  if (separate)
    banded_.emplace(dofs, rods, workspace);
  else
    condensed_.emplace(dofs, rods, workspace);
  const auto first_slot = dofs.firstSlots(rods);
  groups_.resize(separate ? rods.end - rods.begin : 1);
  for (const Tie &t : dofs.ties(rods)) {
    const int tie = int(unknown_.size());
    auto &ends = unknown_.emplace_back();
    for (const int end : {0, 1}) {
      const int slot = end == 0 ? t.slot : t.of, rod = end == 0 ? t.rod : t.to_rod;
      const auto found = first_slot.find(slot);
      for (int a = 0; a < 3; ++a) {
        const PetscInt u = dofs.unknown(found == first_slot.end() ? slot : found->second, a);
        ends[end][a] = u < 0 ? -1 : int(u - dofs.firstUnknown(rods));
      }
      std::vector<Part> &group = groups_[separate ? rod - rods.begin : 0];
      if (group.empty() || group.back().tie != tie) group.push_back({tie, {false, false}});
      group.back().has[end] = true;
    }
  }
  direction_.resize(unknown_.size());
  right_.resize(dofs.unknowns(rods));
  part_.resize(right_.size());
}

bool WoodburyFactor::suits(const DofMap &dofs, RodSet rods) {
  return !dofs.ties(rods).empty() && dofs.bodies(rods).empty() &&
         (dofs.joinedVertices(rods).empty() || CondensedFactor::suits(dofs, rods));
}

/// By what was measured (docs/performance.md, Joined rods): the capacitance, solves for its columns, and MUMPS [s].
bool WoodburyFactor::pays(const DofMap &dofs, RodSet rods) {
  double edges = 0;
  for (int r = rods.begin; r < rods.end; ++r) edges += dofs.rods()[r].edges;
  const double columns = 3.0 * double(dofs.ties(rods).size()),
               solves = dofs.joinedVertices(rods).empty() ? 3.0 * mostTies(dofs, rods) : columns;
  return 1.25e-10 * std::pow(columns, 3) + 2.5e-8 * solves * edges < 8e-6 * edges;
}

/// Calls visit(unknown, value) for the entries of a column that one of its parts has.
template <class Visit> void WoodburyFactor::eachEntry(const Part &part, int column, Visit visit) const {
  const Vec3 along = direction_[part.tie].col(column % 3);
  for (const int end : {0, 1})
    for (int a = 0; a < 3 && part.has[end]; ++a)
      if (const int u = unknown_[part.tie][end][a]; u >= 0) visit(u, column < 3 && end == 1 ? -along[a] : along[a]);
}

void WoodburyFactor::make(Capacitance &c, int columns) {
  if (c.columns > 0) return;
  c.columns = columns;
  std::vector<int> row, column;
  for (const std::vector<Part> &group : groups_)
    for (const Part &i : group)
      for (int a = 0; a < columns; ++a)
        for (const Part &j : group)
          for (int b = 0; b < columns; ++b) {
            row.push_back(columns * j.tie + b);
            column.push_back(columns * i.tie + a);
          }
  const int size = columns * int(unknown_.size());
  for (int k = 0; k < size; ++k) {
    row.push_back(k);
    column.push_back(k);
  }
  c.entries.resize(row.size());
  c.matrix = makeDense(size, std::move(row), std::move(column));
}

/// Solves for one column of every group at once, and takes what it has with all columns of its group.
void WoodburyFactor::fillCapacitance() {
  const int columns = now_->columns;
  std::size_t most = 0;
  for (const std::vector<Part> &group : groups_) most = std::max(most, group.size());
  for (std::size_t k = 0; k < most * columns; ++k) {
    std::fill(right_.begin(), right_.end(), 0.0);
    for (const std::vector<Part> &group : groups_)
      if (k / columns < group.size())
        eachEntry(group[k / columns], int(k % columns), [&](int u, double v) { right_[u] += v; });
    base([&](auto &f) { f.solve(right_.data(), part_.data()); });
    std::size_t begin = 0; // of the entries of a group
    for (const std::vector<Part> &group : groups_) {
      const std::size_t wide = columns * group.size();
      if (k < wide)
        for (std::size_t j = 0; j < wide; ++j) {
          double sum = 0;
          eachEntry(group[j / columns], int(j % columns), [&](int u, double v) { sum += v * part_[u]; });
          now_->entries[begin + k * wide + j] = sum;
        }
      begin += wide * wide;
    }
  }
  for (std::size_t k = 0; k < coefficient_.size(); ++k)
    now_->entries[now_->entries.size() - coefficient_.size() + k] = 1 / coefficient_[k];
}

/// Factors the rods with springs from all tied vertices to the ground. \return their stiffness [N/m]
double WoodburyFactor::factorLifted(const BandedSystem &system) {
  // As stiff as what the ties are in the mean: far from it, digits are lost.
  double stiffness = 0;
  const auto ties = dofs_.ties(rods_);
  for (const Tie &t : ties) {
    const RodRange &rod = dofs_.rods()[t.rod];
    for (int a = 0; a < 3; ++a)
      stiffness += std::abs(system.blocks->entry(rod, EdgeBlocks::vertex(a, a))[t.copy - rod.first_slot]);
  }
  stiffness /= 3 * double(ties.size());
  EdgeBlocks blocks = *system.blocks;
  for (const Tie &t : ties)
    for (const auto &[r, slot] : {std::pair(t.rod, t.slot), std::pair(t.to_rod, t.of)}) {
      const RodRange &rod = dofs_.rods()[r];
      for (int a = 0; a < 3; ++a) blocks.entry(rod, EdgeBlocks::vertex(a, a))[slot - rod.first_slot] += stiffness;
    }
  BandedSystem lifted = system;
  lifted.blocks = &blocks;
  base([&](auto &f) { f.factor(lifted); });
  return stiffness;
}

void WoodburyFactor::factor(const BandedSystem &system) {
  base([&](auto &f) { f.factor(system); });
  double lift = 0;
  if (base([](auto &f) { return f.zero() > 0 || !f.isRegular(); })) lift = factorLifted(system);
  now_ = lift > 0 ? &lifted_ : &plain_;
  make(*now_, lift > 0 ? 6 : 3);
  const auto ties = dofs_.ties(rods_);
  coefficient_.resize(now_->columns * ties.size());
  int positive = 0;
  for (std::size_t k = 0; k < ties.size(); ++k) {
    const Tie &t = ties[k];
    const RodRange &rod = dofs_.rods()[t.rod];
    Mat3 hessian;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        hessian(r, c) =
            system.blocks->entry(rod, EdgeBlocks::vertex(std::min(r, c), std::max(r, c)))[t.copy - rod.first_slot];
    const Eigen::SelfAdjointEigenSolver<Mat3> eigen(hessian);
    direction_[k] = eigen.eigenvectors();
    const double least = 1e-12 * std::max(eigen.eigenvalues().cwiseAbs().maxCoeff(), 1e-200); // stands for none
    for (int c = 0; c < now_->columns; ++c) {
      double value = c < 3 ? eigen.eigenvalues()[c] - 0.5 * lift : -0.5 * lift;
      if (std::abs(value) < least) value = least;
      coefficient_[now_->columns * k + c] = value;
      positive += value > 0;
    }
  }
  fillCapacitance();
  regular_ = now_->matrix->factor(now_->entries) && base([](auto &f) { return f.isRegular(); });
  const int added = int(coefficient_.size()) - now_->matrix->negative - positive;
  negative_ = base([](auto &f) { return f.negative(); }) + added;
  zero_ = base([](auto &f) { return f.zero(); });
}

void WoodburyFactor::solve(const PetscScalar *b, PetscScalar *x) {
  std::copy(b, b + right_.size(), right_.begin());
  base([&](auto &f) { f.solve(right_.data(), part_.data()); });
  columns_.assign(coefficient_.size(), 0.0);
  auto each = [&](auto visit) {
    for (const std::vector<Part> &group : groups_)
      for (const Part &part : group)
        for (int c = 0; c < now_->columns; ++c) visit(part, c, columns_[now_->columns * part.tie + c]);
  };
  each([&](const Part &part, int c, double &column) {
    eachEntry(part, c, [&](int u, double v) { column += v * part_[u]; });
  });
  now_->matrix->solve(columns_);
  each([&](const Part &part, int c, double &column) {
    eachEntry(part, c, [&](int u, double v) { right_[u] -= v * column; });
  });
  base([&](auto &f) { f.solve(right_.data(), x); });
}

std::size_t WoodburyFactor::numbers() const {
  return base([](const auto &f) { return f.numbers(); }) + plain_.entries.size() + lifted_.entries.size();
}
std::size_t WoodburyFactor::bytes() const {
  return base([](const auto &f) { return f.bytes(); }) +
         (plain_.entries.size() + lifted_.entries.size()) * sizeof(double);
}

PetscErrorCode WoodburyFactor::view(PetscViewer viewer) const {
  PetscFunctionBegin;
  PetscCall(base([&](const auto &f) { return f.view(viewer); }));
  PetscCall(PetscViewerASCIIPrintf(viewer, "  and a low-rank update by %d ties: their capacitance is %s\n",
                                   int(unknown_.size()), now_ ? now_->matrix->kind() : "not made yet"));
  PetscFunctionReturn(0);
}

PetscErrorCode registerWoodbury() { return FactorType<WoodburyFactor>::add(); }

const char *ownSolver(const DofMap &dofs, RodSet rods) {
  if (!dofs.touching(rods).empty()) return nullptr;
  if (!dofs.isJoined(rods)) return BandedFactor::name;
  if (!dofs.ties(rods).empty())
    return WoodburyFactor::suits(dofs, rods) && WoodburyFactor::pays(dofs, rods) ? WoodburyFactor::name : nullptr;
  return CondensedFactor::suits(dofs, rods) && CondensedFactor::pays(dofs, rods) ? CondensedFactor::name : nullptr;
}

bool canFactor(const std::string &solver, const DofMap &dofs, RodSet rods) {
  if (solver == WoodburyFactor::name) return WoodburyFactor::suits(dofs, rods) && dofs.touching(rods).empty();
  if (!dofs.ties(rods).empty() || !dofs.touching(rods).empty()) return false;
  return solver == CondensedFactor::name ? CondensedFactor::suits(dofs, rods) : !dofs.isJoined(rods);
}

} // namespace tendril
