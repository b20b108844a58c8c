#pragma once
/// One gradient step of ValueDICE (Kostrikov, Nachum and Tompson 2020, "Imitation learning via off-policy distribution
/// matching"): critic and actor of
///
///   max_pi min_nu  J(pi, nu) = log sum_i w_i exp(nu(s_i, a_i) - gamma nu(s'_i, a'_i))
///                              - (1 - alpha) (1 - gamma) E_logs[nu(s, a~pi)] - alpha E_replay[nu(s, a) - gamma nu(s',
///                              a')]
///
/// with a' ~ pi(.|s'), weights w that share 1 - alpha among logged rows and alpha among rows of a replay. Without a
/// replay (alpha = 0) the minimum over nu is -KL(d^pi || d^logs); with one, that of both mixed with the replay.

#include <deque>
#include <string>
#include <vector>

#include "oted/data/npz.h"
#include "oted/nn/gradient_penalty.h"
#include "oted/nn/mlp.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/imitation_rows.h"
#include "oted/rl/learned_state.h"

namespace oted {

struct ValueDiceOptions {
  double actor_learning_rate = 1e-5;
  double critic_learning_rate = 1e-3;
  double gamma = 0.99;
  double gradient_penalty = 10;  ///< weight of (|d nu / d(s, a)| - 1)^2
  double orthogonal = 1e-4;      ///< weight of the sum over layers of |off-diagonal of W^T W|^2, in the actor's loss
  double replay_share = 0;       ///< alpha
};

/// One mini-batch of B logged rows, and as many of a replay where there is one.
struct ValueDiceBatch {
  int size = 0;                       ///< B
  bool has_replay = false;            ///< R below is B with a replay, 0 without
  AlignedVector<float> observations;  ///< (2B + R, obs_dim): logged s, logged s', the replay's s'
  AlignedVector<float> joint;         ///< (B + R, obs_dim + act_dim): [s, a] of the logs, of the replay
  AlignedVector<float> noise;         ///< (2B + R, act_dim) standard normals, for the actions at `observations`
  AlignedVector<float> mix;           ///< (B) in [0, 1): where between two pairs (s, a) the penalty is taken
};

/// Rows drawn uniformly with replacement; of a replay first the part, then a row of it.
/// @param replay  null for none; otherwise not empty
void DrawValueDiceBatch(const ImitationRows& logged, const std::deque<ImitationRows>* replay, int size,
                        const TanhGaussianPolicy& policy, Rng& rng, ValueDiceBatch& batch);

/// Before the step.
struct ValueDiceLosses {
  double objective = 0;      ///< J [nats]: minus the divergence where nu is at its optimum
  double penalty = 0;        ///< the gradient penalty, without its weight
  double orthogonality = 0;  ///< the actor's regulariser, without its weight
};

/// What a learner of ValueDICE holds and does. Actions enter nu in [-1, 1], observations by the actor's normaliser.
/// Initial states are all logged states, as in the authors' program. Gradients are written out by hand;
/// value_dice_update_torch_test holds them against libtorch's autograd.
class ValueDiceUpdate {
 public:
  /// @param actor  initialised, or a clone to go on from
  ValueDiceUpdate(TanhGaussianPolicy actor, const std::vector<int>& critic_hidden, const ValueDiceOptions& options,
                  Rng& rng);

  /// @param moves_actor  false for a nu that catches up with the policy
  ValueDiceLosses Step(const ValueDiceBatch& batch, bool moves_actor = true);

  const TanhGaussianPolicy& actor() const { return actor_; }
  const Mlp& critic() const { return critic_; }

  /// Parameters and optimiser moments under names that start with "valuedice/".
  void Save(NpzArrays& arrays) { State().Save(arrays); }
  /// @throws DataError naming the array that is missing or of another size, and `where`
  void Restore(const NpzArrays& arrays, const std::string& where);

 private:
  LearnedState State();
  void Act(const ValueDiceBatch& batch);
  double ObjectiveGradient(const ValueDiceBatch& batch);
  double AddGradientPenalty(const ValueDiceBatch& batch);
  double StepActor(const ValueDiceBatch& batch);
  double AddOrthogonality();

  ValueDiceOptions options_;
  TanhGaussianPolicy actor_;
  Mlp critic_;
  Adam actor_adam_, critic_adam_;

  MlpPass actor_pass_, critic_pass_;
  GradientPenalty penalty_;
  const float* actor_out_ = nullptr;  // (2B + R, 2 act_dim), owned by actor_pass_
  AlignedVector<float> pairs_;        // (3B + 2R, obs_dim + act_dim): the batch's joint rows, then [observation, a~pi]
  AlignedVector<float> dnu_, da_;     // dJ / d nu of each pair, dJ / d its action
  AlignedVector<float> std_, between_, actor_dout_, actor_gradient_, critic_gradient_, gram_, product_;
};

}  // namespace oted
