#include "oted/sim/log_window.h"

#include "oted/base/error.h"

namespace oted {

LogWindow WindowAt(const Dataset& dataset, int begin, int n_steps) {
  OTED_CHECK(begin >= 0 && begin < dataset.size());
  const auto ends = [&](int row) {
    return dataset.terminals[static_cast<size_t>(row)] != 0 || dataset.timeouts[static_cast<size_t>(row)] != 0;
  };
  int first = begin;
  while (first > 0 && !ends(first - 1)) --first;
  return {.begin = begin, .n_steps = n_steps, .episode_begin = first};
}

LoggedHistory HistoryBefore(const Dataset& dataset, const LogWindow& window) {
  const auto before = [&](const Array2<double>& rows) {
    const size_t width = static_cast<size_t>(rows.cols());
    return rows.values().subspan(static_cast<size_t>(window.episode_begin) * width,
                                 static_cast<size_t>(window.begin - window.episode_begin) * width);
  };
  return {before(dataset.observations), before(dataset.actions),
          dataset.constants.empty() ? std::span<const double>() : dataset.constants.row(window.begin)};
}

}  // namespace oted
