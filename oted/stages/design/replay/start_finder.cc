#include "oted/stages/design/replay/start_finder.h"

#include <utility>

#include "oted/stages/design/replay/prediction.h"
#include "oted/stages/design/replay/reading_model.h"
#include "oted/stages/design/replay/replay_fit.h"

namespace oted {

StartFinder::StartFinder(const SimulatorFactory& factory, const Dataset& logs, Eigen::VectorXd noise, int n_threads)
    : logs_(logs),
      noise_(std::move(noise)),
      period_s_(factory.spec().control_period_s),
      replayer_(MakeReplayer(factory, logs,
                             ReadingModel::Of(factory.spec(), logs, ReadingsLeftOut(factory.spec(), logs, noise_)),
                             n_threads)) {}

int StartFinder::n_lead() const { return LeadSteps(replayer_.readings(), period_s_); }

std::vector<ReplayStart> StartFinder::Find(const std::vector<int>& rows, int n_steps, const std::vector<double>& z) {
  const PredictionJudge judge(replayer_, logs_, noise_, rows, n_steps - n_lead(), period_s_);
  const PredictionJudge::Squares predicted = judge.Predict(z);
  std::vector<ReplayStart> starts;
  for (size_t i = 0; i < rows.size(); ++i) {
    const Eigen::VectorXd& state = predicted.starts[i];
    starts.push_back({rows[i], {state.begin(), state.end()}});
  }
  return starts;
}

}  // namespace oted
