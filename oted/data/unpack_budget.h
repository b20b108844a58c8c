#pragma once
/// How much a packed file may become: one rule for every reader (npz, csv.gz, ONNX with weights in other
/// files), and so for every writer.

#include <cstdint>

namespace oted {

constexpr uint64_t kUnpackRatio = 16;

/// Bytes that a file of `packed` bytes may unpack to. Numbers are held as doubles and twice, as observations and as
/// next ones: of a file of a few MB the program then holds less than 2 GiB.
constexpr uint64_t UnpackBudget(uint64_t packed) { return (uint64_t{1} << 26) + kUnpackRatio * packed; }

/// The same for what the program itself keeps: a replay buffer may be zeros for the most part.
constexpr uint64_t CheckpointBudget(uint64_t packed) { return (uint64_t{1} << 30) + kUnpackRatio * packed; }

}  // namespace oted
