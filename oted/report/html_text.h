#pragma once
/// Text and tables for the page. Everything that comes from a result file goes through Escape.

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace oted {

/// For HTML text and quoted attributes.
std::string Escape(std::string_view text);

/// About three significant digits: 0.0312, 1.25, 48.1, 1,830; "–" when not known.
std::string FormatNumber(std::optional<double> value);
/// With the decimals of `scale`'s two leading digits: a value beside its spread.
std::string FormatAtScale(std::optional<double> value, std::optional<double> scale);
/// A number that somebody chose, as it was given: 1, 0.6.
std::string FormatGiven(std::optional<double> value);
/// A score less its value at a perfect match: three decimals.
std::string FormatScore(std::optional<double> value);
/// "0.981 ± 0.052", or the value alone when the spread is not known.
std::string FormatSpread(std::optional<double> value, std::optional<double> spread);
/// A score of 0 to 100: one decimal.
std::string FormatPoints(std::optional<double> value);
/// A unit behind a name, as HTML; "x nominal" becomes "× nominal". Empty for no unit.
std::string UnitHtml(std::string_view unit);
/// 12,345.
std::string FormatCount(std::optional<double> value);

/// A table. One that is too wide for the page is shown row by row instead, each cell beside its column's title (without
/// JavaScript it scrolls in a box of its own).
class HtmlTable {
 public:
  enum class Align { kText, kNumber };
  /// `title` is plain text without characters that HTML would need escaped.
  HtmlTable& Column(std::string title, Align align = Align::kNumber);
  /// One cell of HTML per column.
  void Row(std::vector<std::string> cells, bool emphasised = false);
  std::string Html() const;

 private:
  struct Head {
    std::string title;
    Align align;
  };
  struct Line {
    std::vector<std::string> cells;
    bool emphasised;
  };
  std::vector<Head> columns_;
  std::vector<Line> rows_;
};

/// Names and their values, side by side. A value that is not known is left out.
class FactList {
 public:
  /// Both are HTML.
  FactList& Add(std::string_view name, std::string_view value);
  std::string Html() const;

 private:
  std::string items_;
};

/// "name", or "name selected" with a badge; as HTML.
std::string SelectedName(std::string_view name, bool selected);

/// One part of the page; nothing is shown when `html` is empty.
struct Section {
  std::string id;
  std::string label;  ///< in the contents bar
  std::string title;
  std::string html;
};

}  // namespace oted
