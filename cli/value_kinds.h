#pragma once
/// What stands for the values of options that take names: in the help as VALUE, and completed by the shell.

#include <string>
#include <vector>

namespace oted::cli {

/// To be given to CLI::Option::type_name.
namespace value_kind {
inline constexpr const char* kTask = "TASK";            ///< a built-in task
inline constexpr const char* kPreset = "PRESET";        ///< of parameters
inline constexpr const char* kSetting = "SETTING";      ///< section.key=value
inline constexpr const char* kMethod = "METHOD";        ///< of the design
inline constexpr const char* kDevice = "DEVICE";        ///< of gradient steps
inline constexpr const char* kRobot = "ROBOT";          ///< of the paper's studies
inline constexpr const char* kDataset = "DATASET";      ///< of the paper's studies
inline constexpr const char* kParameter = "PARAMETER";  ///< of the paper's studies
inline constexpr const char* kLearner = "LEARNER";      ///< of Table 1
}  // namespace value_kind

/// All values of a kind. Of a setting: "section.key=" for each, or behind a whole "section.key=" what the key takes.
/// Empty for what is no kind of names.
/// @param typed  as far as the value is typed
std::vector<std::string> ValuesOfKind(const std::string& kind, const std::string& typed);

}  // namespace oted::cli
