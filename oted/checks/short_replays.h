#pragma once
/// Short windows of a log, replayed in one simulator: what they miss of each channel.

#include <memory>
#include <optional>
#include <vector>

#include "oted/base/array2.h"
#include "oted/data/dataset.h"
#include "oted/sim/log_window.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Per channel: mean of the squared error at the windows' ends over the squared change from their beginnings.
using ChannelErrors = std::vector<double>;
/// Their mean over some channels; 0 of none.
double MeanOf(const ChannelErrors& errors, const std::vector<int>& channels);

/// Windows of a log, each behind what a simulator with delays reaches back to.
struct ReplayedWindows {
  Dataset log;  ///< of them alone
  std::vector<LogWindow> windows;
  /// (windows, state_dim): the states in which they begin, rates by LocalRates. Empty where readings show a state.
  Array2<double> states;
};

/// Below so many windows nothing is measured.
inline constexpr int kFewestShortWindows = 20;

/// Needs spec().can_replay() and finite data that fit the task.
class ShortReplays {
 public:
  /// In the nominal simulator.
  ShortReplays(const SimulatorFactory& factory, int n_threads);

  /// From now on in the one at z.
  void SetParameters(const std::vector<double>& z);
  /// Windows that are spread evenly over the dataset.
  ReplayedWindows Choose(const Dataset& dataset) const;
  /// Of every `stride`-th window. Nothing where too few can be replayed.
  std::optional<ChannelErrors> Errors(const ReplayedWindows& windows, size_t stride = 1);
  /// Control steps of a window.
  int n_steps() const { return n_steps_; }

 private:
  bool SetLane(int lane, const ReplayedWindows& windows, size_t window);

  const SimulatorSpec& spec_;
  std::unique_ptr<Simulator> simulator_;
  int n_steps_ = 1;
};

}  // namespace oted
