#include "oted/matching/judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "oted/base/error.h"
#include "oted/data/normalizer.h"
#include "oted/matching/discriminator.h"
#include "oted/sim/log_window.h"

namespace oted {
namespace {

const DiscriminatorConfig kImageJudge = {.hidden = {32}, .filters = {16}, .learning_rate = 1e-3};

Array2<double> DrawRows(const Array2<double>& from, int n, Rng& rng) {
  Array2<double> rows(n, from.cols());
  for (int i = 0; i < n; ++i) {
    const auto row = from.row(static_cast<int>(rng.Below(static_cast<uint64_t>(from.rows()))));
    std::copy(row.begin(), row.end(), rows.row(i).begin());
  }
  return rows;
}

/// The judge's logits on all rows of both kinds.
struct Verdicts {
  std::vector<double> data, simulated;
};

/// Eq. 2 / 2 on all rows of both kinds: log 2 for a judge that cannot tell them apart.
double HalfLoss(const Verdicts& logits) {
  double loss_data = 0, loss_simulated = 0;
  for (const double logit : logits.data) loss_data += MinusLogOneMinusG(-logit);
  for (const double logit : logits.simulated) loss_simulated += MinusLogOneMinusG(logit);
  return 0.5 * (loss_data / static_cast<double>(logits.data.size()) +
                loss_simulated / static_cast<double>(logits.simulated.size()));
}

double Accuracy(const Verdicts& logits) {
  const auto share = [](const std::vector<double>& values, bool positive) {
    const auto right = std::count_if(values.begin(), values.end(), [&](double v) { return (v > 0) == positive; });
    return static_cast<double>(right) / static_cast<double>(values.size());
  };
  return 0.5 * (share(logits.data, true) + share(logits.simulated, false));
}

/// Whether rows are so near, pair by pair, that no judge learns to tell them apart: a thousandth of a feature's spread.
bool AreNear(const Array2<double>& logged, const Array2<double>& simulated) {
  constexpr double kNear = 1e-3;
  const std::vector<double> scale = Normalizer::Fit(logged).scale;
  for (int i = 0; i < logged.rows(); ++i) {
    const auto a = logged.row(i), b = simulated.row(i);
    for (size_t j = 0; j < scale.size(); ++j) {
      if (!(std::abs(a[j] - b[j]) <= kNear * scale[j])) return false;
    }
  }
  return true;
}

}  // namespace

JudgeHalves SplitForJudge(const Dataset& dataset) {
  if (dataset.size() < 2) {
    throw DataError(fmt::format(
        "the logs hold {} transition, wanted two or more: each half of them judges the other; record longer episodes",
        dataset.size()));
  }
  std::vector<Episode> episodes = dataset.Episodes();
  if (episodes.size() == 1) {
    const Episode whole = episodes[0];
    const int middle = (whole.begin + whole.end) / 2;
    episodes = {{whole.begin, middle, false}, {middle, whole.end, whole.terminated}};
  }
  // The longest first, each to the half that has less: halves of nearly equal size.
  std::stable_sort(episodes.begin(), episodes.end(),
                   [](const Episode& a, const Episode& b) { return a.size() > b.size(); });
  std::vector<Episode> halves[2];
  int size[2] = {0, 0};
  for (const Episode& episode : episodes) {
    const int half = size[1] < size[0] ? 1 : 0;
    halves[half].push_back(episode);
    size[half] += episode.size();
  }
  return {{dataset.Select(halves[0]), dataset.Select(halves[1])}};
}

EvidenceConfig CommonEvidence(const SimulatorSpec& spec, int n_steps) {
  EvidenceConfig evidence;
  evidence.n_steps = n_steps;
  evidence.n_past_actions = spec.n_past_actions;
  if (!spec.can_set_state) {
    evidence.dataset_starts = evidence.replayed_actions = evidence.transitions = false;
    evidence.first_rows = true;
    evidence.horizon = n_steps;
  }
  if (!spec.image_shape.empty()) {
    evidence.transitions = false;
    evidence.horizon = kFirstSteps;
    evidence.image = spec.image_shape;
  }
  return evidence;
}

Array2<double> Pool(const std::vector<LaneExperience>& experience) {
  Array2<double> pooled;
  for (const LaneExperience& lane : experience) {
    for (int i = 0; i < lane.features.rows(); ++i) pooled.AppendRow(lane.features.row(i));
  }
  return pooled;
}

double AreaUnderCurve(const std::vector<double>& positive, const std::vector<double>& negative) {
  OTED_CHECK(!positive.empty() && !negative.empty());
  std::vector<double> sorted = negative;
  std::sort(sorted.begin(), sorted.end());
  double below = 0;
  for (const double v : positive) {
    const auto [first, last] = std::equal_range(sorted.begin(), sorted.end(), v);
    below += static_cast<double>(first - sorted.begin()) + 0.5 * static_cast<double>(last - first);
  }
  return below / (static_cast<double>(positive.size()) * static_cast<double>(negative.size()));
}

JudgeScore JudgeSamples(const Array2<double> (&data)[2], const Array2<double> (&simulated)[2], int judge_steps,
                        RngKey key, const InputShape& shape) {
  constexpr int kCheckInterval = 20;
  // Images are slow to look at, and few logged ones teach nothing finer.
  const int batch = shape.image.empty() ? 256 : 64;
  const DiscriminatorConfig options = shape.image.empty() ? DiscriminatorConfig() : kImageJudge;
  JudgeScore score;
  score.auc = 0;
  for (int h = 0; h < 2; ++h) {
    score.n_data += data[h].rows();
    score.n_simulated += simulated[h].rows();
    Rng rng = key.Stage("judge").Index(static_cast<uint64_t>(h)).MakeRng();
    Discriminator judge(data[h], options, rng, shape);
    double lowest = std::numeric_limits<double>::infinity();
    Verdicts best;
    for (int step = 1; step <= judge_steps; ++step) {
      const Array2<double> data_rows = DrawRows(data[h], batch, rng);
      judge.Step(data_rows, DrawRows(simulated[h], batch, rng));
      if (step % kCheckInterval != 0) continue;
      Verdicts logits = {judge.Logits(data[1 - h]), judge.Logits(simulated[1 - h])};
      const double loss = HalfLoss(logits);
      if (loss >= lowest) continue;
      lowest = loss;
      best = std::move(logits);
    }
    score.common += 0.5 * std::min(std::numbers::ln2, lowest);
    score.auc += 0.5 * (best.data.empty() ? 0.5 : AreaUnderCurve(best.data, best.simulated));
    score.accuracy += 0.5 * (best.data.empty() ? 0.5 : Accuracy(best));
  }
  return score;
}

JudgeScore JudgeSimulator(const SimulatorFactory& factory, const RolloutJudge& by,
                          const std::vector<std::vector<double>>& z, RngKey key) {
  Array2<double> data[2], simulated[2];
  for (int h = 0; h < 2; ++h) {
    data[h] = DatasetFeatures(by.halves.part[h], by.evidence);
    ExperienceGatherer gatherer(factory.Make(static_cast<int>(z.size()), 1), by.halves.part[h], by.clone, by.evidence);
    simulated[h] = Pool(gatherer.Gather(z, key.Stage("rollouts").Index(static_cast<uint64_t>(h))));
    if (simulated[h].rows() == 0) return {};
  }
  return JudgeSamples(data, simulated, by.judge_steps, key, FeatureShape(factory.spec(), by.evidence));
}

JudgeScore JudgeReplays(const SimulatorFactory& factory, const JudgeHalves& halves,
                        const std::vector<std::vector<double>>& z, int n_rows, int judge_steps, RngKey key) {
  constexpr int kHorizon = 10;  // as EvidenceConfig's
  OTED_CHECK(!z.empty());
  Array2<double> logged[2], simulated[2];
  const auto simulator = factory.Make(1, 1);
  const std::vector<int> lane = {0};
  for (size_t h = 0; h < 2; ++h) {
    const Dataset& d = halves.part[h];
    const Array2<double> features = DatasetFeatures(d, EvidenceConfig{});
    const auto start = [&](const LogWindow& w) {
      return simulator->SetStateFromLog(0, d.observations.row(w.begin), HistoryBefore(d, w));
    };
    simulator->SetParameters(0, factory.parameters().Nominal());
    std::vector<LogWindow> windows;
    for (const Episode& e : d.Episodes()) {
      for (int i = e.begin; i < e.end; ++i) {
        const LogWindow window{i, std::min(kHorizon, e.end - i), e.begin};
        if (start(window)) windows.push_back(window);
      }
    }
    if (windows.empty()) {
      throw DataError(
          fmt::format("no state of dataset '{}' can be set in task '{}' (velocities at the observation's "
                      "clip?); log unclipped velocities",
                      d.path, factory.spec().task));
    }
    Rng rng = key.Stage("windows").Index(h).MakeRng();
    // What diverges at once would be drawn for ever.
    for (int drawn = 0; logged[h].rows() < n_rows && drawn < n_rows; ++drawn) {
      const LogWindow& window = windows[rng.Below(windows.size())];
      simulator->SetParameters(0, z[static_cast<size_t>(drawn) % z.size()]);
      OTED_CHECK(start(window));
      for (int i = window.begin; i < window.begin + window.n_steps; ++i) {
        const auto s = simulator->observation(0), a = d.actions.row(i);
        std::vector<double> row(s.begin(), s.end());
        row.insert(row.end(), a.begin(), a.end());
        simulator->Step(lane, a);
        if (simulator->status(0) == LaneStatus::kDiverged) break;
        const auto next = simulator->observation(0);
        for (size_t j = 0; j < next.size(); ++j) row.push_back(next[j] - row[j]);
        simulated[h].AppendRow(row);
        logged[h].AppendRow(features.row(i));
      }
    }
    if (logged[h].rows() == 0) return {};
  }
  if (AreNear(logged[0], simulated[0]) && AreNear(logged[1], simulated[1])) {
    const int n = logged[0].rows() + logged[1].rows();
    return {.common = std::numbers::ln2, .auc = 0.5, .accuracy = 0.5, .n_data = n, .n_simulated = n};
  }
  return JudgeSamples(logged, simulated, judge_steps, key);
}

}  // namespace oted
