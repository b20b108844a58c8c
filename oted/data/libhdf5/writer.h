#pragma once
/// Writes the arrays of one new HDF5 file. Include from .cc files only; hold an Hdf5Session while it lives.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/data/hdf5.h"
#include "oted/data/libhdf5/handles.h"

namespace oted {

/// Every failure is a DataError that names the file that the user asked for. Equal calls give equal bytes. The file is
/// made in memory and written by Close: libhdf5 crashes at the program's end where a disk has not taken its bytes.
class Hdf5Writer : public Hdf5Output {
 public:
  Hdf5Writer(const std::string& temporary_path, const std::string& path);
  void Group(const std::string& name) override;
  void Attribute(const std::string& group, const char* name, int64_t value) override;
  void Numbers(const std::string& name, const Array2<double>& m, bool as_float32) override;
  void Numbers(const std::string& name, std::span<const double> v, bool as_float32) override;
  void Integers(const std::string& name, std::span<const double> v, const std::vector<int64_t>& shape,
                bool as_bytes) override;
  void Flags(const std::string& name, std::span<const uint8_t> flags) override;
  void Close();

 private:
  [[noreturn]] void Fail(const std::string& what, const char* remedy) const;
  /// Compressed, or as it is where the file could not be read again otherwise.
  void Write(const std::string& name, hid_t file_type, hid_t memory_type, std::span<const hsize_t> dims,
             const void* values);
  /// @return bytes stored
  uint64_t Write(const std::string& name, hid_t file_type, hid_t memory_type, std::span<const hsize_t> dims,
                 const void* values, bool deflates);
  std::string temporary_path_, path_;
  Hdf5Handle file_;
  uint64_t claimed_ = 0, stored_ = 0;  ///< of all arrays: as doubles, and in the file [bytes]
};

}  // namespace oted
