#include "oted/stages/design/design_choice.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "oted/base/error.h"
#include "oted/stages/design/design_method.h"

namespace oted {
namespace {

using nlohmann::json;

/// Keys of [design] as they once were, and what they are now.
const std::map<std::string, std::string>& MovedKeys() {
  static const std::map<std::string, std::string> moved = {
      {"form", "method"},
      {"discriminator", "adversarial.evidence"},
      {"starts", "adversarial.starts"},
      {"actions", "adversarial.actions"},
      {"horizon", "adversarial.horizon"},
      {"n_steps", "adversarial.n_steps"},
      {"rows", "adversarial.rows"},
      {"stack", "adversarial.stack"},
      {"clone_noise", "adversarial.clone_noise"},
      {"clone_updates", "adversarial.clone_updates"},
      {"clone_replay", "adversarial.clone_replay"},
      {"clone_rate", "adversarial.clone_rate"},
      {"n_iterations", "adversarial.n_iterations"},
      {"n_sims", "adversarial.n_sims"},
      {"step_mean", "adversarial.step_mean"},
      {"step_log_std", "adversarial.step_log_std"},
      {"lambda", "adversarial.lambda"},
      {"initial_std", "adversarial.initial_std"},
      {"reward", "adversarial.reward"},
      {"reward_floor", "adversarial.reward_floor"},
      {"average", "adversarial.average"},
      {"replay_iterations", "adversarial.replay_iterations"},
      {"trajectory_window", "trajectories.window"},
      {"trajectory_rows", "trajectories.rows"},
      {"trajectory_starts", "trajectories.starts"},
      {"trajectory_coarse", "trajectories.coarse"},
      {"least_squares_horizon", "least_squares.horizon"},
      {"least_squares_rows", "least_squares.rows"},
      {"least_squares_starts", "least_squares.starts"},
      {"dropo_horizon", "dropo.horizon"},
      {"dropo_transitions", "dropo.transitions"},
      {"dropo_samples", "dropo.samples"},
      {"dropo_budget", "dropo.budget"},
      {"dropo_epsilon", "dropo.epsilon"},
      {"dropo_learn_epsilon", "dropo.learn_epsilon"},
      {"discriminator_hidden", "discriminator.hidden"},
      {"discriminator_filters", "discriminator.filters"},
      {"discriminator_learning_rate", "discriminator.learning_rate"},
      {"discriminator_weight_decay", "discriminator.weight_decay"},
      {"discriminator_steps", "discriminator.steps"},
      {"discriminator_batch", "discriminator.batch"}};
  return moved;
}

/// The field of `key`, bound to `config`.
Field FieldAt(DesignConfig& config, const std::string& key, std::string_view where) {
  if (const auto moved = MovedKeys().find(key); moved != MovedKeys().end()) {
    throw UsageError(fmt::format("{}: design.{} is now design.{}; rename it", where, key, moved->second));
  }
  const size_t dot = key.rfind('.');
  const std::string section = dot == std::string::npos ? "design" : "design." + key.substr(0, dot);
  std::vector<std::string> names;
  for (const FieldList& fields : config.Sections()) {
    names.push_back(fields.section());
    if (fields.section() != section) continue;
    FieldList known = fields;
    std::optional<DesignMethod> unused;
    if (section == "design") known.AddChoice("method", &unused, "", MethodNames());  // that messages name it
    return known.Find(key.substr(dot == std::string::npos ? 0 : dot + 1), where);
  }
  throw UsageError(fmt::format("{}: [{}] is not a section{}; the sections are {}", where, section,
                               DidYouMean(section, names), fmt::join(names, ", ")));
}

/// The defaults where rollouts begin at the simulator's own starts.
DesignConfig FromResets(DesignMethod method) {
  DesignConfig config = DesignConfig::For(method);
  config.adversarial.StartAtResets();
  config.discriminator = {};
  return config;
}

json DefaultOf(DesignMethod method, const std::string& section, const std::string& name) {
  DesignConfig config = DesignConfig::For(method);
  for (const FieldList& fields : config.Sections()) {
    if (fields.section() == section) return fields.Find(name, section).ToJson();
  }
  throw InternalError("no section " + section);
}

/// The methods whose default is another than that of trajectories.
std::vector<std::pair<DesignMethod, json>> OtherDefaults(const std::string& section, const std::string& name) {
  std::vector<std::pair<DesignMethod, json>> others;
  const json usual = DefaultOf(DesignMethod::kTrajectories, section, name);
  for (const MethodDescription& described : DesignMethods()) {
    const json own = DefaultOf(described.method, section, name);
    if (own != usual) others.emplace_back(described.method, own);
  }
  return others;
}

}  // namespace

Field DesignChoice::MethodField() {
  FieldList fields("design");
  fields.AddChoice("method", &method,
                   "how q is found; auto: trajectories where positions are logged (others are tried where it predicts "
                   "no better than the nominal simulator; transitions where a parameter is a sensor's noise), images "
                   "where there are "
                   "some, otherwise paper",
                   MethodNames());
  return fields.fields().front();
}

void DesignChoice::Set(const std::string& key, const json& value, std::string_view where) {
  if (key == "method") return MethodField().FromJson(value, where);
  DesignConfig scratch;
  const Field field = FieldAt(scratch, key, where);
  field.FromJson(value, where);
  given_[key] = field.ToJson();
}

void DesignChoice::SetText(const std::string& key, std::string_view text, std::string_view where) {
  if (key == "method") return MethodField().FromText(text, where);
  DesignConfig scratch;
  const Field field = FieldAt(scratch, key, where);
  field.FromText(text, where);
  given_[key] = field.ToJson();
}

std::vector<DesignMethod> DesignChoice::Possible() const {
  if (method) return {*method};
  std::vector<DesignMethod> possible;
  for (const MethodDescription& described : DesignMethods()) {
    if (described.first_of_auto != nullptr || described.tried_by_auto) possible.push_back(described.method);
  }
  return possible;
}

std::vector<std::string> DesignChoice::UnreadBy(const std::vector<DesignMethod>& methods) const {
  const auto has = [](const std::vector<std::string>& names, const std::string& name) {
    return std::ranges::find(names, name) != names.end();
  };
  const std::vector<std::string> shown_to_g = AdversarialConfig::EvidenceNames();
  std::vector<std::string> unread;
  for (const auto& [key, value] : given_) {
    const size_t dot = key.find('.');
    const std::string section = key.substr(0, dot), name = dot == std::string::npos ? "" : key.substr(dot + 1);
    const auto owner = std::ranges::find_if(DesignMethods(), [&](const auto& d) { return has(d.sections, section); });
    if (owner == DesignMethods().end() || section == "discriminator") continue;
    if (section == "adversarial" && has(shown_to_g, name)) continue;
    const bool is_read =
        std::ranges::any_of(methods, [&](DesignMethod one) { return has(Describe(one).sections, section); });
    if (!is_read && value != DefaultOf(owner->method, "design." + section, name)) unread.push_back(key);
  }
  return unread;
}

DesignConfig DesignChoice::For(DesignMethod wanted) const {
  const auto starts = given_.find("adversarial.starts");
  const bool from_resets = wanted == DesignMethod::kPaper && starts != given_.end() && starts->second == "initial";
  DesignConfig config = from_resets ? FromResets(wanted) : DesignConfig::For(wanted);
  for (const auto& [key, value] : given_) FieldAt(config, key, "design").FromJson(value, "design");
  return config;
}

DesignConfig DesignChoice::Resolved(const ParameterSpace& space, const SimulatorSpec& spec) const {
  return Resolved(method.value_or(FirstMethodOfAuto(space, spec)), spec);
}

DesignConfig DesignChoice::Resolved(DesignMethod wanted, const SimulatorSpec& spec) const {
  const MethodDescription& described = Describe(wanted);
  if ((described.needs.settable_state && !spec.can_set_state) || (described.needs.replays && !spec.can_replay())) {
    throw UsageError(
        fmt::format("design.method = \"{}\" sets logged states, which task '{}' does not take; use auto or paper",
                    described.name, spec.task));
  }
  DesignConfig config = For(wanted);
  if (!spec.can_set_state && config.adversarial.starts == RolloutStarts::kDataset) {
    config = FromResets(wanted);
    for (const auto& [key, value] : given_) FieldAt(config, key, "design").FromJson(value, "design");
    const DesignConfig from_resets = FromResets(wanted);
    config.adversarial.starts = from_resets.adversarial.starts;
    config.adversarial.actions = from_resets.adversarial.actions;
    config.adversarial.rows = from_resets.adversarial.rows;
  }
  if (config.adversarial.clone_updates > 0 && (spec.n_discrete_actions > 0 || !spec.image_shape.empty())) {
    throw UsageError(fmt::format(
        "design.adversarial.clone_updates trains the clone by ValueDICE, which takes continuous actions and "
        "no images; set it to 0 for task '{}'",
        spec.task));
  }
  return config;
}

void DesignChoice::Check() const {
  if (method) return For(*method).Check();
  Assumed().adversarial.Check();
}

json DesignChoice::ToJson() const {
  json object = Assumed().ToJson();
  object["method"] = NameOf(MethodNames(), method);
  return object;
}

bool DependsOnMethod(const std::string& section, const std::string& name) {
  return !OtherDefaults(section, name).empty();
}

std::string DefaultInWords(const std::string& section, const std::string& name) {
  std::string words = DefaultOf(DesignMethod::kTrajectories, section, name).dump();
  for (const auto& [method, value] : OtherDefaults(section, name)) {
    words += fmt::format("; {}: {}", Describe(method).name, value.dump());
  }
  return words;
}

}  // namespace oted
