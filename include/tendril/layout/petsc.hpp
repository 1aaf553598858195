#pragma once
/// \file petsc.hpp
/// Ownership of PETSc objects: destroyed with the C++ object that holds them.

#include <petscdm.h>
#include <petscsection.h>
#include <petscsnes.h>

#include <utility>

namespace tendril {

template <class Object, PetscErrorCode (*destroy)(Object *)> class Owned {
public:
  Owned() = default;
  Owned(Owned &&other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
  Owned &operator=(Owned &&other) noexcept {
    std::swap(object_, other.object_);
    return *this;
  }
  ~Owned() {
    if (object_) (void)destroy(&object_);
  }
  operator Object() const { return object_; }
  Object object() const { return object_; }
  /// For PETSc's creation routines, which return through a pointer; what was held is destroyed.
  Object *out() {
    if (object_) (void)destroy(&object_);
    return &object_;
  }

private:
  Object object_ = nullptr;
};

using OwnedDM = Owned<DM, DMDestroy>;
using OwnedVec = Owned<Vec, VecDestroy>;
using OwnedMat = Owned<Mat, MatDestroy>;
using OwnedKSP = Owned<KSP, KSPDestroy>;
using OwnedSNES = Owned<SNES, SNESDestroy>;
using OwnedSection = Owned<PetscSection, PetscSectionDestroy>;

} // namespace tendril
