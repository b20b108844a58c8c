#include "oted/run/replay_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/seal.h"
#include "oted/run/artifacts.h"
#include "oted/run/record_reader.h"
#include "oted/run/replay_record.h"
#include "oted/run/sensor_noise_of.h"
#include "oted/sim/film.h"
#include "oted/sim/log_window.h"
#include "oted/sim/replay.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr int kWidth = 256, kHeight = 256;  // [pixels]
constexpr int kMostFrames = 64;
constexpr double kReplaySeconds = 0.5;
constexpr int kFewestSteps = 50;
constexpr std::array<const char*, 3> kPanels = {"logged", "nominal", "designed"};

/// The stretch of the logs that the report shows, and the two simulators that repeat it.
struct ShownWindow {
  int begin = 0;    ///< row of the logs
  int n_steps = 0;  ///< control steps
  std::vector<double> nominal, designed;
  std::vector<double> nominal_start, designed_start;  ///< as ReplayStart::state
};

/// The seals of what it is made from.
json Sources(const Artifact& artifact) {
  json seals = json::object();
  for (const fs::path& source : artifact.made_from) {
    seals[source.lexically_relative(artifact.file.parent_path()).generic_string()] = SealOf(ReadSealed(source));
  }
  return seals;
}

/// What an earlier call left, if it is whole and was made from the same; null otherwise. Unlike a stage's result it is
/// simply made again.
json ReadIfCurrent(const RunSetup& run, const Artifact& artifact) {
  if (!fs::exists(artifact.file)) return nullptr;
  try {
    json record = ReadSealed(artifact.file);
    if (record.value("fingerprint", "") != artifact.fingerprint || record["made_from"] != Sources(artifact)) return {};
    if (DamagedFiles(record, artifact.file).empty()) return record;
  } catch (const DataError&) {
  }
  run.context.log->Warning(
      fmt::format("'{}' or a file beside it is damaged, and is made again", artifact.file.string()));
  return nullptr;
}

void WriteComplete(const Artifact& artifact, json& record, const std::vector<std::string>& files) {
  record["fingerprint"] = artifact.fingerprint;
  record["made_from"] = Sources(artifact);
  Seal(record, artifact.file.parent_path(), files);
  WriteJson(artifact.file, record);
}

/// Every `stride`-th pose.
Array2<double> Thinned(const Array2<double>& poses, int stride) {
  Array2<double> thinned;
  for (int t = 0; t < poses.rows(); t += stride) thinned.AppendRow(poses.row(t));
  return thinned;
}

Array2<double> ReplayedPoses(Simulator& simulator, const Dataset& dataset, const ReplayStart& start, int n_steps,
                             const std::vector<double>& z) {
  Array2<double> poses;
  ReplayWindows(simulator, dataset, {&start, 1}, n_steps, z, [&](int) { poses.AppendRow(simulator.pose(0)); });
  return poses;
}

/// How the robot moves in each panel, in the order of kPanels.
std::array<PoseTrack, 3> Tracks(const RunSetup& run, const ShownWindow& window) {
  const auto simulator = run.factory->Make(1, 1);
  // The logged poses are drawn in the designed model's shape: the target's own is not known.
  simulator->SetParameters(0, window.designed);
  const Array2<double> logged = LoggedWindow(run.dataset, window.begin, window.n_steps);
  const auto replayed = [&](const std::vector<double>& start, const std::vector<double>& z) {
    return ReplayedPoses(*simulator, run.dataset, {window.begin, start}, window.n_steps, z);
  };
  return {{{window.designed, PosesOfObservations(*simulator, logged)},
           {window.nominal, replayed(window.nominal_start, window.nominal)},
           {window.designed, replayed(window.designed_start, window.designed)}}};
}

/// Draws `window` into `folder`. @return motion.json, with a note in place of pictures where none can be drawn
json DrawMotion(const RunSetup& run, const ShownWindow& window, const fs::path& folder,
                std::vector<std::string>& files) {
  json motion = {{"schema", "oted.motion/1"}};
  std::string why_not;
  const auto renderer = run.factory->MakeRenderer(kWidth, kHeight, &why_not);
  if (renderer == nullptr) {
    motion["note"] = why_not;
    return motion;
  }
  const std::array<PoseTrack, 3> tracks = Tracks(run, window);
  const int stride = (window.n_steps + kMostFrames) / kMostFrames;
  for (size_t i = 0; i < tracks.size(); ++i) {
    const FilmStrip strip = DrawFilm(*renderer, {tracks[i].z, Thinned(tracks[i].poses, stride)});
    const std::string file = fmt::format("{}.webp", kPanels[i]);
    WriteFileAtomically(folder / file, strip.webp);
    files.push_back(file);
    motion["panels"].push_back({{"name", kPanels[i]}, {"file", file}});
    motion["columns"] = strip.columns;
    motion["n_frames"] = strip.n_frames;
  }
  motion["width"] = kWidth;
  motion["height"] = kHeight;
  motion["frame_period_s"] = stride * run.spec().control_period_s;
  motion["renderer"] = renderer->description();
  return motion;
}

/// None where nothing could be replayed.
std::optional<ShownWindow> ShownIn(const json& replay, const std::string& where) {
  const RecordReader reader(replay, "oted.replay/1", where);
  if (!reader.Has("window")) return std::nullopt;
  const RecordReader window = reader.At("window");
  ShownWindow shown{window.Get<int>("row"),
                    reader.Get<int>("n_steps"),
                    reader.Numbers("nominal"),
                    reader.Numbers("designed"),
                    {},
                    {}};
  if (window.Has("starts")) {
    shown.nominal_start = window.At("starts").Numbers("nominal");
    shown.designed_start = window.At("starts").Numbers("designed");
  }
  return shown;
}

/// As many control steps as the configuration says; by default half a second, and at least kFewestSteps.
int ReplaySteps(const RunSetup& run) {
  if (run.config.report.replay_steps > 0) return run.config.report.replay_steps;
  const double period = run.spec().control_period_s;
  return std::max(kFewestSteps, period > 0 ? static_cast<int>(std::lround(kReplaySeconds / period)) : 0);
}

json Replayed(const RunSetup& run, const DesignRecord& design) {
  const std::vector<double> nominal = run.parameters().Nominal(), designed = design.BestMode();
  std::optional<StartFinder> finder;
  if (!run.spec().can_set_state && run.spec().can_replay()) {
    finder.emplace(*run.factory, run.dataset, SensorNoiseOf(design, run.dataset), run.context.n_threads);
  }
  return MakeReplayRecord({.factory = *run.factory,
                           .dataset = run.dataset,
                           .n_steps = ReplaySteps(run),
                           .nominal = nominal,
                           .designed = designed,
                           .starts = finder ? &*finder : nullptr,
                           .n_threads = run.context.n_threads});
}

void RemoveMotion(const fs::path& folder) {
  fs::remove(folder / "motion.json");
  for (const char* name : kPanels) fs::remove(folder / fmt::format("{}.webp", name));
}

}  // namespace

void CheckCanDraw(const RunConfig& config, const SimulatorFactory& factory) {
  if (config.report.motion != Motion::kTrue) return;
  std::string why_not;
  if (factory.MakeRenderer(kWidth, kHeight, &why_not) != nullptr) return;
  throw UsageError(fmt::format("report.motion is true, but {}; or set it to auto or false", why_not));
}

void ReplayLogs(const RunSetup& run, const DesignRecord& design) {
  const Artifact artifact = ReplayArtifact(run);
  const fs::path folder = artifact.file.parent_path();
  json replay = ReadIfCurrent(run, artifact);
  if (replay.is_null()) {
    replay = Replayed(run, design);
    WriteComplete(artifact, replay, {});
  }
  if (run.config.report.motion == Motion::kFalse) return RemoveMotion(folder);
  const std::optional<ShownWindow> window = ShownIn(replay, artifact.file.string());
  const Artifact film{.file = folder / "motion.json",
                      .schema = "oted.motion/1",
                      .fingerprint = artifact.fingerprint,
                      .made_from = {artifact.file}};
  if (!window || ReadIfCurrent(run, film).contains("panels")) return;
  std::vector<std::string> files;
  json motion = DrawMotion(run, *window, folder, files);
  WriteComplete(film, motion, files);
}

}  // namespace oted
