#include "oted/matching/fit_evidence.h"

#include <nlohmann/json.hpp>

namespace oted {

nlohmann::json ToJson(const FitEvidence& evidence) {
  return {{"window", evidence.window},
          {"explained", evidence.explained},
          {"noise_std", evidence.noise_std},
          {"scale", evidence.scale},
          {"short_noise_std", evidence.short_noise_std},
          {"long_noise_std", evidence.long_noise_std}};
}

FitEvidence FitEvidenceFromJson(const nlohmann::json& json) {
  return {.window = json.at("window"),
          .explained = json.at("explained"),
          .noise_std = json.at("noise_std"),
          .scale = json.at("scale"),
          .short_noise_std = json.at("short_noise_std"),
          .long_noise_std = json.at("long_noise_std")};
}

}  // namespace oted
