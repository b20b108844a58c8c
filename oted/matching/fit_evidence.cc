#include "oted/matching/fit_evidence.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>

namespace oted {

using nlohmann::json;

namespace {

/// JSON has no NaN: null stands for it.
std::vector<double> NumbersFrom(const json& list) {
  std::vector<double> numbers;
  for (const json& number : list) {
    numbers.push_back(number.is_null() ? std::numeric_limits<double>::quiet_NaN() : number.get<double>());
  }
  return numbers;
}

json SpecToJson(const ParameterSpec& spec) {
  return {{"name", spec.name},
          {"field", spec.field},
          {"range", {spec.low, spec.high}},
          {"scale", spec.scale == ParameterScale::kAbsolute ? "absolute" : "nominal"},
          {"log", spec.logarithmic},
          {"unit", spec.unit},
          {"nominal", spec.nominal}};
}

ParameterSpec SpecFromJson(const json& record) {
  return {.name = record.at("name"),
          .field = record.at("field"),
          .low = record.at("range").at(0),
          .high = record.at("range").at(1),
          .scale = record.at("scale") == "absolute" ? ParameterScale::kAbsolute : ParameterScale::kNominal,
          .logarithmic = record.at("log"),
          .unit = record.at("unit"),
          .nominal = record.at("nominal")};
}

json InRecord(const std::vector<SearchInterval>& intervals) {
  json record = json::array();
  for (const SearchInterval& interval : intervals) record.push_back({interval.low, interval.high});
  return record;
}

std::vector<SearchInterval> IntervalsOf(const json& record) {
  std::vector<SearchInterval> intervals;
  for (const json& interval : record) intervals.push_back({interval.at(0), interval.at(1)});
  return intervals;
}

}  // namespace

std::vector<LeftOutPart> LeftOutInTurn::WorseRecordings() const {
  std::vector<LeftOutPart> worse;
  std::ranges::copy_if(parts, std::back_inserter(worse),
                       [&](const LeftOutPart& part) { return recordings && part.sure && part.error > 1; });
  return worse;
}

bool IsLikelier(const FreedTrial& trial) {
  return trial.nats && trial.nats->value > std::max(kFewestSureNats, kSureErrors * trial.nats->error);
}

json ToJson(const FreedTrial& trial) {
  json record = {{"value", trial.value},     {"std", trial.std},           {"kept", trial.kept},
                 {"seconds", trial.seconds}, {"n_steps", trial.n_steps},   {"n_windows", trial.n_windows},
                 {"learned", trial.learned}, {"gain", ToJson(trial.gain)}, {"before", trial.before},
                 {"after", trial.after},     {"led_by", trial.led_by}};
  if (trial.nats) record["nats"] = ToJson(*trial.nats);
  record["intervals90"] = InRecord(trial.intervals90);
  return record;
}

FreedTrial TrialFromJson(const json& record) {
  FreedTrial trial{.value = record.at("value"),
                   .std = record.at("std"),
                   .intervals90 = {},
                   .kept = record.at("kept"),
                   .seconds = record.at("seconds"),
                   .n_steps = record.at("n_steps"),
                   .n_windows = record.at("n_windows"),
                   .learned = record.at("learned"),
                   .gain = EstimatedFromJson(record.at("gain")),
                   .nats = std::nullopt,
                   .led_by = record.at("led_by"),
                   .before = NumbersFrom(record.at("before")),
                   .after = NumbersFrom(record.at("after"))};
  if (record.contains("nats")) trial.nats = EstimatedFromJson(record.at("nats"));
  trial.intervals90 = IntervalsOf(record.at("intervals90"));
  return trial;
}

json ToJson(const Suspect& suspect) {
  json record = SpecToJson(suspect.spec);
  record.update({{"value", suspect.value}, {"explains", suspect.explains}});
  if (suspect.trial) record["freed"] = ToJson(*suspect.trial);
  return record;
}

Suspect SuspectFromJson(const json& record) {
  Suspect suspect;
  suspect.spec = SpecFromJson(record);
  suspect.value = record.at("value");
  suspect.explains = record.at("explains");
  if (record.contains("freed")) suspect.trial = TrialFromJson(record.at("freed"));
  return suspect;
}

json ToJson(const LeftOutInTurn& left_out) {
  json parts = json::array();
  for (const LeftOutPart& part : left_out.parts) {
    json numbers = json::array();
    for (const int episode : part.episodes) numbers.push_back(episode + 1);
    parts.push_back({{"error", part.error}, {"sure", part.sure}, {"episodes", std::move(numbers)}});
  }
  return {{"recordings", left_out.recordings}, {"parts", std::move(parts)}};
}

LeftOutInTurn LeftOutFromJson(const json& record) {
  LeftOutInTurn left_out{{}, record.at("recordings")};
  for (const json& part : record.at("parts")) {
    left_out.parts.push_back({.error = part.at("error"), .sure = part.at("sure")});
    for (const int number : part.at("episodes")) left_out.parts.back().episodes.push_back(number - 1);
  }
  return left_out;
}

json ToJson(const FitEvidence& evidence) {
  json record = {{"window", evidence.window},
                 {"explained", evidence.explained},
                 {"noise_std", evidence.noise_std},
                 {"scale", evidence.scale},
                 {"short_noise_std", evidence.short_noise_std},
                 {"long_noise_std", evidence.long_noise_std},
                 {"rows", evidence.rows},
                 {"logged_rows", evidence.logged_rows},
                 {"errors_grow", evidence.errors_grow}};
  if (const auto& unseen = evidence.unseen) {
    record["unseen"] = {{"z", unseen->z},
                        {"computed", unseen->computed},
                        {"mean", unseen->mean},
                        {"std", unseen->std},
                        {"covariance", unseen->covariance}};
  }
  if (evidence.left_out) record["left_out"] = ToJson(*evidence.left_out);
  if (!evidence.own_logs.empty()) record.update({{"own_logs", evidence.own_logs}, {"unsettled", evidence.unsettled}});
  for (const MirroredValue& value : evidence.mirrored) {
    record["mirrored"].push_back(
        {{"parameter", value.parameter}, {"interval90", {value.interval90.low, value.interval90.high}}});
  }
  for (const Condition& condition : evidence.conditions) {
    json of = SpecToJson(condition.spec);
    of.update({{"parameter", condition.parameter}, {"off", condition.off}, {"value", condition.value}});
    record["conditions"].push_back(std::move(of));
  }
  for (const Suspect& asked : evidence.asked) record["asked"].push_back(ToJson(asked));
  if (evidence.asks_surely) record["asks_surely"] = true;
  return record;
}

FitEvidence FitEvidenceFromJson(const json& record) {
  FitEvidence evidence{.window = record.at("window"),
                       .explained = record.at("explained"),
                       .noise_std = record.at("noise_std"),
                       .scale = record.at("scale"),
                       .short_noise_std = record.at("short_noise_std"),
                       .long_noise_std = record.at("long_noise_std"),
                       .rows = record.value("rows", 0),
                       .logged_rows = record.value("logged_rows", 0),
                       .unseen = {},
                       .errors_grow = record.value("errors_grow", false)};
  if (record.contains("unseen")) {
    const json& unseen = record.at("unseen");
    evidence.unseen = {.z = unseen.at("z"),
                       .computed = unseen.at("computed"),
                       .mean = unseen.at("mean"),
                       .std = unseen.at("std"),
                       .covariance = unseen.at("covariance")};
  }
  if (record.contains("left_out")) evidence.left_out = LeftOutFromJson(record.at("left_out"));
  if (record.contains("own_logs")) {
    evidence.own_logs = record.at("own_logs");
    evidence.unsettled = record.at("unsettled").get<std::vector<int>>();
  }
  for (const json& of : record.value("mirrored", json::array())) {
    const json& interval = of.at("interval90");
    evidence.mirrored.push_back({of.at("parameter"), {interval.at(0), interval.at(1)}});
  }
  for (const json& of : record.value("conditions", json::array())) {
    evidence.conditions.push_back({of.at("parameter"), SpecFromJson(of), of.at("off"), of.at("value")});
  }
  for (const json& of : record.value("asked", json::array())) evidence.asked.push_back(SuspectFromJson(of));
  evidence.asks_surely = record.value("asks_surely", false);
  return evidence;
}

}  // namespace oted
