#pragma once
/// \file factor_type.hpp
/// Makes a class a Cholesky factorisation of PETSc's, chosen by its name. A Factor has
///   Factor(const DofMap &, RodSet, BandedWorkspace &);
///   static constexpr const char *name;
///   void factor(const BandedSystem &);   void solve(const double *b, double *x);
///   bool isRegular() const;  int negative() const, zero() const;  std::size_t bytes() const, numbers() const;

#include "tendril/solver/banded.hpp"

#include <petsc/private/matimpl.h>

namespace tendril {

template <class Factor> class FactorType {
public:
  /// Registers `-pc_factor_mat_solver_type <name>` for the matrices of createBandedMatrix.
  static PetscErrorCode add() {
    PetscFunctionBeginUser;
    PetscCall(MatSolverTypeRegister(Factor::name, MATSHELL, MAT_FACTOR_CHOLESKY, create));
    PetscFunctionReturn(0);
  }
  /// The factor inside PETSc's factored matrix, or null when it is another's.
  static const Factor *of(Mat f) { return f->ops->choleskyfactornumeric == numeric ? factorOf(f) : nullptr; }

private:
  static Factor *factorOf(Mat f) { return static_cast<Factor *>(f->data); }

  static PetscErrorCode numeric(Mat f, Mat a, const MatFactorInfo *) {
    BandedSystem *system;
    PetscFunctionBegin;
    PetscCall(MatShellGetContext(a, &system));
    factorOf(f)->factor(*system);
    f->factorerrortype = factorOf(f)->isRegular() ? MAT_FACTOR_NOERROR : MAT_FACTOR_NUMERIC_ZEROPIVOT;
    f->assembled = PETSC_TRUE;
    PetscFunctionReturn(0);
  }

  static PetscErrorCode solveVec(Mat f, Vec b, Vec x) {
    const PetscScalar *right;
    PetscScalar *out;
    PetscFunctionBegin;
    PetscCall(VecGetArrayRead(b, &right));
    PetscCall(VecGetArrayWrite(x, &out));
    factorOf(f)->solve(right, out);
    PetscCall(VecRestoreArrayWrite(x, &out));
    PetscCall(VecRestoreArrayRead(b, &right));
    PetscFunctionReturn(0);
  }

  static PetscErrorCode inertia(Mat f, PetscInt *negative, PetscInt *zero, PetscInt *positive) {
    const PetscInt minus = factorOf(f)->negative(), none = factorOf(f)->zero();
    PetscFunctionBegin;
    if (negative) *negative = minus;
    if (zero) *zero = none;
    if (positive) *positive = f->rmap->n - minus - none;
    PetscFunctionReturn(0);
  }

  static PetscErrorCode getInfo(Mat f, MatInfoType, MatInfo *info) {
    PetscFunctionBegin;
    *info = {};
    info->nz_used = info->nz_allocated = double(factorOf(f)->numbers());
    info->memory = double(factorOf(f)->bytes());
    PetscFunctionReturn(0);
  }

  static PetscErrorCode symbolic(Mat f, Mat, IS, const MatFactorInfo *) {
    PetscFunctionBegin;
    f->ops->choleskyfactornumeric = numeric;
    f->ops->solve = solveVec;
    f->ops->getinertia = inertia;
    PetscFunctionReturn(0);
  }

  static PetscErrorCode destroy(Mat f) {
    PetscFunctionBegin;
    delete factorOf(f);
    f->data = nullptr;
    PetscCall(PetscObjectComposeFunction((PetscObject)f, "MatFactorGetSolverType_C", nullptr));
    PetscFunctionReturn(0);
  }

  static PetscErrorCode solverType(Mat, MatSolverType *type) {
    PetscFunctionBegin;
    *type = Factor::name;
    PetscFunctionReturn(0);
  }

  static PetscErrorCode view(Mat f, PetscViewer viewer) {
    PetscFunctionBegin;
    PetscCall(factorOf(f)->view(viewer));
    PetscFunctionReturn(0);
  }

  static PetscErrorCode create(Mat a, MatFactorType, Mat *out) {
    Mat f;
    BandedSystem *system;
    PetscFunctionBegin;
    PetscCall(MatShellGetContext(a, &system));
    PetscCall(MatCreate(PetscObjectComm((PetscObject)a), &f));
    PetscCall(MatSetSizes(f, a->rmap->n, a->cmap->n, a->rmap->N, a->cmap->N));
    PetscCall(PetscStrallocpy(Factor::name, &((PetscObject)f)->type_name));
    PetscCall(MatSetUp(f));
    f->data = new Factor(*system->dofs, system->rods, *system->workspace);
    f->ops->choleskyfactorsymbolic = symbolic;
    f->ops->getinfo = getInfo;
    f->ops->destroy = destroy;
    f->ops->view = view;
    PetscCall(PetscObjectComposeFunction((PetscObject)f, "MatFactorGetSolverType_C", solverType));
    f->factortype = MAT_FACTOR_CHOLESKY;
    f->assembled = f->preallocated = PETSC_TRUE;
    PetscCall(PetscFree(f->solvertype));
    PetscCall(PetscStrallocpy(Factor::name, &f->solvertype));
    f->canuseordering = PETSC_FALSE;
    PetscCall(PetscStrallocpy(MATORDERINGEXTERNAL, (char **)&f->preferredordering[MAT_FACTOR_CHOLESKY]));
    *out = f;
    PetscFunctionReturn(0);
  }
};

} // namespace tendril
