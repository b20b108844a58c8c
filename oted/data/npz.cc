#include "oted/data/npz.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/d4rl_layout.h"
#include "oted/data/npy.h"
#include "oted/data/unpack_budget.h"
#include "oted/data/zip.h"

namespace oted {
namespace {

constexpr std::string_view kEnding = ".npy";

/// D4RL's arrays in an archive.
class NpzSource : public ArraySource {
 public:
  explicit NpzSource(const NpzArrays& arrays) : arrays_(arrays) {}
  bool Has(const std::string& name) const override { return arrays_.contains(name); }
  std::vector<int64_t> Shape(const std::string& name) const override { return arrays_.at(name).shape; }
  void Read(const std::string& name, std::span<double> out) const override {
    std::visit(
        [&](const auto& values) {
          OTED_CHECK(values.size() == out.size());
          std::ranges::transform(values, out.begin(), [](auto value) { return static_cast<double>(value); });
        },
        arrays_.at(name).values);
  }

 private:
  const NpzArrays& arrays_;
};

NpyArray Flags(const std::vector<uint8_t>& flags) {
  std::vector<uint8_t> values(flags.size());
  std::ranges::transform(flags, values.begin(), [](uint8_t flag) { return static_cast<uint8_t>(flag != 0); });
  NpyArray array(std::move(values));
  array.is_bool = true;
  return array;
}

}  // namespace

NpyArray::NpyArray(const Array2<double>& m)
    : shape{m.rows(), m.cols()}, values(std::vector<double>(m.values().begin(), m.values().end())) {}

int64_t NpyArray::size() const {
  int64_t n = 1;
  for (const int64_t size : shape) n *= size;
  return n;
}

std::vector<double> NpyArray::ToDouble() const {
  return std::visit([](const auto& v) { return std::vector<double>(v.begin(), v.end()); }, values);
}

namespace {

NpzArrays ArraysOf(std::map<std::string, std::string> members, const std::string& name_in_errors) {
  NpzArrays arrays;
  while (!members.empty()) {
    // Each member is let go as soon as it is parsed: two copies of a large dataset are enough.
    const auto node = members.extract(members.begin());
    const std::string& member = node.key();
    if (!member.ends_with(kEnding)) continue;
    const std::string name = member.substr(0, member.size() - kEnding.size());
    arrays[name] = ParseNpy(node.mapped(), fmt::format("'{}': array '{}'", name_in_errors, name));
  }
  return arrays;
}

std::map<std::string, std::string> MembersOf(const NpzArrays& arrays) {
  std::map<std::string, std::string> members;
  for (const auto& [name, array] : arrays) members[name + std::string(kEnding)] = NpyBytes(array);
  return members;
}

}  // namespace

NpzArrays ParseNpz(const std::string& bytes, const std::string& name_in_errors) {
  return ArraysOf(ParseZip(bytes, name_in_errors), name_in_errors);
}

NpzArrays ReadCheckpoint(const std::filesystem::path& path) {
  const std::string bytes = ReadFile(path);
  try {
    if (HasZipSeal(bytes))
      return ArraysOf(ParseZip(bytes, path.string(), CheckpointBudget(bytes.size())), path.string());
  } catch (const DataError&) {  // whose remedy is that of a file from elsewhere
  }
  throw DataError(fmt::format("checkpoint '{}' is truncated or damaged; remove '{}' to begin its work anew",
                              path.string(), path.parent_path().string()));
}

std::string NpzBytes(const NpzArrays& arrays) { return ZipBytes(MembersOf(arrays)); }

NpzArrays ReadNpz(const std::filesystem::path& path) { return ParseNpz(ReadFile(path), path.string()); }

void WriteNpz(const NpzArrays& arrays, const std::filesystem::path& path) {
  WriteFileAtomically(path, NpzBytes(arrays));
}

void WriteCheckpoint(const NpzArrays& arrays, const std::filesystem::path& path) {
  WriteFileAtomically(path, ZipBytes(MembersOf(arrays), ZipMethod::kStored));
}

Dataset ReadDatasetNpz(const std::string& path, const DataOptions& options) {
  const NpzArrays arrays = ReadNpz(path);
  return ReadD4rlArrays(NpzSource(arrays), path, options.max_episode_steps);
}

void WriteDatasetNpz(const Dataset& dataset, const std::string& path) {
  dataset.Check();
  NpzArrays arrays;
  arrays["observations"] = NpyArray(dataset.observations);
  arrays["actions"] = NpyArray(dataset.actions);
  arrays["next_observations"] = NpyArray(dataset.next_observations);
  if (!dataset.rewards.empty()) arrays["rewards"] = NpyArray(dataset.rewards);
  arrays["terminals"] = Flags(dataset.terminals);
  arrays["timeouts"] = Flags(dataset.timeouts);
  if (dataset.has_states()) {
    arrays["infos/qpos"] = NpyArray(dataset.qpos);
    arrays["infos/qvel"] = NpyArray(dataset.qvel);
  }
  WriteNpz(arrays, path);
}

}  // namespace oted
