#include "oted/report/report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "oted/base/base64.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/seal.h"
#include "oted/report/gather.h"
#include "oted/report/html_page.h"
#include "oted/report/summary.h"

namespace oted {
namespace {

/// The page has the pictures inside; report.json names their files.
nlohmann::json WithPictures(nlohmann::json report, const std::filesystem::path& run_dir) {
  if (!report.contains("motion") || !report["motion"].contains("panels")) return report;
  const std::filesystem::path record = run_dir / "motion" / "motion.json";
  for (nlohmann::json& panel : report["motion"]["panels"]) {
    const std::string name = panel.at("file").get<std::string>();
    if (!IsPlainName(name)) {
      throw DataError(
          fmt::format("'{}' names the picture '{}', wanted a file in its own folder; remove it and run the "
                      "command again",
                      record.string(), name));
    }
    if (!std::filesystem::exists(record.parent_path() / name)) {
      report["motion"] = {{"note", fmt::format("'{}' is missing; 'oted design' draws the films again", name)}};
      return report;
    }
    CheckSealedFile(report["motion"], record, name);
    panel["data"] = "data:image/webp;base64," + Base64(ReadFile(record.parent_path() / name));
  }
  return report;
}

}  // namespace

void CheckReportCanBeMade() { static_cast<void>(PlotlyFile()); }

void WriteReport(const std::filesystem::path& run_dir) { WriteReport(run_dir, run_dir); }

void WriteReport(const std::filesystem::path& run_dir, const std::filesystem::path& folder) {
  nlohmann::json report = GatherReport(run_dir);
  const std::string plotly_js = PlotlyJs();
  std::string page;
  try {
    report["summary"] = Summarise(report);
    static_cast<void>(report.dump());  // throws for text that is no UTF-8, which would spoil the page
    page = HtmlPage(WithPictures(report, run_dir), plotly_js);
  } catch (const nlohmann::json::exception& error) {
    throw DataError(
        fmt::format("a result file in '{}' does not have the layout of its schema ({}); run the stage that "
                    "wrote it again",
                    run_dir.string(), error.what()));
  }
  SealAs(report, {{"report.html", Sha256(page)}});
  AtomicFile html(folder / "report.html"), data(folder / "report.json");
  html.Write(page);
  data.Write(JsonText(report));
  // It speaks for the page, and so stands only beside its own. Both are written by now: a full disk takes neither.
  RemoveFile(folder / "report.json");
  html.Commit();
  data.Commit();
}

}  // namespace oted
