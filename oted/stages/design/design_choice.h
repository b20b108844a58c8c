#pragma once
/// What a user asks of the design: [design] of a configuration, before it is known which method runs.

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "oted/stages/design/design_config.h"

namespace oted {

/// A method, or none where auto is to find one, and the settings that were given. All other settings have the defaults
/// of the method that runs, so the order in which anything is given means nothing.
/// A key is a setting's name behind its section's, both below [design]: "prior", "trajectories.window".
class DesignChoice {
 public:
  std::optional<DesignMethod> method;  ///< none: auto

  /// The setting called "method", bound to this object.
  Field MethodField();

  /// @throws UsageError naming `where` for a key or a value that is none; a key of former times is told its new name
  void Set(const std::string& key, const nlohmann::json& value, std::string_view where);
  /// The same from text as typed on a command line.
  void SetText(const std::string& key, std::string_view text, std::string_view where);
  bool Has(const std::string& key) const { return given_.contains(key); }
  /// The methods that may run: the one that is named, or all that auto chooses from.
  std::vector<DesignMethod> Possible() const;
  /// The keys whose value is not their default and which none of `methods` reads. Evidence and discriminator are the
  /// judge's too, whatever the method.
  std::vector<std::string> UnreadBy(const std::vector<DesignMethod>& methods) const;

  /// The settings of that method: what was given, and its defaults.
  DesignConfig For(DesignMethod wanted) const;
  /// The same where the simulator is not known: of trajectories in the place of auto.
  DesignConfig Assumed() const { return For(method.value_or(DesignMethod::kTrajectories)); }
  /// The method that runs first in this simulator, and its settings. Where no state can be set, rollouts of the clone
  /// begin at the simulator's own starts, with the settings of Algorithm 1 there as far as none were given.
  /// @throws UsageError for a method that the simulator cannot serve
  DesignConfig Resolved(const ParameterSpace& space, const SimulatorSpec& spec) const;
  /// The same for another method than the first.
  DesignConfig Resolved(DesignMethod wanted, const SimulatorSpec& spec) const;

  /// @throws UsageError when settings contradict each other whatever method runs
  void Check() const;
  /// As DesignConfig's, of the assumed method; "method" may be "auto".
  nlohmann::json ToJson() const;

 private:
  std::map<std::string, nlohmann::json> given_;  ///< by key
};

/// Whether the methods have different defaults of the setting `name` of a section.
bool DependsOnMethod(const std::string& section, const std::string& name);
/// The default, and behind it those of the methods that have another: "10; paper: 300; images: 8".
std::string DefaultInWords(const std::string& section, const std::string& name);

}  // namespace oted
