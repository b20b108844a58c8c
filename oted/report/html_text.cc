#include "oted/report/html_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"

namespace oted {
namespace {

constexpr const char* kUnknown = "–";

std::string WithThousands(std::string digits) {
  const size_t point = std::min(digits.find('.'), digits.size());
  for (size_t i = point; i > 3; i -= 3) digits.insert(i - 3, 1, ',');
  return digits;
}

std::string Fixed(double value, int decimals) {
  const std::string digits = WithThousands(fmt::format("{:.{}f}", std::abs(value), decimals));
  const bool is_zero = digits.find_first_not_of("0.,") == std::string::npos;
  return value < 0 && !is_zero ? "\u2212" + digits : digits;
}

// The decimals that show `significant` digits of `value`.
int Decimals(double value, int significant) {
  if (value == 0) return 0;
  return std::clamp(significant - 1 - static_cast<int>(std::floor(std::log10(std::abs(value)))), 0, 6);
}

}  // namespace

std::string Escape(std::string_view text) {
  std::string escaped;
  escaped.reserve(text.size());
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string FormatNumber(std::optional<double> value) {
  if (!value) return kUnknown;
  const double size = std::abs(*value);
  if (size != 0 && (size < 1e-4 || size >= 1e9)) return fmt::format("{:.2e}", *value);
  return Fixed(*value, Decimals(*value, 3));
}

std::string FormatAtScale(std::optional<double> value, std::optional<double> scale) {
  if (!value) return kUnknown;
  if (!scale || *scale == 0) return FormatNumber(value);
  return Fixed(*value, Decimals(*scale, 2));
}

std::string FormatGiven(std::optional<double> value) {
  return value ? (*value < 0 ? "\u2212" : "") + fmt::format("{:.6g}", std::abs(*value)) : kUnknown;
}

std::string FormatScore(std::optional<double> value) { return value ? Fixed(*value, 3) : kUnknown; }

std::string FormatSpread(std::optional<double> value, std::optional<double> spread) {
  if (!value || !spread) return FormatNumber(value);
  return FormatAtScale(value, spread) + "\u00a0±\u00a0" + FormatAtScale(spread, spread);
}

std::string FormatCount(std::optional<double> value) { return value ? Fixed(*value, 0) : kUnknown; }

std::string FormatPoints(std::optional<double> value) { return value ? Fixed(*value, 1) : kUnknown; }

std::string UnitHtml(std::string_view unit) {
  if (unit.empty()) return "";
  return fmt::format(" <small>{}</small>", unit.starts_with("x ") ? "× " + Escape(unit.substr(2)) : Escape(unit));
}

HtmlTable& HtmlTable::Column(std::string title, Align align) {
  columns_.push_back({std::move(title), align});
  return *this;
}

void HtmlTable::Row(std::vector<std::string> cells, bool emphasised) {
  OTED_CHECK(cells.size() == columns_.size());
  rows_.push_back({std::move(cells), emphasised});
}

std::string HtmlTable::Html() const {
  const auto align = [this](size_t i) { return columns_[i].align == Align::kNumber ? " class=\"num\"" : ""; };
  std::string html = "<div class=\"table\" tabindex=\"0\"><table><thead><tr>";
  for (size_t i = 0; i < columns_.size(); ++i) {
    html += fmt::format("<th scope=\"col\"{}>{}</th>", align(i), columns_[i].title);
  }
  html += "</tr></thead><tbody>";
  for (const Line& row : rows_) {
    html += row.emphasised ? "<tr class=\"chosen\">" : "<tr>";
    for (size_t i = 0; i < row.cells.size(); ++i) {
      // Where the table is too wide for the page, each cell stands below the one before and names its column itself.
      html += fmt::format("<td{} data-label=\"{}\">{}</td>", align(i), columns_[i].title, row.cells[i]);
    }
    html += "</tr>";
  }
  return html + "</tbody></table></div>\n";
}

FactList& FactList::Add(std::string_view name, std::string_view value) {
  if (!value.empty() && !value.starts_with(kUnknown)) {
    items_ += fmt::format("<div><dt>{}</dt><dd>{}</dd></div>", name, value);
  }
  return *this;
}

std::string FactList::Html() const { return items_.empty() ? "" : "<dl>" + items_ + "</dl>\n"; }

std::string SelectedName(std::string_view name, bool selected) {
  return Escape(name) + (selected ? " <span class=\"badge good\">selected</span>" : "");
}

}  // namespace oted
