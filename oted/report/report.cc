#include "oted/report/report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "oted/base/base64.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/report/gather.h"
#include "oted/report/html_page.h"
#include "oted/report/summary.h"

namespace oted {
namespace {

/// The page has the pictures inside; report.json names their files.
nlohmann::json WithPictures(nlohmann::json report, const std::filesystem::path& run_dir) {
  if (!report.contains("motion") || !report["motion"].contains("panels")) return report;
  for (nlohmann::json& panel : report["motion"]["panels"]) {
    const std::string bytes = ReadFile(run_dir / "motion" / panel.at("file").get<std::string>());
    panel["data"] = "data:image/webp;base64," + Base64(bytes);
  }
  return report;
}

}  // namespace

void WriteReport(const std::filesystem::path& run_dir) {
  nlohmann::json report = GatherReport(run_dir);
  const std::string plotly_js = PlotlyJs();
  std::string page;
  try {
    report["summary"] = Summarise(report);
    page = HtmlPage(WithPictures(report, run_dir), plotly_js);
    WriteJson(run_dir / "report.json", report);
  } catch (const nlohmann::json::exception& error) {
    throw DataError(
        fmt::format("a result file in '{}' does not have the layout of its schema ({}); run the stage that "
                    "wrote it again",
                    run_dir.string(), error.what()));
  }
  WriteFileAtomically(run_dir / "report.html", page);
}

}  // namespace oted
