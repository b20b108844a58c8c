#pragma once
/// Angles that a log keeps within one turn, made to go on.

#include <string>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/data/recording.h"
#include "oted/data/resample.h"

namespace oted {

/// Adds whole turns (2 pi) to one value after the other so that each lies within half a turn of the one before it. The
/// first stays, and so does what is not finite.
class Unwrapper {
 public:
  double operator()(double value);
  int n_jumps() const { return n_jumps_; }

 private:
  double logged_ = 0, turns_ = 0;
  bool has_begun_ = false;
  int n_jumps_ = 0;
};

/// Unwraps the observations that the patterns name (MatchesGlob), by the log's names, or by the task's where the log
/// has none of these: in each run, before rows are taken between two of them. A remark counts the jumps of each.
/// @throws UsageError where a pattern names no observation, and where there is a qpos, which would stay wrapped
void Unwrap(Recording& recording, const std::vector<std::string>& patterns,
            const std::vector<std::string>& task_names = {});
/// The same in each episode of what was logged at even steps.
void Unwrap(Dataset& dataset, const std::vector<std::string>& patterns,
            const std::vector<std::string>& task_names = {});
/// The same in each state, from its first sample on. @return remarks
std::vector<std::string> Unwrap(std::vector<Stream>& states, const std::vector<std::string>& patterns);

}  // namespace oted
