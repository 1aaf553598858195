#include "tendril/solver/secants.hpp"

#include <cmath>

namespace tendril {

PetscErrorCode copyValues(Vec from, std::vector<double> *values) {
  const double *read;
  PetscInt count;
  PetscFunctionBeginUser;
  PetscCall(VecGetLocalSize(from, &count));
  PetscCall(VecGetArrayRead(from, &read));
  values->assign(read, read + count);
  PetscCall(VecRestoreArrayRead(from, &read));
  PetscFunctionReturn(0);
}

PetscErrorCode Secants::apply(const DofMap &dofs, const std::vector<RodSet> &islands,
                              const std::function<PetscErrorCode(Vec, Vec)> &solve, Vec f, Vec work, Vec y) const {
  PetscFunctionBeginUser;
  auto forIslands = [&](auto visit) {
    for (std::size_t n = 0; n < islands.size(); ++n) {
      const PetscInt begin = dofs.firstUnknown(islands[n]) - dofs.firstUnknown(islands[0]);
      visit(int(n), begin, begin + dofs.unknowns(islands[n]));
    }
  };
  std::vector<std::vector<double>> share(pairs_.size(), std::vector<double>(islands.size()));
  double *q;
  PetscCall(VecCopy(f, work));
  PetscCall(VecGetArray(work, &q));
  for (std::size_t k = pairs_.size(); k-- > 0;)
    forIslands([&](int r, PetscInt begin, PetscInt end) {
      const Pair &secant = pairs_[k];
      double product = 0;
      for (PetscInt i = begin; i < end; ++i) product += secant.step[i] * q[i];
      share[k][r] = secant.inverse[r] * product;
      for (PetscInt i = begin; i < end; ++i) q[i] -= share[k][r] * secant.change[i];
    });
  PetscCall(VecRestoreArray(work, &q));
  PetscCall(solve(work, y));
  PetscCall(VecGetArray(y, &q));
  for (std::size_t k = 0; k < pairs_.size(); ++k)
    forIslands([&](int r, PetscInt begin, PetscInt end) {
      const Pair &secant = pairs_[k];
      double product = 0;
      for (PetscInt i = begin; i < end; ++i) product += secant.change[i] * q[i];
      const double factor = share[k][r] - secant.inverse[r] * product;
      for (PetscInt i = begin; i < end; ++i) q[i] += factor * secant.step[i];
    });
  PetscCall(VecRestoreArray(y, &q));
  PetscFunctionReturn(0);
}

PetscErrorCode Secants::add(const DofMap &dofs, const std::vector<RodSet> &islands, Vec direction,
                            const std::vector<double> &lengths, const std::vector<double> &before, Vec f) {
  PetscFunctionBeginUser;
  Pair secant;
  PetscCall(copyValues(direction, &secant.step));
  PetscCall(copyValues(f, &secant.change));
  for (std::size_t i = 0; i < before.size(); ++i) secant.change[i] -= before[i];
  for (std::size_t n = 0; n < islands.size(); ++n) {
    const PetscInt begin = dofs.firstUnknown(islands[n]) - dofs.firstUnknown(islands[0]),
                   end = begin + dofs.unknowns(islands[n]);
    const double length = lengths[n];
    double product = 0, steps = 0, changes = 0;
    for (PetscInt i = begin; i < end; ++i) {
      secant.step[i] *= length;
      product += secant.step[i] * secant.change[i];
      steps += secant.step[i] * secant.step[i];
      changes += secant.change[i] * secant.change[i];
    }
    secant.inverse.push_back(product > 1e-10 * std::sqrt(steps * changes) ? 1 / product : 0);
  }
  pairs_.push_back(std::move(secant));
  PetscFunctionReturn(0);
}

} // namespace tendril
