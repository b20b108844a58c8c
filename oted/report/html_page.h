#pragma once
/// The page as one file: style, plots and script are inside, and nothing is loaded from anywhere.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace oted {

/// A whole document. All but `plotly_js` is HTML.
/// @param navigation  links to the body's sections
std::string HtmlDocument(std::string_view title, std::string_view navigation, std::string_view body,
                         std::string_view footer, std::string_view plotly_js);

/// The page of a run.
/// @param report  the content of report.json
/// @param plotly_js  the text of plotly.min.js
std::string HtmlPage(const nlohmann::json& report, std::string_view plotly_js);

/// plotly.min.js: the file that the environment variable OTED_PLOTLY_JS names, else the one that FoundPackages() has.
/// @throws DataError when there is none
std::filesystem::path PlotlyFile();
/// Its text; it may be packed with gzip. @throws DataError when there is none
std::string PlotlyJs();

}  // namespace oted
