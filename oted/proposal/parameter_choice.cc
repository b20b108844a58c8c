#include "oted/proposal/parameter_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "oted/checks/parameter_check.h"
#include "oted/proposal/parameter_candidates.h"
#include "oted/proposal/widened_fit.h"

namespace oted {
namespace {

constexpr double kLeastEffect = 0.05;  // standard deviations of an observation, between the bounds
constexpr double kOwnEffect = 0.01;    // share of an effect's square that others together must leave unexplained
constexpr int kEpisodes = 3, kEpisodeRows = 2000;  // that effects are measured on

/// The beginnings of the first episodes.
Dataset Beginnings(const Dataset& dataset) {
  std::vector<Episode> episodes = dataset.Episodes();
  episodes.resize(std::min<size_t>(episodes.size(), kEpisodes));
  for (Episode& episode : episodes) {
    if (episode.size() <= kEpisodeRows) continue;
    episode.end = episode.begin + kEpisodeRows;
    episode.terminated = false;
  }
  return dataset.Select(episodes);
}

/// Takes effects one by one and says of each how much of it those taken before do not explain: Cholesky's
/// decomposition of the matrix of cosines, row by row.
class Explained {
 public:
  explicit Explained(const Array2<double>& cosines) : cosines_(cosines) {}

  /// The share of the square of effect i that is its own. Keeps it among those taken if that is at least `least`.
  double Take(int i, double least) {
    std::vector<double> row;
    double own = cosines_(i, i);
    for (size_t k = 0; k < taken_.size(); ++k) {
      double rest = cosines_(i, taken_[k]);
      for (size_t m = 0; m < k; ++m) rest -= row[m] * rows_[k][m];
      row.push_back(rest / rows_[k][k]);
      own -= row.back() * row.back();
    }
    if (own < least) return own;
    row.push_back(std::sqrt(own));
    rows_.push_back(std::move(row));
    taken_.push_back(i);
    return own;
  }

 private:
  const Array2<double>& cosines_;
  std::vector<int> taken_;
  std::vector<std::vector<double>> rows_;
};

}  // namespace

ParameterChoice ChooseParameters(
    const SimulatorFactory& nominal, const Dataset& dataset, const ModelOutline& model, RngKey key,
    const RunContext& context,
    const std::function<std::unique_ptr<SimulatorFactory>(const std::vector<ParameterSpec>&)>& remake) {
  ParameterChoice choice;
  std::vector<ParameterSpec> candidates = ParameterCandidates(nominal, dataset, model, choice.left_out);
  const Dataset logs = Beginnings(dataset);
  const std::optional<TrialFit> trial = FitWidened(candidates, dataset, key.Stage("trial"), context, remake);
  const ParameterCheck check = CheckParameters(*remake(candidates), &logs, key, context.n_threads);
  // What the robot is like the fit knows better. But it sees short windows: what longer replays at the nominal values
  // tell apart is told apart, too.
  const Array2<double>& cosines = trial ? trial->cosines : check.cosines;
  const auto trade_off = [&](size_t one, size_t other) {
    const int i = static_cast<int>(one), k = static_cast<int>(other);
    return std::min(std::abs(cosines(i, k)), std::abs(check.cosines(i, k))) >= kTradeOffCosine;
  };
  std::vector<bool> kept(candidates.size(), true);
  for (size_t i = 0; i < candidates.size(); ++i) {
    const double effect = check.parameters[i].effect.largest_change;
    if (effect >= kLeastEffect) continue;
    kept[i] = false;
    choice.left_out.push_back(fmt::format(
        "{} ({}): {}", candidates[i].name, candidates[i].field,
        effect == 0 ? "the logs do not show it"
                    : fmt::format("over its range it moves the logs by {:.2g} standard deviations", effect)));
  }
  // An armature from nothing on can only add: a mass with the same effect goes both ways.
  for (size_t i = 0; i < candidates.size(); ++i) {
    const bool is_added =
        candidates[i].field.ends_with("/armature") && candidates[i].scale == ParameterScale::kAbsolute;
    for (size_t mass = 0; is_added && mass < candidates.size(); ++mass) {
      const bool is_mass = candidates[mass].field.starts_with("body/") && kept[mass];
      if (!kept[i] || !is_mass || !trade_off(i, mass)) continue;
      kept[i] = false;
      choice.left_out.push_back(
          fmt::format("{} ({}): the logs can hardly tell it from {}; free the one that you trust less",
                      candidates[i].name, candidates[i].field, candidates[mass].name));
    }
  }
  // In their order: what gives way to another has no other in its turn to give way to it.
  for (size_t i = 0; i < candidates.size(); ++i) {
    for (size_t one = 0; one < i; ++one) {
      if (!kept[one] || !kept[i] || !trade_off(one, i)) continue;
      kept[i] = false;
      choice.left_out.push_back(
          fmt::format("{} ({}): the logs can hardly tell it from {}; free the one that you trust less",
                      candidates[i].name, candidates[i].field, candidates[one].name));
    }
  }
  // Twice the drives, masses, damping and friction move as once all of them: no pair tells that.
  Explained explained(cosines);
  for (size_t i = 0; i < candidates.size(); ++i) {
    if (!kept[i]) continue;
    if (explained.Take(static_cast<int>(i), kOwnEffect) >= kOwnEffect) {
      choice.chosen.push_back(candidates[i]);
    } else {
      choice.left_out.push_back(
          fmt::format("{} ({}): those that are freed have nearly the same effect, taken together; it stays as in the "
                      "model, and the design suspects it if the logs ask; or free it in the place of one that you "
                      "trust more",
                      candidates[i].name, candidates[i].field));
    }
  }
  return choice;
}

}  // namespace oted
