#include "oted/sim/suspect_name.h"

#include <algorithm>
#include <cctype>
#include <utility>

namespace oted {

std::string BareKey(std::string name) {
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '_' && c != '-') c = '_';
  }
  return name;
}

std::string SuspectName(std::string wanted, const ParameterSpace& searched) {
  wanted = BareKey(std::move(wanted));
  while (std::ranges::find(searched.specs(), wanted, &ParameterSpec::name) != searched.specs().end()) wanted += '_';
  return wanted;
}

}  // namespace oted
