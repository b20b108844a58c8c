#include "oted/run/fingerprint.h"

#include <nlohmann/json.hpp>

#include "oted/base/files.h"

namespace oted {

std::string Fingerprint(const nlohmann::json& inputs) { return Sha256(inputs.dump()).substr(0, 16); }

nlohmann::json ParameterIdentity(const ParameterSpace& space) {
  nlohmann::json list = nlohmann::json::array();
  for (const ParameterSpec& spec : space.specs()) {
    list.push_back(
        {spec.name, spec.field, spec.low, spec.high, spec.logarithmic, spec.scale == ParameterScale::kAbsolute});
  }
  return list;
}

}  // namespace oted
