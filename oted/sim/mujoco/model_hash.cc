#include "oted/sim/mujoco/model_hash.h"

#include <mujoco/mjxmacro.h>

#include <algorithm>
#include <string_view>

#include "oted/base/files.h"

namespace oted {
namespace {

bool IsOfPaths(std::string_view name) {
  return name == "paths" || name == "npaths" || name == "nbuffer" || name.ends_with("_pathadr");
}

template <class T>
std::string_view BytesOf(const T* values, mjtSize n) {
  if (n <= 0) return {};
  return {reinterpret_cast<const char*>(values), static_cast<size_t>(n) * sizeof(T)};
}

bool HasFiles(const mjModel& model) {
  const auto has = [](const int* addresses, mjtSize n) {
    return std::any_of(addresses, addresses + n, [](int address) { return address >= 0; });
  };
  return has(model.mesh_pathadr, model.nmesh) || has(model.hfield_pathadr, model.nhfield) ||
         has(model.skin_pathadr, model.nskin) || has(model.tex_pathadr, model.ntex);
}

}  // namespace

std::string ModelSha256(const mjModel& model) {
  if (!HasFiles(model)) return Sha256(SerializeModel(model));
  std::string parts;
  const auto add = [&](std::string_view name, std::string_view bytes) {
    if (!IsOfPaths(name)) parts += Sha256(bytes);
  };
#define X(name) add(#name, BytesOf(&model.name, 1));
  MJMODEL_SIZES
#undef X
#undef MJ_M
#define MJ_M(n) model.n
#define X(type, name, nr, nc) add(#name, BytesOf(model.name, model.nr* static_cast<mjtSize>(nc)));
  MJMODEL_POINTERS
#undef X
#undef MJ_M
#define MJ_M(n) n
  add("opt", BytesOf(&model.opt, 1));
  add("vis", BytesOf(&model.vis, 1));
  add("stat", BytesOf(&model.stat, 1));
  return Sha256(parts);
}

}  // namespace oted
