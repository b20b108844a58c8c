#pragma once
/// Parameter files of mujoco.sysid (MuJoCo's Python toolbox for system identification): written so that its
/// ParameterDict.load_from_disk reads them, and read as its save_to_disk writes them.
///
///   friction:
///     name: friction
///     nominal: [1.0]
///     min_value: [0.2]
///     max_value: [2.0]
///     value: [0.549]
///     frozen: false
///     field: "geom/*/friction[0]"     # from here on ours: mujoco.sysid ignores what it does not know
///     scale: nominal
///     log: false
///
/// mujoco.sysid keeps what a parameter does in a Python function, which it does not save. Our keys say it; when it
/// saves a file again they are gone, and the configuration has to name the fields.

#include <filesystem>
#include <string>
#include <vector>

#include "oted/sim/parameter_space.h"

namespace oted {

/// One entry. `spec.field` is empty where the file does not say what the parameter does.
struct SysidParameter {
  ParameterSpec spec;
  double value = 1;       ///< the current estimate, in the units of z
  bool frozen = false;    ///< not searched
  bool has_ours = false;  ///< the file has our keys, so scale and logarithm are its own
};

/// YAML text with `comment` at its top, one "# " per line.
std::string SysidText(const std::vector<SysidParameter>& parameters, const std::string& comment);

/// Reads a file of at most 1 MB. @throws DataError naming file and parameter: not YAML, an entry without a key that
/// mujoco.sysid writes, something that is no finite number, a parameter of several numbers (ours have one each).
std::vector<SysidParameter> ReadSysidFile(const std::filesystem::path& path);

/// The parameters to search: those of the file, then those of `declared` that the file does not name.
/// A declared parameter of the same name says what the file cannot: its field, scale, logarithm and unit; its range is
/// the file's unless `has_range` is true for it, and its place is the file's. A frozen parameter is left out.
/// @param has_range  parallel to `declared`
/// @throws UsageError when a parameter has no field on either side, when a frozen one does not rest at its nominal
/// value (which is where a parameter that is not searched stays), or when the nominal value of a multiple is not 1.
std::vector<ParameterSpec> MergeSysid(const std::vector<SysidParameter>& file, const std::string& file_name,
                                      const std::vector<ParameterSpec>& declared, const std::vector<bool>& has_range);

}  // namespace oted
