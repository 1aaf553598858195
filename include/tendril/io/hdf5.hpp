#pragma once
/// \file hdf5.hpp
/// The little of HDF5 that tendril needs, with owned handles and errors as exceptions (which never leave io/).

#include <hdf5.h>

#include "tendril/model/scene.hpp"

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tendril {

/// A file of results that cannot be written, though its folder could be.
struct WriteError : SceneError {
  using SceneError::SceneError;
  int exitCode() const override { return 3; }
};

/// An HDF5 handle, closed by `close`.
template <herr_t (*close)(hid_t)> class Hdf5Handle {
public:
  Hdf5Handle(hid_t id = -1) : id_(id) {}
  Hdf5Handle(Hdf5Handle &&other) noexcept : id_(std::exchange(other.id_, -1)) {}
  Hdf5Handle &operator=(Hdf5Handle &&other) noexcept {
    std::swap(id_, other.id_);
    return *this;
  }
  ~Hdf5Handle() {
    if (id_ >= 0) close(id_);
  }
  operator hid_t() const { return id_; }

private:
  hid_t id_;
};
using Hdf5Group = Hdf5Handle<H5Gclose>;
using Hdf5Object = Hdf5Handle<H5Oclose>;
using Hdf5Dataset = Hdf5Handle<H5Dclose>;
using Hdf5Space = Hdf5Handle<H5Sclose>;
using Hdf5Properties = Hdf5Handle<H5Pclose>;
using Hdf5Attribute = Hdf5Handle<H5Aclose>;
using Hdf5Type = Hdf5Handle<H5Tclose>;

class Hdf5File {
public:
  /// For reading. \throws SceneError
  static Hdf5File open(const std::string &path);
  /// A new file whose datasets only grow; every flush leaves it readable (HDF5's single writer, multiple readers).
  /// \throws SceneError
  static Hdf5File create(const std::string &path);
  /// A file that is complete, to add to it. \throws SceneError
  static Hdf5File reopen(const std::string &path);
  /// No datasets may be created afterwards.
  void startAppending();

  bool has(const std::string &name) const;
  /// Whole dataset as doubles, row-major; `columns` is its last dimension (1 for a list).
  /// \param rows how many it has to have; another number is refused before there is memory for it
  std::vector<double> read(const std::string &name, hsize_t columns, std::optional<hsize_t> rows = {}) const;
  /// Whole dataset as doubles, row-major, with its shape, which has one dimension at least.
  std::vector<double> readAll(const std::string &name, std::vector<hsize_t> *shape) const;
  /// Text of a dataset, of no more than `most` bytes.
  std::string readText(const std::string &name, std::size_t most) const;
  /// Attributes of the file: a number, a text; nothing where there is none, or something else.
  std::optional<double> number(const std::string &attribute) const;
  std::optional<std::string> text(const std::string &attribute) const;
  /// Writes what HDF5 still holds back and closes. \throws WriteError when that fails, as on a full disk
  void close();

  void createGroup(const std::string &name);
  /// \param unit becomes the attribute `unit`, if not empty
  void write(const std::string &name, const std::vector<hsize_t> &shape, const double *values,
             const std::string &unit = "");
  void write(const std::string &name, const std::vector<hsize_t> &shape, const int *values);
  /// A list of strings, UTF-8, padded with zeros to the longest.
  void write(const std::string &name, const std::vector<std::string> &values);
  void writeText(const std::string &name, const std::string &text);
  void writeAttribute(const std::string &name, const std::string &value);
  void writeAttribute(const std::string &name, const std::vector<double> &values);
  void writeAttribute(const std::string &name, int value);
  void writeAttribute(const std::string &name, double value);
  /// Of a group or dataset.
  void writeAttribute(const std::string &object, const std::string &name, const std::string &value);
  void writeAttribute(const std::string &object, const std::string &name, double value);
  void writeAttribute(const std::string &object, const std::string &name, int value);
  void writeAttribute(const std::string &object, const std::string &name, const std::vector<double> &values);
  hid_t id() const { return file_; }

private:
  Hdf5Handle<H5Fclose> file_;
  std::string path_;

  void writeStrings(const std::string &name, hid_t space, std::size_t width, const char *values);
  Hdf5Object objectAt(const std::string &name) const;
  Hdf5Dataset datasetAt(const std::string &name) const;
  static std::vector<hsize_t> shapeOf(hid_t data);
  std::vector<double> valuesOf(hid_t data, const std::string &name, const std::vector<hsize_t> &shape) const;
};

/// A dataset that grows by one slab per append: shape (n, slab...). Small slabs wait in memory until flush() and are
/// then written at once; large ones go to the file directly. Readers see both after flush().
class Hdf5Series {
public:
  Hdf5Series(const Hdf5File &file, const std::string &name, const std::vector<hsize_t> &slab, bool integer = false);
  void append(const double *values);
  void flush();
  std::size_t waitingBytes() const { return waiting_.size() * sizeof(double); }

private:
  Hdf5Dataset dataset_;
  std::vector<hsize_t> extent_;
  std::size_t slab_size_ = 1; ///< values in a slab
  std::vector<double> waiting_;

  bool isLarge() const;
  void write(const double *values, hsize_t slabs);
};

} // namespace tendril
