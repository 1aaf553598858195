#include "tendril/solver/banded.hpp"

#include <petsc/private/matimpl.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace tendril {

bool BandedCholesky::analyse(PetscInt rows, const PetscInt *row_start, const PetscInt *column) {
  rows_ = rows;
  blocks_.clear();
  far_.clear();
  PetscInt begin = 0, reach = 0, first_far = -1;
  for (PetscInt i = 0; i < rows; ++i) {
    for (PetscInt k = row_start[i]; k < row_start[i + 1]; ++k) {
      reach = std::max(reach, column[k]);
      if (column[k] < i - half_band && first_far < 0) first_far = i;
    }
    if (reach > i) continue;
    const int border = first_far < 0 ? 0 : int(i + 1 - first_far);
    if (border > half_band + 1) return false;
    blocks_.push_back({begin, i + 1, border});
    far_.emplace_back(std::size_t(border) * std::size_t(i + 1 - begin), 0.0);
    begin = i + 1;
    first_far = -1;
  }
  band_.assign(std::size_t(rows + half_band + 1) * width, 0.0);
  diagonal_.assign(rows, 0.0);
  return true;
}

void BandedCholesky::factor(const PetscInt *row_start, const PetscInt *column, const PetscScalar *value) {
  std::fill(band_.begin(), band_.end(), 0.0);
  negative_ = neutral_ = 0;
  for (std::size_t n = 0; n < blocks_.size(); ++n) {
    const Block &block = blocks_[n];
    std::vector<double> &far = far_[n];
    std::fill(far.begin(), far.end(), 0.0);
    const PetscInt size = block.end - block.begin, first_border = block.end - block.border;
    for (PetscInt i = block.begin; i < block.end; ++i)
      for (PetscInt k = row_start[i]; k < row_start[i + 1]; ++k) {
        const PetscInt distance = column[k] - i;
        if (distance >= 0 && distance <= half_band)
          band_[std::size_t(i) * width + distance] = value[k];
        else if (distance > half_band)
          far[std::size_t(column[k] - first_border) * size + (i - block.begin)] = value[k];
      }
    for (PetscInt i = block.begin; i < block.end; ++i) diagonal_[i] = band_[std::size_t(i) * width];
    eliminate(block, far);
  }
}

/// Pivot of a row with its sign counted. What rounding has left of a diagonal is no pivot.
double BandedCholesky::pivot(PetscInt row) {
  double d = band_[std::size_t(row) * width];
  const double scale = std::abs(diagonal_[row]);
  if (std::abs(d) <= 16 * std::numeric_limits<double>::epsilon() * scale || d == 0) {
    ++neutral_;
    d = scale > 0 ? 1e-6 * scale : 1;
    band_[std::size_t(row) * width] = d;
  } else if (d < 0)
    ++negative_;
  return d;
}

/// Right-looking elimination of one block: each row updates the ten below it, and for a ring the border.
void BandedCholesky::eliminate(const Block &block, std::vector<double> &far) {
  const PetscInt size = block.end - block.begin, first_border = block.end - block.border;
  for (PetscInt j = block.begin; j < block.end; ++j) {
    double *row = &band_[std::size_t(j) * width];
    const double inverse = 1 / pivot(j);
    double l[half_band + 1];
    for (int r = 1; r <= half_band; ++r) l[r] = row[r] * inverse;
    for (int r = 1; r <= half_band; ++r) {
      double *below = row + std::size_t(r) * width;
      for (int c = 0; c <= half_band - r; ++c) below[c] -= l[r] * row[r + c];
    }
    // Border rows beyond the band of row j: they meet the rows within it, and each other.
    for (int q = 0; q < block.border; ++q) {
      const PetscInt i = first_border + q;
      if (i - j <= half_band) continue;
      double *far_row = &far[std::size_t(q) * size];
      const double w = far_row[j - block.begin];
      if (w == 0) continue;
      const double lq = w * inverse;
      for (int r = 1; r <= half_band; ++r) {
        const PetscInt k = j + r;
        if (k >= i) break;
        if (i - k > half_band)
          far_row[k - block.begin] -= lq * row[r];
        else
          band_[std::size_t(k) * width + (i - k)] -= lq * row[r];
      }
      for (int p = q; p < block.border; ++p) { // the corner of the border; rows p >= q are also beyond the band
        const double wp = far[std::size_t(p) * size + (j - block.begin)];
        band_[std::size_t(i) * width + (p - q)] -= lq * wp;
      }
      far_row[j - block.begin] = lq;
    }
    for (int r = 1; r <= half_band; ++r) row[r] = l[r];
  }
}

void BandedCholesky::solve(const PetscScalar *b, PetscScalar *x) const {
  if (x != b) std::copy(b, b + rows_, x);
  for (std::size_t n = 0; n < blocks_.size(); ++n) {
    const Block &block = blocks_[n];
    const PetscInt size = block.end - block.begin, first_border = block.end - block.border;
    auto farRow = [&](int q) { return &far_[n][std::size_t(q) * size]; };
    for (PetscInt j = block.begin; j < block.end; ++j) {
      const double *row = &band_[std::size_t(j) * width];
      const int most = int(std::min<PetscInt>(half_band, block.end - 1 - j));
      for (int r = 1; r <= most; ++r) x[j + r] -= row[r] * x[j];
      for (int q = 0; q < block.border; ++q)
        if (first_border + q - j > half_band) x[first_border + q] -= farRow(q)[j - block.begin] * x[j];
    }
    for (PetscInt j = block.end - 1; j >= block.begin; --j) {
      const double *row = &band_[std::size_t(j) * width];
      const int most = int(std::min<PetscInt>(half_band, block.end - 1 - j));
      double sum = x[j] / row[0];
      for (int r = 1; r <= most; ++r) sum -= row[r] * x[j + r];
      for (int q = 0; q < block.border; ++q)
        if (first_border + q - j > half_band) sum -= farRow(q)[j - block.begin] * x[first_border + q];
      x[j] = sum;
    }
  }
}

namespace {

constexpr const char *name = "banded";

PetscErrorCode numeric(Mat f, Mat a, const MatFactorInfo *) {
  PetscInt n;
  const PetscInt *ia, *ja;
  const PetscScalar *values;
  PetscBool done;
  PetscFunctionBegin;
  auto *factor = static_cast<BandedCholesky *>(f->data);
  PetscCall(MatGetRowIJ(a, 0, PETSC_FALSE, PETSC_FALSE, &n, &ia, &ja, &done));
  PetscCall(MatSeqAIJGetArrayRead(a, &values));
  factor->factor(ia, ja, values);
  PetscCall(MatSeqAIJRestoreArrayRead(a, &values));
  PetscCall(MatRestoreRowIJ(a, 0, PETSC_FALSE, PETSC_FALSE, &n, &ia, &ja, &done));
  f->assembled = PETSC_TRUE;
  PetscFunctionReturn(0);
}

PetscErrorCode solveVec(Mat f, Vec b, Vec x) {
  const PetscScalar *right;
  PetscScalar *out;
  PetscFunctionBegin;
  PetscCall(VecGetArrayRead(b, &right));
  PetscCall(VecGetArrayWrite(x, &out));
  static_cast<BandedCholesky *>(f->data)->solve(right, out);
  PetscCall(VecRestoreArrayWrite(x, &out));
  PetscCall(VecRestoreArrayRead(b, &right));
  PetscFunctionReturn(0);
}

PetscErrorCode inertia(Mat f, PetscInt *negative, PetscInt *zero, PetscInt *positive) {
  PetscFunctionBegin;
  const auto *factor = static_cast<BandedCholesky *>(f->data);
  if (negative) *negative = factor->negativePivots();
  if (zero) *zero = factor->neutralPivots();
  if (positive) *positive = f->rmap->n - factor->negativePivots() - factor->neutralPivots();
  PetscFunctionReturn(0);
}

PetscErrorCode getInfo(Mat f, MatInfoType, MatInfo *info) {
  PetscFunctionBegin;
  *info = {};
  info->nz_used = info->nz_allocated = double(f->rmap->n) * (BandedCholesky::half_band + 1);
  PetscFunctionReturn(0);
}

PetscErrorCode symbolic(Mat f, Mat a, IS, const MatFactorInfo *) {
  PetscInt n;
  const PetscInt *ia, *ja;
  PetscBool done;
  PetscFunctionBegin;
  PetscCall(MatGetRowIJ(a, 0, PETSC_FALSE, PETSC_FALSE, &n, &ia, &ja, &done));
  const bool fits = static_cast<BandedCholesky *>(f->data)->analyse(n, ia, ja);
  PetscCall(MatRestoreRowIJ(a, 0, PETSC_FALSE, PETSC_FALSE, &n, &ia, &ja, &done));
  PetscCheck(fits, PetscObjectComm((PetscObject)a), PETSC_ERR_USER_INPUT,
             "solver type banded needs a scene of chains and rings; use -pc_factor_mat_solver_type petsc or mumps");
  f->ops->choleskyfactornumeric = numeric;
  f->ops->solve = solveVec;
  f->ops->getinertia = inertia;
  PetscFunctionReturn(0);
}

PetscErrorCode destroy(Mat f) {
  PetscFunctionBegin;
  delete static_cast<BandedCholesky *>(f->data);
  f->data = nullptr;
  PetscCall(PetscObjectComposeFunction((PetscObject)f, "MatFactorGetSolverType_C", nullptr));
  PetscFunctionReturn(0);
}

PetscErrorCode solverType(Mat, MatSolverType *type) {
  PetscFunctionBegin;
  *type = name;
  PetscFunctionReturn(0);
}

PetscErrorCode create(Mat a, MatFactorType, Mat *out) {
  Mat f;
  PetscFunctionBegin;
  PetscCall(MatCreate(PetscObjectComm((PetscObject)a), &f));
  PetscCall(MatSetSizes(f, a->rmap->n, a->cmap->n, a->rmap->N, a->cmap->N));
  PetscCall(PetscStrallocpy(name, &((PetscObject)f)->type_name));
  PetscCall(MatSetUp(f));
  f->data = new BandedCholesky;
  f->ops->choleskyfactorsymbolic = symbolic;
  f->ops->getinfo = getInfo;
  f->ops->destroy = destroy;
  PetscCall(PetscObjectComposeFunction((PetscObject)f, "MatFactorGetSolverType_C", solverType));
  f->factortype = MAT_FACTOR_CHOLESKY;
  f->assembled = f->preallocated = PETSC_TRUE;
  PetscCall(PetscFree(f->solvertype));
  PetscCall(PetscStrallocpy(name, &f->solvertype));
  f->canuseordering = PETSC_FALSE;
  PetscCall(PetscStrallocpy(MATORDERINGEXTERNAL, (char **)&f->preferredordering[MAT_FACTOR_CHOLESKY]));
  *out = f;
  PetscFunctionReturn(0);
}

} // namespace

PetscErrorCode registerBanded() {
  PetscFunctionBeginUser;
  PetscCall(MatSolverTypeRegister(name, MATSEQAIJ, MAT_FACTOR_CHOLESKY, create));
  PetscFunctionReturn(0);
}

} // namespace tendril
