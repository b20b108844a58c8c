#include "oted/stages/design/replay/reading_model.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "oted/base/statistics.h"
#include "oted/data/checks_rates.h"
#include "oted/data/normalizer.h"
#include "oted/matching/as_vector.h"
#include "oted/stages/design/replay/noise_bound.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kSampledRows = 500;
constexpr double kUnguessedStd = 1.0;    // of a coordinate that no log suggests, before any fit
constexpr double kRounding = 0.1;        // of a step, by which multiples of it may be off
constexpr double kMostDistinct = 0.5;    // of the rows: beyond, repeated readings are chance
constexpr double kComputedWithin = 0.1;  // of a reading's noise
constexpr double kComputedOver = 0.06;   // [s] of positions on either side
constexpr int kMostNeighbours = 15, kRegressedRows = 4000;

/// The coordinate whose rate of change state coordinate `j` is, where its reading is taken at once; or -1.
int SourceOf(const SimulatorSpec& spec, const ReadingModel& readings, int j) {
  const int obs_dim = spec.obs_dim();
  const int source = j >= obs_dim           ? spec.hidden[static_cast<size_t>(j - obs_dim)].rate_of
                     : spec.rate_of.empty() ? -1
                                            : spec.rate_of[static_cast<size_t>(j)];
  return source >= 0 && readings.IsHeld(source, 0) ? source : -1;
}

/// The step of which all of these numbers are multiples, from some origin; 0 where there is none.
double StepOf(std::vector<double> values) {
  const size_t n = values.size();
  std::ranges::sort(values);
  values.erase(std::unique(values.begin(), values.end()), values.end());
  if (values.size() < 3 || static_cast<double>(values.size()) > kMostDistinct * static_cast<double>(n)) return 0;
  // Printed multiples of a step are off by the last digit: a first guess from the smallest gap, then from ever longer
  // stretches.
  double step = std::numeric_limits<double>::infinity();
  const double span = values.back() - values.front();
  for (size_t i = 1; i < values.size(); ++i) {
    const double gap = values[i] - values[i - 1];
    if (gap > 1e-12 * span) step = std::min(step, gap);
  }
  for (size_t i = 1; i < values.size(); ++i) {
    const double distance = values[i] - values.front(), count = std::round(distance / step);
    if (count < 1) continue;
    if (std::abs(distance / step - count) > kRounding) return 0;
    step = distance / count;
  }
  return step;
}

}  // namespace

ReadingModel ReadingModel::Plain(int obs_dim) {
  ReadingModel plain;
  plain.ages.assign(static_cast<size_t>(obs_dim), 0);
  plain.computed.assign(static_cast<size_t>(obs_dim), 0);
  plain.smallest_std = VectorXd::Zero(obs_dim);
  plain.state_scale = VectorXd::Ones(obs_dim);
  return plain;
}

ReadingModel ReadingModel::Of(const SimulatorSpec& spec, const Dataset& dataset, const std::vector<char>& computed) {
  const int obs_dim = spec.obs_dim();
  ReadingModel readings = Plain(obs_dim);
  if (!spec.reading_ages.empty()) readings.ages = spec.reading_ages;
  if (!computed.empty()) readings.computed = computed;
  readings.smallest_std = QuantisationNoise(dataset);
  const std::vector<double> scale = Normalizer::Fit(dataset.observations).scale;
  readings.state_scale = VectorXd::Ones(spec.state_dim());
  readings.state_scale.head(obs_dim) = AsVector(scale);
  for (int j = 0; j < spec.state_dim(); ++j) {
    if (j >= obs_dim || !readings.IsHeld(j, 0)) readings.unread.push_back(j);
  }
  readings.mean = VectorXd::Zero(readings.n_unread());
  readings.std = VectorXd::Constant(readings.n_unread(), kUnguessedStd);
  if (readings.unread.empty()) return readings;

  // Of the guesses over the logs: how far the coordinates spread.
  LocalRates rates(dataset, spec.control_period_s);
  const int stride = std::max(1, dataset.size() / kSampledRows);
  VectorXd sum = VectorXd::Zero(spec.state_dim()), squares = sum;
  double n = 0;
  for (int row = 0; row < dataset.size(); row += stride) {
    const VectorXd guess = readings.Guess(spec, dataset, rates, row);
    sum += guess;
    squares += guess.cwiseAbs2();
    ++n;
  }
  const VectorXd spread = (squares / n - (sum / n).cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
  for (int k = 0; k < readings.n_unread(); ++k) {
    const int j = readings.unread[static_cast<size_t>(k)];
    const bool suggested = j < obs_dim || SourceOf(spec, readings, j) >= 0 ||
                           spec.hidden[static_cast<size_t>(j - obs_dim)].turn_about >= 0;
    readings.guessed.push_back(suggested ? 1 : 0);
    if (suggested && spread[j] > 0) readings.std[k] = spread[j];
    if (j >= obs_dim) readings.state_scale[j] = readings.std[k];
  }
  return readings;
}

int ReadingModel::longest_age() const { return ages.empty() ? 0 : *std::ranges::max_element(ages); }

VectorXd ReadingModel::Held(int n_steps) const {
  VectorXd held = VectorXd::Ones((n_steps + 1) * obs_dim() + n_unread());
  for (int t = 0; t <= n_steps; ++t) {
    for (int c = 0; c < obs_dim(); ++c) held[t * obs_dim() + c] = IsHeld(c, t) ? 1 : 0;
  }
  return held;
}

VectorXd ReadingModel::Guess(const SimulatorSpec& spec, const Dataset& dataset, LocalRates& rates, int row) const {
  VectorXd state(state_dim());
  const auto reading = dataset.observations.row(row);
  std::copy(reading.begin(), reading.end(), state.begin());
  for (int k = 0; k < n_unread(); ++k) {
    const int j = unread[static_cast<size_t>(k)], source = SourceOf(spec, *this, j);
    if (source >= 0) {
      state[j] = rates.Rate(source, row);
    } else if (j >= obs_dim()) {
      const HiddenCoordinate& hidden = spec.hidden[static_cast<size_t>(j - obs_dim())];
      state[j] = hidden.turn_about < 0 ? mean[k] : rates.TurnRate(hidden.orientation, hidden.turn_about, row);
    }
  }
  return state;
}

VectorXd QuantisationNoise(const Dataset& dataset) {
  VectorXd noise(dataset.obs_dim());
  std::vector<double> column(static_cast<size_t>(dataset.size()));
  for (int c = 0; c < dataset.obs_dim(); ++c) {
    for (int row = 0; row < dataset.size(); ++row) {
      column[static_cast<size_t>(row)] = dataset.observations.row(row)[static_cast<size_t>(c)];
    }
    noise[c] = StepOf(column) / std::sqrt(12.0);
  }
  return noise;
}

std::vector<char> LateReadings(const SimulatorSpec& spec, const Dataset& dataset) {
  std::vector<char> late(static_cast<size_t>(spec.obs_dim()), 0);
  if (spec.rate_of.empty()) return late;
  for (const RateAgreement& rate : CompareRates(dataset, spec.rate_of, spec.control_period_s)) {
    const auto c = static_cast<size_t>(rate.velocity);
    const bool is_known = !spec.reading_ages.empty() && spec.reading_ages[c] > 0;
    if (rate.IsShifted() && rate.lag > 0 && !is_known) late[c] = 1;
  }
  return late;
}

std::vector<char> ComputedReadings(const SimulatorSpec& spec, const Dataset& dataset, const VectorXd& told) {
  std::vector<char> computed(static_cast<size_t>(spec.obs_dim()), 0);
  const int n_around =
      spec.control_period_s > 0
          ? std::clamp(static_cast<int>(std::lround(kComputedOver / spec.control_period_s)), 3, kMostNeighbours)
          : 0;
  if (spec.rate_of.empty() || n_around == 0) return computed;
  // A fit takes what its simulator has wrong for noise.
  const VectorXd noise = told.cwiseMin(LargestNoise(dataset));
  for (int c = 0; c < spec.obs_dim(); ++c) {
    const int source = spec.rate_of[static_cast<size_t>(c)];
    if (source < 0) continue;
    std::vector<int> rows;
    for (const Episode& episode : dataset.Episodes()) {
      for (int row = episode.begin + n_around; row + n_around < episode.end; ++row) rows.push_back(row);
    }
    const size_t n = std::min<size_t>(rows.size(), kRegressedRows);
    if (n < static_cast<size_t>(8 * n_around)) continue;
    MatrixXd around(static_cast<Eigen::Index>(n), 2 * n_around);
    VectorXd rate(static_cast<Eigen::Index>(n));
    const auto position = [&](int row) { return dataset.observations.row(row)[static_cast<size_t>(source)]; };
    for (size_t k = 0; k < n; ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      const int row = rows[k * rows.size() / n];
      rate[i] = dataset.observations.row(row)[static_cast<size_t>(c)];
      for (int t = 1; t <= n_around; ++t) {
        around(i, t - 1) = position(row + t) - position(row);
        around(i, n_around + t - 1) = position(row - t) - position(row);
      }
    }
    const VectorXd left = (rate - around * around.colPivHouseholderQr().solve(rate)).cwiseAbs();
    const double error = Median({left.begin(), left.end()}) / 0.6745;
    computed[static_cast<size_t>(c)] = error < kComputedWithin * noise[c] ? 1 : 0;
  }
  return computed;
}

std::vector<char> ReadingsLeftOut(const SimulatorSpec& spec, const Dataset& dataset, const VectorXd& noise) {
  std::vector<char> left_out = ComputedReadings(spec, dataset, noise);
  const std::vector<char> late = LateReadings(spec, dataset);
  for (size_t c = 0; c < left_out.size(); ++c) left_out[c] = static_cast<char>(left_out[c] | late[c]);
  return left_out;
}

}  // namespace oted
