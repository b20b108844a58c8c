#include "oted/checks/correction.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace oted {
namespace {

std::string List(const std::vector<std::string>& names) {
  if (names.size() == 1) return names[0];
  return fmt::format("{} and {}", fmt::join(names.begin(), names.end() - 1, ", "), names.back());
}

void Change(Array2<double>& values, const Correction& c) {
  for (int i = 0; i < values.rows(); ++i) {
    const auto at = [&](size_t k) -> double& { return values(i, c.columns[k]); };
    switch (c.kind) {
      case CorrectionKind::kSign:
      case CorrectionKind::kMirror:
      case CorrectionKind::kActionSign:
        for (size_t k = 0; k < c.columns.size(); ++k) at(k) = -at(k);
        break;
      case CorrectionKind::kUnit:
      case CorrectionKind::kActionUnit:
        for (size_t k = 0; k < c.columns.size(); ++k) at(k) *= c.value;
        break;
      case CorrectionKind::kZero:
        at(0) += c.value;
        break;
      case CorrectionKind::kSwap:
      case CorrectionKind::kActionSwap:
        for (size_t k = 0; k + 1 < c.columns.size(); k += 2) std::swap(at(k), at(k + 1));
        break;
      case CorrectionKind::kQuaternionOrder: {
        const double scalar = at(3);
        for (size_t k = 3; k > 0; --k) at(k) = at(k - 1);
        at(0) = scalar;
        break;
      }
    }
  }
}

}  // namespace

const char* Correction::Check() const {
  switch (kind) {
    case CorrectionKind::kSign:
      return "joint_sign";
    case CorrectionKind::kSwap:
      return "swapped_joints";
    case CorrectionKind::kZero:
      return "joint_zero";
    case CorrectionKind::kUnit:
      return "joint_unit";
    case CorrectionKind::kActionSign:
      return "action_sign";
    case CorrectionKind::kActionSwap:
      return "swapped_actions";
    case CorrectionKind::kActionUnit:
      return "action_unit";
    case CorrectionKind::kQuaternionOrder:
      return "quaternion_order";
    case CorrectionKind::kMirror:
      return "mirrored_joint";
  }
  return "";
}

std::string Correction::Setting(const SimulatorSpec& spec) const {
  const auto line = [&](const char* setting, double number) {
    std::vector<std::string> entries;
    for (const std::string& name : Names(spec)) entries.push_back(fmt::format("\"{}\" = {:.6g}", name, number));
    return fmt::format("{} = {{ {} }}", setting, fmt::join(entries, ", "));
  };
  switch (kind) {
    case CorrectionKind::kSign:
    case CorrectionKind::kActionSign:
    case CorrectionKind::kMirror:
      return line("data.scale", -1);
    case CorrectionKind::kUnit:
    case CorrectionKind::kActionUnit:
      return line("data.scale", value);
    case CorrectionKind::kZero:
      return line("data.offset", value);
    case CorrectionKind::kSwap:
    case CorrectionKind::kActionSwap:
    case CorrectionKind::kQuaternionOrder:
      return "";
  }
  return "";
}

std::vector<std::string> Correction::Names(const SimulatorSpec& spec) const {
  std::vector<std::string> names;
  const auto& all = IsOfActions() ? spec.action_names : spec.observation_names;
  for (const int j : columns) {
    const size_t k = static_cast<size_t>(j);
    names.push_back(k < all.size() ? all[k] : fmt::format("{}[{}]", IsOfActions() ? "actions" : "observations", j));
  }
  if (command >= 0) names.push_back(spec.action_names[static_cast<size_t>(command)]);
  return names;
}

Correction::Words Correction::InWords(const SimulatorSpec& spec) const {
  const std::vector<std::string> names = Names(spec);
  switch (kind) {
    case CorrectionKind::kSign:
    case CorrectionKind::kMirror:
    case CorrectionKind::kActionSign:
      return {fmt::format("{} turned round", List(names)), fmt::format("turn round the sign of {}", List(names))};
    case CorrectionKind::kUnit:
    case CorrectionKind::kActionUnit:
      return {fmt::format("{} times {:.6g}", List(names), value),
              fmt::format("multiply {} by {:.6g}", List(names), value)};
    case CorrectionKind::kZero:
      return {fmt::format("{} {} {:.3g}", names[0], value < 0 ? "-" : "+", std::abs(value)),
              fmt::format("add {:.3g} to {}, or make its zero a parameter: obs/{}/bias", value, names[0], names[0])};
    case CorrectionKind::kSwap:
    case CorrectionKind::kActionSwap: {
      std::vector<std::string> swaps;
      for (size_t k = 0; k + 1 < names.size(); k += 2)
        swaps.push_back(fmt::format("{} with {}", names[k], names[k + 1]));
      return {fmt::format("{} in each other's place", List(names)), "swap " + List(swaps)};
    }
    case CorrectionKind::kQuaternionOrder:
      return {fmt::format("{} to {} read as x, y, z, w", names.front(), names.back()),
              fmt::format("put {}, the scalar, before the other three", names.back())};
  }
  return {};
}

void Correction::ApplyTo(Dataset& dataset) const {
  if (IsOfActions()) {
    Change(dataset.actions, *this);
    return;
  }
  for (int i = 0; command >= 0 && i < dataset.size(); ++i) dataset.actions(i, command) *= -1;
  Change(dataset.observations, *this);
  Change(dataset.next_observations, *this);
}

void Correction::ApplyToStates(Array2<double>& states, const SimulatorSpec& spec) const {
  if (IsOfActions()) return;
  Correction of_state = *this;
  for (const int column : columns) {
    for (size_t k = 0; k < spec.hidden.size(); ++k) {
      if (spec.hidden[k].rate_of == column) of_state.columns.push_back(spec.obs_dim() + static_cast<int>(k));
    }
  }
  Change(states, of_state);
}

}  // namespace oted
