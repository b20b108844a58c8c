#include "oted/sim/mujoco/model_compare.h"

#include <fmt/format.h>
#include <mujoco/mjxmacro.h>

#include <cmath>
#include <type_traits>

namespace oted {
namespace {

constexpr double kRelative = 1e-9, kAbsolute = 1e-12;

bool Same(double got, double wanted) {
  return got == wanted || (std::isnan(got) && std::isnan(wanted)) ||
         std::abs(got - wanted) <= kRelative * std::abs(wanted) + kAbsolute;
}

// Appends to `difference` unless something stands there already.
template <class T>
void Compare(std::string& difference, const char* name, const T* got, const T* wanted, mjtSize n_got,
             mjtSize n_wanted) {
  if (!std::is_floating_point_v<T> || !difference.empty()) return;
  if (n_got != n_wanted) {
    difference = fmt::format("{} has {} numbers, not {}", name, n_got, n_wanted);
    return;
  }
  for (mjtSize i = 0; i < n_got; ++i) {
    const double a = static_cast<double>(got[i]), b = static_cast<double>(wanted[i]);
    if (Same(a, b)) continue;
    difference = fmt::format("{}[{}] is {}, not {}", name, i, a, b);
    return;
  }
}

}  // namespace

std::string FirstDifference(const mjModel& got, const mjModel& wanted) {
  std::string difference;
#undef MJ_M
#define MJ_M(n) wanted.n
#define X(type, name, nr, nc)                                                         \
  Compare(difference, #name, got.name, wanted.name, got.nr* static_cast<mjtSize>(nc), \
          wanted.nr* static_cast<mjtSize>(nc));
  MJMODEL_POINTERS
#undef X
#undef MJ_M
#define MJ_M(n) n
#define X(type, name, n) Compare(difference, "opt." #name, &got.opt.name, &wanted.opt.name, 1, 1);
#define XVEC(type, name, n) Compare(difference, "opt." #name, got.opt.name, wanted.opt.name, n, n);
  MJOPTION_FIELDS
#undef XVEC
#undef X
  return difference;
}

}  // namespace oted
