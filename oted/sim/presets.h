#pragma once
/// Lists of parameters that are usually off, for kinds of robots, with bounds to start from. The lists are data, at the
/// top of presets.cc; docs/parameters.md says why each entry is there.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "oted/sim/parameter_space.h"
#include "oted/sim/simulator.h"

namespace oted {

struct PresetEntry {
  struct Bounds {
    double low, high;
  };
  const char* name;                                 ///< of the parameter
  const char* field;                                ///< its path
  std::optional<Bounds> multiple = std::nullopt;    ///< of the nominal value, where one of the path's values is not 0
  bool logarithmic = false;                         ///< search in log z, of multiples
  std::optional<Bounds> absolute = std::nullopt;    ///< the value itself, where all of them are 0
  std::array<const char*, 2> set_with_others = {};  ///< paths that set its numbers together with others
  const char* otherwise = "";                       ///< what to say where they do: it is left out
  /// A parameter for each number of the path, as far as the simulator tells that they reach, believed to be near 0. The
  /// parameter is called by the name, by what owns the number, and by the term that stands at the number's index.
  const char* const* terms = nullptr;
};

struct Preset {
  const char* name;
  const char* purpose;
  std::vector<PresetEntry> entries;
};

const std::vector<Preset>& Presets();
std::vector<std::string> PresetNames();
/// @throws UsageError with the nearest name.
const Preset& FindPreset(const std::string& name);

/// Parameters of presets, as far as a simulator has them.
struct ExpandedPresets {
  std::vector<ParameterSpec> parameters;
  bool has_beliefs = false;          ///< some of the presets' parameters have a prior: it has to be used
  std::vector<std::string> skipped;  ///< "arm: friction loss (path): why", one line each
};

/// The entries of `names`, one preset after the other, that `simulator` has, then `own`: what the user declares.
/// An own parameter takes the place of an entry of its name, and drops one that would write the same numbers; of two
/// presets' entries of one name the first counts.
/// @throws UsageError for an unknown preset, or an own parameter that names nothing.
ExpandedPresets ExpandPresets(const std::vector<std::string>& names, const std::vector<ParameterSpec>& own,
                              const SimulatorFactory& simulator);

}  // namespace oted
