#pragma once
/// Keyed random streams. A stream is named by what it is for (seed, stage, index), never by the thread that draws
/// from it or by the order of completion, so results are the same at any thread count.

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace oted {

/// A generator: xoshiro256++ (Blackman and Vigna 2019). Copyable; the copy continues the same stream.
class Rng {
 public:
  /// Equal seeds give equal streams.
  explicit Rng(uint64_t seed);

  uint64_t Next();
  /// Uniform in [0, 1), 53 bits.
  double Uniform();
  /// Uniform in [low, high).
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }
  /// Uniform in {0, ..., n - 1}; n >= 1.
  uint64_t Below(uint64_t n);
  /// Standard normal.
  double Normal();
  /// Fills `out` with standard normals.
  void FillNormal(std::span<float> out);

  using State = std::array<uint64_t, 4>;
  const State& state() const { return state_; }
  void set_state(const State& state) { state_ = state; }

 private:
  State state_;
};

/// The name of a random stream: derive sub-keys with Stage and Index, then draw from MakeRng().
class RngKey {
 public:
  explicit RngKey(uint64_t seed);
  [[nodiscard]] RngKey Stage(std::string_view name) const;
  [[nodiscard]] RngKey Index(uint64_t index) const;
  [[nodiscard]] Rng MakeRng() const { return Rng(value_); }
  uint64_t value() const { return value_; }

 private:
  uint64_t value_;
};

/// A uniformly random order of 0, ..., n - 1.
std::vector<int> RandomPermutation(int n, Rng& rng);

}  // namespace oted
