#include "oted/stages/simulator_selection/simulator_selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "oted/base/error.h"
#include "oted/base/parallel.h"
#include "oted/matching/judge.h"

namespace oted {

FieldList SelectionConfig::Fields() {
  FieldList fields("selection");
  fields.Add("n_seeds", &n_seeds, "seeded designs per setting (n in the paper)", AtLeast(1));
  fields.AddChoice("score", &score,
                   "what ranks the settings: the common judge, or the paper's c, design deviation or learning progress",
                   {"common", "paper", "design_deviation", "learning_progress"});
  fields.Add("n_sims", &n_sims, "draws z ~ q per candidate", AtLeast(1));
  fields.Add("n_steps", &n_steps, "control steps per draw", AtLeast(1));
  fields.Add("judge_steps", &judge_steps, "gradient steps of the common judge", AtLeast(1));
  return fields;
}

namespace {

constexpr double kTie = 1e-9;  // scores nearer than this are equal

std::vector<std::vector<double>> DrawParameters(const Designer& q, int n, RngKey key) {
  Rng rng = key.MakeRng();
  std::vector<std::vector<double>> z;
  for (int k = 0; k < n; ++k) z.push_back(q.Draw(rng).z);
  return z;
}

/// Steps 2 and 3 of the paper's procedure: c(h_i) = mean over E of -log(1 - g(.|h_i)), z ~ q(.|h_i).
double PaperScore(const SimulatorFactory& factory, const Dataset& dataset, const Policy* clone, Candidate& candidate,
                  const SelectionConfig& config, RngKey key) {
  EvidenceConfig evidence = candidate.evidence;
  evidence.n_steps = config.n_steps;
  ExperienceGatherer gatherer(factory.Make(config.n_sims, 1), dataset, candidate.clone ? candidate.clone.get() : clone,
                              evidence);
  const auto z = DrawParameters(candidate.q, config.n_sims, key.Stage("z"));
  const Array2<double> pooled = Pool(gatherer.Gather(z, key.Stage("rollouts")));
  if (pooled.rows() == 0) return 0;
  double sum = 0;
  for (const double logit : candidate.g.Logits(pooled)) sum += MinusLogOneMinusG(logit);
  return sum / pooled.rows();
}

double DesignDeviation(const std::vector<Candidate>& candidates, const std::vector<int>& indices) {
  const ParameterSpace& space = candidates[static_cast<size_t>(indices[0])].q.space();
  double deviation = 0;
  for (int i = 0; i < space.size(); ++i) {
    double mean = 0, square = 0;
    for (const int k : indices) {
      const double mode =
          candidates[static_cast<size_t>(k)].q.Mode()[static_cast<size_t>(i)] / (space[i].high - space[i].low);
      mean += mode / static_cast<double>(indices.size());
      square += mode * mode / static_cast<double>(indices.size());
    }
    deviation += std::sqrt(std::max(0.0, square - mean * mean)) / space.size();
  }
  return deviation;
}

/// Of each candidate's mode to the mean of all, in ranges, summed over parameters.
std::vector<double> DistancesToMean(const std::vector<Candidate>& candidates, const std::vector<int>& indices) {
  const ParameterSpace& space = candidates[static_cast<size_t>(indices[0])].q.space();
  std::vector<double> distances(indices.size(), 0.0);
  for (int p = 0; p < space.size(); ++p) {
    const auto mode = [&](int k) { return candidates[static_cast<size_t>(k)].q.Mode()[static_cast<size_t>(p)]; };
    double mean = 0;
    for (const int k : indices) mean += mode(k) / static_cast<double>(indices.size());
    for (size_t i = 0; i < indices.size(); ++i) {
      distances[i] += std::abs(mode(indices[i]) - mean) / (space[p].high - space[p].low);
    }
  }
  return distances;
}

double RankingScore(const SettingScore& setting, const std::string& score) {
  if (score == "common") return setting.common;
  if (score == "paper") return setting.c;
  if (score == "design_deviation") return -setting.design_deviation;
  return setting.learning_progress;
}

/// Of a setting's seeds the best-scoring; of tied ones that nearest to the mean of all.
int BestSeed(const std::vector<int>& seeds, const std::vector<Candidate>& candidates,
             const std::vector<CandidateScore>& scores, const std::string& score) {
  const std::vector<double> distance = DistancesToMean(candidates, seeds);
  const auto score_of = [&](size_t i) {
    const CandidateScore& of = scores[static_cast<size_t>(seeds[i])];
    return score == "paper" ? of.c : of.common;
  };
  size_t best = 0;
  for (size_t i = 1; i < seeds.size(); ++i) {
    const double gain = score_of(i) - score_of(best);
    if (std::abs(gain) > kTie ? gain > 0 : distance[i] < distance[best]) best = i;
  }
  return seeds[best];
}

}  // namespace

SelectionResult SelectSimulator(const SimulatorFactory& factory, const Dataset& dataset, const Policy* clone,
                                std::vector<Candidate>& candidates, const SelectionConfig& config, RngKey key,
                                const RunContext& context) {
  OTED_CHECK(!candidates.empty());
  const JudgeHalves halves = SplitForJudge(dataset);
  const EvidenceConfig common_evidence = CommonEvidence(factory.spec(), config.n_steps);
  SelectionResult result;
  result.candidates.resize(candidates.size());
  const int n = static_cast<int>(candidates.size());
  std::atomic<int> n_done{0};
  ParallelFor(n + 1, context.n_threads, [&](int i) {
    context.ThrowIfStopped();
    const auto common = [&](const std::vector<std::vector<double>>& z) {
      // One key for all: every candidate is judged on the same windows by a judge with the same initial weights.
      const RngKey judge = key.Stage("common");
      return factory.spec().can_set_state
                 ? JudgeReplays(factory, halves, z, config.n_sims * config.n_steps, config.judge_steps, judge).common
                 : JudgeSimulator(factory, halves, clone, z, common_evidence, config.judge_steps, judge).common;
    };
    if (i == n) {
      const std::vector<std::vector<double>> nominal(static_cast<size_t>(config.n_sims),
                                                     factory.parameters().Nominal());
      result.nominal_common = common(nominal);
    } else {
      Candidate& candidate = candidates[static_cast<size_t>(i)];
      const RngKey own = key.Stage(candidate.setting).Index(static_cast<uint64_t>(candidate.seed));
      CandidateScore& score = result.candidates[static_cast<size_t>(i)];
      score.c = PaperScore(factory, dataset, clone, candidate, config, own.Stage("c"));
      score.common = common(DrawParameters(candidate.q, config.n_sims, own.Stage("common")));
    }
    context.log->Progress("select", "simulators", ++n_done, n + 1, "");
  });

  // Steps 4 and 5: average over seeds, pick the best.
  for (int i = 0; i < n; ++i) {
    const std::string& name = candidates[static_cast<size_t>(i)].setting;
    auto found = std::find_if(result.settings.begin(), result.settings.end(),
                              [&](const SettingScore& s) { return s.setting == name; });
    if (found == result.settings.end()) {
      result.settings.push_back({});
      result.settings.back().setting = name;
      found = result.settings.end() - 1;
    }
    found->candidates.push_back(i);
  }
  for (SettingScore& setting : result.settings) {
    const double n_seeds = static_cast<double>(setting.candidates.size());
    for (const int i : setting.candidates) {
      setting.c += result.candidates[static_cast<size_t>(i)].c / n_seeds;
      setting.common += result.candidates[static_cast<size_t>(i)].common / n_seeds;
      setting.learning_progress += candidates[static_cast<size_t>(i)].learning_progress / n_seeds;
    }
    setting.design_deviation = DesignDeviation(candidates, setting.candidates);
  }
  // A judge that sees nothing leaves candidates tied at log 2: then the setting whose seeds agree best wins, and of its
  // seeds the one nearest their mean.
  const auto better_setting = [&](const SettingScore& x, const SettingScore& y) {
    const double score_x = RankingScore(x, config.score), score_y = RankingScore(y, config.score);
    return std::abs(score_x - score_y) > kTie ? score_x > score_y : x.design_deviation < y.design_deviation;
  };
  const auto is_eligible = [&](const SettingScore& setting) {
    return !candidates[static_cast<size_t>(setting.candidates[0])].superseded;
  };
  result.selected_setting = -1;
  for (size_t s = 0; s < result.settings.size(); ++s) {
    SettingScore& setting = result.settings[s];
    setting.best_candidate = BestSeed(setting.candidates, candidates, result.candidates, config.score);
    if (!is_eligible(setting)) continue;
    if (result.selected_setting < 0 ||
        better_setting(setting, result.settings[static_cast<size_t>(result.selected_setting)])) {
      result.selected_setting = static_cast<int>(s);
    }
  }
  OTED_CHECK(result.selected_setting >= 0);
  result.best_candidate = result.settings[static_cast<size_t>(result.selected_setting)].best_candidate;
  return result;
}

}  // namespace oted
