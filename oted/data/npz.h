#pragma once
/// NumPy's .npz archives (zip of .npy), without pickles: named numeric arrays in and out.

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "oted/data/dataset.h"

namespace oted {

/// A numeric array in C order.
struct NpyArray {
  std::vector<int64_t> shape;
  std::variant<std::vector<double>, std::vector<float>, std::vector<int64_t>, std::vector<uint8_t>> values;
  bool is_bool = false;  ///< uint8_t values are NumPy's bool, 0 or 1

  NpyArray() = default;
  /// One dimension, as long as the values.
  explicit NpyArray(std::vector<float> v) : shape{static_cast<int64_t>(v.size())}, values(std::move(v)) {}
  explicit NpyArray(std::vector<double> v) : shape{static_cast<int64_t>(v.size())}, values(std::move(v)) {}
  explicit NpyArray(std::vector<int64_t> v) : shape{static_cast<int64_t>(v.size())}, values(std::move(v)) {}
  explicit NpyArray(std::vector<uint8_t> v) : shape{static_cast<int64_t>(v.size())}, values(std::move(v)) {}
  explicit NpyArray(const Array2<double>& m);

  /// The product of the shape; 1 for a scalar.
  int64_t size() const;
  /// The values converted to double, whatever they are stored as.
  std::vector<double> ToDouble() const;
};

using NpzArrays = std::map<std::string, NpyArray>;

/// Reads every array; float16/32/64, signed and unsigned integers and bool, little-endian, C or Fortran order; stored
/// or deflated. Sizes are checked against the file before anything is allocated.
/// @throws DataError naming file and array.
NpzArrays ReadNpz(const std::filesystem::path& path);
/// The same of a checkpoint: one without the seal that WriteCheckpoint leaves is damaged. It may unpack to more, too.
NpzArrays ReadCheckpoint(const std::filesystem::path& path);

/// Writes a deflated archive, atomically and with a fixed time stamp: equal arrays give equal bytes. Each array is
/// below 4 GiB.
/// @throws DataError
void WriteNpz(const NpzArrays& arrays, const std::filesystem::path& path);
/// The same of a checkpoint, which is stored: to deflate an agent's replay takes longer than to train it meanwhile.
void WriteCheckpoint(const NpzArrays& arrays, const std::filesystem::path& path);
/// The same, to and from memory.
std::string NpzBytes(const NpzArrays& arrays);
NpzArrays ParseNpz(const std::string& bytes, const std::string& name_in_errors);

/// A dataset with the array names of D4RL ("observations", "infos/qpos", ...).
Dataset ReadDatasetNpz(const std::string& path, const DataOptions& options = {});
void WriteDatasetNpz(const Dataset& dataset, const std::string& path);

}  // namespace oted
