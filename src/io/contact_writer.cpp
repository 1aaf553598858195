#include "tendril/io/contact_writer.hpp"

namespace tendril {
namespace {

struct Column {
  const char *name, *unit;
  hsize_t components;
  bool integer;
  void (*put)(const ContactReading &reading, double *out);
};

void putVector(const Vec3 &v, double *out) { std::copy(v.data(), v.data() + 3, out); }

constexpr Column columns[] = {
    {"rod", "1", 1, true, [](const ContactReading &c, double *out) { *out = c.rod; }},
    {"collider", "1", 1, true, [](const ContactReading &c, double *out) { *out = c.collider; }},
    {"edge", "1", 1, true, [](const ContactReading &c, double *out) { *out = c.edge; }},
    {"at", "1", 1, false, [](const ContactReading &c, double *out) { *out = c.at; }},
    {"gap", "m", 1, false, [](const ContactReading &c, double *out) { *out = c.gap; }},
    {"position", "m", 3, false, [](const ContactReading &c, double *out) { putVector(c.place, out); }},
    {"normal", "1", 3, false, [](const ContactReading &c, double *out) { putVector(c.normal, out); }},
    {"normal_force", "N", 3, false, [](const ContactReading &c, double *out) { putVector(c.force, out); }},
    {"friction", "N", 3, false, [](const ContactReading &c, double *out) { putVector(c.friction, out); }}};

} // namespace

ContactWriter::ContactWriter(Hdf5File &file) {
  file.createGroup("contacts");
  for (const Column &column : columns) {
    const std::string path = std::string("contacts/") + column.name;
    columns_.push_back(std::make_unique<Hdf5Series>(
        file, path, column.components > 1 ? std::vector<hsize_t>{column.components} : std::vector<hsize_t>{},
        column.integer));
    file.writeAttribute(path, "unit", std::string(column.unit));
  }
  end_ = std::make_unique<Hdf5Series>(file, "contacts/end", std::vector<hsize_t>{}, true);
}

void ContactWriter::append(const std::vector<ContactReading> &readings) {
  double values[3];
  for (const ContactReading &reading : readings)
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      columns[k].put(reading, values);
      columns_[k]->append(values);
    }
  rows_ += double(readings.size());
  end_->append(&rows_);
}

/// What tells of rows goes behind them.
void ContactWriter::flush() {
  for (const auto &column : columns_) column->flush();
  end_->flush();
}

std::size_t ContactWriter::waitingBytes() const {
  std::size_t waiting = end_->waitingBytes();
  for (const auto &column : columns_) waiting += column->waitingBytes();
  return waiting;
}

void ContactWriter::abandon() {
  for (auto &column : columns_) (void)column.release();
  (void)end_.release();
}

} // namespace tendril
