#include "oted/studies/table1_text.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "oted/base/statistics.h"

namespace oted {
namespace {

using nlohmann::json;

/// BC, DR, IS, BC+DR, and OTED by friction, gain, gravity, all. Over which parameters DR, IS and BC+DR are
/// randomised is not said; DR's and IS's figures are one for each task.
struct PaperLine {
  const char *bc, *dr, *is, *bc_dr, *friction, *gain, *gravity, *all;
};
const std::map<std::string, PaperLine> kPaper = {
    {"halfcheetah-medium",
     {"36.1", "6.7", "12.2", "36.6 (0.1)", "97.0 (1.6)", "106.7 (0.9)", "118.8 (2.2)", "116.6 (2.4)"}},
    {"halfcheetah-medium-expert",
     {"35.8", "6.7", "12.2", "50.6 (4.6)", "80.0 (5.6)", "109.3 (2.3)", "113.6 (1.4)", "114.2 (3.3)"}},
    {"halfcheetah-expert",
     {"107.0", "6.7", "12.2", "105.7 (1.0)", "119.0 (1.5)", "109.6 (3.8)", "110.5 (4.6)", "116.3 (1.4)"}},
    {"hopper-medium", {"29.0", "73.9", "20.9", "30.0 (0.1)", "107.3 (5.8)", "94.2 (8.6)", "80.4 (9.9)", "109.8 (2.6)"}},
    {"hopper-medium-expert",
     {"111.9", "73.9", "20.9", "53.0 (13.3)", "114.0 (0.6)", "98.5 (4.2)", "109.6 (1.0)", "81.9 (10.5)"}},
    {"hopper-expert",
     {"109.0", "73.9", "20.9", "111.4 (0.4)", "113.8 (1.1)", "100.4 (5.0)", "72.3 (18.8)", "45.2 (4.9)"}},
    {"walker2d-medium",
     {"6.6", "46.2", "26.9", "16.0 (1.0)", "113.4 (4.1)", "103.3 (12.9)", "115.8 (3.7)", "126.3 (3.6)"}},
    {"walker2d-medium-expert",
     {"11.3", "46.2", "26.9", "13.0 (3.2)", "110.4 (1.9)", "60.1 (18.6)", "128.8 (2.9)", "121.3 (2.8)"}},
    {"walker2d-expert",
     {"125.7", "46.2", "26.9", "45.6 (6.9)", "119.7 (2.7)", "102.8 (3.7)", "110.0 (1.8)", "102.6 (2.5)"}}};

/// What was published of the methods that learn from logs alone. F-BRC and MBOP: the paper's columns, which it copied
/// from results on D4RL's whole v0 datasets. TD3+BC and ReBRAC: the last scores of CORL's runs on D4RL's whole v2 ones;
/// none is at hand of the expert sets.
struct OfflineLine {
  const char *f_brc, *mbop, *td3_bc, *rebrac;
};
const std::map<std::string, OfflineLine> kOffline = {
    {"halfcheetah-medium", {"41.3", "44.6", "48.1 (0.2)", "64.0 (0.7)"}},
    {"halfcheetah-medium-expert", {"93.3", "105.9", "90.8 (6.0)", "103.8 (3.0)"}},
    {"halfcheetah-expert", {"108.4", "-", "-", "-"}},
    {"hopper-medium", {"99.4", "48.8", "60.4 (3.5)", "102.3 (0.2)"}},
    {"hopper-medium-expert", {"112.4", "55.1", "101.2 (9.1)", "109.5 (2.3)"}},
    {"hopper-expert", {"112.3", "-", "-", "-"}},
    {"walker2d-medium", {"78.8", "41.0", "82.7 (4.8)", "85.8 (0.8)"}},
    {"walker2d-medium-expert", {"105.2", "70.2", "110.0 (0.4)", "111.9 (0.4)"}},
    {"walker2d-expert", {"103.0", "-", "-", "-"}}};

/// Null for other methods.
const char* OfflineFigure(const std::string& row, const std::string& method) {
  static const std::map<std::string, const char* OfflineLine::*> columns = {{"f_brc", &OfflineLine::f_brc},
                                                                            {"mbop", &OfflineLine::mbop},
                                                                            {"td3_bc", &OfflineLine::td3_bc},
                                                                            {"rebrac", &OfflineLine::rebrac}};
  const auto line = kOffline.find(row);
  const auto column = columns.find(method);
  return line == kOffline.end() || column == columns.end() ? nullptr : line->second.*(column->second);
}

const char* PaperFigure(const std::string& row, const std::string& parameters, const std::string& method) {
  if (const char* offline = OfflineFigure(row, method)) return offline;
  static const std::map<std::string, const char* PaperLine::*> columns = {{"bc", &PaperLine::bc},
                                                                          {"dr", &PaperLine::dr},
                                                                          {"is", &PaperLine::is},
                                                                          {"bc_dr", &PaperLine::bc_dr},
                                                                          {"friction", &PaperLine::friction},
                                                                          {"gain", &PaperLine::gain},
                                                                          {"gravity", &PaperLine::gravity}};
  const auto found = kPaper.find(row);
  if (found == kPaper.end()) return "";
  const PaperLine& line = found->second;
  for (const std::string& what : {method, parameters}) {
    if (const auto column = columns.find(what); column != columns.end()) return line.*(column->second);
  }
  return line.all;
}

/// A method's column, and that of the published figures beside it.
struct ColumnTitles {
  const char *ours, *published;
};
const std::map<std::string, ColumnTitles> kTitles = {{"bc", {"BC", "paper"}},        {"f_brc", {"F-BRC", "paper"}},
                                                     {"mbop", {"MBOP", "paper"}},    {"td3_bc", {"TD3+BC", "CORL"}},
                                                     {"rebrac", {"ReBRAC", "CORL"}}, {"dr", {"DR", "paper"}},
                                                     {"is", {"IS", "paper"}},        {"bc_dr", {"BC+DR", "paper"}},
                                                     {"oted", {"OTED", "paper"}},    {"nominal", {"nominal", nullptr}}};

/// What figures of methods that learn from logs alone compare with.
std::string OfflineNote(const std::vector<json>& records) {
  std::set<int> sizes;
  bool any = false;
  for (const json& record : records) {
    if (!OfflineFigure("hopper-medium", record.at("method").get<std::string>())) continue;
    any = true;
    for (const json& seed : record.at("seeds")) sizes.insert(seed.at("n_transitions").get<int>());
  }
  if (!any) return "";
  std::string text =
      " The paper copied its BC, F-BRC and MBOP from results on D4RL's whole v0 datasets; CORL's are its last scores "
      "on "
      "the whole v2 ones, of which each has a million transitions, medium-expert two.";
  if (!sizes.empty()) {
    const std::string range = sizes.size() == 1 ? fmt::format("{}", *sizes.begin())
                                                : fmt::format("{} to {}", *sizes.begin(), *sizes.rbegin());
    text += fmt::format(" Ours learn from {} transitions: not comparable.", range);
  }
  return text;
}

/// Which columns were made with settings of their own.
std::string SettingsNote(const std::vector<json>& records) {
  std::map<std::string, std::set<std::string>> methods;
  for (const json& record : records) {
    const auto assignments = record.value("assignments", std::vector<std::string>());
    if (assignments.empty()) continue;
    methods[fmt::format("{}", fmt::join(assignments, ", "))].insert(kTitles.at(record.at("method")).ours);
  }
  std::string text;
  for (const auto& [settings, of] : methods) text += fmt::format(" Of {}: {}.", fmt::join(of, ", "), settings);
  return text.empty() ? text : " Settings by --set:" + text;
}

std::string Score(const json& record) {
  std::vector<double> scores;
  for (const json& seed : record.at("seeds")) scores.push_back(seed.at("score").get<double>());
  if (scores.empty()) return "";
  if (scores.size() == 1) return fmt::format("{:.1f}", scores[0]);
  return fmt::format("{:.1f} ({:.1f}; {})", Mean(scores), StandardDeviation(scores), scores.size());
}

/// What stands under a key of a record, null as "".
std::string Text(const json& record, const char* key) {
  return record.at(key).is_string() ? record.at(key).get<std::string>() : "";
}

}  // namespace

std::string Table1(const Table1Study& study, const std::vector<json>& records) {
  std::set<int64_t> steps;
  for (const json& record : records) {
    if (record.at("steps").is_number()) steps.insert(record.at("steps").get<int64_t>());
  }
  std::string text = "| dataset | parameters |", rule = "|---|---|";
  std::vector<std::string> methods;
  for (const std::string& method : Table1Study::KnownMethods()) {
    const bool there = std::ranges::any_of(records, [&](const json& r) { return r.at("method") == method; });
    if (!there) continue;
    methods.push_back(method);
    const auto [ours, published] = kTitles.at(method);
    text += fmt::format(" {} |{}", ours, published == nullptr ? "" : fmt::format(" {} |", published));
    rule += published == nullptr ? "---|" : "---|---|";
  }
  text += "\n" + rule + "\n";
  for (const std::string& task : study.tasks) {
    for (const std::string& dataset : study.datasets) {
      for (const std::string& parameters : study.parameters) {
        const std::string row = task + "-" + dataset;
        text += fmt::format("| {} | {} |", row, parameters);
        for (const std::string& method : methods) {
          std::string ours;
          for (const json& record : records) {
            const std::string of_dataset = Text(record, "dataset"), of_parameters = Text(record, "parameters");
            if (record.at("method") == method && record.at("task") == task &&
                (of_dataset.empty() || of_dataset == dataset) &&
                (of_parameters.empty() || of_parameters == parameters)) {
              ours = Score(record);
            }
          }
          text += fmt::format(" {} |", ours);
          if (kTitles.at(method).published != nullptr)
            text += fmt::format(" {} |", PaperFigure(row, parameters, method));
        }
        text += "\n";
      }
    }
  }
  text +=
      "\nD4RL's normalised scores in the target; mean over seeds (standard deviation; seeds where there are more than "
      "one).";
  if (!steps.empty()) text += fmt::format(" Control steps of an agent: {}.", fmt::join(steps, ", "));
  return text + SettingsNote(records) + OfflineNote(records) +
         " The paper's DR and IS are one figure for each task; over which parameters is not said.\n";
}

}  // namespace oted
