#include "oted/run/validation.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "oted/base/error.h"
#include "oted/base/seal.h"
#include "oted/base/words.h"
#include "oted/checks/data_check.h"
#include "oted/matching/verdict.h"
#include "oted/run/design_findings.h"
#include "oted/run/finished_design.h"
#include "oted/run/prediction_words.h"
#include "oted/run/run_inputs.h"
#include "oted/run/sensor_noise_of.h"
#include "oted/run/verify.h"
#include "oted/sim/channel_path.h"
#include "oted/stages/design/replay/prediction_evidence.h"
#include "oted/stages/design/replay/replay_fit.h"

namespace oted {
namespace {

using Eigen::VectorXd;

constexpr double kAboutAlike = 0.05;  // share by which errors differ

/// As the logs say, and as the design found in its own.
std::vector<char> LeftOut(const DesignRecord& design, const SimulatorSpec& spec, const Dataset& logs,
                          const VectorXd& noise) {
  std::vector<char> left_out = ReadingsLeftOut(spec, logs, noise);
  if (!design.validation || design.validation->horizons.empty()) return left_out;
  for (const auto& channel : design.validation->horizons.front().channels) {
    const auto found = std::ranges::find(spec.observation_names, channel.name);
    if (channel.judged || found == spec.observation_names.end()) continue;
    left_out[static_cast<size_t>(found - spec.observation_names.begin())] = 1;
  }
  return left_out;
}

HeldOutPrediction Predict(const SimulatorFactory& factory, const Dataset& logs, const std::vector<double>& z,
                          const VectorXd& noise, const std::vector<char>& left_out, const RunContext& context) {
  const ReadingModel readings = ReadingModel::Of(factory.spec(), logs, left_out);
  const std::optional<HeldOutPrediction> prediction =
      PredictLogs({.factory = factory,
                   .kept_aside = logs,
                   .learned = nullptr,
                   .z = z,
                   .noise = noise,
                   .readings = readings,
                   .narrow = {},
                   .key = RngKey(1).Stage("validation"),
                   .n_threads = context.n_threads,
                   .noise_of_other_logs = true,
                   .n_whole = static_cast<int>(logs.Episodes().size()),
                   .tell = [&](int done, int total) {
                     context.log->Progress("predict", logs.path, done, total, "");
                     context.ThrowIfStopped();
                   }});
  if (!prediction) {
    throw DataError(fmt::format(
        "no window of '{}' can be predicted: its episodes are too short, or its states cannot be set; give longer ones",
        logs.path));
  }
  return *prediction;
}

/// Of predictions of which no channel is off: why the floor counts as not reached.
std::string WhyNotReached(const DesignRecord::Validation& validation) {
  const std::string not_told = NotTold(validation);
  return not_told.empty() ? "the sensors explain what it leaves, but not in every recording" : not_told;
}

std::string SentenceOf(const ValidationResult& result, const HeldOutPrediction& prediction) {
  if (ShowsNothing(prediction.horizons)) return kNothingShown;
  const DesignRecord::Validation::Horizon& shown = ShownHorizon(result.validation);
  const std::vector<int> off = ChannelsOff(prediction);
  const std::string rest = result.reaches_floor ? "; what it leaves, the sensors explain" + ButByChance(shown)
                           : off.empty()        ? "; " + WhyNotReached(result.validation) + ButOdd(result.validation)
                                                : "; what it leaves is more than the sensors explain: " +
                                               WhatRemains(result.validation, shown, off) + ButOdd(result.validation);
  if (PredictsWorse(prediction)) {
    return fmt::format(
        "the designed simulator surely predicts these recordings worse than the nominal one{}{}",
        shown.narrowed < 0 ? fmt::format(", over {} with {} error", InWords(shown), LessOrMore(shown.narrowed)) : "",
        rest);
  }
  if (!result.predicts_better) {
    return fmt::format(
        "over {} it is not sure that the designed simulator predicts these recordings better than the nominal one{}",
        InWords(shown), rest);
  }
  return fmt::format("over {} the designed simulator predicts these recordings with {} error than the nominal one{}",
                     InWords(shown), LessOrMore(shown.narrowed), rest) +
         ButElsewhere(result.validation) + ButAGuess(result.validation);
}

/// "12 % less than the designed simulator's (smaller in 4 of 6 channels)", by the geometric mean over channels.
std::string BesideIn(const std::vector<double>& errors, const std::vector<double>& others, const char* whose) {
  double log_ratio = 0;
  int n_smaller = 0;
  for (size_t c = 0; c < errors.size(); ++c) {
    log_ratio += std::log(errors[c] / others[c]) / static_cast<double>(errors.size());
    n_smaller += errors[c] < others[c];
  }
  const std::string counted = fmt::format("in {} of {} channels", n_smaller, errors.size());
  const double less = 1 - std::exp(log_ratio);
  if (!std::isfinite(less)) return fmt::format("smaller than {} {}", whose, counted);  // one of them is none
  const std::string amount = std::abs(less) < kAboutAlike ? "about" : LessOrMore(less) + " than";
  return fmt::format("{} {} (smaller {})", amount, whose, counted);
}

/// Another model's errors beside those of the two simulators. Its windows were not compared with theirs one by one:
/// what is chance is not told.
/// @param searched  parameters of the design: those that no model holds act in the design alone
std::string SentenceOfModel(const std::string& model, const ValidationResult& result,
                            const std::vector<ParameterSpec>& searched) {
  const DesignRecord::Validation::Horizon& shown = ShownHorizon(result.validation);
  const auto same =
      std::ranges::find(result.model->horizons, shown.n_steps, &DesignRecord::Validation::Horizon::n_steps);
  if (same == result.model->horizons.end()) return "";
  std::vector<double> of_model, nominal, designed;
  for (size_t c = 0; c < shown.channels.size(); ++c) {
    if (!shown.channels[c].judged) continue;
    of_model.push_back(same->channels[c].designed);
    nominal.push_back(shown.channels[c].nominal);
    designed.push_back(shown.channels[c].designed);
  }
  std::vector<std::string> without;
  for (const ParameterSpec& parameter : searched) {
    if (IsChannelPath(parameter.field)) without.push_back("'" + parameter.name + "'");
  }
  return fmt::format("{}{}: over {} its error is {}, and {}", std::filesystem::path(model).filename().string(),
                     without.empty() ? "" : fmt::format(", without {}", Enumerate(without)), InWords(shown),
                     BesideIn(of_model, nominal, "the nominal simulator's"),
                     BesideIn(of_model, designed, "the designed one's"));
}

/// @throws UsageError where none is named, or a task file among others
void TakeData(const std::vector<std::string>& files, DataConfig& data) {
  if (files.empty()) throw UsageError("no recordings are named; add --data FILE");
  const auto is_task_file = [](const std::string& file) { return file.ends_with(".toml"); };
  if (files.size() == 1) {
    if (is_task_file(files.front()))
      data = RunConfig::FromTomlFile(files.front()).data;
    else
      data.Take(files.front());
    return;
  }
  data.Take("");
  for (const std::string& file : files) {
    if (is_task_file(file)) {
      throw UsageError(fmt::format("'{}' is a task file among other recordings; name it alone", file));
    }
    data.recordings.push_back({file, {}});
  }
}

/// The files of `asked` whose content the design learned from.
std::vector<std::string> Learned(const DataConfig& design, const DataConfig& asked) {
  std::set<std::string> known;
  for (const std::string& file : design.AllFiles()) {
    if (std::filesystem::exists(file)) known.insert(Sha256OfDataset(file, design.Options()));
  }
  std::vector<std::string> learned;
  std::ranges::copy_if(asked.AllFiles(), std::back_inserter(learned),
                       [&](const std::string& file) { return known.contains(Sha256OfDataset(file, asked.Options())); });
  return learned;
}

/// Why these recordings may say less, or something else, than they seem to.
std::vector<std::string> Doubts(const Dataset& logs, const SimulatorSpec& spec,
                                const std::vector<std::string>& learned) {
  std::vector<std::string> doubts = logs.warnings;
  if (!learned.empty()) {
    doubts.push_back(fmt::format("the design learned from {}: what it predicts of others stands in design.json",
                                 fmt::format("'{}'", fmt::join(learned, "', '"))));
  }
  SimulatorSpec unlimited = spec;
  unlimited.max_episode_steps = 0;  // that of the design's own logs
  std::ranges::move(DataWarnings(logs, unlimited, Concern::kEveryMethod), std::back_inserter(doubts));
  return doubts;
}

/// The simulator of another model of the same robot, as it is. Delays and sensors stay parameters, so that its windows
/// are those of the task's own model.
/// @throws UsageError where its channels are not those of the task's model, by name and in order
std::unique_ptr<SimulatorFactory> OtherModel(RunConfig config, const std::string& model, const SimulatorSpec& spec,
                                             const Dataset& logs) {
  config.task.model.model = model;
  std::erase_if(config.parameters, [](const ParameterSpec& parameter) { return !IsChannelPath(parameter.field); });
  auto factory = MakeSimulatorFactory(config.task, config.parameters, logs.EpisodeStarts());
  const SimulatorSpec& of_model = factory->spec();
  if (!of_model.can_replay()) {
    throw UsageError(
        fmt::format("--model '{}' has joints that these recordings do not show: it cannot be set to a logged state; "
                    "take them out of it",
                    model));
  }
  for (const auto& [what, got, wanted] :
       {std::tuple("observations", &of_model.observation_names, &spec.observation_names),
        {"actions", &of_model.action_names, &spec.action_names}}) {
    if (*got == *wanted) continue;
    throw UsageError(
        fmt::format("--model '{}' has the {} {}, wanted those of the task's model, {}, in this order; give its joints "
                    "and actuators these names, or name the observations in the task file one by one",
                    model, what, fmt::join(*got, ", "), fmt::join(*wanted, ", ")));
  }
  return factory;
}

}  // namespace

ValidationResult Validate(const ValidationRequest& request, const RunContext& context) {
  CheckRecords(request.run);
  FinishedDesign design = ReadDesign(request.run);
  RunConfig& config = design.config;
  config.task.Resolve();
  if (!request.model.empty() && !config.task.has_model()) {
    throw UsageError(
        fmt::format("--model takes the place of a task file's model, and task '{}' is built in; describe the task in a "
                    "file to compare models of it",
                    config.task.name));
  }
  const DataConfig of_design = config.data;
  TakeData(request.data, config.data);
  config.data.episodes = request.episodes;
  const std::vector<std::string> learned = Learned(of_design, config.data);
  const Dataset logs = ReadEpisodes(config.data, SpecOf(config.task));
  const auto factory = MakeSimulatorFactory(config.task, config.parameters, logs.EpisodeStarts());
  const SimulatorSpec& spec = factory->spec();
  const auto other = request.model.empty() ? nullptr : OtherModel(config, request.model, spec, logs);
  logs.CheckFits(spec.task, spec.obs_dim(), spec.act_dim);
  if (!spec.can_replay()) {
    throw UsageError(
        fmt::format("task '{}' cannot be set to a logged state: its recordings cannot be predicted", config.task.name));
  }
  CheckSameModel(design, *factory);
  const VectorXd noise = SensorNoiseOf(design.record, logs);
  const std::vector<char> left_out = LeftOut(design.record, spec, logs, noise);
  const HeldOutPrediction prediction = Predict(*factory, logs, design.record.BestMode(), noise, left_out, context);
  ValidationResult result{.validation = InRecord(prediction, spec),
                          .model = std::nullopt,
                          .of_model = {},
                          .predicts_better = PredictsBetter(prediction),
                          .reaches_floor = ReachesFloor(prediction),
                          .sentence = {},
                          .warnings = Doubts(logs, spec, learned),
                          .data_sha256 = logs.sha256,
                          .n_transitions = logs.size()};
  result.sentence = SentenceOf(result, prediction);
  if (!result.reaches_floor) {
    const std::vector<Finding> corrections = FindCorrections(*factory, logs, context);
    if (!corrections.empty()) result.sentence += "; but the recordings themselves may be wrong (see the warnings)";
    std::ranges::transform(corrections, std::back_inserter(result.warnings), CorrectionWarning);
  }
  result.sentence = Sentences(std::move(result.sentence));
  if (other == nullptr) return result;
  context.ThrowIfStopped();
  result.model = InRecord(Predict(*other, logs, other->parameters().Nominal(), noise, left_out, context), spec);
  result.of_model = SentenceOfModel(request.model, result, config.parameters);
  return result;
}

nlohmann::json ValidationResult::ToJson(const ValidationRequest& request) const {
  nlohmann::json record = {
      {"schema", "oted.validation/1"},
      {"run", request.run.string()},
      {"dataset",
       {{"path", request.data.size() == 1 ? nlohmann::json(request.data.front()) : nlohmann::json(request.data)},
        {"sha256", data_sha256},
        {"n_transitions", n_transitions}}},
      {"sentence", sentence},
      {"warnings", warnings},
      {"predicts_better", predicts_better},
      {"reaches_floor", reaches_floor},
      {"validation", ValidationToJson(validation)}};
  if (model) {
    record["model"] = {{"path", request.model}, {"sentence", of_model}, {"validation", ValidationToJson(*model)}};
  }
  return record;
}

}  // namespace oted
