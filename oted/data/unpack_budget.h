#pragma once
/// How much a packed file may become: one rule for every reader (npz, csv.gz, ONNX with weights in other
/// files), and so for every writer.

#include <cstdint>

namespace oted {

constexpr uint64_t kUnpackRatio = 16;

/// Bytes that a file of `packed` bytes may unpack to. Numbers are held as doubles and twice, as observations and as
/// next ones: of a file of a few MB the program then holds less than 2 GiB.
constexpr uint64_t UnpackBudget(uint64_t packed) { return (uint64_t{1} << 26) + kUnpackRatio * packed; }

/// The same for the numbers of an HDF5 file, counted as doubles: a robot that rests for an hour takes a few KB in one,
/// and its chunks are unpacked one by one.
constexpr uint64_t Hdf5Budget(uint64_t packed) { return (uint64_t{1} << 28) + kUnpackRatio * packed; }

/// The same for what the program itself keeps: a replay buffer may be zeros for the most part.
constexpr uint64_t CheckpointBudget(uint64_t packed) { return (uint64_t{1} << 30) + kUnpackRatio * packed; }

}  // namespace oted
