#include "oted/matching/log_window.h"

namespace oted {

LoggedHistory HistoryBefore(const Dataset& dataset, const LogWindow& window) {
  const auto before = [&](const Array2<double>& rows) {
    const size_t width = static_cast<size_t>(rows.cols());
    return rows.values().subspan(static_cast<size_t>(window.episode_begin) * width,
                                 static_cast<size_t>(window.begin - window.episode_begin) * width);
  };
  return {before(dataset.observations), before(dataset.actions)};
}

}  // namespace oted
