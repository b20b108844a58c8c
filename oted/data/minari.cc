#include "oted/data/minari.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <regex>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/hdf5.h"
#include "oted/data/minari_layout.h"

namespace oted {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kDataFile = "main_data.hdf5";
constexpr const char* kMetadataFile = "metadata.json";
/// The newest Minari whose layout this is; Minari refuses a version that it does not know.
constexpr const char* kMinariVersion = "0.5.4";
constexpr uint64_t kMaxMetadataBytes = uint64_t{1} << 24;

std::string WithoutTrailingSlash(std::string path) {
  while (path.size() > 1 && path.back() == '/') path.pop_back();
  return path;
}

/// What is wrong with a dataset that has no main_data.hdf5.
[[noreturn]] void FailNoData(const std::string& path, const fs::path& metadata) {
  std::error_code error;
  if (fs::is_regular_file(metadata, error) && fs::file_size(metadata, error) <= kMaxMetadataBytes) {
    const json object = json::parse(ReadFile(metadata), nullptr, false);
    if (object.is_object() && object.contains("data_format") && object["data_format"].is_string() &&
        object["data_format"] != "hdf5") {
      throw DataError(fmt::format(
          "'{}' is a Minari dataset in {} format, wanted hdf5; write it again in Minari with data_format=\"hdf5\"",
          path, object["data_format"].get<std::string>()));
    }
  }
  throw DataError(fmt::format(
      "'{}' is a folder without {}; give a Minari dataset's folder (NAME-v0, with data/{} in it), or a file", path,
      kDataFile, kDataFile));
}

/// What metadata.json says that concerns us.
struct Metadata {
  int64_t n_episodes = -1;  ///< -1: not said
  double period_s = 0;
  std::vector<std::string> observation_names;
  std::vector<std::string> action_names;
};

std::string Dump(const json& value) { return value.dump(-1, ' ', true, json::error_handler_t::replace); }

/// Our own keys, which Minari keeps: taken when they are sound.
std::vector<std::string> Names(const json& object, const char* key) {
  std::vector<std::string> names;
  const auto found = object.find(key);
  if (found == object.end() || !found->is_array()) return names;
  for (const json& name : *found) {
    if (!name.is_string()) return {};
    names.push_back(name.get<std::string>());
  }
  return names;
}

Metadata ReadMetadata(const std::string& file) {
  Metadata metadata;
  if (file.empty()) return metadata;
  std::error_code error;
  const uint64_t size = fs::file_size(file, error);
  if (error || size > kMaxMetadataBytes) {
    throw DataError(fmt::format("'{}' cannot be read or is larger than 16 MiB; download the dataset again", file));
  }
  const json object = json::parse(ReadFile(file), nullptr, false);
  if (!object.is_object()) {
    throw DataError(
        fmt::format("'{}' is not a JSON object, as Minari's metadata are; download the dataset again", file));
  }
  if (const auto found = object.find("data_format"); found != object.end() && *found != "hdf5") {
    throw DataError(
        fmt::format("'{}': data_format is {}, wanted \"hdf5\"; write it again in Minari with data_format=\"hdf5\"",
                    file, Dump(*found)));
  }
  if (const auto found = object.find("total_episodes"); found != object.end()) {
    if (!found->is_number_integer() || *found < 0) {
      throw DataError(
          fmt::format("'{}': total_episodes is {}, wanted a number; download the dataset again", file, Dump(*found)));
    }
    metadata.n_episodes = found->get<int64_t>();
  }
  metadata.observation_names = Names(object, "observation_names");
  metadata.action_names = Names(object, "action_names");
  if (const auto found = object.find("control_period_s"); found != object.end() && found->is_number()) {
    const double period_s = found->get<double>();
    if (period_s > 0 && std::isfinite(period_s)) metadata.period_s = period_s;
  }
  return metadata;
}

/// A Box space as Minari writes it; Python's JSON has Infinity literals.
std::string BoxSpace(bool is_float32, int size, const std::vector<double>& low, const std::vector<double>& high) {
  const auto list = [&](const std::vector<double>& bounds, const char* none) {
    std::vector<std::string> texts(static_cast<size_t>(size), none);
    for (size_t i = 0; i < bounds.size(); ++i) {
      if (std::isfinite(bounds[i])) texts[i] = json(bounds[i]).dump();
    }
    return fmt::format("{}", fmt::join(texts, ", "));
  };
  return fmt::format(R"({{"type": "Box", "dtype": "{}", "shape": [{}], "low": [{}], "high": [{}]}})",
                     is_float32 ? "float32" : "float64", size, list(low, "-Infinity"), list(high, "Infinity"));
}

/// The spaces of an image with one index behind it, as Minari writes Farama's grid worlds'.
json ImageSpace(const WriteOptions& options) {
  const auto filled = [&](int value) {
    json rows = json::array();
    for (int y = 0; y < options.image_shape[0]; ++y) {
      json row = json::array();
      for (int x = 0; x < options.image_shape[1]; ++x) row.push_back(std::vector<int>(options.image_shape[2], value));
      rows.push_back(row);
    }
    return rows;
  };
  json space = {{"type", "Dict"}};
  space["subspaces"][options.index_name] = {
      {"type", "Discrete"}, {"dtype", "int64"}, {"start", 0}, {"n", options.n_index}};
  space["subspaces"]["image"] = {
      {"type", "Box"}, {"dtype", "uint8"}, {"shape", options.image_shape}, {"low", filled(0)}, {"high", filled(255)}};
  return space;
}

void CheckWhole(const Array2<double>& m, double below, const char* what, const std::string& path) {
  for (const double value : m.values()) {
    if (value >= 0 && value < below && value == std::floor(value)) continue;
    throw DataError(fmt::format("'{}': {} hold {:g}, wanted whole numbers below {:g}; write .hdf5 or .npz", path, what,
                                value, below));
  }
}

/// Gymnasium's EnvSpec of the tasks that this program knows; empty for others, whose entry point it cannot say.
std::string EnvSpec(const std::string& id) {
  static const std::regex kPattern("(Hopper|HalfCheetah|Walker2d)-(v[45])");
  std::smatch match;
  if (!std::regex_match(id, match, kPattern)) return "";
  const std::string name = match[1];
  const std::string module = name == "HalfCheetah" ? "half_cheetah" : name == "Hopper" ? "hopper" : "walker2d";
  const json spec = {{"id", id},
                     {"entry_point", fmt::format("gymnasium.envs.mujoco.{}_{}:{}Env", module, match[2].str(), name)},
                     {"reward_threshold", nullptr},
                     {"nondeterministic", false},
                     {"max_episode_steps", 1000},
                     {"order_enforce", true},
                     {"disable_env_checker", false},
                     {"kwargs", json::object()},
                     {"additional_wrappers", json::array()},
                     {"vector_entry_point", nullptr}};
  return spec.dump();
}

void CheckChained(const Dataset& dataset, const std::string& path) {
  for (const Episode& episode : dataset.Episodes()) {
    for (int i = episode.begin; i + 1 < episode.end; ++i) {
      if (std::ranges::equal(dataset.next_observations.row(i), dataset.observations.row(i + 1))) continue;
      throw DataError(fmt::format(
          "'{}': next_observations[{}] is not observations[{}] of the same episode, and Minari's layout holds "
          "each state once; write .hdf5 or .npz, or mark a timeout there",
          path, i, i + 1));
    }
  }
}

/// Observations of one episode, T + 1 rows, as image and index.
void WriteImages(Hdf5Output& writer, const std::string& group, const Array2<double>& observations,
                 const WriteOptions& options) {
  std::vector<int64_t> shape = {observations.rows()};
  shape.insert(shape.end(), options.image_shape.begin(), options.image_shape.end());
  const size_t n_image = static_cast<size_t>(observations.cols()) - 1;
  std::vector<double> images, indices;
  for (int i = 0; i < observations.rows(); ++i) {
    const auto row = observations.row(i);
    images.insert(images.end(), row.begin(), row.begin() + static_cast<ptrdiff_t>(n_image));
    indices.push_back(row[n_image]);
  }
  writer.Group(group);
  writer.Integers(group + "/image", images, shape, true);
  writer.Integers(group + "/" + options.index_name, indices, {observations.rows()}, false);
}

void WriteEpisodes(Hdf5Output& writer, const Dataset& dataset, bool obs_fit, bool act_fit,
                   const WriteOptions& options) {
  const bool rewards_fit = FitsFloat32({dataset.rewards});
  const bool states_fit = FitsFloat32({dataset.qpos.values(), dataset.qvel.values()});
  const std::vector<Episode> episodes = dataset.Episodes();
  const auto rows = [](const Array2<double>& all, const Episode& episode) {
    Array2<double> some;
    for (int i = episode.begin; i < episode.end; ++i) some.AppendRow(all.row(i));
    return some;
  };
  for (size_t e = 0; e < episodes.size(); ++e) {
    const Episode& episode = episodes[e];
    const size_t begin = static_cast<size_t>(episode.begin), size = static_cast<size_t>(episode.size());
    const std::string group = fmt::format("episode_{}", e);
    writer.Group(group);
    writer.Attribute(group, "id", static_cast<int64_t>(e));
    writer.Attribute(group, "total_steps", episode.size());
    Array2<double> observations = rows(dataset.observations, episode);
    observations.AppendRow(dataset.next_observations.row(episode.end - 1));
    if (options.image_shape.empty()) {
      writer.Numbers(group + "/observations", observations, obs_fit);
    } else {
      WriteImages(writer, group + "/observations", observations, options);
    }
    const Array2<double> actions = rows(dataset.actions, episode);
    if (options.n_discrete_actions > 0) {
      writer.Integers(group + "/actions", actions.values(), {episode.size()}, false);
    } else {
      writer.Numbers(group + "/actions", actions, act_fit);
    }
    if (dataset.rewards.empty()) {
      const std::vector<double> none(size, std::numeric_limits<double>::quiet_NaN());
      writer.Numbers(group + "/rewards", none, false);
    } else {
      writer.Numbers(group + "/rewards", std::span(dataset.rewards).subspan(begin, size), rewards_fit);
    }
    std::vector<uint8_t> timeouts(dataset.timeouts.begin() + episode.begin, dataset.timeouts.begin() + episode.end);
    if (!episode.terminated) timeouts.back() = 1;
    writer.Flags(group + "/terminations", std::span(dataset.terminals).subspan(begin, size));
    writer.Flags(group + "/truncations", timeouts);
    if (!dataset.has_states()) continue;
    writer.Group(group + "/infos");
    writer.Numbers(group + "/infos/qpos", rows(dataset.qpos, episode), states_fit);
    writer.Numbers(group + "/infos/qvel", rows(dataset.qvel, episode), states_fit);
  }
}

}  // namespace

bool IsMinariName(const std::string& path) {
  static const std::regex kName("[A-Za-z0-9_][A-Za-z0-9_-]*-v[0-9]+");
  return std::regex_match(fs::path(WithoutTrailingSlash(path)).filename().string(), kName);
}

MinariFiles FindMinari(const std::string& path) {
  std::error_code error;
  fs::path folder = WithoutTrailingSlash(path);
  fs::path data = folder;
  if (fs::is_directory(folder, error)) {
    if (fs::is_directory(folder / "data", error)) folder /= "data";
    data = folder / kDataFile;
    if (!fs::is_regular_file(data, error)) FailNoData(path, folder / kMetadataFile);
  } else if (fs::is_regular_file(folder, error)) {
    folder = folder.parent_path();
  } else {
    throw DataError(fmt::format("dataset '{}' is neither a file nor a folder; check the path", path));
  }
  MinariFiles files{data.string(), ""};
  if (fs::is_regular_file(folder / kMetadataFile, error)) files.metadata = (folder / kMetadataFile).string();
  return files;
}

Dataset ReadMinari(const std::string& path, const DataOptions& options) {
  const MinariFiles files = FindMinari(path);
  const Metadata metadata = ReadMetadata(files.metadata);
  Dataset dataset = ReadHdf5File(files.data, options.hdf5_limits, [&](const Hdf5Reader& source) {
    return ReadMinariEpisodes(source, files.data, metadata.n_episodes);
  });
  dataset.period_s = metadata.period_s;
  const auto take = [](const std::vector<std::string>& names, int n, std::vector<std::string>& to) {
    if (static_cast<int>(names.size()) == n) to = names;
  };
  take(metadata.observation_names, dataset.obs_dim(), dataset.observation_names);
  take(metadata.action_names, dataset.act_dim(), dataset.action_names);
  return dataset;
}

void WriteMinari(const Dataset& dataset, const std::string& path, const WriteOptions& options) {
  dataset.Check();
  const fs::path target = WithoutTrailingSlash(path);
  std::error_code error;
  if (fs::exists(target, error)) {
    throw DataError(
        fmt::format("'{}' exists already; remove it, or write the next version (-v1, -v2, ...)", target.string()));
  }
  CheckChained(dataset, path);
  if (!options.image_shape.empty()) {
    const int n_image = options.image_shape[0] * options.image_shape[1] * options.image_shape[2];
    OTED_CHECK(dataset.obs_dim() == n_image + 1 && options.n_index > 0);
    CheckWhole(dataset.observations, 256, "observations", path);
    CheckWhole(dataset.next_observations, 256, "next_observations", path);
  }
  if (options.n_discrete_actions > 0) CheckWhole(dataset.actions, options.n_discrete_actions, "actions", path);
  for (const auto* bounds : {&options.action_low, &options.action_high}) {
    OTED_CHECK(bounds->empty() || static_cast<int>(bounds->size()) == dataset.act_dim());
  }
  // Made beside its place and renamed: a folder of this name is whole.
  AtomicFile folder(target);
  const fs::path temporary = folder.temporary_path();
  struct Remover {
    fs::path path;
    ~Remover() {
      std::error_code ignored;
      fs::remove_all(path, ignored);
    }
  } const remover{temporary};
  const fs::path data = temporary / "data";
  fs::create_directories(data, error);
  if (error) throw DataError(fmt::format("'{}': cannot make the folder ({}); is it writable?", path, error.message()));
  const bool obs_fit = FitsFloat32({dataset.observations.values(), dataset.next_observations.values()});
  const bool act_fit = FitsFloat32({dataset.actions.values()});
  WriteHdf5File((data / kDataFile).string(), path,
                [&](Hdf5Output& writer) { WriteEpisodes(writer, dataset, obs_fit, act_fit, options); });
  json metadata = {
      {"total_episodes", dataset.Episodes().size()},
      {"total_steps", dataset.size()},
      {"data_format", "hdf5"},
      {"jpeg_encoding", false},
      {"observation_space",
       options.image_shape.empty() ? BoxSpace(obs_fit, dataset.obs_dim(), {}, {}) : ImageSpace(options).dump()},
      {"action_space",
       options.n_discrete_actions > 0
           ? json({{"type", "Discrete"}, {"dtype", "int64"}, {"start", 0}, {"n", options.n_discrete_actions}}).dump()
           : BoxSpace(act_fit, dataset.act_dim(), options.action_low, options.action_high)},
      {"dataset_id", options.dataset_id.empty() ? target.filename().string() : options.dataset_id},
      {"algorithm_name", options.algorithm},
      {"author", json::array()},
      {"author_email", json::array()},
      {"code_permalink", ""},
      {"requirements", json::array()},
      {"minari_version", kMinariVersion}};
  if (const std::string spec = EnvSpec(options.environment); !spec.empty()) metadata["env_spec"] = spec;
  if (!dataset.observation_names.empty()) metadata["observation_names"] = dataset.observation_names;
  if (!dataset.action_names.empty()) metadata["action_names"] = dataset.action_names;
  if (dataset.period_s > 0) metadata["control_period_s"] = dataset.period_s;
  // Minari's unit: megabytes, to one decimal.
  const auto bytes = static_cast<double>(fs::file_size(data / kDataFile, error));
  metadata["dataset_size"] = std::round(bytes / 1e5) / 10;
  WriteFileAtomically(data / kMetadataFile, metadata.dump(2, ' ', false, json::error_handler_t::replace) + "\n");
  folder.Commit();
}

}  // namespace oted
