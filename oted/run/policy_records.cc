#include "oted/run/policy_records.h"

#include <limits>
#include <nlohmann/json.hpp>

#include "oted/run/record_reader.h"

namespace oted {

using nlohmann::json;

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
  if (always_diverged) record["always_diverged"] = true;
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
  read.always_diverged = reader.Has("always_diverged");
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
  if (selection.selected < 1 || static_cast<size_t>(selection.selected) > selection.agents.size()) {
    reader.Fail("selected", "it is none of the agents");
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
