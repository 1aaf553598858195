#pragma once
/// \file row_writer.hpp
/// Groups of a trajectory with rows of which each frame has as many as there are then.

#include "tendril/io/hdf5.hpp"

#include <span>

namespace tendril {

/// Rows of all frames one behind the other; `end` in their group has for each frame the number of rows up to its last.
template <class Row> class RowWriter {
public:
  struct Column {
    const char *name, *unit;
    hsize_t components;
    bool integer;
    void (*put)(const Row &row, double *out);
  };

  /// \param columns stay in place
  RowWriter(Hdf5File &file, const std::string &group, std::span<const Column> columns) : columns_(columns) {
    file.createGroup(group);
    for (const Column &column : columns) {
      const std::string path = group + "/" + column.name;
      series_.push_back(std::make_unique<Hdf5Series>(
          file, path, column.components > 1 ? std::vector<hsize_t>{column.components} : std::vector<hsize_t>{},
          column.integer));
      file.writeAttribute(path, "unit", std::string(column.unit));
    }
    series_.push_back(std::make_unique<Hdf5Series>(file, group + "/end", std::vector<hsize_t>{}, true));
  }

  /// The rows of another frame.
  void append(const std::vector<Row> &rows) {
    double values[3];
    for (const Row &row : rows)
      for (std::size_t k = 0; k < columns_.size(); ++k) {
        columns_[k].put(row, values);
        series_[k]->append(values);
      }
    count_ += double(rows.size());
    series_.back()->append(&count_);
  }
  /// What tells of rows goes behind them.
  void flush() {
    for (const auto &series : series_) series->flush();
  }
  std::size_t waitingBytes() const {
    std::size_t waiting = 0;
    for (const auto &series : series_) waiting += series->waitingBytes();
    return waiting;
  }
  /// Lets the datasets go without closing them (see ~TrajectoryWriter).
  void abandon() {
    for (auto &series : series_) (void)series.release();
  }

private:
  std::span<const Column> columns_;
  std::vector<std::unique_ptr<Hdf5Series>> series_; ///< of each column, then `end`
  double count_ = 0;
};

} // namespace tendril
