#include "oted/proposal/parameter_choice.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "oted/checks/parameter_check.h"
#include "oted/proposal/parameter_candidates.h"
#include "oted/proposal/widened_fit.h"

namespace oted {
namespace {

constexpr double kLeastEffect = 0.05;  // standard deviations of an observation, between the bounds
constexpr double kOwnEffect = 0.01;    // share of an effect's square that others together must leave unexplained
constexpr double kTogether = 1.5;      // times what the model has, of all that is a force
constexpr double kNamedShare = 0.3;    // of the largest part: those that make up an effect
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

/// What an effect has that others, taken together, do not give.
struct Rest {
  double own = 1;                    ///< share of its square
  std::vector<size_t> made_of = {};  ///< the others that give most of it
};

/// @param cosines  of the angles between effects
Rest RestOf(size_t effect, const std::vector<size_t>& others, const Array2<double>& cosines) {
  if (others.empty()) return {};
  const auto n = static_cast<Eigen::Index>(others.size());
  const auto cosine = [&](size_t i, size_t k) { return cosines(static_cast<int>(i), static_cast<int>(k)); };
  Eigen::MatrixXd among(n, n);
  Eigen::VectorXd with(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const size_t one = others[static_cast<size_t>(i)];
    with[i] = cosine(effect, one);
    for (Eigen::Index k = 0; k < n; ++k) among(i, k) = cosine(one, others[static_cast<size_t>(k)]);
  }
  const Eigen::VectorXd given = among.ldlt().solve(with);
  Rest rest{cosine(effect, effect) - with.dot(given), {}};
  const double least = kNamedShare * given.cwiseAbs().maxCoeff();
  for (Eigen::Index k = 0; k < n; ++k) {
    if (std::abs(given[k]) >= least) rest.made_of.push_back(others[static_cast<size_t>(k)]);
  }
  return rest;
}

/// Whether it sets nothing but how heavy something is or how strong a torque or force: where all that there is of these
/// grows alike, a robot moves as before.
bool IsForce(const ParameterSpec& spec) {
  constexpr const char* kForces[] = {"/mass",         "/inertia",   "/armature",   "/damping",
                                     "/frictionloss", "/stiffness", "/gainprm[0]", "/gear",
                                     "/gear[0]",      "/kp",        "/kv"};
  return std::ranges::all_of(TiedPaths(spec.field), [&](const std::string& path) {
    return std::ranges::any_of(kForces, [&](const char* end) { return path.ends_with(end); });
  });
}

/// A delay before all others: it moves all joints much as a damping and a rotor of each would, and hardly a robot has
/// none.
std::vector<size_t> DelayFirst(const std::vector<ParameterSpec>& candidates) {
  std::vector<size_t> order(candidates.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::ranges::stable_partition(order, [&](size_t i) { return candidates[i].field == kDelayPath; });
  return order;
}

/// All of `specs` as one multiple.
ParameterSpec AsOne(const std::vector<ParameterSpec>& specs) {
  std::vector<std::string> fields;
  for (const ParameterSpec& spec : specs) fields.push_back(spec.field);
  return {.name = "all_of_them",
          .field = fmt::format("{}", fmt::join(fields, " + ")),
          .low = 1 / kTogether,
          .high = kTogether,
          .logarithmic = true};
}

/// It acts nearly as these do: "gain", "gain, damping together".
ParameterChoice::LeftOut ActsAs(const ParameterSpec& spec, const std::string& others) {
  return {fmt::format("{} ({}): it acts nearly as {}; it stays as in the model, and the design suspects it if the logs "
                      "ask; or free it in the place of one of them",
                      spec.name, spec.field, others),
          spec};
}

/// It acts nearly as this one does.
ParameterChoice::LeftOut HardlyToldFrom(const ParameterSpec& spec, const ParameterSpec& other) {
  return {fmt::format("{} ({}): the logs can hardly tell it from {}; free the one that you doubt more", spec.name,
                      spec.field, other.name),
          spec};
}

}  // namespace

ParameterChoice ChooseParameters(
    const SimulatorFactory& nominal, const Dataset& dataset, const ModelOutline& model, RngKey key,
    const RunContext& context,
    const std::function<std::unique_ptr<SimulatorFactory>(const std::vector<ParameterSpec>&)>& remake) {
  ParameterChoice choice;
  std::vector<std::string> ruled_out;
  std::vector<ParameterSpec> candidates = ParameterCandidates(nominal, dataset, model, ruled_out);
  for (std::string& why : ruled_out) choice.left_out.push_back({std::move(why)});
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
    choice.left_out.push_back({fmt::format(
        "{} ({}): {}", candidates[i].name, candidates[i].field,
        effect == 0 ? "the logs do not show it"
                    : fmt::format("over its range it moves the logs by {:.2g} standard deviations", effect))});
  }
  // An armature from nothing on can only add: a mass with the same effect goes both ways.
  for (size_t i = 0; i < candidates.size(); ++i) {
    const bool is_added =
        candidates[i].field.ends_with("/armature") && candidates[i].scale == ParameterScale::kAbsolute;
    for (size_t mass = 0; is_added && mass < candidates.size(); ++mass) {
      const bool is_mass = candidates[mass].field.starts_with("body/") && kept[mass];
      if (!kept[i] || !is_mass || !trade_off(i, mass)) continue;
      kept[i] = false;
      choice.left_out.push_back(HardlyToldFrom(candidates[i], candidates[mass]));
    }
  }
  // In their order: what gives way to another has no other in its turn to give way to it.
  for (size_t i = 0; i < candidates.size(); ++i) {
    for (size_t one = 0; one < i; ++one) {
      if (!kept[one] || !kept[i] || !trade_off(one, i)) continue;
      kept[i] = false;
      choice.left_out.push_back(HardlyToldFrom(candidates[i], candidates[one]));
    }
  }
  // Twice the drives, masses, damping and friction move as once all of them: no pair tells that.
  std::vector<size_t> taken;
  for (const size_t i : DelayFirst(candidates)) {
    if (!kept[i]) continue;
    const Rest rest = RestOf(i, taken, cosines);
    if (rest.own >= kOwnEffect) {
      taken.push_back(i);
      continue;
    }
    std::vector<std::string> names;
    for (const size_t other : rest.made_of) names.push_back(candidates[other].name);
    choice.left_out.push_back(ActsAs(candidates[i], names.size() == 1
                                                        ? names.front() + " does"
                                                        : fmt::format("{} do together", fmt::join(names, ", "))));
  }
  std::ranges::sort(taken);
  for (const size_t i : taken) choice.chosen.push_back(candidates[i]);
  // Through contact derivatives are too rough to tell that. Replays with all of them larger are not.
  std::vector<ParameterSpec> forces;
  for (const size_t i : taken) {
    const ParameterSpec& spec = check.parameters[i].spec;
    if (IsForce(spec) && spec.nominal != 0) forces.push_back(spec);
  }
  if (forces.size() < 2) return choice;
  const ParameterCheck together = CheckParameters(*remake({AsOne(forces)}), &logs, key, context.n_threads);
  if (together.parameters.front().effect.largest_change >= kLeastEffect) return choice;
  const ParameterSpec& last = forces.back();
  choice.left_out.push_back(ActsAs(last, "the other masses, drives, damping and friction do together"));
  std::erase_if(choice.chosen, [&](const ParameterSpec& spec) { return spec.name == last.name; });
  return choice;
}

}  // namespace oted
