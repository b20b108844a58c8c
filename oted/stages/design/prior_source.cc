#include "oted/stages/design/prior_source.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/seal.h"
#include "oted/matching/as_vector.h"
#include "oted/matching/designer.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using nlohmann::json;
namespace fs = std::filesystem;

Prior FromBeliefs(const ParameterSpace& space) {
  VectorXd mean = VectorXd::Zero(space.size());
  VectorXd variance = VectorXd::Constant(space.size(), Prior::kUniformStd * Prior::kUniformStd);
  bool any = false;
  const std::vector<double> middle = LogitToZ(space, std::vector<double>(static_cast<size_t>(space.size()), 0.0));
  for (int i = 0; i < space.size(); ++i) {
    const auto& belief = space[i].prior;
    if (!belief) continue;
    any = true;
    const size_t at = static_cast<size_t>(i);
    std::vector<double> z = middle;
    z[at] = belief->mean;
    std::vector<double> up = ZToLogit(space, z), down = up;
    mean[i] = up[at];
    up[at] += 1e-4;
    down[at] -= 1e-4;
    const double slope = (LogitToZ(space, up)[at] - LogitToZ(space, down)[at]) / 2e-4;
    const double std = std::min(belief->std / slope, Prior::kUniformStd);
    variance[i] = std * std;
  }
  if (!any) {
    throw UsageError(
        "design.prior is gaussian, but no parameter has a prior; add prior = { mean = 1.0, std = 0.1 } to one of "
        "[parameters], or :prior=MEAN,STD to a --param");
  }
  return Prior::Gaussian(mean, variance.asDiagonal());
}

/// The files of q that `source` stands for.
std::vector<fs::path> FilesOf(const fs::path& source) {
  if (!fs::is_directory(source)) return {source};
  const fs::path design = source / "design.json";
  if (!fs::exists(design)) {
    throw UsageError(
        fmt::format("design.prior: '{}' holds no design.json; name a q.json or the run directory of a finished design",
                    source.string()));
  }
  std::vector<fs::path> files;
  const json record = ReadSealed(design, true);
  try {
    const std::string setting = record.at("selected").get<std::string>();
    for (const json& member : record.at("mixture")) {
      files.push_back(source / "design" / setting / std::to_string(member.at("seed").get<int>()) / "q.json");
    }
  } catch (const json::exception& e) {
    throw DataError(fmt::format("'{}' is no design ({}); make it again with 'oted design'", design.string(), e.what()));
  }
  return files;
}

/// One q for each seed: of a mixture's file, its components.
std::vector<Designer> ReadComponents(const fs::path& path, const ParameterSpace& space) {
  const json q = ReadSealed(path, true);
  const std::string where = path.string();
  std::vector<Designer> components;
  if (q.is_object() && q.value("kind", "") == "mixture") {
    try {
      for (const json& component : q.at("components")) {
        json one = component;
        one["schema"] = q.at("schema");
        for (const char* key : {"parameters", "bounds", "scale"}) one[key] = q.at(key);
        components.push_back(Designer::FromJson(one, space, where));
      }
    } catch (const json::exception& e) {
      throw DataError(fmt::format("'{}' is no mixture of schema oted.q/1 ({}); make it again with 'oted export --q'",
                                  where, e.what()));
    }
  } else {
    components.push_back(Designer::FromJson(q, space, where));
  }
  return components;
}

Prior OfGrids(const std::vector<Designer>& components, const ParameterSpace& space, const PriorUse& use,
              const std::string& source) {
  const Designer wanted = use.categorical ? Designer::OnGrid(space, use.grid_step) : Designer();
  Prior prior = Prior::Uniform(space.size());
  prior.uniform = false;
  for (int i = 0; i < space.size(); ++i) {
    std::vector<double> mean;
    for (const Designer& q : components) {
      if (!use.categorical || q.grid() == nullptr || q.grid()->values(i) != wanted.grid()->values(i)) {
        throw UsageError(
            fmt::format("design.prior: '{}' is categorical, which only a design of the same grid can use; set "
                        "design.designer = \"categorical\" and its design.grid_step",
                        source));
      }
      const std::vector<double>& p = q.grid()->probabilities(i);
      mean.resize(p.size());
      for (size_t k = 0; k < p.size(); ++k) mean[k] += p[k] / static_cast<double>(components.size());
    }
    prior.values.push_back(std::move(mean));
  }
  return prior;
}

Prior FromDesign(const std::string& source, const ParameterSpace& space, const PriorUse& use) {
  if (!fs::exists(source)) {
    throw UsageError(fmt::format(
        "design.prior is '{}', wanted uniform, gaussian, or the path of a q.json or of a run directory, and "
        "there is no such path",
        source));
  }
  std::vector<Designer> components;
  for (const fs::path& file : FilesOf(source)) {
    for (Designer& q : ReadComponents(file, space)) components.push_back(std::move(q));
  }
  if (components.empty()) throw DataError(fmt::format("'{}' holds no q(z); make it again with 'oted design'", source));
  const bool any_grid = std::ranges::any_of(components, [](const Designer& q) { return q.grid() != nullptr; });
  if (any_grid) return OfGrids(components, space, use, source);
  const double n = static_cast<double>(components.size());
  VectorXd mean = VectorXd::Zero(space.size());
  MatrixXd covariance = MatrixXd::Zero(space.size(), space.size());
  for (const Designer& q : components) mean += AsVector(q.mean()) / n;
  for (const Designer& q : components) {
    const VectorXd off = AsVector(q.mean()) - mean;
    covariance += (q.Covariance() + off * off.transpose()) / n;
  }
  return Prior::Gaussian(mean, covariance);
}

}  // namespace

PriorSource PriorSourceOf(const std::string& prior) {
  if (prior == "uniform") return PriorSource::kUniform;
  return prior == "gaussian" ? PriorSource::kBeliefs : PriorSource::kDesign;
}

Prior MakePrior(const std::string& source, const ParameterSpace& space, const PriorUse& use) {
  switch (PriorSourceOf(source)) {
    case PriorSource::kUniform:
      return Prior::Uniform(space.size());
    case PriorSource::kBeliefs:
      return FromBeliefs(space);
    case PriorSource::kDesign:
      break;
  }
  return FromDesign(source, space, use);
}

}  // namespace oted
