#pragma once
/// \file schur.hpp
/// What is left of a matrix when all but its separators are eliminated.

#include <memory>
#include <vector>

namespace tendril {

/// A symmetric matrix over the separators: entries are added, then it is factored.
class Schur {
public:
  virtual ~Schur() = default;
  /// Takes the values for the entries that it was made with, in their order; those of one place add up.
  /// \return whether it could be factored
  virtual bool factor(const std::vector<double> &values) = 0;
  virtual void solve(std::vector<double> &x) = 0;
  virtual const char *kind() const = 0;
  int negative = 0;
};
/// Dense, by LAPACK with pivoting. \param rows, columns of the entries, both triangles
std::unique_ptr<Schur> makeDense(int size, std::vector<int> rows, std::vector<int> columns);
/// Dense for few unknowns; sparse for many, by PETSc without pivoting.
std::unique_ptr<Schur> makeSchur(int size, std::vector<int> rows, std::vector<int> columns);

} // namespace tendril
