#include "oted/run/replay_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>

#include "oted/run/record_reader.h"
#include "oted/sim/replay.h"

namespace oted {
namespace {

using nlohmann::json;

constexpr int kMostWindows = 32;

using Windows = std::vector<Array2<double>>;

struct Side {
  std::vector<ReplayStart> starts;
  Windows windows;
  std::vector<std::vector<double>> errors;  // per window, per step
  double MeanError(size_t window) const {
    return std::accumulate(errors[window].begin(), errors[window].end(), 0.0) /
           static_cast<double>(errors[window].size());
  }
};

// Infinite and unknown numbers are null.
json Number(double value) { return std::isfinite(value) ? json(value) : json(); }

/// The share `q` of the windows has at most this error, at each step: nearest rank, so that infinite ones count as any.
json Quantile(const std::vector<std::vector<double>>& errors, double q) {
  json list = json::array();
  for (size_t t = 0; t < errors.front().size(); ++t) {
    std::vector<double> values;
    for (const auto& window : errors) values.push_back(window[t]);
    std::sort(values.begin(), values.end());
    list.push_back(Number(values[static_cast<size_t>(q * static_cast<double>(values.size() - 1) + 0.5)]));
  }
  return list;
}

json Growth(const Side& side) {
  return {{"median", Quantile(side.errors, 0.5)},
          {"low", Quantile(side.errors, 0.25)},
          {"high", Quantile(side.errors, 0.75)}};
}

json Column(const Array2<double>& window, int c) {
  json list = json::array();
  for (int t = 0; t < window.rows(); ++t) list.push_back(Number(window(t, c)));
  return list;
}

/// Root mean square error of one channel over all windows and steps, in spreads; infinite when a window diverged.
double ChannelError(const Windows& logged, const Windows& replayed, int c, double spread) {
  double sum = 0;
  int n = 0;
  for (size_t w = 0; w < logged.size(); ++w) {
    for (int t = 1; t < logged[w].rows(); ++t, ++n) sum += std::pow(replayed[w](t, c) - logged[w](t, c), 2);
  }
  const double error = std::sqrt(sum / n) / spread;
  return std::isfinite(error) ? error : std::numeric_limits<double>::infinity();
}

/// The window in the middle of the order by error in the designed simulator.
size_t MedianWindow(const Side& designed) {
  std::vector<size_t> order(designed.windows.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return designed.MeanError(a) < designed.MeanError(b); });
  return order[(order.size() - 1) / 2];
}

json Window(const Dataset& dataset, int begin) {
  const std::vector<Episode> episodes = dataset.Episodes();
  size_t e = 0;
  while (begin >= episodes[e].end) ++e;
  return {{"row", begin}, {"episode", e + 1}, {"step", begin - episodes[e].begin}};
}

constexpr int kPictures = 8;

/// The first channel of an image of kinds: what each cell is, in the image's own order.
json Cells(std::span<const double> observation, const SimulatorSpec& spec) {
  json cells = json::array();
  const int n = spec.image_shape[0] * spec.image_shape[1], stride = spec.image_shape[2];
  for (int i = 0; i < n; ++i) cells.push_back(static_cast<int>(observation[static_cast<size_t>(i * stride)]));
  return cells;
}

/// How episodes begin in the logs and in the two simulators: pictures to look at.
json FirstImages(const SimulatorFactory& factory, const Dataset& dataset, const std::vector<double>& nominal,
                 const std::vector<double>& designed) {
  const SimulatorSpec& spec = factory.spec();
  json images = {{"columns", spec.image_shape[0]}, {"rows", spec.image_shape[1]}};
  const Array2<double> starts = dataset.EpisodeStarts();
  for (int i = 0; i < std::min(kPictures, starts.rows()); ++i) images["logged"].push_back(Cells(starts.row(i), spec));
  const auto simulator = factory.Make(1, 1);
  for (const auto& [name, z] : {std::pair("nominal", &nominal), std::pair("designed", &designed)}) {
    simulator->SetParameters(0, *z);
    for (uint64_t i = 0; i < kPictures; ++i) {
      Rng rng = RngKey(1).Stage("pictures").Index(i).MakeRng();
      simulator->Reset(0, rng);
      images[name].push_back(Cells(simulator->observation(0), spec));
    }
  }
  return images;
}

/// Root mean square errors of each channel that moves, and its curves in the window that is shown; the largest error of
/// the nominal simulator first.
json Channels(const ReplayRequest& request, const Windows& logged, const Side& nominal, const Side& designed,
              size_t shown) {
  const SimulatorSpec& spec = request.factory.spec();
  const std::vector<double> spreads = ChannelSpreads(request.dataset);
  std::vector<std::pair<double, json>> channels;
  for (int c = 0; c < request.dataset.obs_dim(); ++c) {
    const size_t i = static_cast<size_t>(c);
    if (spreads[i] <= 0) continue;  // it stands still: nothing to see
    const double error = ChannelError(logged, nominal.windows, c, spreads[i]);
    const std::string name =
        i < spec.observation_names.size() ? spec.observation_names[i] : fmt::format("observation {}", c);
    channels.push_back({error,
                        {{"name", name},
                         {"unit", i < spec.observation_units.size() ? spec.observation_units[i] : ""},
                         {"index", c},
                         {"spread", spreads[i]},
                         {"error_nominal", Number(error)},
                         {"error_designed", Number(ChannelError(logged, designed.windows, c, spreads[i]))},
                         {"logged", Column(logged[shown], c)},
                         {"nominal", Column(nominal.windows[shown], c)},
                         {"designed", Column(designed.windows[shown], c)}}});
  }
  std::stable_sort(channels.begin(), channels.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  json list = json::array();
  for (auto& [error, channel] : channels) list.push_back(std::move(channel));
  return list;
}

}  // namespace

std::string FilmOf(const std::string& panel) { return panel + ".webp"; }

json MakeReplayRecord(const ReplayRequest& request) {
  const auto& [factory, dataset, n_predicted, nominal, designed, finder, n_threads] = request;
  const SimulatorSpec& spec = factory.spec();
  const int n_lead = finder == nullptr ? 0 : finder->n_lead(), n_steps = n_lead + n_predicted;
  json record = {{"schema", kReplaySchema},
                 {"task", spec.task},
                 {"n_steps", n_steps},
                 {"n_lead", n_lead},
                 {"nominal", nominal},
                 {"designed", designed},
                 {"control_period_s", spec.control_period_s}};
  if (!spec.can_set_state && finder == nullptr) {
    if (!spec.image_shape.empty() && !spec.observation_levels.empty()) {
      record["images"] = FirstImages(factory, dataset, nominal, designed);
    }
    record["note"] = fmt::format("{} cannot be put into a logged state, so its logs cannot be replayed.", spec.task);
    return record;
  }
  const std::vector<int> rows = ReplayStarts(*factory.Make(1, 1), dataset, n_steps, kMostWindows);
  if (rows.empty()) {
    record["note"] = fmt::format(
        "No stretch of {} logged steps lies within one episode and starts in a state that the simulator can be put "
        "into; a smaller report.replay_steps may help.",
        n_steps);
    return record;
  }
  Windows logged;
  for (const int row : rows) logged.push_back(LoggedWindow(dataset, row, n_steps));
  const std::vector<double> spreads = ChannelSpreads(dataset);
  const auto simulator = factory.Make(static_cast<int>(rows.size()), n_threads);
  const auto replay = [&](const std::vector<double>& z) {
    Side side{finder == nullptr ? AsLogged(rows) : finder->Find(rows, n_steps, z), {}, {}};
    side.windows = ReplayWindows(*simulator, dataset, side.starts, n_steps, z);
    for (size_t w = 0; w < logged.size(); ++w) {
      side.errors.push_back(ReplayError(logged[w], side.windows[w], spreads));
    }
    return side;
  };
  const Side at_nominal = replay(nominal), at_designed = replay(designed);
  const size_t shown = MedianWindow(at_designed);

  record["n_windows"] = rows.size();
  record["window"] = Window(dataset, rows[shown]);
  if (finder != nullptr) {
    record["window"]["starts"] = {{"nominal", at_nominal.starts[shown].state},
                                  {"designed", at_designed.starts[shown].state}};
  }
  record["error"] = {{"nominal", Growth(at_nominal)}, {"designed", Growth(at_designed)}};
  record["channels"] = Channels(request, logged, at_nominal, at_designed, shown);
  return record;
}

std::optional<ShownWindow> ShownIn(const json& replay, const std::string& where) {
  const RecordReader reader(replay, kReplaySchema, where);
  if (!reader.Has("window")) return std::nullopt;
  const RecordReader window = reader.At("window");
  ShownWindow shown{.begin = window.Get<int>("row"),
                    .n_steps = reader.Get<int>("n_steps"),
                    .nominal = reader.Numbers("nominal"),
                    .designed = reader.Numbers("designed")};
  if (window.Has("starts")) {
    shown.nominal_start = window.At("starts").Numbers("nominal");
    shown.designed_start = window.At("starts").Numbers("designed");
  }
  return shown;
}

}  // namespace oted
