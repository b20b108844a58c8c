#include "oted/sim/suspect_name.h"

#include <cctype>
#include <set>
#include <utility>

namespace oted {

std::string BareKey(std::string name) {
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '_' && c != '-') c = '_';
  }
  return name;
}

void NameApart(std::vector<ParameterSpec>& suspects, const ParameterSpace& searched,
               const std::vector<ParameterSpec>& others) {
  std::set<std::string> taken;
  for (const auto& specs : {searched.specs(), others}) {
    for (const ParameterSpec& spec : specs) taken.insert(spec.name);
  }
  for (ParameterSpec& suspect : suspects) {
    suspect.name = BareKey(std::move(suspect.name));
    while (!taken.insert(suspect.name).second) suspect.name += '_';
  }
}

}  // namespace oted
