#include "oted/stages/design/trajectories/left_out.h"

#include <algorithm>
#include <cmath>

#include "oted/matching/designer.h"
#include "oted/stages/design/replay/replay_fit.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kFewestRecordings = 3;   // to leave out whole ones
constexpr double kShortestPart = 1.4;  // [s]
constexpr int kMostJudged = 200;       // windows
constexpr double kSure = 2.0;          // standard errors
constexpr int kFewestFitted = 2;       // windows

bool AreMany(const std::vector<int>& recording) {
  return !recording.empty() && recording.back() + 1 >= kFewestRecordings;
}

/// What is left out together, the smallest such: a recording, or a piece of one.
struct Unit {
  int logged_as = 0;  // HeldOutParts::logged_as
  std::vector<Episode> episodes;
};

std::vector<Unit> UnitsOf(const HeldOutParts& parts, int shortest) {
  const std::vector<Episode> episodes = parts.learn.Episodes();
  const std::vector<int>& recording = parts.recording;
  const auto logged_as = [&](size_t e) {  // logs that were not divided have no recordings
    return recording.empty() ? static_cast<int>(e) : parts.logged_as[static_cast<size_t>(recording[e])];
  };
  std::vector<Unit> units;
  if (AreMany(recording)) {
    units.resize(static_cast<size_t>(recording.back()) + 1);
    for (size_t e = 0; e < episodes.size(); ++e) {
      Unit& unit = units[static_cast<size_t>(recording[e])];
      unit.logged_as = logged_as(e);
      unit.episodes.push_back(episodes[e]);
    }
    return units;
  }
  const int n_episodes = static_cast<int>(episodes.size()),
            wanted = (kMostLeftOut + n_episodes - 1) / std::max(1, n_episodes);
  for (size_t e = 0; e < episodes.size(); ++e) {
    const Episode& episode = episodes[e];
    const int n = std::clamp(episode.size() / shortest, 1, wanted);
    for (int k = 0; k < n; ++k) {
      const int begin = episode.begin + k * episode.size() / n, end = episode.begin + (k + 1) * episode.size() / n;
      units.push_back({logged_as(e), {{begin, end, episode.terminated && end == episode.end}}});
    }
  }
  return units;
}

}  // namespace

LeftOutRecordings::LeftOutRecordings(const Logs& logs, int n_threads)
    : space_(logs.factory.parameters()),
      recordings_(AreMany(logs.parts.recording)),
      part_of_row_(static_cast<size_t>(logs.parts.learn.size())) {
  const double period = logs.factory.spec().control_period_s;
  const auto steps_of = [&](double seconds) { return std::max(1, static_cast<int>(std::lround(seconds / period))); };
  const std::vector<Unit> units = UnitsOf(logs.parts, steps_of(kShortestPart));
  if (units.size() < 2) return;
  const size_t n_parts = std::min(size_t{kMostLeftOut}, units.size());
  std::vector<std::vector<Episode>> rows(n_parts);
  parts_.resize(n_parts);  // judges refer to their logs: nothing may move them
  for (size_t u = 0; u < units.size(); ++u) {
    const size_t part = u * n_parts / units.size();
    std::vector<int>& of = parts_[part].episodes;
    if (of.empty() || of.back() != units[u].logged_as) of.push_back(units[u].logged_as);
    for (const Episode& episode : units[u].episodes) {
      rows[part].push_back(episode);
      std::fill(part_of_row_.begin() + episode.begin, part_of_row_.begin() + episode.end, static_cast<int>(part));
    }
  }
  for (size_t k = 0; k < n_parts; ++k) {
    Part& part = parts_[k];
    part.logs = logs.parts.learn.Select(rows[k]);
    part.replayer = std::make_unique<WindowReplayer>(MakeReplayer(logs.factory, part.logs, logs.readings, n_threads));
    part.judge = std::make_unique<PredictionJudge>(*part.replayer, part.logs, logs.noise,
                                                   std::vector<int>{steps_of(logs.predicted_s)}, period,
                                                   kMostJudged / static_cast<int>(n_parts));
  }
}

int LeftOutRecordings::n_windows() const {
  int n = 0;
  for (const Part& part : parts_) n += part.judge->n_windows();
  return n;
}

std::vector<char> LeftOutRecordings::Touches(const std::vector<LogWindow>& windows, int part) const {
  std::vector<char> flags;
  for (const LogWindow& window : windows) {
    const auto first = static_cast<size_t>(window.begin), last = first + static_cast<size_t>(window.n_steps) - 1;
    flags.push_back(part_of_row_[first] == part || part_of_row_[last] == part ? 1 : 0);
  }
  return flags;
}

MatrixXd LeftOutRecordings::Errors(const std::function<VectorXd(int)>& x_of) const {
  std::vector<MatrixXd> of_parts;
  Eigen::Index n = 0;
  for (int k = 0; k < n_parts(); ++k) {
    const PredictionJudge& judge = *parts_[static_cast<size_t>(k)].judge;
    if (judge.n_windows() == 0) continue;
    of_parts.push_back(judge.MeanSquares(ToZ(space_, x_of(k))));
    n += of_parts.back().cols();
  }
  if (of_parts.empty()) return {};
  MatrixXd errors(of_parts.front().rows(), n);
  n = 0;
  for (const MatrixXd& of_part : of_parts) {
    errors.middleCols(n, of_part.cols()) = of_part;
    n += of_part.cols();
  }
  return errors;
}

LeftOutInTurn LeftOutRecordings::BesideNominal(const MatrixXd& errors, const MatrixXd& of_nominal) const {
  LeftOutInTurn in_turn{{}, recordings_};
  Eigen::Index at = 0;
  for (const Part& part : parts_) {
    const Eigen::Index n = part.judge->n_windows();
    if (n == 0) continue;
    const PredictionRatio ratio = ComparePredictions(errors.middleCols(at, n), of_nominal.middleCols(at, n));
    in_turn.parts.push_back({.error = std::exp(ratio.log_ratio / 2),
                             .sure = std::abs(ratio.log_ratio) > kSure * ratio.std,
                             .episodes = part.episodes});
    at += n;
  }
  return in_turn;
}

MatrixXd LeftOutRecordings::ErrorsAt(const VectorXd& x) const {
  return Errors([&](int) { return x; });
}

MatrixXd LeftOutRecordings::ErrorsOf(const LevelFit& fit, const std::function<void()>& tell) const {
  return Errors([&](int part) {
    const std::vector<char> left_out = Touches(fit.level().windows, part);
    if (std::ranges::count(left_out, 0) < kFewestFitted) return fit.x();
    LevelFit rest = fit.LeavingOut(left_out);
    rest.Descend(kStepsWithoutPart, [&](const VectorXd&) { tell(); });
    return rest.x();
  });
}

}  // namespace oted
