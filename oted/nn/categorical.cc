#include "oted/nn/categorical.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "oted/base/error.h"

namespace oted {

void LogSoftmax(std::span<const float> logits, int n, std::span<float> out) {
  const auto width = static_cast<size_t>(n);
  OTED_CHECK(n > 0 && logits.size() % width == 0 && out.size() == logits.size());
  for (size_t begin = 0; begin < logits.size(); begin += width) {
    const std::span<const float> row = logits.subspan(begin, width);
    const float largest = *std::max_element(row.begin(), row.end());
    double sum = 0;
    for (const float value : row) sum += std::exp(static_cast<double>(value - largest));
    const auto log_sum = static_cast<float>(std::log(sum));
    for (size_t i = 0; i < width; ++i) out[begin + i] = row[i] - largest - log_sum;
  }
}

double CategoricalLoss(std::span<const float> logits, int n, std::span<const int> actions, std::span<float> gradient) {
  const auto width = static_cast<size_t>(n);
  const size_t rows = actions.size();
  OTED_CHECK(logits.size() == rows * width && (gradient.empty() || gradient.size() == logits.size()));
  double loss = 0;
  std::vector<float> row(width);
  for (size_t r = 0; r < rows; ++r) {
    OTED_CHECK(actions[r] >= 0 && actions[r] < n);
    LogSoftmax(logits.subspan(r * width, width), n, row);
    loss -= static_cast<double>(row[static_cast<size_t>(actions[r])]);
    if (gradient.empty()) continue;
    for (size_t i = 0; i < width; ++i) {
      const float wanted = static_cast<int>(i) == actions[r] ? 1.0f : 0.0f;
      gradient[r * width + i] = (std::exp(row[i]) - wanted) / static_cast<float>(rows);
    }
  }
  return loss / static_cast<double>(rows);
}

int SampleCategorical(std::span<const float> logits, Rng& rng) {
  const float largest = logits[static_cast<size_t>(MostProbable(logits))];
  double total = 0;
  for (const float value : logits) total += std::exp(static_cast<double>(value - largest));
  double left = rng.Uniform() * total;
  for (size_t i = 0; i < logits.size(); ++i) {
    left -= std::exp(static_cast<double>(logits[i] - largest));
    if (left < 0) return static_cast<int>(i);
  }
  return MostProbable(logits);  // rounding alone leads here
}

int MostProbable(std::span<const float> logits) {
  OTED_CHECK(!logits.empty());
  return static_cast<int>(std::max_element(logits.begin(), logits.end()) - logits.begin());
}

}  // namespace oted
