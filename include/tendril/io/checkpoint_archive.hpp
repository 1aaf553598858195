#pragma once
/// \file checkpoint_archive.hpp
/// The two archives of checkpoints, of the same names: what one writes, the other reads.

#include "tendril/io/checkpoint.hpp"
#include "tendril/io/digest.hpp"

#include <cmath>
#include <filesystem>
#include <optional>

namespace tendril {

inline constexpr const char *checkpoint_format = "tendril-checkpoint";
/// 1 had no names, hashes and checksum, 2 no actions of supports, 3 no contact, 4 no friction, 5 no
/// junctions, 6 no bodies.
inline constexpr int checkpoint_version = 11;
inline constexpr int most_memory = 8; ///< more than any integrator remembers

/// Writes numbers, texts and arrays by name, and a checksum over all.
class CheckpointWriter {
public:
  static constexpr bool reads = false;
  static constexpr std::size_t format_version = checkpoint_version;
  CheckpointWriter(const std::string &path) : file_(Hdf5File::create(path)) {}
  void number(const char *name, double value) {
    file_.writeAttribute(std::string(name), value);
    digest_.add(name);
    digest_.add(&value, sizeof value);
  }
  void text(const char *name, const std::string &value) {
    file_.writeAttribute(std::string(name), value);
    digest_.add(name);
    digest_.add(value);
  }
  void longText(const char *name, const std::string &value) {
    file_.writeText(name, value);
    digest_.add(name);
    digest_.add(value);
  }
  void array(const std::string &name, const double *values, std::size_t rows, hsize_t columns) {
    std::vector<hsize_t> shape{rows};
    if (columns > 1) shape.push_back(columns);
    file_.write(name, shape, values);
    digest_.add(name);
    digest_.add(values, rows * columns * sizeof(double));
  }
  template <class T> void array(const std::string &name, const std::vector<T> &values, std::size_t rows) {
    array(name, reinterpret_cast<const double *>(values.data()), rows, sizeof(T) / sizeof(double));
  }
  void finish() {
    file_.writeAttribute("checksum", digest_.hex());
    file_.close();
  }

private:
  Hdf5File file_;
  Digest digest_;
};

/// Takes nothing on trust: sizes are those that the caller asks for, and no more than the file can hold.
class CheckpointReader {
public:
  static constexpr bool reads = true;
  std::size_t format_version = 0; ///< of the file
  CheckpointReader(const std::string &path, const Hdf5File &file) : path_(path), file_(file) {
    std::error_code none;
    bytes_ = std::filesystem::file_size(path, none);
  }
  [[noreturn]] void fail(const std::string &what) const {
    throw DamagedCheckpoint(path_ + ": " + what + "; take another checkpoint");
  }
  void number(const char *name, double &value) {
    const std::optional<double> read = file_.number(name);
    if (!read) fail(std::string("has no number '") + name + "'");
    value = *read;
    digest_.add(name);
    digest_.add(&value, sizeof value);
  }
  /// A whole number up to a bound.
  std::size_t count(const char *name, double most) {
    double value;
    number(name, value);
    if (!(value >= 0 && value <= most && value == std::floor(value)))
      fail(std::string("'") + name + "' is " + shortText(value));
    return std::size_t(value);
  }
  void text(const char *name, std::string &value) {
    const std::optional<std::string> read = file_.text(name);
    if (!read) fail(std::string("has no text '") + name + "'");
    value = *read;
    digest_.add(name);
    digest_.add(value);
  }
  void longText(const char *name, std::string &value) {
    value = file_.readText(name, bytes_);
    digest_.add(name);
    digest_.add(value);
  }
  template <class T> void array(const std::string &name, std::vector<T> &values, std::size_t rows) {
    constexpr hsize_t columns = sizeof(T) / sizeof(double);
    if (rows * sizeof(T) > bytes_) fail("is too short for '" + name + "'");
    const std::vector<double> read = file_.read(name, columns, rows);
    values.resize(rows);
    std::copy(read.begin(), read.end(), reinterpret_cast<double *>(values.data()));
    digest_.add(name);
    digest_.add(read.data(), read.size() * sizeof(double));
  }
  /// Whether there was a checksum.
  bool finish() const {
    const std::optional<std::string> sum = file_.text("checksum");
    if (sum && *sum != digest_.hex()) fail("is damaged: its checksum is not that of its data");
    return sum.has_value();
  }

private:
  std::string path_;
  const Hdf5File &file_;
  Digest digest_;
  std::uintmax_t bytes_ = 0;
};

/// Per rod a number of rows of 3 + 6 numbers (ContactMemory).
template <class Archive, class AnyState, class Whole> void exchangeContacts(Archive &a, AnyState &s, Whole &whole) {
  std::size_t rods = s.contacts.size(), total = 0;
  std::vector<double> counts;
  std::vector<Vec3> rows;
  for (const auto &of_rod : s.contacts) {
    counts.push_back(double(of_rod.size()));
    for (const ContactMemory &m : of_rod)
      rows.insert(rows.end(), {Vec3(m.edge, m.point, m.collider), m.stick, m.friction});
  }
  total = rows.size();
  whole("rods_with_friction", rods, 1e15);
  whole("contact_rows", total, 1e15);
  a.array("contact_counts", counts, rods);
  a.array("contact_memory", rows, total);
  if constexpr (Archive::reads) {
    s.contacts.assign(rods, {});
    std::size_t next = 0;
    for (std::size_t r = 0; r < rods; ++r)
      for (double n = 0; n < counts[r] && next + 3 <= rows.size(); ++n, next += 3)
        s.contacts[r].push_back(
            {int(rows[next][0]), int(rows[next][1]), int(rows[next][2]), rows[next + 1], rows[next + 2]});
  }
}

/// Per rod a number of rows (PairMemory).
template <class Archive, class AnyState, class Whole> void exchangePairs(Archive &a, AnyState &s, Whole &whole) {
  std::size_t rods = s.pairs.size(), total = 0;
  std::vector<double> counts, rows;
  for (const auto &of_rod : s.pairs) {
    counts.push_back(double(of_rod.size()));
    for (const PairMemory &m : of_rod) {
      const auto row = m.numbers();
      rows.insert(rows.end(), row.begin(), row.end());
    }
  }
  total = rows.size();
  whole("rods_with_pairs", rods, 1e15);
  whole("pair_numbers", total, 1e15);
  a.array("pair_counts", counts, rods);
  a.array("pair_memory", rows, total);
  if constexpr (Archive::reads) {
    s.pairs.assign(rods, {});
    std::size_t next = 0;
    for (std::size_t r = 0; r < rods; ++r)
      for (double n = 0; n < counts[r] && next + PairMemory::width <= rows.size(); ++n, next += PairMemory::width)
        s.pairs[r].push_back(PairMemory::of(&rows[next]));
  }
}

} // namespace tendril
