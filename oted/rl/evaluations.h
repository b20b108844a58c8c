#pragma once
/// The evaluations that a training makes of its policies, beside the training where there is a second thread.

#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "oted/rl/training.h"
#include "oted/sim/rollout.h"

namespace oted {

/// One evaluation at a time, of the policy as it was when it began. With more than one thread it runs while the learner
/// goes on; what it finds enters curve, log and observer on the caller's thread, in the same order at any number of
/// threads.
class Evaluations {
 public:
  /// What it is given must outlive it.
  Evaluations(const AgentJob& job, const TrainingSchedule& schedule, LearningCurve& curve)
      : job_(job), schedule_(schedule), curve_(curve) {}

  /// Of the learner's present policy; the last one must be finished. With one thread it is finished on return.
  /// @param figures  of the training until now, for the log
  void Begin(const Learner& learner, std::vector<std::pair<std::string, double>> figures);
  void FinishIfReady();
  /// Waits for the evaluation under way. @return whether there was one. @throws what the evaluation threw
  bool Finish();

 private:
  void Keep(double eval_return, int n_diverged);

  const AgentJob& job_;
  const TrainingSchedule& schedule_;
  LearningCurve& curve_;
  struct {
    int64_t step = 0;
    std::vector<float> parameters;
    std::unique_ptr<Policy> policy;
    std::vector<std::pair<std::string, double>> figures;
    std::future<std::vector<EpisodeResult>> episodes;  ///< last: its end is waited for before the policy goes
  } now_;
};

}  // namespace oted
