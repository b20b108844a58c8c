#include "oted/matching/fit_evidence.h"

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

}  // namespace

nlohmann::json ToJson(const FitEvidence& evidence) {
  return {{"window", evidence.window},
          {"explained", evidence.explained},
          {"noise_std", evidence.noise_std},
          {"scale", evidence.scale},
          {"short_noise_std", evidence.short_noise_std},
          {"long_noise_std", evidence.long_noise_std},
          {"suspects", ToJson(evidence.suspects)}};
}

FitEvidence FitEvidenceFromJson(const nlohmann::json& json) {
  return {.window = json.at("window"),
          .explained = json.at("explained"),
          .noise_std = json.at("noise_std"),
          .scale = json.at("scale"),
          .short_noise_std = json.at("short_noise_std"),
          .long_noise_std = json.at("long_noise_std"),
          .suspects = SuspectsFromJson(json.value("suspects", nlohmann::json::array()))};
}

}  // namespace oted
