#include "oted/run/growth_design.h"

#include <nlohmann/json.hpp>

#include "oted/run/artifacts.h"
#include "oted/run/design_step.h"
#include "oted/stages/design/design.h"

namespace oted {

using nlohmann::json;

namespace {

constexpr int kSeed = 1;

const std::string& FirstSetting(const RunSetup& run) { return run.settings.begin()->first; }

}  // namespace

DesignProblem ProblemOfRound(const RunSetup& run, int round, const RunContext& context) {
  DesignProblem problem = ProblemOf(run, FirstSetting(run), kSeed, nullptr, context);
  problem.folder = run.directory.growth_design(round);
  problem.run_name = run.directory.NameOf(problem.folder);
  return problem;
}

json JsonOfRound(const RunSetup& run, int round, const RunContext& context) {
  return run.directory.Once(GrowthDesignArtifact(run, round), [&] {
    const DesignConfig& config = run.Designs(FirstSetting(run)).config;
    return RecordOf(LearnDesign(ProblemOfRound(run, round, context), config), config).ToJson();
  });
}

QRecord DesignOfRound(const RunSetup& run, int round, const RunContext& context) {
  return QRecord::FromJson(JsonOfRound(run, round, context), run.parameters(),
                           GrowthDesignArtifact(run, round).file.string());
}

PredictionRecord PredictionOfRound(const RunSetup& run, int round, const QRecord& design, const RunContext& context) {
  const auto make = [&] {
    return PredictionRecord{PredictKeptAside(ProblemOfRound(run, round, context), design.q, design.fit)};
  };
  return OnceAs<PredictionRecord>(run.directory, GrowthPredictionArtifact(run, round), make);
}

std::optional<int> RoundOf(const RunSetup& run, const std::string& setting, int seed) {
  const bool adds_nothing = !run.growth.empty() && run.growth.back().Freed() == nullptr;
  if (!adds_nothing || setting != FirstSetting(run) || seed != kSeed) return std::nullopt;
  return static_cast<int>(run.growth.size());
}

}  // namespace oted
