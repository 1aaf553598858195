#pragma once
/// \file contact_writer.hpp
/// The group /contacts of a trajectory: samples in contact, frame after frame.

#include "tendril/contact/contact.hpp"
#include "tendril/io/hdf5.hpp"

namespace tendril {

/// Rows of all frames one behind the other; `/contacts/end` has for each frame the number of rows up to its last.
class ContactWriter {
public:
  explicit ContactWriter(Hdf5File &file);
  void append(const std::vector<ContactReading> &readings);
  void flush();
  std::size_t waitingBytes() const;
  /// Lets the datasets go without closing them (see ~TrajectoryWriter).
  void abandon();

private:
  std::vector<std::unique_ptr<Hdf5Series>> columns_;
  std::unique_ptr<Hdf5Series> end_;
  double rows_ = 0;
};

} // namespace tendril
