#pragma once
/// A statistic of samples whose mean tells the simulator's parameters, learned in simulators alone.
///
/// A discriminator that learns its features from a handful of logged images remembers those images, and then favours
/// whatever simulator comes nearest to them. What is worth looking at can be learned without the logs: h(s, a) is
/// fitted so that its mean over the samples of one simulator gives that simulator's parameters,
///   minimise  E_{z uniform}  |mean_{(s, a) ~ M(z)} h(s, a) - u(z)|^2,   u in the unit cube,
/// with as many samples as one likes. A discriminator on h has a few weights and no way to remember anything.

#include <string>
#include <vector>

#include "oted/base/rng.h"
#include "oted/data/npz.h"
#include "oted/nn/feature_net.h"

namespace oted {

struct StatisticOptions {
  NetSize size = {.hidden = {32}, .filters = {16}, .mean_pool = true};
  double learning_rate = 2e-3;
  int n_steps = 600;  ///< gradient steps
  int batch = 8;      ///< simulators per step
};

class SimulatedStatistic {
 public:
  SimulatedStatistic() = default;
  /// @param samples  of each simulator, none empty
  /// @param targets  (simulators, d): u of each
  SimulatedStatistic(const std::vector<Array2<double>>& samples, const Array2<double>& targets, const InputShape& shape,
                     const StatisticOptions& options, RngKey key);

  int size() const { return net_.out(); }
  /// Root mean square of |mean h - u| per component over the last tenth of the training steps.
  double error() const { return error_; }
  /// (n, d): h of each row.
  Array2<double> Of(const Array2<double>& rows);

  static bool IsIn(const NpzArrays& arrays) { return arrays.contains("statistic/parameters"); }
  void Save(NpzArrays& arrays) const;
  static SimulatedStatistic Load(const NpzArrays& arrays, const std::string& where);

 private:
  FeatureNet net_;
  FeaturePass pass_;
  double error_ = 0;
};

}  // namespace oted
