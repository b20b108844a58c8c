#include "oted/stages/design/replay/prediction.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "oted/base/picked.h"
#include "oted/stages/design/replay/replay_fit.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLead = 0.05;       // [s] of readings that tell a start state
constexpr double kUnreadLead = 0.1;  // the same where they do not show all of it
constexpr int kFewestLead = 4;       // control steps
constexpr int kLeadIterations = 4, kGuessedIterations = 15;
constexpr int kFollowed = 3;  // leads that the start of an imitated window is fitted to at first
constexpr int kMostRowsBefore = 16;

JudgedChannels ChannelsOf(const Dataset& logs, const ReadingModel& readings) {
  VectorXd weight(readings.obs_dim());
  for (Eigen::Index c = 0; c < weight.size(); ++c) weight[c] = readings.computed[static_cast<size_t>(c)] == 0 ? 1 : 0;
  return {ChannelScales(logs), weight / weight.sum()};
}

}  // namespace

int LeadSteps(const ReadingModel& readings, double period_s) {
  const double lead = readings.unread.empty() ? kLead : kUnreadLead;
  const int n_steps = period_s > 0 ? static_cast<int>(std::lround(lead / period_s)) : 0;
  return readings.longest_age() + std::max(kFewestLead, n_steps);
}

PredictionJudge::PredictionJudge(WindowReplayer& replayer, const Dataset& logs, const VectorXd& noise,
                                 std::vector<int> horizons, double period_s, int most)
    : replayer_(replayer),
      logs_(logs),
      variance_(noise.cwiseAbs2()),
      start_step_(replayer.readings().StartStep()),
      channels_(ChannelsOf(logs, replayer.readings())),
      horizons_(std::move(horizons)) {
  n_lead_ = LeadSteps(replayer.readings(), period_s);
  int longest = 0;
  for (const Episode& episode : logs.Episodes()) longest = std::max(longest, episode.size());
  longest -= n_lead_ + replayer.n_past_actions();
  if (longest < 1) {
    horizons_.clear();
    return;
  }
  const int shortest = std::min(horizons_.front(), longest);
  std::erase_if(horizons_, [&](int n_steps) { return n_steps > longest; });
  if (horizons_.empty()) horizons_ = {shortest};
  lasting_.resize(horizons_.size());

  struct Place {
    LogWindow window;
    int end;  // of its episode
  };
  std::vector<Place> all;
  for (const Episode& episode : logs.Episodes()) {
    for (int i = episode.begin + replayer.n_past_actions(); i + n_lead_ + shortest <= episode.end;
         i += std::max(1, shortest / 2)) {
      all.push_back({{i, n_lead_ + shortest, episode.begin}, episode.end});
    }
  }
  const size_t n = std::min(all.size(), static_cast<size_t>(most));
  for (size_t k = 0; k < n; ++k) {
    auto& [window, end] = all[k * all.size() / n];
    if (!replayer.CanStart(window)) continue;
    for (size_t h = 0; h < horizons_.size(); ++h) {
      const LogWindow* last = lasting_[h].empty() ? nullptr : &windows_[static_cast<size_t>(lasting_[h].back())];
      const bool is_crowded = last != nullptr && last->episode_begin == window.episode_begin &&
                              window.begin < last->begin + horizons_[h] / 2;
      if (window.begin + n_lead_ + horizons_[h] > end || is_crowded) continue;
      lasting_[h].push_back(n_windows());
      window.n_steps = n_lead_ + horizons_[h];
    }
    windows_.push_back(window);
  }
}

PredictionJudge::PredictionJudge(WindowReplayer& replayer, const Dataset& logs, const VectorXd& noise,
                                 const std::vector<int>& rows, int n_steps, double period_s)
    : replayer_(replayer),
      logs_(logs),
      variance_(noise.cwiseAbs2()),
      start_step_(replayer.readings().StartStep()),
      channels_(ChannelsOf(logs, replayer.readings())),
      n_lead_(LeadSteps(replayer.readings(), period_s)),
      horizons_({n_steps}),
      lasting_(1) {
  for (const int row : rows) {
    lasting_.front().push_back(n_windows());
    windows_.push_back(WindowAt(logs, row, n_lead_ + n_steps));
  }
}

PredictionJudge::PredictionJudge(WindowReplayer& replayer, const PredictionJudge& other)
    : replayer_(replayer),
      logs_(other.logs_),
      variance_(other.variance_),
      start_step_(replayer.readings().StartStep()),
      channels_(other.channels_),
      n_lead_(other.n_lead_),
      horizons_(other.horizons_),
      windows_(other.windows_),
      lasting_(other.lasting_) {}

PredictionJudge::PredictionJudge(WindowReplayer& replayer, const Dataset& imitated, const PredictionJudge& other)
    : replayer_(replayer),
      logs_(imitated),
      variance_(other.variance_),
      start_step_(other.start_step_),
      channels_(other.channels_),
      n_lead_(other.n_lead_),
      horizons_(other.horizons_),
      lasting_(other.lasting_) {
  int row = 0;
  for (const LogWindow& window : other.windows_) {
    const int before = other.RowsBefore(window);
    windows_.push_back({row + before, window.n_steps, row});
    row += before + window.n_steps;
  }
}

int PredictionJudge::n_windows(size_t h, int n_episodes) const {
  const std::vector<Episode> episodes = logs_.Episodes();
  const int end = n_episodes > 0 ? episodes[static_cast<size_t>(n_episodes) - 1].end : 0;
  return static_cast<int>(
      std::ranges::count_if(lasting_[h], [&](int w) { return windows_[static_cast<size_t>(w)].begin < end; }));
}

std::vector<int> PredictionJudge::Begins(size_t h) const {
  std::vector<int> rows;
  for (const int w : lasting_[h]) rows.push_back(windows_[static_cast<size_t>(w)].begin);
  return rows;
}

int PredictionJudge::RowsBefore(const LogWindow& window) const {
  return std::min(std::max(kMostRowsBefore, replayer_.n_past_actions()), window.begin - window.episode_begin);
}

std::vector<size_t> PredictionJudge::WindowsOf(int n_steps) const {
  std::vector<size_t> of_this_length;
  for (size_t w = 0; w < windows_.size(); ++w) {
    if (windows_[w].n_steps == n_steps) of_this_length.push_back(w);
  }
  return of_this_length;
}

FittedStarts PredictionJudge::Fit(const std::vector<double>& z, std::vector<LogWindow> windows, int n_steps,
                                  std::vector<VectorXd> starts) const {
  for (LogWindow& window : windows) window.n_steps = n_steps;
  const WindowLikelihood likelihood(replayer_.readings(), variance_, n_steps);
  // What no reading shows is guessed before the lead is fitted, and near behind it.
  const bool is_guessed = n_steps <= n_lead_ && !replayer_.readings().unread.empty();
  return FitStarts(replayer_, std::move(starts),
                   {.windows = windows,
                    .z = z,
                    .likelihood = likelihood,
                    .start_step = start_step_,
                    .n_iterations = is_guessed ? kGuessedIterations : kLeadIterations});
}

std::vector<VectorXd> PredictionJudge::FitLeads(const std::vector<double>& z, const std::vector<LogWindow>& windows,
                                                const std::vector<VectorXd>& guesses) const {
  FittedStarts fitted = Fit(z, windows, n_lead_, guesses);
  const ReadingModel& readings = replayer_.readings();
  if (readings.unread.empty()) return std::move(fitted.starts);
  const WindowLikelihood likelihood(readings, variance_, n_lead_);
  std::vector<size_t> caught;
  for (size_t w = 0; w < windows.size(); ++w) {
    if (!likelihood.Explains(fitted.residuals[w])) caught.push_back(w);
  }
  FittedStarts grown{Picked(guesses, caught), {}};
  for (int n_steps = readings.ShortestWindow(); n_steps < 2 * n_lead_; n_steps *= 2) {
    grown = Fit(z, Picked(windows, caught), std::min(n_steps, n_lead_), std::move(grown.starts));
  }
  for (size_t k = 0; k < caught.size(); ++k) {
    const bool is_better = likelihood.Cost(grown.residuals[k]) < likelihood.Cost(fitted.residuals[caught[k]]);
    if (is_better) fitted.starts[caught[k]] = std::move(grown.starts[k]);
  }
  return std::move(fitted.starts);
}

FittedStarts PredictionJudge::Replay(const std::vector<double>& z, bool fits_leads) const {
  FittedStarts replays{LoggedStarts(replayer_, windows_), {}};
  replays.residuals.resize(windows_.size());
  for (const int n_steps : horizons_) {  // windows of one length at a time
    const std::vector<size_t> at = WindowsOf(n_lead_ + n_steps);
    const std::vector<LogWindow> windows = Picked(windows_, at);
    std::vector<VectorXd> starts = Picked(replays.starts, at);
    if (fits_leads) starts = FitLeads(z, windows, starts);
    std::vector<VectorXd> residuals = replayer_.Residuals(windows, starts, z);
    for (size_t k = 0; k < at.size(); ++k) {
      replays.starts[at[k]] = std::move(starts[k]);
      replays.residuals[at[k]] = std::move(residuals[k]);
    }
  }
  return replays;
}

PredictionJudge::Squares PredictionJudge::Predict(const std::vector<double>& z) const {
  return SquaresOf(Replay(z, true));
}

PredictionJudge::Squares PredictionJudge::PredictFromReadings(const std::vector<double>& z) const {
  return SquaresOf(Replay(z, false));
}

PredictionJudge::Squares PredictionJudge::SquaresOf(FittedStarts replays) const {
  const std::vector<VectorXd>& residuals = replays.residuals;
  const Eigen::Index n_channels = variance_.size();
  const auto broken = [&](size_t n) {
    return MatrixXd::Constant(n_channels, static_cast<Eigen::Index>(n), std::numeric_limits<double>::quiet_NaN());
  };
  const auto has_broken = [](const VectorXd& residual) { return residual.size() == 0 || !residual.allFinite(); };
  const auto readings_of = [&](size_t w) {
    return Eigen::Map<const MatrixXd>(residuals[w].data(), n_channels, windows_[w].n_steps + 1);
  };
  Squares squares{{}, broken(windows_.size()), std::move(replays.starts)};
  const int oldest = replayer_.readings().longest_age();  // readings before tell of before the window
  for (size_t w = 0; w < windows_.size(); ++w) {
    if (has_broken(residuals[w])) continue;
    squares.lead.col(static_cast<Eigen::Index>(w)) =
        readings_of(w).middleCols(oldest, n_lead_ + 1 - oldest).cwiseAbs2().rowwise().mean();
  }
  for (size_t h = 0; h < horizons_.size(); ++h) {
    squares.predicted.push_back(broken(lasting_[h].size()));
    for (size_t k = 0; k < lasting_[h].size(); ++k) {
      const auto w = static_cast<size_t>(lasting_[h][k]);
      if (has_broken(residuals[w])) continue;
      squares.predicted[h].col(static_cast<Eigen::Index>(k)) =
          readings_of(w).middleCols(n_lead_ + 1, horizons_[h]).cwiseAbs2().rowwise().mean();
    }
  }
  return squares;
}

int PredictionJudge::NextFollowed(int n_fitted, int whole) const {
  return std::min(whole, n_fitted == 0 ? kFollowed * n_lead_ : 2 * n_fitted);
}

int PredictionJudge::FollowSteps() const {
  int n = 0;
  for (const int n_steps : horizons_) {
    const int whole = n_lead_ + n_steps;
    for (int n_fitted = 0; n_fitted < whole; n_fitted = NextFollowed(n_fitted, whole)) ++n;
  }
  return n;
}

std::vector<VectorXd> PredictionJudge::Follow(const std::vector<double>& z, const std::vector<VectorXd>& starts,
                                              const std::function<void()>& tell) const {
  std::vector<VectorXd> residuals(windows_.size());
  for (const int n_steps : horizons_) {
    const int whole = n_lead_ + n_steps;
    const std::vector<size_t> at = WindowsOf(whole);
    FittedStarts fitted{Picked(starts, at), {}};
    for (int n_fitted = 0; n_fitted < whole;) {
      n_fitted = NextFollowed(n_fitted, whole);
      fitted = Fit(z, Picked(windows_, at), n_fitted, std::move(fitted.starts));
      tell();
    }
    for (size_t k = 0; k < at.size(); ++k) residuals[at[k]] = std::move(fitted.residuals[k]);
  }
  return residuals;
}

Dataset PredictionJudge::Imitate(const std::vector<VectorXd>& followed, const VectorXd& noise, Rng& rng) const {
  std::vector<Episode> episodes;
  for (const LogWindow& window : windows_) {
    episodes.push_back({window.begin - RowsBefore(window), window.begin + window.n_steps, false});
  }
  Dataset made = logs_.Select(episodes);
  int row = 0;
  for (size_t w = 0; w < windows_.size(); ++w) {
    const int n_rows = windows_[w].n_steps;
    row += RowsBefore(windows_[w]);
    const VectorXd& residual = followed[w];
    const bool broke_down = residual.size() == 0 || !residual.allFinite();
    for (int t = 0; t <= n_rows && !broke_down; ++t) {
      for (Eigen::Index c = 0; c < variance_.size(); ++c) {
        const double logged = replayer_.Logged(windows_[w], t)[c];
        const double reading = logged - residual[t * variance_.size() + c] + noise[c] * rng.Normal();
        if (t < n_rows) made.observations(row + t, static_cast<int>(c)) = reading;
        // Of the row before the window, too: there is one reading of each state.
        if (t > 0 || RowsBefore(windows_[w]) > 0) made.next_observations(row + t - 1, static_cast<int>(c)) = reading;
      }
    }
    row += n_rows;
  }
  made.qpos = made.qvel = {};
  return made;
}

VectorXd PredictionJudge::Guess(size_t h) const {
  const VectorXd time = VectorXd::LinSpaced(n_lead_ + 1, -n_lead_, 0);  // 0: the last reading
  const double mean_time = time.mean(), spread_of_time = (time.array() - mean_time).square().sum();
  VectorXd stays = VectorXd::Zero(variance_.size()), goes_on = stays;
  for (const int at : lasting_[h]) {
    const LogWindow& window = windows_[static_cast<size_t>(at)];
    MatrixXd lead(variance_.size(), n_lead_ + 1);
    for (int t = 0; t <= n_lead_; ++t) lead.col(t) = replayer_.Logged(window, t);
    const VectorXd mean = lead.rowwise().mean(), last = lead.col(n_lead_);
    const VectorXd slope = lead * (time.array() - mean_time).matrix() / spread_of_time;
    for (int t = 1; t <= horizons_[h]; ++t) {
      const VectorXd logged = replayer_.Logged(window, n_lead_ + t);
      stays += (logged - last).cwiseAbs2();
      goes_on += (logged - mean - (t - mean_time) * slope).cwiseAbs2();
    }
  }
  const double n = static_cast<double>(lasting_[h].size()) * horizons_[h];
  return stays.cwiseMin(goes_on)
      .cwiseQuotient(VectorXd::Constant(stays.size(), n))
      .cwiseSqrt()
      .cwiseMin(channels_.spread);
}

MatrixXd PredictionJudge::MeanSquares(const std::vector<double>& z) const {
  const VectorXd most = channels_.spread.cwiseAbs2();  // what is farther off is no nearer than a guess
  MatrixXd squares = Predict(z).predicted.back();
  for (Eigen::Index w = 0; w < squares.cols(); ++w) {
    squares.col(w) = squares.col(w).hasNaN() ? most : (squares.col(w) + variance_).cwiseMin(most).eval();
  }
  std::vector<Eigen::Index> judged;
  for (Eigen::Index c = 0; c < squares.rows(); ++c) {
    if (channels_.weight[c] > 0) judged.push_back(c);
  }
  return squares(judged, Eigen::all);
}

PredictionRatio ComparePredictions(const MatrixXd& a, const MatrixXd& b) {
  const double n = static_cast<double>(a.cols());
  const VectorXd sum_a = a.rowwise().sum(), sum_b = b.rowwise().sum();
  PredictionRatio result{(sum_a.array() / sum_b.array()).log().mean(), 0};
  if (n < 2) return result;
  double square = 0;
  for (Eigen::Index w = 0; w < a.cols(); ++w) {
    const double without = ((sum_a - a.col(w)).array() / (sum_b - b.col(w)).array()).log().mean();
    square += (without - result.log_ratio) * (without - result.log_ratio);
  }
  result.std = std::sqrt(square * (n - 1) / n);
  return result;
}

}  // namespace oted
