#pragma once
/// What the paths of parameters and of observations have in common: objects by name, and an index in brackets.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <vector>

namespace oted {

/// The objects of one kind.
struct ObjectKind {
  const char* word;  ///< as a path says it: "geom"
  mjtObj type;       ///< mjOBJ_UNKNOWN for those without names
  int count;
};

/// "friction[0]".
struct FieldRef {
  std::string name;
  int index = -1;  ///< -1: all
};

/// "friction[0]" -> ("friction", 0); "friction", "friction[*]" -> all. @throws UsageError that begins with `what`.
FieldRef ParseField(std::string_view text, const std::string& what);

/// The object's name, or "#id" where it has none.
std::string ObjectName(const mjModel& model, mjtObj type, int id);

/// Ids of the objects whose name or "#id" matches `pattern` (a glob, or "@actuated" for joints and bodies), ascending,
/// at least one.
/// @throws UsageError that begins with `what`, with the nearest name and the list.
std::vector<int> MatchObjects(const mjModel& model, const ObjectKind& kind, std::string_view pattern,
                              const std::string& what);

}  // namespace oted
