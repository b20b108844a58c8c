#pragma once
/// A force on a joint that no field of MuJoCo's model makes: a sum of a few smooth functions of the joint's own
/// position q and velocity v, whose weights are parameters like others (docs/parameters.md#residual-torque). Not in the
/// paper.
///
///   w0 + w1 sin q + w2 cos q + w3 sin 2q + w4 cos 2q + w5 tanh v + w6 v |v|          [N, N m], q and v in SI units
///
/// It acts at the start of every physics step, and has no state.

#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/sim/residual_terms.h"

struct mjBatch_;
struct mjModel_;

namespace oted {

inline constexpr int kResidualSize = static_cast<int>(kResidualTerms.size());
/// The array of the weights, as mjModel would call it, (nv, kResidualSize).
inline constexpr const char* kResidualArray = "dof_residual";

/// A force that is large for a joint's residual [N m]: what its actuators can do, as far as the model limits them, and
/// otherwise what holds a mean body at the model's length against gravity; a fifth of it, rounded up.
double ResidualReach(const mjModel_& model);

/// Whether a path, or one of those that are tied together in it, is a joint's residual: MJCF has no place for it.
bool IsResidualPath(const std::string& path);

/// The residual forces of all lanes of a batch.
class JointResidual {
 public:
  explicit JointResidual(mjBatch_* batch);

  /// (lanes, nv * kResidualSize): where parameters are written.
  double* Weights() { return weights_.data(); }
  /// Writes what the batch applies to the joints of a lane, as it stands.
  void Write(int lane);

 private:
  mjBatch_* batch_;
  int nv_, n_state_;
  std::vector<int> position_;  // (nv): of a degree of freedom in qpos; -1: it turns in space, and has no angle
  const double *positions_, *velocities_;  // of the first lane; those of the next lie a state further
  double* applied_;
  Array2<double> weights_;
};

}  // namespace oted
