#pragma once
/// growth/ROUND/design: what a round of growth designs, by the first setting and seed, and how it predicts.
///
/// The round that adds nothing designs what the run's first design is, by the same streams. It is made once.

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "oted/run/records.h"
#include "oted/run/run_setup.h"
#include "oted/stages/design/design_problem.h"

namespace oted {

/// What a round's design is given.
DesignProblem ProblemOfRound(const RunSetup& run, int round, const RunContext& context);

/// growth/ROUND/design/q.json, and as a record
nlohmann::json JsonOfRound(const RunSetup& run, int round, const RunContext& context);
QRecord DesignOfRound(const RunSetup& run, int round, const RunContext& context);

/// growth/ROUND/design/prediction.json
PredictionRecord PredictionOfRound(const RunSetup& run, int round, const QRecord& design, const RunContext& context);

/// The round, if any, whose design is that of this setting and seed.
std::optional<int> RoundOf(const RunSetup& run, const std::string& setting, int seed);

}  // namespace oted
