#include "tendril/solver/schur.hpp"

#include "tendril/layout/petsc.hpp"

#include <petscblaslapack.h>

#include <Eigen/Dense>

namespace tendril {
namespace {

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

} // namespace

std::unique_ptr<Schur> makeDense(int size, std::vector<int> rows, std::vector<int> columns) {
  return std::make_unique<DenseSchur>(size, std::move(rows), std::move(columns));
}

std::unique_ptr<Schur> makeSchur(int size, std::vector<int> rows, std::vector<int> columns) {
  constexpr int most_dense = 200;
  if (size <= most_dense) return makeDense(size, std::move(rows), std::move(columns));
  return std::make_unique<SparseSchur>(size, rows, columns);
}

} // namespace tendril
