#pragma once
/// \file team.hpp
/// The ranks that share a scene. All that one of them has to know of the others goes through here; nothing else calls
/// MPI but the output of results.

#include "tendril/geometry/exact_sum.hpp"
#include "tendril/model/scene.hpp"

#include <functional>
#include <petscsys.h> // MPI, whose reductions -log_view counts
#include <span>

namespace tendril {

/// Numbers that each rank has, and that become those of all by one reduction.
class Tally {
public:
  /// The largest of all ranks; not a number is larger than any.
  Tally &largest(double &x);
  Tally &smallest(double &x);
  Tally &any(bool &x);
  Tally &largest(int &x);
  Tally &sum(int &x);
  Tally &sum(std::int64_t &x);
  Tally &sum(ExactSum &x);

private:
  friend class Team;
  /// A number and what it becomes.
  struct Greatest {
    double value;
    std::function<void(double)> set;
  };
  std::vector<Greatest> greatest_;
  std::vector<std::pair<std::int64_t, std::function<void(std::int64_t)>>> counts_;
  std::vector<ExactSum *> sums_;
};

/// A mistake that all ranks know of, with the exit code that it ends them with: one of them tells it.
struct AgreedError : SceneError {
  AgreedError(const std::string &message, int code) : SceneError(message), code_(code) {}
  int exitCode() const override { return code_; }

private:
  int code_;
};

/// A group of ranks; one rank alone asks nobody. Whatever they do together all of them have to call, in the same order.
/// Which way a run goes may follow only from what is the same on all of them.
class Team {
public:
  Team() = default;
  /// All ranks of the program.
  static Team world();
  int rank() const { return rank_; }
  int size() const { return size_; }
  bool isAlone() const { return size_ == 1; }
  /// Whether this rank speaks for all: it reads, writes and tells.
  bool leads() const { return rank_ == 0; }
  /// The first `count` ranks as a team of their own. \return one without ranks on the others
  Team first(int count) const;
  bool isEmpty() const { return size_ == 0; }

  void combine(Tally &tally) const;
  bool all(bool mine) const;
  bool any(bool mine) const;
  /// A text, or numbers, of one rank to all.
  void share(std::string &text, int from = 0) const;
  void share(std::span<double> numbers, int from = 0) const;
  template <class T> void shareList(std::vector<T> &list) const {
    double count = double(list.size());
    share({&count, 1});
    std::vector<double> numbers(list.begin(), list.end());
    numbers.resize(std::size_t(count));
    share(numbers);
    list.assign(numbers.begin(), numbers.end());
  }
  /// The text of the first rank whose number is the smallest, where that is finite; else none.
  std::string textOfFirst(double order, const std::string &mine) const;
  /// Does something on all ranks, or what is empty on some, in which none waits for another. What goes wrong on any of
  /// them is an AgreedError on all.
  void together(const std::function<void()> &work) const;
  /// Numbers of all ranks, one behind the other, on the leading one. \param counts of each rank, needed there only
  std::vector<double> gather(std::span<const double> mine, const std::vector<int> &counts) const;
  /// The same on all ranks.
  std::vector<double> gatherAll(std::span<const double> mine) const;
  /// The way back. \param all on the leading rank only
  void scatter(const std::vector<double> &all, const std::vector<int> &counts, std::span<double> mine) const;
  /// Ends all ranks at once, for what only one of them knows.
  [[noreturn]] void abort(int exit_code) const;

private:
  MPI_Comm comm_ = MPI_COMM_NULL;
  int rank_ = 0, size_ = 1;
  static Team of(MPI_Comm comm);
};

} // namespace tendril
