#pragma once
/// The page as one file: style, plots and script are inside, and nothing is loaded from anywhere.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace oted {

/// @param report  the content of report.json
/// @param plotly_js  the text of plotly.min.js
std::string HtmlPage(const nlohmann::json& report, std::string_view plotly_js);

/// The page's style sheet and scripts (page_style.cc, page_script.cc, page_player.cc).
std::string_view PageStyle();
std::string_view PageScript();
std::string_view PlayerScript();

}  // namespace oted
