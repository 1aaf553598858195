#include "tendril/layout/team.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <thread>

namespace tendril {
namespace {

/// Of two buffers: how many numbers, and how many whole ones, then the numbers, of which the larger counts, then the
/// whole ones, which are added.
void reduce(void *in, void *in_out, int *count, MPI_Datatype *type) {
  int bytes;
  MPI_Type_size(*type, &bytes);
  for (int k = 0; k < *count; ++k) {
    const auto *from = static_cast<const std::int64_t *>(in) + std::size_t(k) * bytes / 8;
    auto *to = static_cast<std::int64_t *>(in_out) + std::size_t(k) * bytes / 8;
    const std::int64_t numbers = from[0], whole = from[1];
    for (std::int64_t n = 2; n < 2 + numbers; ++n) {
      double a, b;
      std::memcpy(&a, from + n, sizeof a);
      std::memcpy(&b, to + n, sizeof b);
      if (a > b || std::isnan(a)) to[n] = from[n];
    }
    for (std::int64_t n = 2 + numbers; n < 2 + numbers + whole; ++n) to[n] += from[n];
  }
}

/// Waits for the other ranks. What takes longer than a step in the cache does is slept through: ranks that wait must
/// not take a core from one that works, and giving way (sched_yield) does not always do.
void finish(MPI_Request request) {
  using Clock = std::chrono::steady_clock;
  constexpr auto awake = std::chrono::microseconds(200), longest = std::chrono::microseconds(1000);
  auto nap = std::chrono::microseconds(20);
  const Clock::time_point begin = Clock::now();
  for (int done = 0; MPI_Test(&request, &done, MPI_STATUS_IGNORE), !done;) {
    if (Clock::now() - begin < awake) continue;
    std::this_thread::sleep_for(nap);
    nap = std::min(2 * nap, longest);
  }
}

} // namespace

Tally &Tally::largest(double &x) {
  greatest_.push_back({x, [&x](double value) { x = value; }});
  return *this;
}
Tally &Tally::smallest(double &x) {
  greatest_.push_back({-x, [&x](double value) { x = -value; }});
  return *this;
}
Tally &Tally::any(bool &x) {
  greatest_.push_back({x ? 1.0 : 0.0, [&x](double value) { x = value > 0; }});
  return *this;
}
Tally &Tally::largest(int &x) {
  greatest_.push_back({double(x), [&x](double value) { x = int(value); }});
  return *this;
}
Tally &Tally::sum(int &x) {
  counts_.emplace_back(x, [&x](std::int64_t value) { x = int(value); });
  return *this;
}
Tally &Tally::sum(std::int64_t &x) {
  counts_.emplace_back(x, [&x](std::int64_t value) { x = value; });
  return *this;
}
Tally &Tally::sum(ExactSum &x) {
  sums_.push_back(&x);
  return *this;
}

Team Team::of(MPI_Comm comm) {
  Team team;
  team.comm_ = comm;
  MPI_Comm_rank(comm, &team.rank_);
  MPI_Comm_size(comm, &team.size_);
  return team;
}

Team Team::world() { return of(MPI_COMM_WORLD); }

Team Team::first(int count) const {
  if (count >= size_) return *this;
  MPI_Comm part; // lives as long as the program
  MPI_Comm_split(comm_, rank_ < count ? 0 : MPI_UNDEFINED, rank_, &part);
  if (rank_ < count) return of(part);
  Team none;
  none.size_ = 0;
  return none;
}

void Team::combine(Tally &tally) const {
  if (isAlone()) return;
  const std::size_t numbers = tally.greatest_.size(),
                    whole = tally.counts_.size() + tally.sums_.size() * ExactSum::words;
  std::vector<std::int64_t> buffer{std::int64_t(numbers), std::int64_t(whole)};
  buffer.resize(2 + numbers);
  for (std::size_t n = 0; n < numbers; ++n) std::memcpy(&buffer[2 + n], &tally.greatest_[n].value, sizeof(double));
  for (const auto &[count, set] : tally.counts_) buffer.push_back(count);
  for (ExactSum *sum : tally.sums_) buffer.insert(buffer.end(), sum->data(), sum->data() + ExactSum::words);
  static const MPI_Op operation = [] {
    MPI_Op op;
    MPI_Op_create(reduce, 1, &op);
    return op;
  }();
  MPI_Datatype type;
  MPI_Type_contiguous(int(buffer.size()), MPI_INT64_T, &type);
  MPI_Type_commit(&type);
  MPI_Request request;
  MPI_Iallreduce(MPI_IN_PLACE, buffer.data(), 1, type, operation, comm_, &request);
  finish(request);
#if defined(PETSC_USE_LOG)
  petsc_allreduce_ct += 1; // for -log_view, which does not see this kind
#endif
  MPI_Type_free(&type);
  const std::int64_t *next = buffer.data() + 2;
  for (const Tally::Greatest &g : tally.greatest_) {
    double value;
    std::memcpy(&value, next++, sizeof value);
    g.set(value);
  }
  for (const auto &[count, set] : tally.counts_) set(*next++);
  for (ExactSum *sum : tally.sums_) {
    std::copy_n(next, ExactSum::words, sum->data());
    next += ExactSum::words;
  }
}

bool Team::any(bool mine) const {
  Tally tally;
  combine(tally.any(mine));
  return mine;
}

bool Team::all(bool mine) const { return !any(!mine); }

void Team::share(std::string &text, int from) const {
  if (isAlone()) return;
  double length = double(text.size());
  share({&length, 1}, from);
  text.resize(std::size_t(length));
  MPI_Request request;
  MPI_Ibcast(text.data(), int(text.size()), MPI_CHAR, from, comm_, &request);
  finish(request);
}

void Team::share(std::span<double> numbers, int from) const {
  if (isAlone()) return;
  MPI_Request request;
  MPI_Ibcast(numbers.data(), int(numbers.size()), MPI_DOUBLE, from, comm_, &request);
  finish(request);
}

std::string Team::textOfFirst(double order, const std::string &mine) const {
  std::string text = mine;
  if (isAlone()) return std::isfinite(order) ? text : "";
  double first = order;
  Tally least;
  combine(least.smallest(first));
  if (!std::isfinite(first)) return "";
  int from = order == first ? rank_ : size_;
  Tally lowest;
  double rank = from;
  combine(lowest.smallest(rank));
  share(text, int(rank));
  return text;
}

void Team::together(const std::function<void()> &work) const {
  if (isAlone()) return work();
  std::string mistake;
  double code = 0;
  try {
    work();
  } catch (const SceneError &e) {
    mistake = e.what();
    code = e.exitCode();
  }
  const std::string first = textOfFirst(code > 0 ? rank_ : HUGE_VAL, mistake);
  Tally worst;
  combine(worst.largest(code));
  if (code > 0) throw AgreedError(first, int(code));
}

std::vector<double> Team::gather(std::span<const double> mine, const std::vector<int> &counts) const {
  if (isAlone()) return {mine.begin(), mine.end()};
  std::vector<double> all;
  std::vector<int> places;
  for (const int count : counts) {
    places.push_back(int(all.size()));
    all.resize(all.size() + std::size_t(count));
  }
  if (all.size() > std::size_t(std::numeric_limits<int>::max()))
    throw SceneError(
        "a field of " + std::to_string(all.size()) +
        " numbers is more than one rank can gather; write fewer fields (-output_fields) or split the scene");
  MPI_Request request;
  MPI_Igatherv(mine.data(), int(mine.size()), MPI_DOUBLE, all.data(), counts.data(), places.data(), MPI_DOUBLE, 0,
               comm_, &request);
  finish(request);
  return all;
}

std::vector<double> Team::gatherAll(std::span<const double> mine) const {
  if (isAlone()) return {mine.begin(), mine.end()};
  int count = int(mine.size());
  std::vector<int> counts(std::size_t(size_), 0), places{0};
  MPI_Request request;
  MPI_Iallgather(&count, 1, MPI_INT, counts.data(), 1, MPI_INT, comm_, &request);
  finish(request);
  for (const int n : counts) places.push_back(places.back() + n);
  std::vector<double> all(std::size_t(places.back()));
  MPI_Iallgatherv(mine.data(), count, MPI_DOUBLE, all.data(), counts.data(), places.data(), MPI_DOUBLE, comm_,
                  &request);
  finish(request);
  return all;
}

void Team::scatter(const std::vector<double> &all, const std::vector<int> &counts, std::span<double> mine) const {
  if (isAlone()) {
    std::copy(all.begin(), all.end(), mine.begin());
    return;
  }
  std::vector<int> places{0};
  for (const int count : counts) places.push_back(places.back() + count);
  MPI_Request request;
  MPI_Iscatterv(all.data(), counts.data(), places.data(), MPI_DOUBLE, mine.data(), int(mine.size()), MPI_DOUBLE, 0,
                comm_, &request);
  finish(request);
}

void Team::abort(int exit_code) const {
  if (!isAlone()) MPI_Abort(comm_, exit_code);
  std::_Exit(exit_code);
}

} // namespace tendril
