#pragma once
/// Transitions as imitation learning reads them: normalised, and with a successor for every row.

#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/data/npz.h"
#include "oted/nn/tanh_gaussian.h"

namespace oted {

/// Rows of a process with restarts: what follows the last row of an episode, whether it was terminal or cut, is the
/// first state of an episode drawn at random. That is how logs come about, and under it the rows of the logs are the
/// stationary distribution of the behaviour that made them (docs/deviations.md#valuedice).
class ImitationRows {
 public:
  ImitationRows() = default;
  /// @param policy  whose normaliser and action range are used
  /// @param drawn   rows that are counted and drawn, ascending or not; by default all. Others still follow them
  ImitationRows(const Dataset& dataset, const TanhGaussianPolicy& policy, std::vector<int> drawn = {});

  /// Rows to draw from; i below is one of them.
  int size() const { return static_cast<int>(drawn_.size()); }
  /// (obs_dim) normalised
  const float* state(int i) const { return State(drawn_[static_cast<size_t>(i)]); }
  /// (act_dim) in [-1, 1]
  const float* action(int i) const {
    return actions_.data() + static_cast<size_t>(drawn_[static_cast<size_t>(i)]) * act_dim_;
  }
  /// (obs_dim) normalised: s', or, of an episode's last row, the start of one drawn at random.
  const float* Next(int i, Rng& rng) const;

  /// Arrays PREFIX/states and so on.
  void Save(const std::string& prefix, NpzArrays& arrays) const;
  /// What Save wrote. @throws DataError naming `where`
  static ImitationRows FromArrays(const std::string& prefix, const NpzArrays& arrays, const std::string& where);

 private:
  const float* State(int row) const { return states_.data() + static_cast<size_t>(row) * obs_dim_; }

  size_t obs_dim_ = 0, act_dim_ = 0;
  std::vector<float> states_, actions_, next_;
  std::vector<uint8_t> last_;
  std::vector<int> drawn_;
  std::vector<int> starts_;  // rows at which episodes begin
};

}  // namespace oted
