#include "oted/rl/action_gradient.h"

#include <algorithm>

namespace oted {

double ActionGradient::Compute(const Mlp* critics, MlpPass* passes, const float* joint, int obs_dim, int act_dim,
                               int batch) {
  const size_t n = static_cast<size_t>(batch), width = static_cast<size_t>(act_dim);
  const float* q[2];
  for (int i = 0; i < 2; ++i) q[i] = passes[i].Forward(critics[i], joint, batch);

  // The gradient runs through the smaller critic of each row, so only its rows go back through a critic; no critic
  // needs its own weights' gradient here.
  double loss = 0;
  for (std::vector<int>& rows : smaller_) rows.clear();
  for (size_t b = 0; b < n; ++b) {
    loss -= std::min(q[0][b], q[1][b]) / static_cast<double>(n);
    smaller_[q[0][b] <= q[1][b] ? 0 : 1].push_back(static_cast<int>(b));
  }
  dq_.assign(n, -1.0f / static_cast<float>(n));
  dq_da_.resize(n * width);
  dq_da_rows_.resize(n * width);
  for (int i = 0; i < 2; ++i) {
    passes[i].BackwardRows(critics[i], smaller_[i], dq_.data(), dq_da_rows_.data(), {obs_dim, obs_dim + act_dim});
    const float* from = dq_da_rows_.data();
    for (const int row : smaller_[i]) {
      std::copy_n(from, width, dq_da_.data() + static_cast<size_t>(row) * width);
      from += width;
    }
  }
  return loss;
}

}  // namespace oted
