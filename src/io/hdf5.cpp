#include "tendril/io/hdf5.hpp"

#include <algorithm>
#include <chrono>
#include <thread>

namespace tendril {
namespace {

constexpr std::size_t chunk_bytes = 1 << 16;  ///< at least a slab, about as much as this
constexpr std::size_t direct_bytes = 1 << 18; ///< slabs from here on are not worth collecting
constexpr const char *write_failed = "the trajectory cannot be written; is the disk full?";

template <class Error = SceneError, class Id> Id checked(Id id, const std::string &what) {
  if (id < 0) throw Error(what);
  return id;
}
template <class Id> Id written(Id id, const std::string &what) { return checked<WriteError>(id, what); }

/// Whoever reads a file looks into it for a moment, which keeps it from being locked; another run stays.
template <class Open> hid_t patiently(Open open) {
  constexpr int most_tries = 20;
  hid_t file = open();
  for (int k = 1; file < 0 && k < most_tries; ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(25));
    file = open();
  }
  return file;
}

/// An attribute, new or there already: a file that is appended to takes other values, but nothing new.
hid_t attributeOf(hid_t to, const std::string &name, hid_t type, hid_t space) {
  return H5Aexists(to, name.c_str()) > 0 ? H5Aopen(to, name.c_str(), H5P_DEFAULT)
                                         : H5Acreate2(to, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT);
}

void attach(hid_t to, const std::string &name, const std::string &value) {
  const Hdf5Type type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, std::max<std::size_t>(value.size(), 1));
  H5Tset_cset(type, H5T_CSET_UTF8);
  const Hdf5Space space = H5Screate(H5S_SCALAR);
  const Hdf5Attribute a = H5Acreate2(to, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT);
  written(H5Awrite(a, type, value.c_str()), write_failed);
}

void attach(hid_t to, const std::string &name, const std::vector<double> &values) {
  const hsize_t size = values.size();
  const Hdf5Space space = H5Screate_simple(1, &size, nullptr);
  const Hdf5Attribute a = attributeOf(to, name, H5T_IEEE_F64LE, space);
  written(H5Awrite(a, H5T_NATIVE_DOUBLE, values.data()), write_failed);
}

template <class Number> void attachScalar(hid_t to, const std::string &name, Number value, hid_t stored, hid_t native) {
  const Hdf5Space space = H5Screate(H5S_SCALAR);
  const Hdf5Attribute a = attributeOf(to, name, stored, space);
  written(H5Awrite(a, native, &value), write_failed);
}
void attach(hid_t to, const std::string &name, double value) {
  attachScalar(to, name, value, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE);
}
void attach(hid_t to, const std::string &name, int value) {
  attachScalar(to, name, value, H5T_STD_I32LE, H5T_NATIVE_INT);
}

} // namespace

Hdf5File Hdf5File::open(const std::string &path) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  Hdf5File f;
  f.path_ = path;
  f.file_ = checked(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), path + ": is not a readable HDF5 file");
  return f;
}

Hdf5File Hdf5File::create(const std::string &path) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  Hdf5File f;
  f.path_ = path;
  Hdf5Properties access = H5Pcreate(H5P_FILE_ACCESS);
  H5Pset_libver_bounds(access, H5F_LIBVER_LATEST, H5F_LIBVER_LATEST); // what appending under readers needs
  const hid_t file = patiently([&] { return H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access); });
  f.file_ = checked(file, path + ": cannot be written; is another run using it?");
  return f;
}

Hdf5File Hdf5File::reopen(const std::string &path) {
  Hdf5File f;
  f.path_ = path;
  f.file_ = checked(patiently([&] { return H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT); }),
                    path + ": cannot be opened again; is another program using it?");
  return f;
}

void Hdf5File::startAppending() {
  written(H5Fstart_swmr_write(file_), path_ + ": cannot be written; is the disk full?");
}

bool Hdf5File::has(const std::string &name) const { return H5Lexists(file_, name.c_str(), H5P_DEFAULT) > 0; }

std::vector<double> Hdf5File::read(const std::string &name, hsize_t columns, std::optional<hsize_t> rows) const {
  const Hdf5Dataset data = datasetAt(name);
  const std::vector<hsize_t> shape = shapeOf(data);
  const bool fits = columns == 1 ? shape.size() == 1 : shape.size() == 2 && shape.back() == columns;
  if (!fits)
    throw SceneError(path_ + ": dataset '" + name + "' must have " +
                     (columns == 1 ? "one dimension" : "shape (n, " + std::to_string(columns) + ")"));
  if (rows && shape[0] != *rows)
    throw SceneError(path_ + ": '" + name + "' has " + std::to_string(shape[0]) + " entries, where it takes " +
                     std::to_string(*rows));
  return valuesOf(data, name, shape);
}

std::vector<double> Hdf5File::readAll(const std::string &name, std::vector<hsize_t> *shape) const {
  const Hdf5Dataset data = datasetAt(name);
  *shape = shapeOf(data);
  return valuesOf(data, name, *shape);
}

Hdf5Dataset Hdf5File::datasetAt(const std::string &name) const {
  if (!has(name)) throw SceneError(path_ + ": has no dataset '" + name + "'");
  return checked(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), path_ + ": '" + name + "' is not a dataset");
}

std::vector<hsize_t> Hdf5File::shapeOf(hid_t data) {
  const Hdf5Space space = H5Dget_space(data);
  const int rank = H5Sget_simple_extent_ndims(space);
  std::vector<hsize_t> shape(std::size_t(std::max(rank, 1)), rank > 0 ? 1 : 0);
  if (rank > 0) H5Sget_simple_extent_dims(space, shape.data(), nullptr);
  return shape;
}

std::vector<double> Hdf5File::valuesOf(hid_t data, const std::string &name, const std::vector<hsize_t> &shape) const {
  // Rows that were declared but never written would be zeros. Compressed, a byte stands for a thousand at most.
  constexpr hsize_t most_rows = 50'000'000, most_compressed = 1100;
  if (shape[0] > most_rows)
    throw SceneError(path_ + ": dataset '" + name + "' declares " + std::to_string(shape[0]) + " rows, at most " +
                     std::to_string(most_rows) + " are read");
  hsize_t values_count = 1;
  for (const hsize_t n : shape) values_count *= std::min(n, most_rows);
  const hsize_t stored = H5Dget_storage_size(data);
  if (values_count / most_compressed > stored)
    throw SceneError(path_ + ": dataset '" + name + "' declares " + std::to_string(shape[0]) +
                     " rows, but the file holds only " + std::to_string(stored) + " bytes of them");
  if (values_count > 6 * most_rows) throw SceneError(path_ + ": dataset '" + name + "' has too many numbers");
  std::vector<double> values(values_count);
  checked(H5Dread(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()),
          path_ + ": '" + name + "' does not hold numbers");
  for (const double v : values)
    if (!std::isfinite(v)) throw SceneError(path_ + ": dataset '" + name + "' holds a number that is not finite");
  return values;
}

std::string Hdf5File::readText(const std::string &name, std::size_t most) const {
  if (!has(name)) throw SceneError(path_ + ": has no dataset '" + name + "'");
  const Hdf5Dataset data =
      checked(H5Dopen2(file_, name.c_str(), H5P_DEFAULT), path_ + ": '" + name + "' is not a dataset");
  const Hdf5Type type = H5Dget_type(data);
  const Hdf5Space space = H5Dget_space(data);
  const std::string no_text = path_ + ": '" + name + "' is not a text";
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) > 0 || H5Sget_simple_extent_npoints(space) != 1 ||
      H5Tget_size(type) > most)
    throw SceneError(no_text);
  std::string value(H5Tget_size(type), '\0');
  checked(H5Dread(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, value.data()), no_text);
  value.resize(std::min(value.find('\0'), value.size()));
  return value;
}

std::optional<double> Hdf5File::number(const std::string &attribute) const {
  if (H5Aexists(file_, attribute.c_str()) <= 0) return {};
  const Hdf5Attribute a = H5Aopen(file_, attribute.c_str(), H5P_DEFAULT);
  const Hdf5Space space = H5Aget_space(a);
  double value;
  if (H5Sget_simple_extent_npoints(space) != 1 || H5Aread(a, H5T_NATIVE_DOUBLE, &value) < 0) return {};
  return value;
}

std::optional<std::string> Hdf5File::text(const std::string &attribute) const {
  if (H5Aexists(file_, attribute.c_str()) <= 0) return {};
  const Hdf5Attribute a = H5Aopen(file_, attribute.c_str(), H5P_DEFAULT);
  const Hdf5Type type = H5Aget_type(a);
  const Hdf5Space space = H5Aget_space(a);
  if (H5Tget_class(type) != H5T_STRING || H5Sget_simple_extent_npoints(space) != 1) return {};
  if (H5Tis_variable_str(type) > 0) { // as h5py writes them
    char *value = nullptr;
    if (H5Aread(a, type, &value) < 0 || !value) return {};
    const std::string text = value;
    H5free_memory(value);
    return text;
  }
  std::string value(H5Tget_size(type), '\0');
  if (H5Aread(a, type, value.data()) < 0) return {};
  value.resize(std::min(value.find('\0'), value.size()));
  return value;
}

void Hdf5File::close() {
  const herr_t flushed = H5Fflush(file_, H5F_SCOPE_LOCAL);
  file_ = {};
  written(flushed, path_ + ": cannot be written; is the disk full?");
}

void Hdf5File::createGroup(const std::string &name) {
  Hdf5Group(written(H5Gcreate2(file_, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                    path_ + ": cannot be written; is the disk full?"));
}

void Hdf5File::write(const std::string &name, const std::vector<hsize_t> &shape, const double *values,
                     const std::string &unit) {
  const Hdf5Space space = H5Screate_simple(int(shape.size()), shape.data(), nullptr);
  const Hdf5Dataset data =
      written(H5Dcreate2(file_, name.c_str(), H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
              path_ + ": cannot be written; is the disk full?");
  written(H5Dwrite(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values),
          path_ + ": cannot be written; is the disk full?");
  if (!unit.empty()) attach(data, "unit", unit);
}

void Hdf5File::write(const std::string &name, const std::vector<hsize_t> &shape, const int *values) {
  const Hdf5Space space = H5Screate_simple(int(shape.size()), shape.data(), nullptr);
  const Hdf5Dataset data =
      written(H5Dcreate2(file_, name.c_str(), H5T_STD_I32LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
              path_ + ": cannot be written; is the disk full?");
  written(H5Dwrite(data, H5T_NATIVE_INT, H5S_ALL, H5S_ALL, H5P_DEFAULT, values),
          path_ + ": cannot be written; is the disk full?");
}

void Hdf5File::write(const std::string &name, const std::vector<std::string> &values) {
  std::size_t width = 1;
  for (const std::string &value : values) width = std::max(width, value.size());
  std::string all;
  for (const std::string &value : values) all.append(value).append(width - value.size(), '\0');
  const hsize_t size = values.size();
  writeStrings(name, Hdf5Space(H5Screate_simple(1, &size, nullptr)), width, all.data());
}

void Hdf5File::writeText(const std::string &name, const std::string &text) {
  writeStrings(name, Hdf5Space(H5Screate(H5S_SCALAR)), std::max<std::size_t>(text.size(), 1), text.c_str());
}

void Hdf5File::writeStrings(const std::string &name, hid_t space, std::size_t width, const char *values) {
  const Hdf5Type type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, width);
  H5Tset_cset(type, H5T_CSET_UTF8);
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  const Hdf5Dataset data = written(H5Dcreate2(file_, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                                   path_ + ": cannot be written; is the disk full?");
  written(H5Dwrite(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values),
          path_ + ": cannot be written; is the disk full?");
}

void Hdf5File::writeAttribute(const std::string &name, const std::string &value) { attach(file_, name, value); }
void Hdf5File::writeAttribute(const std::string &name, const std::vector<double> &values) {
  attach(file_, name, values);
}
void Hdf5File::writeAttribute(const std::string &name, int value) { attach(file_, name, value); }
void Hdf5File::writeAttribute(const std::string &name, double value) { attach(file_, name, value); }

void Hdf5File::writeAttribute(const std::string &object, const std::string &name, const std::string &value) {
  attach(objectAt(object), name, value);
}
void Hdf5File::writeAttribute(const std::string &object, const std::string &name, double value) {
  attach(objectAt(object), name, value);
}
void Hdf5File::writeAttribute(const std::string &object, const std::string &name, int value) {
  attach(objectAt(object), name, value);
}
void Hdf5File::writeAttribute(const std::string &object, const std::string &name, const std::vector<double> &values) {
  attach(objectAt(object), name, values);
}

Hdf5Object Hdf5File::objectAt(const std::string &name) const {
  return checked(H5Oopen(file_, name.c_str(), H5P_DEFAULT), path_ + ": has nothing of the name '" + name + "'");
}

Hdf5Series::Hdf5Series(const Hdf5File &file, const std::string &name, const std::vector<hsize_t> &slab, bool integer)
    : extent_(slab) {
  extent_.insert(extent_.begin(), 0);
  std::vector<hsize_t> most = extent_, chunk = extent_;
  for (const hsize_t n : slab) slab_size_ *= n;
  most[0] = H5S_UNLIMITED;
  chunk[0] = std::clamp<hsize_t>(chunk_bytes / std::max<hsize_t>(slab_size_ * sizeof(double), 1), 1, 1024);
  const Hdf5Space space = H5Screate_simple(int(extent_.size()), extent_.data(), most.data());
  const Hdf5Properties create = H5Pcreate(H5P_DATASET_CREATE);
  H5Pset_chunk(create, int(chunk.size()), chunk.data());
  H5Pset_fill_time(
      create,
      H5D_FILL_TIME_NEVER); // all of the extent is written; without this, large chunks pass through memory twice
  const Hdf5Properties access = H5Pcreate(H5P_DATASET_ACCESS);
  if (isLarge()) H5Pset_chunk_cache(access, 0, 0, 1); // no cache: to the file from where the values are
  const hid_t type = integer ? H5T_STD_I64LE : H5T_IEEE_F64LE;
  dataset_ = written(H5Dcreate2(file.id(), name.c_str(), type, space, H5P_DEFAULT, create, access),
                     "dataset " + name + " cannot be created");
}

bool Hdf5Series::isLarge() const { return slab_size_ * sizeof(double) >= direct_bytes; }

void Hdf5Series::append(const double *values) {
  if (isLarge())
    write(values, 1);
  else
    waiting_.insert(waiting_.end(), values, values + slab_size_);
}

void Hdf5Series::flush() {
  if (!waiting_.empty()) write(waiting_.data(), waiting_.size() / slab_size_);
  waiting_.clear();
  written(H5Dflush(dataset_), write_failed);
}

void Hdf5Series::write(const double *values, hsize_t slabs) {
  std::vector<hsize_t> start(extent_.size(), 0), count = extent_;
  start[0] = extent_[0];
  count[0] = slabs;
  extent_[0] += slabs;
  written(H5Dset_extent(dataset_, extent_.data()), write_failed);
  const Hdf5Space file_space = H5Dget_space(dataset_),
                  memory = H5Screate_simple(int(count.size()), count.data(), nullptr);
  H5Sselect_hyperslab(file_space, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
  written(H5Dwrite(dataset_, H5T_NATIVE_DOUBLE, memory, file_space, H5P_DEFAULT, values), write_failed);
}

} // namespace tendril
