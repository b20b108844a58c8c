#include "oted/checks/data_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "oted/data/checks_dynamics.h"

namespace oted {

using nlohmann::json;

namespace {

json ChannelsJson(const std::vector<ChannelSummary>& channels) {
  json list = json::array();
  for (const ChannelSummary& c : channels) {
    list.push_back({{"name", c.name}, {"low", c.low}, {"high", c.high}, {"mean", c.mean}, {"std", c.std}});
  }
  return list;
}

json DatasetJson(const Dataset& d) {
  return {{"path", d.path},
          {"sha256", d.sha256},
          {"n_transitions", d.size()},
          {"n_episodes", d.Episodes().size()},
          {"obs_dim", d.obs_dim()},
          {"act_dim", d.act_dim()}};
}

/// How many numbers differ, and by how much at most.
std::string Difference(const char* name, std::span<const double> a, std::span<const double> b) {
  size_t n = 0;
  double largest = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    n += a[i] != b[i];
    largest = std::max(largest, std::abs(a[i] - b[i]));
  }
  return n == 0 ? "" : fmt::format("{}: {} numbers were rounded, by {:.2g} at most", name, n, largest);
}

}  // namespace

json DataCheckRecord(const Dataset& dataset, const SimulatorSpec* spec, const DataCheck& check) {
  const std::vector<Episode> episodes = dataset.Episodes();
  json findings = json::array();
  for (const Finding& f : check.findings) {
    const auto of_row = std::find_if(episodes.begin(), episodes.end(),
                                     [&](const Episode& e) { return e.begin <= f.row && f.row < e.end; });
    const bool has_episode = f.row >= 0 && of_row != episodes.end();
    findings.push_back({{"check", f.check},
                        {"severity", ToString(f.severity)},
                        {"what", f.what},
                        {"row", f.row < 0 ? json() : json(f.row)},
                        {"episode", has_episode ? json(of_row - episodes.begin() + 1) : json()},
                        {"count", f.count},
                        {"channels", f.channels},
                        {"meaning", f.meaning},
                        {"remedy", f.remedy}});
  }
  json record = {{"schema", "oted.data_check/1"},
                 {"dataset", DatasetJson(dataset)},
                 {"task", spec != nullptr ? json(spec->task) : json()},
                 {"errors", CountOf(check.findings, Severity::kError)},
                 {"warnings", CountOf(check.findings, Severity::kWarning)},
                 {"notes", CountOf(check.findings, Severity::kNote)},
                 {"findings", findings},
                 {"noise", json::array()},
                 {"one_step", json()},
                 {"gap", json()}};
  const TaskFacts facts = spec != nullptr ? FactsOf(*spec) : TaskFacts{};
  for (int j = 0; j < static_cast<int>(check.noise.size()); ++j) {
    const ChannelNoise& c = check.noise[static_cast<size_t>(j)];
    record["noise"].push_back({{"name", facts.ObservationName(j)},
                               {"assessable", c.assessable},
                               {"visible", c.visible},
                               {"sigma", c.visible ? json(c.sigma) : json()},
                               {"below", c.assessable ? json(c.below) : json()},
                               {"std", c.std},
                               {"rms_change", c.rms_change},
                               {"r_squared", c.r_squared}});
  }
  if (check.one_step) {
    const OneStepError& e = *check.one_step;
    json& one_step = record["one_step"];
    one_step = {{"rows", e.n_rows},
                {"unsettable", e.n_unsettable},
                {"diverged", e.n_diverged},
                {"median_ratio", e.median_ratio},
                {"ratio_by_shift", json::object()},
                {"channels", json::array()}};
    for (const auto& [shift, ratio] : e.ratio_by_shift) one_step["ratio_by_shift"][fmt::format("{}", shift)] = ratio;
    for (int j = 0; j < static_cast<int>(e.rms_error.size()); ++j) {
      one_step["channels"].push_back({{"name", facts.ObservationName(j)},
                                      {"rms_error", e.rms_error[static_cast<size_t>(j)]},
                                      {"rms_change", e.rms_change[static_cast<size_t>(j)]}});
    }
  }
  if (check.gap) {
    record["gap"] = {{"verdict", ToString(check.Verdict())},
                     {"auc", check.gap->auc},
                     {"accuracy", check.gap->accuracy},
                     {"common", check.gap->common},
                     {"log2", std::numbers::ln2},
                     {"n_logged", dataset.size()},
                     {"n_samples", check.gap->n_data},
                     {"n_simulated", check.gap->n_simulated}};
  }
  return record;
}

json DataInfoRecord(const Dataset& dataset, const SimulatorSpec* spec, const DatasetSummary& s) {
  json record = {{"schema", "oted.data_info/1"},
                 {"dataset", DatasetJson(dataset)},
                 {"task", spec != nullptr ? json(spec->task) : json()},
                 {"episode_length", {{"min", s.shortest}, {"median", s.median_length}, {"max", s.longest}}},
                 {"terminals", s.n_terminals},
                 {"timeouts", s.n_timeouts},
                 {"returns", s.returns},
                 {"scores", json::array()},
                 {"rewards", !s.returns.empty()},
                 {"qpos", s.nq},
                 {"qvel", s.nv},
                 {"observations", ChannelsJson(s.observations)},
                 {"actions", ChannelsJson(s.actions)}};
  if (spec != nullptr && spec->has_score()) {
    for (const double r : s.returns) record["scores"].push_back(spec->NormalizedScore(r));
  }
  return record;
}

std::vector<std::string> Losses(const Dataset& wanted, const Dataset& got) {
  std::vector<std::string> losses;
  if (wanted.size() != got.size()) {
    losses.push_back(fmt::format("{} of {} transitions", wanted.size() - got.size(), wanted.size()));
    return losses;
  }
  if (!wanted.rewards.empty() && got.rewards.empty()) losses.push_back("rewards");
  if (wanted.has_states() && !got.has_states()) losses.push_back("infos/qpos and infos/qvel");
  if (wanted.terminals != got.terminals) losses.push_back("terminals: which rows are terminal");
  if (wanted.timeouts != got.timeouts) losses.push_back("timeouts: where episodes were cut");
  const auto compare = [&](const char* name, std::span<const double> a, std::span<const double> b) {
    if (a.size() != b.size()) return;
    const std::string difference = Difference(name, a, b);
    if (!difference.empty()) losses.push_back(difference);
  };
  compare("observations", wanted.observations.values(), got.observations.values());
  compare("actions", wanted.actions.values(), got.actions.values());
  compare("next_observations", wanted.next_observations.values(), got.next_observations.values());
  compare("rewards", wanted.rewards, got.rewards);
  compare("infos/qpos", wanted.qpos.values(), got.qpos.values());
  compare("infos/qvel", wanted.qvel.values(), got.qvel.values());
  return losses;
}

}  // namespace oted
