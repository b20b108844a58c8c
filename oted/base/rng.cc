#include "oted/base/rng.h"

#include <bit>
#include <cmath>
#include <numbers>
#include <numeric>

namespace oted {
namespace {

// SplitMix64 (Steele, Lea and Flood 2014): spreads a seed or a key over 64 bits.
uint64_t Mix(uint64_t x) {
  x += 0x9E3779B97F4A7C15ull;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
  return x ^ (x >> 31);
}

}  // namespace

Rng::Rng(uint64_t seed) {
  for (uint64_t& word : state_) word = seed = Mix(seed);
}

uint64_t Rng::Next() {
  auto& s = state_;
  const uint64_t result = std::rotl(s[0] + s[3], 23) + s[0];
  const uint64_t t = s[1] << 17;
  s[2] ^= s[0];
  s[3] ^= s[1];
  s[1] ^= s[2];
  s[0] ^= s[3];
  s[2] ^= t;
  s[3] = std::rotl(s[3], 45);
  return result;
}

double Rng::Uniform() { return static_cast<double>(Next() >> 11) * 0x1.0p-53; }

uint64_t Rng::Below(uint64_t n) {
  // The high word of a 128-bit product; the bias of n / 2^64 is far below anything drawn here.
  return static_cast<uint64_t>((static_cast<unsigned __int128>(Next()) * n) >> 64);
}

double Rng::Normal() {
  // Box-Muller, one of the pair: no carried value, so the state alone describes the stream.
  const double u = 1.0 - Uniform();
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * Uniform());
}

void Rng::FillNormal(std::span<float> out) {
  for (size_t i = 0; i < out.size(); i += 2) {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform()));
    const double angle = 2.0 * std::numbers::pi * Uniform();
    out[i] = static_cast<float>(radius * std::cos(angle));
    if (i + 1 < out.size()) out[i + 1] = static_cast<float>(radius * std::sin(angle));
  }
}

RngKey::RngKey(uint64_t seed) : value_(Mix(seed)) {}

RngKey RngKey::Stage(std::string_view name) const {
  // FNV-1a over the name, then mixed with the parent: stable over compilers and machines.
  uint64_t hash = 0xCBF29CE484222325ull;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3ull;
  RngKey key = *this;
  key.value_ = Mix(value_ ^ Mix(hash));
  return key;
}

RngKey RngKey::Index(uint64_t index) const {
  RngKey key = *this;
  key.value_ = Mix(value_ + Mix(index ^ 0xD6E8FEB86659FD93ull));
  return key;
}

std::vector<int> RandomPermutation(int n, Rng& rng) {
  std::vector<int> order(static_cast<size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  for (int i = n - 1; i > 0; --i) std::swap(order[i], order[rng.Below(static_cast<uint64_t>(i) + 1)]);
  return order;
}

}  // namespace oted
