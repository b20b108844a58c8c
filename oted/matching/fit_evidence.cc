#include "oted/matching/fit_evidence.h"

#include <limits>
#include <nlohmann/json.hpp>

namespace oted {

nlohmann::json ToJson(const std::vector<Suspect>& suspects) {
  nlohmann::json list = nlohmann::json::array();
  for (const Suspect& s : suspects) list.push_back({{"field", s.field}, {"factor", s.factor}, {"log_std", s.log_std}});
  return list;
}

namespace {

std::vector<Suspect> SuspectsFromJson(const nlohmann::json& list) {
  std::vector<Suspect> suspects;
  for (const nlohmann::json& s : list) suspects.push_back({s.at("field"), s.at("factor"), s.at("log_std")});
  return suspects;
}

nlohmann::json ToJson(const HeldOutPrediction& prediction) {
  nlohmann::json horizons = nlohmann::json::array();
  for (const HeldOutPrediction::Horizon& h : prediction.horizons) {
    horizons.push_back({{"seconds", h.seconds}, {"nominal", h.nominal}, {"designed", h.designed}});
  }
  return {{"n_windows", prediction.n_windows}, {"horizons", horizons}};
}

/// Null is NaN: every window broke down.
std::vector<double> NumbersFromJson(const nlohmann::json& list) {
  std::vector<double> numbers;
  for (const nlohmann::json& value : list) {
    numbers.push_back(value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>());
  }
  return numbers;
}

HeldOutPrediction PredictionFromJson(const nlohmann::json& json) {
  HeldOutPrediction prediction{json.at("n_windows"), {}};
  for (const nlohmann::json& h : json.at("horizons")) {
    prediction.horizons.push_back(
        {h.at("seconds"), NumbersFromJson(h.at("nominal")), NumbersFromJson(h.at("designed"))});
  }
  return prediction;
}

}  // namespace

nlohmann::json ToJson(const FitEvidence& evidence) {
  nlohmann::json json = {{"window", evidence.window},
                         {"explained", evidence.explained},
                         {"noise_std", evidence.noise_std},
                         {"scale", evidence.scale},
                         {"short_noise_std", evidence.short_noise_std},
                         {"long_noise_std", evidence.long_noise_std},
                         {"suspects", ToJson(evidence.suspects)}};
  if (evidence.held_out) json["held_out"] = ToJson(*evidence.held_out);
  return json;
}

FitEvidence FitEvidenceFromJson(const nlohmann::json& json) {
  return {
      .window = json.at("window"),
      .explained = json.at("explained"),
      .noise_std = json.at("noise_std"),
      .scale = json.at("scale"),
      .short_noise_std = json.at("short_noise_std"),
      .long_noise_std = json.at("long_noise_std"),
      .suspects = SuspectsFromJson(json.value("suspects", nlohmann::json::array())),
      .held_out = json.contains("held_out") ? std::optional(PredictionFromJson(json.at("held_out"))) : std::nullopt};
}

}  // namespace oted
