#include "oted/stages/design/method_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/statistics.h"
#include "oted/matching/verdict.h"

namespace oted {

using nlohmann::json;

std::vector<DesignMethod> OtherMethods() {
  std::vector<DesignMethod> methods;
  for (const MethodDescription& described : DesignMethods()) {
    if (described.tried_by_auto) methods.push_back(described.method);
  }
  return methods;
}

namespace {

constexpr double kStandardErrors = 2.0;
constexpr double kLargestLogRatio = 3.0;  // of one window: a contact that breaks does not decide

double GeometricMean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += std::log(std::max(value, 1e-12));
  return std::exp(sum / static_cast<double>(values.size()));
}

/// "12 % nearer", "3 % farther".
std::string Nearness(double gain) {
  const double ratio = std::exp(-gain);
  if (gain >= 0) return fmt::format("{:.2g} % nearer", 100 * (1 - ratio));
  return ratio < 2 ? fmt::format("{:.2g} % farther", 100 * (ratio - 1)) : fmt::format("{:.2g} times as far", ratio);
}

}  // namespace

MethodChoice ChooseByCapability(DesignMethod method, const SimulatorSpec& spec) {
  MethodChoice choice;
  choice.method = method;
  choice.reason =
      !spec.image_shape.empty()               ? "the task shows images"
      : method == DesignMethod::kTrajectories ? "the logs show only a part of the states, and it alone finds the rest"
      : !spec.can_set_state
          ? "the task cannot be set to a logged state, which the other methods need"
          : "the noise of sensors is among the parameters, which replays do not show; other methods were not "
            "tried";
  return choice;
}

bool AsksForOtherMethods(const std::optional<HeldOutPrediction>& prediction) {
  return prediction && LeavesGap(*prediction) && !PredictsBetter(*prediction);
}

MethodChoice KeepFirstMethod(const std::optional<HeldOutPrediction>& prediction) {
  MethodChoice choice;
  choice.method = DesignMethod::kTrajectories;
  choice.reason = !prediction ? "episodes are too short for predictions that could compare methods"
                  : AsksForOtherMethods(prediction)
                      ? "it does not surely predict better than the nominal simulator, but too little of the logs can "
                        "be held out and replayed to compare others"
                  : ShowsNothing(prediction->horizons)
                      ? "these logs show nothing that methods could be compared by: no other method was tried"
                  : ReachesFloor(*prediction)
                      ? "its predictions are as near to the logs as the sensors let them: no other method was tried"
                  : PredictsBetter(*prediction)
                      ? "it surely predicts better than the nominal simulator: no other method was tried"
                  : !IsFloorTold(*prediction)
                      ? "too little of the logs can be predicted to compare methods: no other method was tried"
                      : "the nominal simulator predicts as well as the sensors let it: no other method was tried";
  return choice;
}

MethodChoice ChooseByHeldOut(const std::vector<DesignMethod>& methods, const std::vector<std::vector<double>>& modes,
                             const HeldOutErrors& errors) {
  OTED_CHECK(methods.size() == modes.size() && errors.of.size() == methods.size() + 1 &&
             errors.n_windows >= kFewestWindows);
  MethodChoice choice;
  choice.n_windows = errors.n_windows;
  choice.n_steps = errors.n_steps;
  choice.nominal_error = GeometricMean(errors.of.back());
  size_t taken = 0;
  for (size_t k = 0; k < methods.size(); ++k) {
    TriedMethod tried{.method = methods[k], .mode = modes[k], .error = GeometricMean(errors.of[k])};
    std::vector<double> log_ratios;
    for (size_t w = 0; w < errors.of[k].size(); ++w) {
      const double ratio = std::max(errors.of[0][w], 1e-12) / std::max(errors.of[k][w], 1e-12);
      log_ratios.push_back(std::clamp(std::log(ratio), -kLargestLogRatio, kLargestLogRatio));
    }
    tried.gain = Mean(log_ratios);
    tried.gain_std = StandardDeviation(log_ratios) * std::sqrt(static_cast<double>(errors.overlap) / errors.n_windows);
    choice.tried.push_back(tried);
    const bool surely = tried.gain > std::max(kLeastGain, kStandardErrors * tried.gain_std) &&
                        tried.error < (1 + kLeastGain) * choice.nominal_error;
    if (surely && tried.gain > choice.tried[taken].gain) taken = k;
  }
  const TriedMethod &first = choice.tried.front(), &best = choice.tried[taken];
  choice.method = best.method;
  std::string others;
  for (size_t k = 1; k < choice.tried.size(); ++k) {
    others += fmt::format("{}{} {}", k > 1 ? ", " : "", Describe(choice.tried[k].method).name,
                          Nearness(choice.tried[k].gain));
  }
  const std::string windows = fmt::format("{} held-out windows of {} control steps", choice.n_windows, choice.n_steps);
  if (taken == 0) {
    choice.reason =
        fmt::format("no other method that was tried replays {} surely nearer to the log (its error {:.3g}; {})",
                    windows, first.error, others);
  } else {
    choice.reason = fmt::format(
        "{} does not surely predict better than the nominal simulator, and of all methods this one replays {} nearest "
        "to the log: {} (error "
        "{:.3g} against {:.3g})",
        Describe(first.method).name, windows, Nearness(best.gain), best.error, first.error);
  }
  return choice;
}

json ToJson(const MethodChoice& choice) {
  json tried = json::array();
  for (const TriedMethod& t : choice.tried) {
    tried.push_back({{"method", Describe(t.method).name},
                     {"mode", t.mode},
                     {"error", t.error},
                     {"gain", t.gain},
                     {"gain_std", t.gain_std}});
  }
  json record = {{"setting", choice.setting},
                 {"method", Describe(choice.method).name},
                 {"picked", choice.picked},
                 {"reason", choice.reason},
                 {"tried", tried}};
  if (choice.tried.empty()) return record;
  record["n_windows"] = choice.n_windows;
  record["n_steps"] = choice.n_steps;
  record["nominal_error"] = choice.nominal_error;
  return record;
}

MethodChoice MethodChoiceFromJson(const json& record) {
  MethodChoice choice{.setting = record.at("setting"),
                      .method = MethodNamed(record.at("method").get<std::string>()),
                      .picked = record.at("picked"),
                      .reason = record.at("reason"),
                      .n_windows = record.value("n_windows", 0),
                      .n_steps = record.value("n_steps", 0),
                      .nominal_error = record.value("nominal_error", 0.0),
                      .tried = {}};
  for (const auto& t : record.at("tried")) {
    choice.tried.push_back({.method = MethodNamed(t.at("method").get<std::string>()),
                            .mode = t.at("mode"),
                            .error = t.at("error"),
                            .gain = t.at("gain"),
                            .gain_std = t.at("gain_std")});
  }
  return choice;
}

}  // namespace oted
