#include "oted/stages/simulator_selection/simulator_selection.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "oted/base/error.h"
#include "oted/base/parallel.h"
#include "oted/matching/judge.h"

namespace oted {

const NamedValues<SelectionScore>& SelectionScoreNames() {
  static const NamedValues<SelectionScore> names = {{SelectionScore::kCommon, "common"},
                                                    {SelectionScore::kPaper, "paper"},
                                                    {SelectionScore::kDesignDeviation, "design_deviation"},
                                                    {SelectionScore::kLearningProgress, "learning_progress"}};
  return names;
}

FieldList SelectionConfig::Fields() {
  FieldList fields("selection");
  fields.Add("n_seeds", &n_seeds,
             "seeded designs per setting (n in the paper); 0: one of methods that compute their spread, three of the "
             "others, whose spread is what seeds differ by",
             Between(0, 10000));
  fields.AddChoice("score", &score,
                   "score that ranks the settings: the common judge (common), the paper's c (paper), design deviation "
                   "or learning progress",
                   SelectionScoreNames());
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

/// Steps 2 and 3 of the paper's procedure: c(h_i) = mean over E of -log(1 - g(.|h_i)), z ~ q(.|h_i). The candidate has
/// a g.
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
  for (const double logit : candidate.g->Logits(pooled)) sum += MinusLogOneMinusG(logit);
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

double RankingScore(const SettingScore& setting, SelectionScore score) {
  switch (score) {
    case SelectionScore::kCommon:
      return setting.common.value();
    case SelectionScore::kPaper:
      return setting.c.value();
    case SelectionScore::kDesignDeviation:
      return -setting.design_deviation;
    case SelectionScore::kLearningProgress:
      break;
  }
  return setting.learning_progress.value();
}

/// Of a setting's seeds the best-scoring; of tied ones that nearest to the mean of all.
int BestSeed(const std::vector<int>& seeds, const std::vector<Candidate>& candidates,
             const std::vector<CandidateScore>& scores, SelectionScore score) {
  const std::vector<double> distance = DistancesToMean(candidates, seeds);
  const auto score_of = [&](size_t i) {
    const CandidateScore& of = scores[static_cast<size_t>(seeds[i])];
    return (score == SelectionScore::kPaper ? of.c : of.common).value();
  };
  size_t best = 0;
  for (size_t i = 1; i < seeds.size(); ++i) {
    const double gain = score_of(i) - score_of(best);
    if (std::abs(gain) > kTie ? gain > 0 : distance[i] < distance[best]) best = i;
  }
  return seeds[best];
}

/// Steps 2 and 3 for every candidate, and the common score of the nominal simulator.
void ScoreCandidates(const SimulatorSelectionJob& job, std::vector<Candidate>& candidates, SelectionResult& result) {
  const JudgeHalves halves = SplitForJudge(job.dataset);
  const EvidenceConfig common_evidence = CommonEvidence(job.factory.spec(), job.config.n_steps);
  const auto common = [&](const std::vector<std::vector<double>>& z) {
    // One key for all: every candidate is judged on the same windows by a judge with the same initial weights.
    const RngKey judge = job.key.Stage("common");
    if (!job.factory.spec().can_set_state) {
      return JudgeSimulator(job.factory, {halves, job.clone, common_evidence, job.config.judge_steps}, z, judge).common;
    }
    const int n_rows = job.config.n_sims * job.config.n_steps;
    return JudgeReplays(job.factory, halves, z, n_rows, job.config.judge_steps, judge).common;
  };
  const int n = static_cast<int>(candidates.size());
  std::atomic<int> n_done{0};
  ParallelFor(n + 1, job.context.n_threads, [&](int i) {
    job.context.ThrowIfStopped();
    if (i == n) {
      result.nominal_common =
          common(std::vector(static_cast<size_t>(job.config.n_sims), job.factory.parameters().Nominal()));
    } else {
      Candidate& candidate = candidates[static_cast<size_t>(i)];
      const RngKey own = job.key.Stage(candidate.setting).Index(static_cast<uint64_t>(candidate.seed));
      CandidateScore& score = result.candidates[static_cast<size_t>(i)];
      if (candidate.g) {
        score.c = PaperScore(job.factory, job.dataset, job.clone, candidate, job.config, own.Stage("c"));
      }
      score.common = common(DrawParameters(candidate.q, job.config.n_sims, own.Stage("common")));
    }
    job.context.log->Progress("select", "simulators", ++n_done, n + 1, "");
  });
}

/// The mean of what all have; none otherwise.
template <class Of>
std::optional<double> MeanOver(const std::vector<int>& indices, const Of& of) {
  double sum = 0;
  for (const int i : indices) {
    const std::optional<double> value = of(static_cast<size_t>(i));
    if (!value) return std::nullopt;
    sum += *value / static_cast<double>(indices.size());
  }
  return sum;
}

/// Step 4: every setting's scores, averaged over its seeds.
void ScoreSettings(const std::vector<Candidate>& candidates, SelectionResult& result) {
  for (size_t i = 0; i < candidates.size(); ++i) {
    const std::string& name = candidates[i].setting;
    auto found = std::ranges::find(result.settings, name, &SettingScore::setting);
    if (found == result.settings.end()) {
      result.settings.push_back({});
      result.settings.back().setting = name;
      found = result.settings.end() - 1;
    }
    found->candidates.push_back(static_cast<int>(i));
  }
  for (SettingScore& setting : result.settings) {
    setting.c = MeanOver(setting.candidates, [&](size_t i) { return result.candidates[i].c; });
    setting.common = MeanOver(setting.candidates, [&](size_t i) { return result.candidates[i].common; });
    setting.learning_progress = MeanOver(setting.candidates, [&](size_t i) { return candidates[i].learning_progress; });
    setting.design_deviation = DesignDeviation(candidates, setting.candidates);
  }
}

/// Step 5: the best setting, and of each the best seed.
void PickBest(const std::vector<Candidate>& candidates, SelectionScore score, SelectionResult& result) {
  // A judge that sees nothing leaves candidates tied at log 2: then the setting whose seeds agree best wins, and of its
  // seeds the one nearest their mean.
  const auto better_setting = [&](const SettingScore& x, const SettingScore& y) {
    const double score_x = RankingScore(x, score), score_y = RankingScore(y, score);
    return std::abs(score_x - score_y) > kTie ? score_x > score_y : x.design_deviation < y.design_deviation;
  };
  result.selected_setting = -1;
  for (size_t s = 0; s < result.settings.size(); ++s) {
    SettingScore& setting = result.settings[s];
    setting.best_candidate = BestSeed(setting.candidates, candidates, result.candidates, score);
    if (candidates[static_cast<size_t>(setting.candidates[0])].superseded) continue;
    if (result.selected_setting < 0 ||
        better_setting(setting, result.settings[static_cast<size_t>(result.selected_setting)])) {
      result.selected_setting = static_cast<int>(s);
    }
  }
  OTED_CHECK(result.selected_setting >= 0);
  result.best_candidate = result.settings[static_cast<size_t>(result.selected_setting)].best_candidate;
}

}  // namespace

void CheckSelectionScore(SelectionScore score, const std::string& setting, const std::string& method,
                         bool is_algorithm1) {
  const bool of_algorithm1 = score == SelectionScore::kPaper || score == SelectionScore::kLearningProgress;
  if (!of_algorithm1 || is_algorithm1) return;
  throw UsageError(fmt::format(
      "selection.score = \"{}\" ranks by the discriminator that Algorithm 1 trains, and the method of setting "
      "'{}', {}, trains none; use common or design_deviation",
      NameOf(SelectionScoreNames(), score), setting, method));
}

bool AsksCommonJudge(const std::vector<Candidate>& candidates) {
  return candidates.size() != 1 || !candidates[0].prediction || candidates[0].g;
}

SelectionResult SelectSimulator(const SimulatorSelectionJob& job, std::vector<Candidate>& candidates) {
  OTED_CHECK(!candidates.empty());
  SelectionResult result;
  result.candidates.resize(candidates.size());
  if (AsksCommonJudge(candidates)) ScoreCandidates(job, candidates, result);
  ScoreSettings(candidates, result);
  PickBest(candidates, job.config.score, result);
  return result;
}

}  // namespace oted
