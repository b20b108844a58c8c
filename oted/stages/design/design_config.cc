#include "oted/stages/design/design_config.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/stages/design/design_method.h"
#include "oted/stages/design/prior_source.h"

namespace oted {
namespace {

const NamedValues<DesignerKind> kDesignerNames = {{DesignerKind::kGaussian, "gaussian"},
                                                  {DesignerKind::kCategorical, "categorical"}};

}  // namespace

DesignConfig DesignConfig::For(DesignMethod method) {
  DesignConfig config;
  config.method = method;
  if (const auto set_defaults = Describe(method).set_defaults) set_defaults(config);
  return config;
}

std::vector<FieldList> DesignConfig::Sections() {
  FieldList own("design");
  own.Add("prior", &prior,
          "p(z): uniform; gaussian (the prior of each parameter); or the path of an earlier design's q.json or run "
          "directory");
  own.AddChoice("designer", &designer, "q: a Gaussian in logits of the range, or probabilities of grid values",
                kDesignerNames);
  own.Add("grid_step", &grid_step, "of the categorical designer: its values are multiples of this", Above(0));
  own.Add("grow", &grow,
          "add the suspect that surely predicts better to the parameters and begin again, up to three times; method "
          "trajectories");
  return {own,
          trajectories.Fields(),
          adversarial.Fields(),
          discriminator.Fields(),
          least_squares.Fields(),
          dropo.Fields(),
          images.Fields()};
}

nlohmann::json DesignConfig::ToJson() const {
  DesignConfig copy = *this;
  nlohmann::json object = {{"method", Describe(method).name}};
  for (const FieldList& section : copy.Sections()) {
    const size_t dot = section.section().find('.');
    if (dot == std::string::npos) {
      object.update(section.ToJson());
    } else {
      object[section.section().substr(dot + 1)] = section.ToJson();
    }
  }
  return object;
}

void DesignConfig::Check() const {
  const MethodDescription& described = Describe(method);
  adversarial.Check();
  if (adversarial.clone_updates > 0 && (adversarial.actions != RolloutActions::kClone || !described.is_algorithm1)) {
    throw UsageError(
        fmt::format("design.adversarial.clone_updates trains a clone that acts in the design, which it does not by "
                    "method \"{}\" with design.adversarial.actions = \"{}\"; set design.method = \"paper\", or "
                    "design.adversarial.clone_updates = 0",
                    described.name, ToJson().at("adversarial").at("actions").get<std::string>()));
  }
  if (described.needs.uniform_prior && PriorSourceOf(prior) != PriorSource::kUniform) {
    throw UsageError(
        fmt::format("design.method = \"{}\" maximises a likelihood and knows no prior; set design.prior = "
                    "\"uniform\", or another method",
                    described.name));
  }
  if (described.needs.gaussian_q && designer == DesignerKind::kCategorical) {
    throw UsageError(
        fmt::format("design.method = \"{}\" finds a Gaussian; for design.designer = \"categorical\" set design.method "
                    "to transitions or paper",
                    described.name));
  }
}

bool DesignConfig::UsesClone() const {
  const MethodNeeds& needs = Describe(method).needs;
  return !needs.settable_state && !needs.replays && adversarial.actions == RolloutActions::kClone;
}

int DesignConfig::n_iterations() const {
  const auto of_method = Describe(method).n_iterations;
  return of_method == nullptr ? 1 : of_method(*this);
}

Designer DesignConfig::Start(const ParameterSpace& space) const {
  Designer q = designer == DesignerKind::kCategorical ? Designer::OnGrid(space, grid_step)
                                                      : Designer(space, adversarial.initial_std);
  q.SetPrior(MakePrior(space));
  q.StartAtPrior(adversarial.initial_std);
  return q;
}

Prior DesignConfig::MakePrior(const ParameterSpace& space) const {
  return ::oted::MakePrior(prior, space,
                           {.categorical = designer == DesignerKind::kCategorical, .grid_step = grid_step});
}

}  // namespace oted
