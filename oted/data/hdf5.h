#pragma once
/// HDF5 files, whichever library reads and writes them. Every program links one of two sets of definitions: libhdf5
/// with a child process for the reading (oted/data/libhdf5), or in the Python module h5py (python/h5py_files.cc).

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "oted/base/array2.h"
#include "oted/data/d4rl_layout.h"
#include "oted/data/dataset.h"

namespace oted {

/// The arrays of an open file.
class Hdf5Reader : public ArraySource {
 public:
  explicit Hdf5Reader(std::string path) : path_(std::move(path)) {}
  virtual bool IsGroup(const std::string& name) const = 0;
  /// Whether the array holds unsigned bytes: images, or what an encoder made of them.
  virtual bool HoldsBytes(const std::string& name) const = 0;
  /// The names in a group, in byte order; "/" is the file's top.
  virtual std::vector<std::string> Names(const std::string& group) const = 0;
  /// @throws DataError "'FILE': NAME WHAT; REMEDY"
  [[noreturn]] void Fail(const std::string& name, std::string_view what, std::string_view remedy) const;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// The arrays of one new file. Every failure is a DataError that names the file that the user asked for.
class Hdf5Output {
 public:
  virtual ~Hdf5Output() = default;
  virtual void Group(const std::string& name) = 0;
  /// An attribute of a group.
  virtual void Attribute(const std::string& group, const char* name, int64_t value) = 0;
  virtual void Numbers(const std::string& name, const Array2<double>& m, bool as_float32) = 0;
  virtual void Numbers(const std::string& name, std::span<const double> v, bool as_float32) = 0;
  /// Whole numbers of any shape, as bytes or as 64-bit integers.
  virtual void Integers(const std::string& name, std::span<const double> v, const std::vector<int64_t>& shape,
                        bool as_bytes) = 0;
  /// h5py's bool: an enumeration of FALSE and TRUE over one byte.
  virtual void Flags(const std::string& name, std::span<const uint8_t> flags) = 0;
};

/// Opens `file` and gives back the dataset that `read` makes of it, without its path and sha256. libhdf5 does it in a
/// child process within LimitsFor the file. @throws DataError naming `file`; what `read` throws.
Dataset ReadHdf5File(const std::string& file, const ChildLimits& limits,
                     const std::function<Dataset(const Hdf5Reader&)>& read);

/// Writes a new file at `temporary_path`, of which errors speak as `path`. Equal calls give equal bytes.
/// @throws DataError
void WriteHdf5File(const std::string& temporary_path, const std::string& path,
                   const std::function<void(Hdf5Output&)>& write);

/// Whether float32 holds every value exactly.
bool FitsFloat32(std::initializer_list<std::span<const double>> arrays);

}  // namespace oted
