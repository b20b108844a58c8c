#include "oted/run/records.h"

#include <nlohmann/json.hpp>
#include <numbers>

#include "oted/run/record_reader.h"
#include "oted/stages/design/trajectories/freed.h"

namespace oted {

using nlohmann::json;

namespace {

json EvidenceToJson(const MethodEvidence& evidence) {
  json object = {{"held_out_loss", evidence.held_out_loss}, {"closeness", nullptr}};
  if (evidence.closeness) object["closeness"] = *evidence.closeness;
  return object;
}

MethodEvidence EvidenceFrom(const RecordReader& reader) {
  return {reader.Number("held_out_loss"), reader.Find<double>("closeness")};
}

}  // namespace

// ---------------------------------------------------------------- clone.json

CloneRecord CloneRecord::Of(const CloneResult& clone) {
  return {clone.method, clone.train_loss, clone.held_out_loss, clone.n_steps, clone.choice};
}

json CloneRecord::ToJson() const {
  json record = {{"schema", kSchema},
                 {"method", NameOf(CloneMethodNames(), method)},
                 {"train_loss", train_loss},
                 {"held_out_loss", held_out_loss},
                 {"n_steps", n_steps}};
  if (choice) {
    record["choice"] = {{"n_held_out", choice->n_held_out},
                        {"bc", EvidenceToJson(choice->bc)},
                        {"valuedice", EvidenceToJson(choice->valuedice)},
                        {"reason", choice->reason}};
  }
  return record;
}

CloneRecord CloneRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  CloneRecord clone{.method = reader.GetNamed<CloneMethod>("method", CloneMethodNames()),
                    .train_loss = reader.Number("train_loss"),
                    .held_out_loss = reader.Number("held_out_loss"),
                    .n_steps = reader.Get<int>("n_steps"),
                    .choice = {}};
  if (reader.Has("choice")) {
    const RecordReader choice = reader.At("choice");
    clone.choice = {EvidenceFrom(choice.At("bc")), EvidenceFrom(choice.At("valuedice")), choice.Get<int>("n_held_out"),
                    choice.Get<std::string>("reason")};
  }
  return clone;
}

// ---------------------------------------------------------------- q.json and choice.json

json QRecord::ToJson() const {
  json record = q.ToJson(lambda);
  if (learning_progress) record["learning_progress"] = *learning_progress;
  if (fit) record["fit"] = ::oted::ToJson(*fit);
  return record;
}

QRecord QRecord::FromJson(const json& record, const ParameterSpace& space, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  QRecord read{.q = Designer::FromJson(record, space, where),
               .lambda = reader.Get<double>("lambda"),
               .learning_progress = reader.Find<double>("learning_progress"),
               .fit = {}};
  if (reader.Has("fit")) read.fit = reader.Read("fit", FitEvidenceFromJson);
  return read;
}

json PredictionRecord::ToJson() const {
  json record = {{"schema", kSchema}};
  if (prediction) record["prediction"] = ::oted::ToJson(*prediction);
  return record;
}

PredictionRecord PredictionRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  if (!reader.Has("prediction")) return {};
  return {reader.Read("prediction", HeldOutPredictionFromJson)};
}

json MethodChoiceRecord::ToJson() const {
  json record = ::oted::ToJson(choice);
  record["schema"] = kSchema;
  return record;
}

MethodChoiceRecord MethodChoiceRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  try {
    return {MethodChoiceFromJson(record)};
  } catch (const json::exception& e) {
    reader.Fail("choice", e.what());
  } catch (const UsageError& e) {
    reader.Fail("choice", e.what());
  }
}

// ---------------------------------------------------------------- growth.json

namespace {

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

}  // namespace

const Suspect* GrowthRecord::Freed() const { return BestFreed(suspects); }

json GrowthRecord::ToJson() const { return {{"schema", kSchema}, {"suspects", SuspectsToJson(suspects)}}; }

GrowthRecord GrowthRecord::FromJson(const json& record, const std::string& where) {
  return {SuspectsFrom(RecordReader(record, kSchema, where), "suspects")};
}

// ---------------------------------------------------------------- design.json

namespace {

json FitToJson(const DesignRecord::Fit& fit) {
  json record = {
      {"window", fit.window}, {"explained", fit.explained}, {"channels", json::array()}, {"suspects", json::array()}};
  if (fit.left_out) record["left_out"] = ToJson(*fit.left_out);
  for (const DesignRecord::Suspected& s : fit.suspects) {
    record["suspects"].push_back(ToJson(s.suspect));
    record["suspects"].back().update({{"sentence", s.sentence}, {"line", s.line}});
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
  return fit;
}

DesignRecord::Validation ValidationFrom(const RecordReader& reader) {
  DesignRecord::Validation validation;
  const RecordReader judges = reader.At("judged_by");
  validation.n_recordings = judges.Get<int>("recordings");
  validation.n_parts = judges.Get<int>("parts");
  for (const RecordReader& h : reader.List("horizons")) {
    DesignRecord::Validation::Horizon horizon{h.Number("seconds"),
                                              h.Get<int>("n_steps"),
                                              h.Get<int>("n_windows"),
                                              h.Get<bool>("learned"),
                                              h.Number("narrowed"),
                                              h.Get<bool>("surely_better"),
                                              {}};
    for (const RecordReader& c : h.List("channels")) {
      horizon.channels.push_back({c.Get<std::string>("name"), c.Get<std::string>("unit"), c.Number("nominal"),
                                  c.Number("designed"), c.Number("floor"), c.Number("spread"), c.Get<bool>("judged")});
    }
    if (h.Has("in_recordings")) {
      const RecordReader of = h.At("in_recordings");
      horizon.in_recordings = {of.Get<int>("n_windows"), of.Number("narrowed"), of.Get<bool>("surely_better")};
    }
    validation.horizons.push_back(std::move(horizon));
  }
  return validation;
}

void AddOfAlgorithm1(const std::optional<double>& c, const std::optional<double>& learning_progress, json& record) {
  if (c) record["c"] = *c;
  if (learning_progress) record["learning_progress"] = *learning_progress;
}

json SettingToJson(const DesignRecord::Setting& setting) {
  json seeds = json::array();
  for (const DesignRecord::Seed& seed : setting.seeds) {
    seeds.push_back({{"seed", seed.seed}, {"mode", seed.mode}, {"std", seed.std}, {"common", seed.common}});
    AddOfAlgorithm1(seed.c, seed.learning_progress, seeds.back());
  }
  json record = {{"name", setting.name},
                 {"method", setting.method},
                 {"common", setting.common},
                 {"design_deviation", setting.design_deviation},
                 {"seeds", seeds}};
  AddOfAlgorithm1(setting.c, setting.learning_progress, record);
  return record;
}

DesignRecord::Setting SettingFrom(const RecordReader& reader) {
  DesignRecord::Setting setting;
  setting.name = reader.Get<std::string>("name");
  setting.method = reader.Get<std::string>("method");
  setting.c = reader.Find<double>("c");
  setting.common = reader.Number("common");
  setting.design_deviation = reader.Number("design_deviation");
  setting.learning_progress = reader.Find<double>("learning_progress");
  for (const RecordReader& s : reader.List("seeds")) {
    DesignRecord::Seed seed;
    seed.seed = s.Get<int>("seed");
    seed.mode = s.Numbers("mode");
    seed.std = s.Numbers("std");
    seed.c = s.Find<double>("c");
    seed.common = s.Number("common");
    seed.learning_progress = s.Find<double>("learning_progress");
    setting.seeds.push_back(std::move(seed));
  }
  return setting;
}

constexpr const char *kLogScale = "log", *kLinearScale = "linear";

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
  p.verdict = reader.GetNamed<ParameterVerdict>("verdict", ParameterVerdictNames());
  return p;
}

}  // namespace

json ValidationToJson(const DesignRecord::Validation& validation) {
  json record = {{"horizons", json::array()},
                 {"judged_by", {{"recordings", validation.n_recordings}, {"parts", validation.n_parts}}}};
  for (const DesignRecord::Validation::Horizon& h : validation.horizons) {
    json channels = json::array();
    for (const auto& c : h.channels) {
      channels.push_back({{"name", c.name},
                          {"unit", c.unit},
                          {"nominal", c.nominal},
                          {"designed", c.designed},
                          {"floor", c.floor},
                          {"spread", c.spread},
                          {"judged", c.judged}});
    }
    record["horizons"].push_back({{"seconds", h.seconds},
                                  {"n_steps", h.n_steps},
                                  {"n_windows", h.n_windows},
                                  {"learned", h.learned},
                                  {"narrowed", h.narrowed},
                                  {"surely_better", h.surely_better},
                                  {"channels", channels}});
    if (h.in_recordings) {
      record["horizons"].back()["in_recordings"] = {{"n_windows", h.in_recordings->n_windows},
                                                    {"narrowed", h.in_recordings->narrowed},
                                                    {"surely_better", h.in_recordings->surely_better}};
    }
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
      {"correlation", correlation},
      {"selected", selected},
      {"mixture", json::array()},
      {"score", score},
      {"score_name", NameOf(SelectionScoreNames(), score_name)},
      {"verdict", ToString(verdict)},
      {"sentence", sentence},
      {"predicts_better", predicts_better},
      {"log2", std::numbers::ln2},
      {"nominal_common", nominal_common},
      {"dataset", {{"path", dataset.path}, {"sha256", dataset.sha256}, {"n_transitions", dataset.n_transitions}}},
      {"model", {{"task", task}, {"sha256", model_sha256}}},
      {"versions", {{"oted", oted_version}, {"mujoco", mujoco_version}}}};
  for (const Parameter& parameter : parameters) record["parameters"].push_back(ParameterToRecord(parameter));
  for (const Member& member : mixture) {
    record["mixture"].push_back({{"seed", member.seed}, {"mode", member.mode}, {"std", member.std}});
  }
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
  for (const RecordReader& p : reader.List("parameters")) design.parameters.push_back(ParameterFrom(p));
  design.correlation = reader.Get<std::vector<std::vector<double>>>("correlation");
  design.selected = reader.Get<std::string>("selected");
  for (const RecordReader& m : reader.List("mixture")) {
    design.mixture.push_back({m.Get<int>("seed"), m.Numbers("mode"), m.Numbers("std")});
  }
  design.score = reader.Number("score");
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
  design.nominal_common = reader.Number("nominal_common");
  for (const RecordReader& s : reader.List("settings")) design.settings.push_back(SettingFrom(s));
  const RecordReader dataset = reader.At("dataset"), versions = reader.At("versions");
  design.dataset = {dataset.Get<std::string>("path"), dataset.Get<std::string>("sha256"),
                    dataset.Get<int>("n_transitions")};
  design.model_sha256 = reader.At("model").Get<std::string>("sha256");
  design.oted_version = versions.Get<std::string>("oted");
  design.mujoco_version = versions.Get<std::string>("mujoco");
  design.fingerprint = reader.Find<std::string>("fingerprint").value_or("");
  return design;
}

// ---------------------------------------------------------------- agent.json

namespace {

std::vector<std::pair<std::string, double>> FiguresFrom(const json& object) {
  std::vector<std::pair<std::string, double>> figures;
  for (const auto& [name, value] : object.items()) {
    figures.emplace_back(name, value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>());
  }
  return figures;
}

}  // namespace

json AgentRecord::ToJson() const {
  const bool designed = ground == Ground::kDesigned;
  json record = {{"schema", kSchema}, {"agent", agent},     {"designed", designed},
                 {"seed", seed},      {"n_steps", n_steps}, {"eval_return", eval_return}};
  // What is SAC's and Algorithm 2's is not said.
  if (algorithm != AgentAlgorithm::kSac) record["algorithm"] = EntryOf(algorithm).name;
  if (designed && train_in != TrainIn::kModes) record["train_in"] = NameOf(TrainInNames(), train_in);
  if (!designed && ground != Ground::kNominal) record["baseline"] = NameOf(GroundNames(), ground);
  for (const auto& [name, value] : episodes) record["episodes"][name] = value;
  return record;
}

AgentRecord AgentRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  AgentRecord read;
  read.agent = reader.Get<int>("agent");
  if (!reader.Get<bool>("designed")) {
    read.ground = reader.Has("baseline") ? reader.GetNamed<Ground>("baseline", GroundNames()) : Ground::kNominal;
  }
  if (reader.Has("algorithm")) {
    NamedValues<AgentAlgorithm> names;
    for (const AlgorithmEntry& entry : Algorithms()) names.emplace_back(entry.algorithm, entry.name);
    read.algorithm = reader.GetNamed<AgentAlgorithm>("algorithm", names);
  }
  if (reader.Has("train_in")) read.train_in = reader.GetNamed<TrainIn>("train_in", TrainInNames());
  read.seed = reader.Get<int64_t>("seed");
  read.n_steps = reader.Get<int64_t>("n_steps");
  read.eval_return = reader.Number("eval_return");
  if (reader.Has("episodes")) read.episodes = reader.Read("episodes", FiguresFrom);
  return read;
}

// ---------------------------------------------------------------- offline.json

json OfflineRecord::ToJson() const {
  json record = {{"schema", kSchema},  {"baseline", baseline},           {"seed", seed},
                 {"n_steps", n_steps}, {"n_transitions", n_transitions}, {"losses", json::object()}};
  for (const auto& [name, value] : losses) record["losses"][name] = value;
  return record;
}

OfflineRecord OfflineRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  return {reader.Get<std::string>("baseline"), reader.Get<int64_t>("seed"), reader.Get<int64_t>("n_steps"),
          reader.Get<int>("n_transitions"), reader.Read("losses", FiguresFrom)};
}

// ---------------------------------------------------------------- policy_selection.json

json PolicySelectionRecord::ToJson() const {
  json record = {{"schema", kSchema}, {"selected", selected}};
  for (const Simulator& s : simulators) record["simulators"].push_back({{"seed", s.seed}, {"mode", s.mode}});
  for (const Agent& a : agents) {
    record["agents"].push_back(
        {{"agent", a.agent}, {"returns", a.returns}, {"mean_return", a.mean_return}, {"n_diverged", a.n_diverged}});
  }
  return record;
}

PolicySelectionRecord PolicySelectionRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  PolicySelectionRecord selection;
  selection.selected = reader.Get<int>("selected");
  for (const RecordReader& s : reader.List("simulators")) {
    selection.simulators.push_back({s.Get<int>("seed"), s.Numbers("mode")});
  }
  for (const RecordReader& a : reader.List("agents")) {
    selection.agents.push_back(
        {a.Get<int>("agent"), a.Numbers("returns"), a.Number("mean_return"), a.Get<int>("n_diverged")});
  }
  return selection;
}

// ---------------------------------------------------------------- evaluation.json

json EvaluationRecord::ToJson() const {
  json record = {{"schema", kSchema},
                 {"task", task},
                 {"episodes", episodes},
                 {"parameters", json::array()},
                 {"policies", json::array()}};
  for (const Parameter& p : parameters) {
    record["parameters"].push_back({{"name", p.name},
                                    {"unit", p.unit},
                                    {"nominal", p.nominal},
                                    {"truth", p.truth},
                                    {"mode", p.mode},
                                    {"std", p.std},
                                    {"absolute_error", p.absolute_error}});
  }
  for (const PolicyResult& p : policies) {
    record["policies"].push_back({{"name", p.name},
                                  {"label", p.label},
                                  {"mean_return", p.mean_return},
                                  {"std_return", p.std_return},
                                  {"n_diverged", p.n_diverged},
                                  {"score", p.score ? json(*p.score) : json()}});
  }
  return record;
}

EvaluationRecord EvaluationRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  EvaluationRecord evaluation{reader.Get<std::string>("task"), reader.Get<int>("episodes"), {}, {}};
  for (const RecordReader& p : reader.List("parameters")) {
    evaluation.parameters.push_back({p.Get<std::string>("name"), p.Get<std::string>("unit"), p.Number("nominal"),
                                     p.Number("truth"), p.Number("mode"), p.Number("std"), p.Number("absolute_error")});
  }
  for (const RecordReader& p : reader.List("policies")) {
    evaluation.policies.push_back({p.Get<std::string>("name"), p.Get<std::string>("label"), p.Number("mean_return"),
                                   p.Number("std_return"), p.Get<int>("n_diverged"), p.Find<double>("score")});
  }
  return evaluation;
}

}  // namespace oted
