// What the report shows of the design at work: logs replayed in the nominal and in the designed simulator, as curves
// and, where there is an OpenGL context, as pictures. Nothing else depends on it.

#include <fmt/format.h>

#include <array>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/run/pipeline.h"
#include "oted/run/replay_record.h"
#include "oted/sim/film.h"
#include "oted/sim/replay.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr int kWidth = 256, kHeight = 256;  // [pixels]
constexpr int kMostFrames = 64;

/// What an earlier call left, if it was made from the same; null otherwise. Unlike a stage's result it is simply made
/// again.
json ReadIfCurrent(const fs::path& file, const std::string& fingerprint) {
  if (!fs::exists(file)) return nullptr;
  json record = ReadJson(file);
  return record.is_object() && record.value("fingerprint", "") == fingerprint ? record : json();
}

/// Every `stride`-th pose.
Array2<double> Thinned(const Array2<double>& poses, int stride) {
  Array2<double> thinned;
  for (int t = 0; t < poses.rows(); t += stride) thinned.AppendRow(poses.row(t));
  return thinned;
}

Array2<double> ReplayedPoses(Simulator& simulator, const Dataset& dataset, int begin, int n_steps,
                             const std::vector<double>& z) {
  Array2<double> poses;
  ReplayWindows(simulator, dataset, std::vector{begin}, n_steps, z, [&](int) { poses.AppendRow(simulator.pose(0)); });
  return poses;
}

/// Draws the window that `replay` shows into `folder`. @return motion.json, with a note in place of pictures where none
/// can be drawn
json DrawMotion(const SimulatorFactory& factory, const Dataset& dataset, const json& replay, const fs::path& folder) {
  json motion = {{"schema", "oted.motion/1"}};
  std::string why_not;
  const auto renderer = factory.MakeRenderer(kWidth, kHeight, &why_not);
  if (renderer == nullptr) {
    motion["note"] = why_not;
    return motion;
  }
  const int n_steps = replay.at("n_steps").get<int>(), begin = replay.at("window").at("row").get<int>();
  const auto nominal = replay.at("nominal").get<std::vector<double>>();
  const auto designed = replay.at("designed").get<std::vector<double>>();
  const auto simulator = factory.Make(1, 1);
  // The logged poses are drawn in the designed model's shape: the target's own is not known.
  simulator->SetParameters(0, designed);
  const std::array<std::pair<const char*, PoseTrack>, 3> tracks = {
      {{"logged", {designed, PosesOfObservations(*simulator, LoggedWindow(dataset, begin, n_steps))}},
       {"nominal", {nominal, ReplayedPoses(*simulator, dataset, begin, n_steps, nominal)}},
       {"designed", {designed, ReplayedPoses(*simulator, dataset, begin, n_steps, designed)}}}};
  const int stride = (n_steps + kMostFrames) / kMostFrames;
  const double period = factory.spec().control_period_s;
  for (const auto& [name, track] : tracks) {
    const FilmStrip strip = DrawFilm(*renderer, {track.z, Thinned(track.poses, stride)});
    const std::string file = fmt::format("{}.webp", name);
    WriteFileAtomically(folder / file, strip.webp);
    motion["panels"].push_back({{"name", name}, {"file", file}});
    motion["columns"] = strip.columns;
    motion["n_frames"] = strip.n_frames;
  }
  motion["width"] = kWidth;
  motion["height"] = kHeight;
  motion["frame_period_s"] = stride * period;
  motion["renderer"] = renderer->description();
  return motion;
}

}  // namespace

void Pipeline::CheckCanDraw() const {
  if (config_.report.motion != "true") return;
  std::string why_not;
  if (factory_->MakeRenderer(kWidth, kHeight, &why_not) != nullptr) return;
  throw UsageError(fmt::format("report.motion is true, but {}; or set it to auto or false", why_not));
}

void Pipeline::ReplayLogs() {
  SelectSimulator();
  const fs::path folder = directory_.root() / "motion";
  const std::string fingerprint = Fingerprint({"replay", SelectionFingerprint(), config_.report.replay_steps});
  json replay = ReadIfCurrent(folder / "replay.json", fingerprint);
  if (replay.is_null()) {
    const json design = ReadJson(directory_.root() / "design.json");
    std::vector<double> designed;
    for (const json& parameter : design.at("parameters")) designed.push_back(parameter.at("mode").get<double>());
    replay = MakeReplayRecord(*factory_, dataset_, config_.report.replay_steps, factory_->parameters().Nominal(),
                              designed, context_.n_threads);
    replay["fingerprint"] = fingerprint;
    WriteJson(folder / "replay.json", replay);
  }
  const json drawn = ReadIfCurrent(folder / "motion.json", fingerprint);
  if (config_.report.motion == "false") {
    fs::remove(folder / "motion.json");
    for (const char* name : {"logged", "nominal", "designed"}) fs::remove(folder / fmt::format("{}.webp", name));
  } else if (replay.contains("window") && !drawn.contains("panels")) {
    json motion = DrawMotion(*factory_, dataset_, replay, folder);
    motion["fingerprint"] = fingerprint;
    WriteJson(folder / "motion.json", motion);
  }
}

}  // namespace oted
