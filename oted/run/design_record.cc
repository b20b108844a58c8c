#include "oted/run/design_record.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numbers>

#include "oted/run/prediction_words.h"
#include "oted/run/record_reader.h"
#include "oted/stages/design/trajectories/best_freed.h"

namespace oted {

using nlohmann::json;

// ---------------------------------------------------------------- growth.json

json SuspectsToJson(const std::vector<Suspect>& suspects) {
  json list = json::array();
  for (const Suspect& suspect : suspects) list.push_back(ToJson(suspect));
  return list;
}

std::vector<Suspect> SuspectsFrom(const RecordReader& reader, const char* field) {
  return reader.Read(field, [](const json& list) {
    std::vector<Suspect> suspects;
    for (const json& suspect : list) suspects.push_back(SuspectFromJson(suspect));
    return suspects;
  });
}

const Suspect* GrowthRecord::Freed() const { return BestFreed(suspects); }
std::vector<const Suspect*> GrowthRecord::Rivals() const { return RivalsOfBest(suspects); }

bool DesignRecord::WasGrown(const std::string& parameter) const {
  return std::ranges::any_of(grown, [&](const Suspect& added) { return added.spec.name == parameter; });
}

std::vector<Disputed> DisputedIn(const std::vector<GrowthRecord>& growth) {
  std::vector<Disputed> disputed;
  for (const GrowthRecord& round : growth) {
    for (const Suspect* rival : round.Rivals()) {
      const bool is_added = std::ranges::any_of(growth, [&](const GrowthRecord& other) {
        return other.Freed() != nullptr && other.Freed()->spec.field == rival->spec.field;
      });
      if (!is_added) disputed.push_back({round.Freed(), rival});
    }
  }
  return disputed;
}

json GrowthRecord::ToJson() const {
  return {{"schema", kSchema},
          {"suspects", SuspectsToJson(suspects)},
          {"at_bounds", at_bounds},
          {"wrong_columns", wrong_columns}};
}

GrowthRecord GrowthRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  return {SuspectsFrom(reader, "suspects"), reader.Get<std::vector<std::string>>("at_bounds"),
          reader.Get<std::vector<std::string>>("wrong_columns")};
}

// ---------------------------------------------------------------- design.json

namespace {

json FitToJson(const DesignRecord::Fit& fit) {
  json record = {
      {"window", fit.window}, {"explained", fit.explained}, {"channels", json::array()}, {"suspects", json::array()}};
  if (fit.left_out) record["left_out"] = ToJson(*fit.left_out);
  if (const auto& own = fit.own_logs) record["own_logs"] = {{"found", own->found}, {"sentence", own->sentence}};
  for (const DesignRecord::Suspected& s : fit.suspects) {
    record["suspects"].push_back(ToJson(s.suspect));
    record["suspects"].back().update({{"sentence", s.sentence}, {"line", s.line}, {"likely", s.suspect.IsLikely()}});
  }
  for (const DesignRecord::Channel& c : fit.channels) {
    record["channels"].push_back({{"name", c.name},
                                  {"noise_std", c.noise_std},
                                  {"short_noise_std", c.short_noise_std},
                                  {"long_noise_std", c.long_noise_std},
                                  {"disagrees", c.disagrees}});
  }
  return record;
}

DesignRecord::Fit FitFrom(const RecordReader& reader) {
  DesignRecord::Fit fit{reader.Get<int>("window"), reader.Number("explained"), {}, {}};
  for (const RecordReader& c : reader.List("channels")) {
    fit.channels.push_back({c.Get<std::string>("name"), c.Number("noise_std"), c.Number("short_noise_std"),
                            c.Number("long_noise_std"), c.Get<bool>("disagrees")});
  }
  std::vector<Suspect> suspects = SuspectsFrom(reader, "suspects");
  size_t k = 0;
  for (const RecordReader& s : reader.List("suspects")) {
    fit.suspects.push_back({std::move(suspects[k++]), s.Get<std::string>("sentence"), s.Get<std::string>("line")});
  }
  if (reader.Has("left_out")) fit.left_out = reader.Read("left_out", LeftOutFromJson);
  if (reader.Has("own_logs")) {
    const RecordReader own = reader.At("own_logs");
    fit.own_logs = {own.Get<std::vector<std::vector<double>>>("found"), own.Get<std::string>("sentence")};
  }
  return fit;
}

DesignRecord::Validation::Horizon HorizonFrom(const RecordReader& h) {
  DesignRecord::Validation::Horizon horizon{h.Number("seconds"),
                                            h.Get<int>("n_steps"),
                                            h.Get<int>("n_windows"),
                                            h.Get<bool>("learned"),
                                            h.Number("narrowed"),
                                            h.Get<bool>("surely_better"),
                                            {},
                                            {},
                                            h.Find<double>("most_times_floor").value_or(1),
                                            {}};
  for (const int number : h.Find<std::vector<int>>("odd_episodes").value_or(std::vector<int>())) {
    horizon.odd_episodes.push_back(number - 1);
  }
  for (const RecordReader& c : h.List("channels")) {
    horizon.channels.push_back({c.Get<std::string>("name"), c.Get<std::string>("unit"), c.Number("nominal"),
                                c.Number("designed"), c.Has("floor") ? c.Number("floor") : 0, c.Number("spread"),
                                c.Get<bool>("judged"), c.Number("guess"), c.Find<double>("times_in_some").value_or(0)});
  }
  if (h.Has("in_recordings")) {
    const RecordReader of = h.At("in_recordings");
    horizon.in_recordings = {of.Get<int>("n_windows"), of.Number("narrowed"), of.Get<bool>("surely_better")};
  }
  return horizon;
}

DesignRecord::Validation ValidationFrom(const RecordReader& reader) {
  DesignRecord::Validation validation;
  const RecordReader judges = reader.At("judged_by");
  validation.n_recordings = judges.Get<int>("recordings");
  validation.n_parts = judges.Get<int>("parts");
  for (const RecordReader& h : reader.List("horizons")) validation.horizons.push_back(HorizonFrom(h));
  if (reader.Has("longest")) validation.longest = HorizonFrom(reader.At("longest"));
  return validation;
}

/// @param scored  a seed or a setting
template <class Scored>
void AddScores(const Scored& scored, json& record) {
  if (scored.common) record["common"] = *scored.common;
  if (scored.c) record["c"] = *scored.c;
  if (scored.learning_progress) record["learning_progress"] = *scored.learning_progress;
}

template <class Scored>
void ReadScores(const RecordReader& reader, Scored& scored) {
  scored.common = reader.Find<double>("common");
  scored.c = reader.Find<double>("c");
  scored.learning_progress = reader.Find<double>("learning_progress");
}

json SettingToJson(const DesignRecord::Setting& setting) {
  json seeds = json::array();
  for (const DesignRecord::Seed& seed : setting.seeds) {
    seeds.push_back({{"seed", seed.seed}, {"mode", seed.mode}, {"std", seed.std}});
    AddScores(seed, seeds.back());
  }
  json record = {{"name", setting.name},
                 {"method", setting.method},
                 {"design_deviation", setting.design_deviation},
                 {"seeds", seeds}};
  AddScores(setting, record);
  return record;
}

DesignRecord::Setting SettingFrom(const RecordReader& reader) {
  DesignRecord::Setting setting;
  setting.name = reader.Get<std::string>("name");
  setting.method = reader.Get<std::string>("method");
  setting.design_deviation = reader.Number("design_deviation");
  ReadScores(reader, setting);
  for (const RecordReader& s : reader.List("seeds")) {
    DesignRecord::Seed seed;
    seed.seed = s.Get<int>("seed");
    seed.mode = s.Numbers("mode");
    seed.std = s.Numbers("std");
    ReadScores(s, seed);
    setting.seeds.push_back(std::move(seed));
  }
  return setting;
}

constexpr const char *kLogScale = "log", *kLinearScale = "linear";

json RestsOnToJson(const std::vector<DesignRecord::RestsOn>& rests_on) {
  json list = json::array();
  for (const DesignRecord::RestsOn& of : rests_on) {
    list.push_back(
        {{"name", of.name}, {"field", of.field}, {"off", of.off}, {"value", of.value}, {"condition", of.condition}});
  }
  return list;
}

json ParameterToRecord(const DesignRecord::Parameter& p) {
  return {{"name", p.name},
          {"field", p.field},
          {"unit", p.unit},
          {"nominal", p.nominal},
          {"bounds", {p.low, p.high}},
          {"scale", p.logarithmic ? kLogScale : kLinearScale},
          {"mode", p.mode},
          {"std", p.std},
          {"interval90", {p.interval90_low, p.interval90_high}},
          {"rests_on", RestsOnToJson(p.rests_on)},
          {"either_side", p.either_side},
          {"verdict", ToString(p.verdict)}};
}

DesignRecord::Parameter ParameterFrom(const RecordReader& reader) {
  DesignRecord::Parameter p;
  p.name = reader.Get<std::string>("name");
  p.field = reader.Get<std::string>("field");
  p.unit = reader.Get<std::string>("unit");
  p.nominal = reader.Number("nominal");
  p.mode = reader.Number("mode");
  p.std = reader.Number("std");
  const std::vector<double> bounds = reader.Numbers("bounds"), interval = reader.Numbers("interval90");
  if (bounds.size() != 2) reader.Fail("bounds", "it has no two ends");
  if (interval.size() != 2) reader.Fail("interval90", "it has no two ends");
  p.low = bounds[0], p.high = bounds[1];
  p.logarithmic = reader.Get<std::string>("scale") == kLogScale;
  p.interval90_low = interval[0], p.interval90_high = interval[1];
  for (const RecordReader& of : reader.List("rests_on")) {
    p.rests_on.push_back({of.Get<std::string>("name"), of.Get<std::string>("field"), of.Number("off"),
                          of.Number("value"), of.Get<std::string>("condition")});
  }
  p.either_side = reader.Find<bool>("either_side").value_or(false);
  p.verdict = reader.GetNamed<ParameterVerdict>("verdict", ParameterVerdictNames());
  return p;
}

/// Without what is told of the floor.
json HorizonToRecord(const DesignRecord::Validation::Horizon& h) {
  json channels = json::array();
  for (const auto& c : h.channels) {
    channels.push_back({{"name", c.name},
                        {"unit", c.unit},
                        {"nominal", c.nominal},
                        {"designed", c.designed},
                        {"spread", c.spread},
                        {"guess", c.guess},
                        {"judged", c.judged}});
    if (c.times_in_some > 0) channels.back()["times_in_some"] = c.times_in_some;
  }
  json record = {{"seconds", h.seconds}, {"n_steps", h.n_steps},   {"n_windows", h.n_windows},
                 {"learned", h.learned}, {"narrowed", h.narrowed}, {"surely_better", h.surely_better},
                 {"channels", channels}};
  for (const int episode : h.odd_episodes) record["odd_episodes"].push_back(episode + 1);
  if (h.in_recordings) {
    record["in_recordings"] = {{"n_windows", h.in_recordings->n_windows},
                               {"narrowed", h.in_recordings->narrowed},
                               {"surely_better", h.in_recordings->surely_better}};
  }
  return record;
}

}  // namespace

json ValidationToJson(const DesignRecord::Validation& validation) {
  json record = {{"horizons", json::array()},
                 {"judged_by", {{"recordings", validation.n_recordings}, {"parts", validation.n_parts}}}};
  for (const DesignRecord::Validation::Horizon& h : validation.horizons) {
    record["horizons"].push_back(HorizonToRecord(h));
    for (size_t c = 0; c < h.channels.size(); ++c) {
      record["horizons"].back()["channels"][c]["floor"] = h.channels[c].floor;
    }
    record["horizons"].back()["most_times_floor"] = h.most_times_floor;
  }
  if (validation.longest) {
    record["longest"] = HorizonToRecord(*validation.longest);
    record["longest"]["sentence"] = LongestInWords(validation);
  }
  return record;
}

std::vector<double> DesignRecord::BestMode() const {
  std::vector<double> mode;
  for (const Parameter& parameter : parameters) mode.push_back(parameter.mode);
  return mode;
}

std::vector<std::vector<double>> DesignRecord::MixtureModes() const {
  std::vector<std::vector<double>> modes;
  for (const Member& member : mixture) modes.push_back(member.mode);
  return modes;
}

json DesignRecord::ToJson() const {
  json record = {
      {"schema", kSchema},
      {"task", task},
      {"warnings", warnings},
      {"columns_seem_wrong", columns_seem_wrong},
      {"correlation", correlation},
      {"selected", selected},
      {"mixture", json::array()},
      {"score_name", NameOf(SelectionScoreNames(), score_name)},
      {"verdict", ToString(verdict)},
      {"sentence", sentence},
      {"predicts_better", predicts_better},
      {"log2", std::numbers::ln2},
      {"dataset", {{"path", dataset.path}, {"sha256", dataset.sha256}, {"n_transitions", dataset.n_transitions}}},
      {"model", {{"task", task}, {"sha256", model_sha256}}},
      {"versions", {{"oted", oted_version}, {"mujoco", mujoco_version}}}};
  if (!period_sentence.empty()) record["period_sentence"] = period_sentence;
  for (const Parameter& parameter : parameters) record["parameters"].push_back(ParameterToRecord(parameter));
  for (const Member& member : mixture) {
    record["mixture"].push_back({{"seed", member.seed}, {"mode", member.mode}, {"std", member.std}});
  }
  if (score) record["score"] = *score;
  if (nominal_common) record["nominal_common"] = *nominal_common;
  if (!inputs.empty()) record["inputs"] = inputs;
  if (fit) record["fit"] = FitToJson(*fit);
  if (!grown.empty()) record["grown"] = SuspectsToJson(grown);
  if (validation) record["validation"] = ValidationToJson(*validation);
  for (const MethodChoice& choice : method_choices) record["method_choices"].push_back(::oted::ToJson(choice));
  for (const Setting& setting : settings) record["settings"].push_back(SettingToJson(setting));
  return record;
}

DesignRecord DesignRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  DesignRecord design;
  design.task = reader.Get<std::string>("task");
  design.warnings = reader.Get<std::vector<std::string>>("warnings");
  design.columns_seem_wrong = reader.Get<bool>("columns_seem_wrong");
  design.period_sentence = reader.Find<std::string>("period_sentence").value_or("");
  for (const RecordReader& p : reader.List("parameters")) design.parameters.push_back(ParameterFrom(p));
  design.correlation = reader.Get<std::vector<std::vector<double>>>("correlation");
  design.selected = reader.Get<std::string>("selected");
  for (const RecordReader& m : reader.List("mixture")) {
    design.mixture.push_back({m.Get<int>("seed"), m.Numbers("mode"), m.Numbers("std")});
  }
  design.score = reader.Find<double>("score");
  design.score_name = reader.GetNamed<SelectionScore>("score_name", SelectionScoreNames());
  design.verdict = reader.GetNamed<DesignVerdict>("verdict", DesignVerdictNames());
  design.sentence = reader.Get<std::string>("sentence");
  design.predicts_better = reader.Get<bool>("predicts_better");
  if (reader.Has("fit")) design.fit = FitFrom(reader.At("fit"));
  if (reader.Has("grown")) design.grown = SuspectsFrom(reader, "grown");
  if (reader.Has("validation")) design.validation = ValidationFrom(reader.At("validation"));
  if (reader.Has("method_choices")) {
    design.method_choices = reader.Read("method_choices", [](const json& list) {
      std::vector<MethodChoice> choices;
      for (const json& choice : list) choices.push_back(MethodChoiceFromJson(choice));
      return choices;
    });
  }
  design.nominal_common = reader.Find<double>("nominal_common");
  for (const RecordReader& s : reader.List("settings")) design.settings.push_back(SettingFrom(s));
  const RecordReader dataset = reader.At("dataset"), versions = reader.At("versions");
  design.dataset = {dataset.Get<std::string>("path"), dataset.Get<std::string>("sha256"),
                    dataset.Get<int>("n_transitions")};
  design.model_sha256 = reader.At("model").Get<std::string>("sha256");
  design.inputs = reader.Find<std::string>("inputs").value_or("");
  design.oted_version = versions.Get<std::string>("oted");
  design.mujoco_version = versions.Get<std::string>("mujoco");
  design.fingerprint = reader.Find<std::string>("fingerprint").value_or("");
  return design;
}

}  // namespace oted
