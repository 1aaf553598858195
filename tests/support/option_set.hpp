#pragma once
/// PETSc options in force as long as an object lives.
#include <petscsys.h>

#include <string>

namespace tendril::test {

/// While it lives, an option of PETSc is set.
class OptionSet {
public:
  OptionSet(const char *name, const char *value) : name_(name) { (void)PetscOptionsSetValue(nullptr, name, value); }
  ~OptionSet() { (void)PetscOptionsClearValue(nullptr, name_); }
  OptionSet(const OptionSet &) = delete;

private:
  const char *name_;
};

} // namespace tendril::test
