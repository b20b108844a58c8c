#include "oted/report/html_page.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <vector>

#include "oted/report/json_values.h"
#include "oted/report/sections.h"

namespace oted {
namespace {

using nlohmann::json;

// The browser itself refuses whatever would reach for the network.
constexpr std::string_view kPolicy =
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:";

std::string Header(const json& report) {
  const json& summary = report.at("summary");
  const std::string verdict = TextAt(summary, "verdict");
  const auto list = [](const char* title, const json& items) {
    std::string html;
    for (const json& item : items) html += fmt::format("<p>{}</p>", Escape(AsText(item)));
    return html.empty() ? "" : fmt::format("<div><h2>{}</h2>{}</div>\n", title, html);
  };
  const char* tone = verdict == "outside_family" ? "poor" : verdict.empty() ? "open" : "good";
  return fmt::format("<header class=\"{}\" id=\"top\"><p class=\"eyebrow\">{}</p><h1>{}</h1>\n", tone,
                     Escape(TextAt(report, "title")), Escape(TextAt(summary, "headline"))) +
         fmt::format("<p class=\"asked\">{}</p>\n<div class=\"answer\">{}{}{}</div></header>\n",
                     Escape(TextAt(summary, "asked")), list("What came out", summary.at("found")),
                     list("How far to trust it", summary.at("trust")),
                     list("What stays unknown", summary.at("unknown")));
}

}  // namespace

std::string HtmlPage(const json& report, std::string_view plotly_js) {
  const std::vector<Section> sections = {
      ParametersSection(report),      ReplaySection(report),        PoliciesSection(report),  WarningsSection(report),
      DesignSection(report),          DiscriminatorSection(report), SelectionSection(report), AgentsSection(report),
      PolicySelectionSection(report), DataSection(report),          CloneSection(report),     RunSection(report)};
  std::string contents;
  std::string body;
  for (const Section& section : sections) {
    if (section.html.empty()) continue;
    contents += fmt::format("<a href=\"#{}\">{}</a>", section.id, section.label);
    body += fmt::format("<section id=\"{}\"><h2>{}</h2>\n{}</section>\n", section.id, section.title, section.html);
  }
  const std::string title = Escape(TextAt(report, "title"));
  std::string page = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta name=\"color-scheme\" content=\"light dark\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"{}\">\n"
      "<link rel=\"icon\" href=\"data:,\">\n<title>{} – simulator design</title>\n<style>{}</style>\n</head>\n<body>\n",
      kPolicy, title, PageStyle());
  page +=
      fmt::format("<nav aria-label=\"Contents\"><div><a class=\"home\" href=\"#top\">{}</a>{}</div></nav>\n<main>\n",
                  title, contents);
  page += Header(report);
  page += "<noscript><p class=\"note\">The plots need JavaScript; the tables do not.</p></noscript>\n";
  page += body;
  page += "<footer>Made by oted from the files of this run; report.json has the same as data.</footer>\n</main>\n";
  page += "<script>";
  page += plotly_js;
  page += "</script>\n<script>";
  page += PageScript();
  page += PlayerScript();
  page += "</script>\n</body>\n</html>\n";
  return page;
}

}  // namespace oted
