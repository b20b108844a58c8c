#pragma once
/// The texts of oted/report/assets, which the build puts into the program (cmake/EmbedAssets.cmake).

#include <string_view>

namespace oted {

std::string_view PageStyle();    ///< page.css
std::string_view PlotsScript();  ///< plots.js: draws the figures with plotly, in the colours of the page's mode
std::string_view
PlayerScript();  ///< player.js: plays films; their frames lie in strips, and all panels show one moment

}  // namespace oted
