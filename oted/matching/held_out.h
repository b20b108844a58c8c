#pragma once
/// Part of the logs, kept from what is learned so that it can judge it.

#include <vector>

#include "oted/base/rng.h"
#include "oted/data/dataset.h"

namespace oted {

/// The episodes that learn and those that judge; two parts of the one where there is one.
struct HeldOutParts {
  Dataset learn, judge;
  std::vector<int> recording = {};     ///< of each episode of `learn`: which recording it is part of, from 0 upwards
  std::vector<int> logged_as = {};     ///< of each recording: which episode of all logs it is
  std::vector<int> learned_rows = {};  ///< of each row of `learn`: which one of all logs it is
  std::vector<int> judged_rows = {};   ///< the same of `judge`
  int n_whole = 0;  ///< of the judge's episodes, the first ones: recordings of which nothing was learned
};

/// The rows of episodes, one after the other.
std::vector<int> RowsOf(const std::vector<Episode>& episodes);

/// Of each row, which of the episodes it is in.
std::vector<int> EpisodesOf(const std::vector<int>& rows, const std::vector<Episode>& episodes);

/// A fifth of the rows judges, in whole episodes drawn at random: at least one.
HeldOutParts HoldOut(const Dataset& dataset, RngKey key);

}  // namespace oted
