#include "oted/matching/simulated_statistic.h"

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"

namespace oted {
namespace {

constexpr int kRowsAtOnce = 256;  // what a batch of images and their patches leaves of the cache

}  // namespace

SimulatedStatistic::SimulatedStatistic(const std::vector<Array2<double>>& samples, const Array2<double>& targets,
                                       const InputShape& shape, const StatisticOptions& options, RngKey key) {
  OTED_CHECK(!samples.empty() && static_cast<int>(samples.size()) == targets.rows());
  Array2<double> pooled;
  for (const Array2<double>& rows : samples) {
    OTED_CHECK(rows.rows() > 0);
    for (int i = 0; i < rows.rows(); ++i) pooled.AppendRow(rows.row(i));
  }
  const int d = targets.cols();
  net_ = FeatureNet(pooled, shape, options.size, d);
  Rng rng = key.MakeRng();
  net_.Initialize(rng);
  const size_t n_parameters = net_.n_parameters();
  Adam adam(n_parameters, {.learning_rate = static_cast<float>(options.learning_rate)});
  AlignedVector<float> gradient(n_parameters), dout;
  double square_sum = 0;
  int n_measured = 0;
  for (int step = 0; step < options.n_steps; ++step) {
    // Steps that shrink to nothing end at the mean of what noisy ones wander about.
    adam.set_learning_rate(
        static_cast<float>(options.learning_rate * (1.0 - static_cast<double>(step) / options.n_steps)));
    std::vector<size_t> picks;
    int n_rows = 0;
    for (int k = 0; k < options.batch; ++k) {
      picks.push_back(rng.Below(samples.size()));
      n_rows += samples[picks.back()].rows();
    }
    pass_.Reserve(net_, n_rows);
    int first = 0;
    for (const size_t pick : picks) {
      pass_.Encode(net_, samples[pick], first);
      first += samples[pick].rows();
    }
    const float* out = pass_.Forward(net_);
    dout.resize(static_cast<size_t>(n_rows) * static_cast<size_t>(d));
    size_t at = 0;
    for (const size_t pick : picks) {
      const int n = samples[pick].rows();
      for (int j = 0; j < d; ++j) {
        double mean = 0;
        for (int i = 0; i < n; ++i) mean += static_cast<double>(out[at + static_cast<size_t>(i * d + j)]) / n;
        const double error = mean - targets(static_cast<int>(pick), j);
        if (10 * step >= 9 * options.n_steps) {
          square_sum += error * error;
          ++n_measured;
        }
        for (int i = 0; i < n; ++i) {
          dout[at + static_cast<size_t>(i * d + j)] = static_cast<float>(2 * error / n / options.batch);
        }
      }
      at += static_cast<size_t>(n) * static_cast<size_t>(d);
    }
    pass_.Backward(net_, dout.data(), gradient.data());
    adam.Step({net_.parameters().data(), n_parameters}, {gradient.data(), n_parameters});
  }
  error_ = n_measured > 0 ? std::sqrt(square_sum / n_measured) : 0;
}

Array2<double> SimulatedStatistic::Of(const Array2<double>& rows) {
  Array2<double> statistic(rows.rows(), size());
  for (int first = 0; first < rows.rows(); first += kRowsAtOnce) {
    const int n = std::min(kRowsAtOnce, rows.rows() - first);
    pass_.Reserve(net_, n);
    for (int i = 0; i < n; ++i) pass_.Encode(net_, rows.row(first + i), i);
    const float* out = pass_.Forward(net_);
    std::copy_n(out, static_cast<size_t>(n) * static_cast<size_t>(size()), statistic.row(first).data());
  }
  return statistic;
}

void SimulatedStatistic::Save(NpzArrays& arrays) const { net_.Save("statistic", arrays); }

SimulatedStatistic SimulatedStatistic::Load(const NpzArrays& arrays, const std::string& where) {
  SimulatedStatistic statistic;
  statistic.net_ = FeatureNet::FromArrays("statistic", arrays, where);
  return statistic;
}

}  // namespace oted
