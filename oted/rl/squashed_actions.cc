#include "oted/rl/squashed_actions.h"

#include <algorithm>

#include "oted/nn/kernels.h"
#include "oted/nn/kernels_math.h"
#include "oted/nn/tanh_gaussian.h"

namespace oted {
namespace {

constexpr float kHalfLog2Pi = 0.9189385332046727f;
constexpr float kSquashEpsilon = 1e-6f;  // inside log(1 - a^2 + eps)

}  // namespace

void SquashedActions::Forward(const float* out, const float* noise, int rows, int act_dim) {
  width_ = static_cast<size_t>(act_dim);
  const size_t n = static_cast<size_t>(rows) * width_;
  for (AlignedVector<float>* values : {&actions_, &log_std_, &std_, &log_slope_}) values->resize(n);
  log_prob_.resize(static_cast<size_t>(rows));
  // Element-wise functions on whole arrays: the vector versions take eight or sixteen elements at a time.
  for (size_t b = 0; b < static_cast<size_t>(rows); ++b) {
    const float* log_std = out + 2 * b * width_ + width_;
    for (size_t j = 0; j < width_; ++j) log_std_[b * width_ + j] = std::clamp(log_std[j], kLogStdMin, kLogStdMax);
  }
  kernels::Exp(log_std_.data(), std_.data(), n);
  for (size_t b = 0; b < static_cast<size_t>(rows); ++b) {
    const float* mean = out + 2 * b * width_;
    for (size_t j = 0, at = b * width_; j < width_; ++j, ++at) actions_[at] = mean[j] + std_[at] * noise[at];
  }
  kernels::Tanh(actions_.data(), actions_.data(), n);
  for (size_t i = 0; i < n; ++i) log_slope_[i] = 1.0f - actions_[i] * actions_[i] + kSquashEpsilon;
  kernels::Log(log_slope_.data(), log_slope_.data(), n);
  for (size_t b = 0; b < static_cast<size_t>(rows); ++b) {
    float log_prob = 0;
    for (size_t at = b * width_; at < (b + 1) * width_; ++at) {
      log_prob += -0.5f * noise[at] * noise[at] - log_std_[at] - kHalfLog2Pi - log_slope_[at];
    }
    log_prob_[b] = log_prob;
  }
}

double SquashedActions::MeanLogProb(int rows) const {
  double sum = 0;
  for (int b = 0; b < rows; ++b) sum += log_prob_[static_cast<size_t>(b)];
  return sum / rows;
}

void SquashedActions::Join(const float* observations, int obs_dim, int begin, int rows, float* joint) const {
  const float* action = actions_.data() + static_cast<size_t>(begin) * width_;
  for (int b = 0; b < rows; ++b, action += width_, observations += obs_dim) {
    joint = std::copy_n(observations, obs_dim, joint);
    joint = std::copy_n(action, width_, joint);
  }
}

void SquashedActions::Backward(const float* out, const float* noise, const float* dq_da, float alpha, int rows,
                               float* dout) const {
  const float alpha_over_n = alpha / static_cast<float>(rows);
  for (size_t b = 0; b < static_cast<size_t>(rows); ++b) {
    for (size_t j = 0; j < width_; ++j) {
      const size_t at = b * width_ + j;
      const float action = actions_[at], one_minus = 1.0f - action * action;
      // d/du of alpha log pi: only the squashing term depends on u once the noise is fixed.
      const float du = dq_da[at] * one_minus + alpha_over_n * 2.0f * action * one_minus / (one_minus + kSquashEpsilon);
      const float log_std = out[b * 2 * width_ + width_ + j];
      const bool inside = log_std >= kLogStdMin && log_std <= kLogStdMax;
      dout[b * 2 * width_ + j] = du;
      dout[b * 2 * width_ + width_ + j] = inside ? du * std_[at] * noise[at] - alpha_over_n : 0.0f;
    }
  }
}

}  // namespace oted
