#pragma once
/// \file planes.hpp
/// Structure-of-arrays storage for the element loops.

#include "tendril/geometry/scalar.hpp"

#include <vector>

namespace tendril {

using AlignedVector = std::vector<double, Eigen::aligned_allocator<double>>;

/// Several arrays over the same slots. Loops run over whole packs: a pack may begin one slot before the first and end a
/// pack beyond the last. Work arrays hold a window of the slots, which moves along the scene and stays in the cache.
class Planes {
public:
  Planes() = default;
  /// All zero.
  Planes(int planes, int slots) : stride_(planeStride(slots)), data_(std::size_t(planes) * stride_ + 2 * lanes, 0.0) {}

  double *operator[](int plane) { return data_.data() + (lanes + std::ptrdiff_t(plane) * stride_ - origin_); }
  const double *operator[](int plane) const {
    return data_.data() + (lanes + std::ptrdiff_t(plane) * stride_ - origin_);
  }
  /// Moves the window; it keeps what numbers it has.
  void setOrigin(int first_slot) { origin_ = first_slot; }
  int origin() const { return origin_; }
  Vec3 vector(int plane, int slot) const {
    return {(*this)[plane][slot], (*this)[plane + 1][slot], (*this)[plane + 2][slot]};
  }
  void setVector(int plane, int slot, const Vec3 &v) {
    for (int a = 0; a < 3; ++a) (*this)[plane + a][slot] = v[a];
  }
  void clear() { std::fill(data_.begin(), data_.end(), 0.0); }

  /// Everything as one vector, for linear algebra; what is not a slot of something is zero.
  std::size_t size() const { return data_.size(); }
  double *data() { return data_.data(); }
  const double *data() const { return data_.data(); }
  AlignedVector::iterator begin() { return data_.begin(); }
  AlignedVector::iterator end() { return data_.end(); }
  AlignedVector::const_iterator begin() const { return data_.begin(); }
  AlignedVector::const_iterator end() const { return data_.end(); }

  /// An odd number of packs: the same slot of different planes then never falls on the same sets of the cache.
  static int planeStride(int slots) { return (((slots + lanes - 1) / lanes) | 1) * lanes; }

private:
  int stride_ = 0, origin_ = 0;
  AlignedVector data_;
};

/// A vector, or a pack of them, from three planes.
template <class T> Vector3<T> readVector(const Planes &planes, int plane, int slot) {
  return {read<T>(planes[plane] + slot), read<T>(planes[plane + 1] + slot), read<T>(planes[plane + 2] + slot)};
}
template <class T> void writeVector(Planes &planes, int plane, int slot, const Vector3<T> &v) {
  for (int a = 0; a < 3; ++a) write(planes[plane + a] + slot, v[a]);
}

} // namespace tendril
