#pragma once
/// \file quiet_errors.hpp
/// Errors of PETSc as one line.

#include <petscsys.h>

#include <string>

namespace tendril {

/// While it lives, PETSc's errors are kept as one line instead of printed with their trace.
class QuietErrors {
public:
  QuietErrors() { (void)PetscPushErrorHandler(keep, &message_); }
  ~QuietErrors() { (void)PetscPopErrorHandler(); }
  QuietErrors(const QuietErrors &) = delete;
  const std::string &message() const { return message_; }

private:
  std::string message_;
  static PetscErrorCode keep(MPI_Comm, int, const char *, const char *, PetscErrorCode code, PetscErrorType type,
                             const char *text, void *message) {
    if (type == PETSC_ERROR_INITIAL && text) *static_cast<std::string *>(message) = text;
    return code;
  }
};

} // namespace tendril
