#pragma once
/// \file contact_writer.hpp
/// The groups /contacts and /touching of a trajectory: samples in contact with obstacles, and with rods and bodies.

#include "tendril/contact/contact.hpp"
#include "tendril/contact/pair_readings.hpp"
#include "tendril/io/row_writer.hpp"

namespace tendril {

using ContactWriter = RowWriter<ContactReading>;
using PairWriter = RowWriter<PairReading>;
std::unique_ptr<ContactWriter> makeContactWriter(Hdf5File &file);
std::unique_ptr<PairWriter> makePairWriter(Hdf5File &file);

} // namespace tendril
