#include "oted/run/kept_trials.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "oted/base/files.h"
#include "oted/matching/as_vector.h"
#include "oted/run/design_record.h"
#include "oted/run/fingerprint.h"
#include "oted/run/record_reader.h"

namespace oted {

using Eigen::VectorXd;
using nlohmann::json;

namespace {

constexpr const char* kSuspects = "suspects";
std::string NameOf(int trial) { return fmt::format("trial_{}", trial); }
std::string FileOf(const std::string& name) { return name + ".json"; }

json ListOf(const VectorXd& numbers) { return std::vector<double>(numbers.begin(), numbers.end()); }

}  // namespace

json ScreeningRecord::ToJson() const {
  json record = {{"schema", kSchema}, {"suspects", SuspectsToJson(screened.suspects)}, {"x_with", json::object()}};
  for (const auto& [name, x] : screened.x_with) record["x_with"][name] = ListOf(x);
  return record;
}

ScreeningRecord ScreeningRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  ScreeningRecord read{{SuspectsFrom(reader, "suspects"), {}}};
  const RecordReader x_with = reader.At("x_with");
  for (const auto& [name, unused] : record.at("x_with").items()) {
    read.screened.x_with[name] = AsVector(x_with.Numbers(name.c_str()));
  }
  return read;
}

json TrialRecord::ToJson() const {
  json record = {{"schema", kSchema}};
  if (tried.trial) record["trial"] = ::oted::ToJson(*tried.trial);
  if (!tried.costs) return record;
  record["ages"] = tried.costs->ages;
  record["parts"] = json::array();
  for (const WindowCosts::Part& part : tried.costs->of_windows.parts) {
    record["parts"].push_back({{"rows", part.rows}, {"costs", ListOf(part.costs)}});
  }
  return record;
}

TrialRecord TrialRecord::FromJson(const json& record, const std::string& where) {
  const RecordReader reader(record, kSchema, where);
  TrialRecord read;
  if (reader.Has("trial")) read.tried.trial = reader.Read("trial", TrialFromJson);
  if (!reader.Has("parts")) return read;
  read.tried.costs.emplace();
  read.tried.costs->ages = reader.Get<std::vector<int>>("ages");
  for (const RecordReader& part : reader.List("parts")) {
    WindowCosts::Part costs{part.Get<std::vector<int>>("rows"), AsVector(part.Numbers("costs"))};
    if (costs.rows.size() != static_cast<size_t>(costs.costs.size())) part.Fail("costs", "not as many as rows");
    read.tried.costs->of_windows.parts.push_back(std::move(costs));
  }
  return read;
}

Artifact KeptTrials::Beside(const std::string& name, const char* schema) const {
  return {.file = of_.file.parent_path() / FileOf(name),
          .schema = schema,
          .fingerprint = Fingerprint({name, of_.fingerprint}),
          .made_from = {of_.file},
          .is_guest = true,
          .is_replaceable = true};
}

ScreenedSuspects KeptTrials::Screened(const std::function<ScreenedSuspects()>& make) {
  return OnceAs<ScreeningRecord>(directory_, Beside(kSuspects, ScreeningRecord::kSchema),
                                 [&] { return ScreeningRecord{make()}; })
      .screened;
}

TriedSuspect KeptTrials::Tried(int number, const std::function<TriedSuspect()>& make) {
  return OnceAs<TrialRecord>(directory_, Beside(NameOf(number), TrialRecord::kSchema),
                             [&] { return TrialRecord{make()}; })
      .tried;
}

void KeptTrials::Remove(const std::filesystem::path& folder) {
  RemoveFile(folder / FileOf(kSuspects));
  for (int number = 1; std::filesystem::exists(folder / FileOf(NameOf(number))); ++number) {
    RemoveFile(folder / FileOf(NameOf(number)));
  }
}

}  // namespace oted
