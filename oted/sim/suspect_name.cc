#include "oted/sim/suspect_name.h"

#include <algorithm>
#include <cctype>

namespace oted {

std::string SuspectName(std::string wanted, const ParameterSpace& searched) {
  for (char& c : wanted) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '_' && c != '-') c = '_';
  }
  while (std::ranges::find(searched.specs(), wanted, &ParameterSpec::name) != searched.specs().end()) wanted += '_';
  return wanted;
}

}  // namespace oted
