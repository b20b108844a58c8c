#pragma once
/// Plots of the page: plotly.js figures, given as JSON that the page's script draws. A colour is `var:--name`, a CSS
/// variable of the page, so that plots follow the reader's light or dark mode.

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace oted {

/// What lines of one role look like.
struct LineStyle {
  std::string color;  ///< for example "var:--designed"
  double width = 1.5;
  std::string dash = "solid";
  double opacity = 1;
};

/// One plot. Names and texts are plain; they are escaped for plotly.js, which reads tags in text.
class Figure {
 public:
  /// @param title  HTML, above the plot
  explicit Figure(std::string title) : title_(std::move(title)) {}

  /// A curve: list of [step, value].
  void AddCurve(const nlohmann::json& points, const std::string& name, const LineStyle& style);
  /// The area of mean +- spread, from two curves with the same steps.
  void AddBand(const nlohmann::json& mean, const nlohmann::json& spread, const std::string& color);
  /// The area between two curves over the same steps.
  void AddRange(const nlohmann::json& steps, const nlohmann::json& low, const nlohmann::json& high,
                const std::string& color, double opacity = 1);
  /// A horizontal line over the curves' whole width. Call after the curves.
  void AddLevel(double y, const std::string& name, const LineStyle& style);
  /// Points without a line. @param texts  what each says under the pointer, plain
  void AddMarkers(nlohmann::json x, nlohmann::json y, const std::vector<std::string>& texts, nlohmann::json marker);
  /// A plotly.js trace as it is; texts in it must have been escaped with PlotText.
  void AddTrace(nlohmann::json trace) { traces_.push_back(std::move(trace)); }
  void SetXTitle(std::string_view text);
  /// Of a matrix: the values at the ends of its colours.
  void SetValueRange(double low, double high);
  nlohmann::json& layout() { return layout_; }
  bool empty() const { return traces_.empty(); }
  /// @param css_class  "wide" for a plot that takes the page's width
  std::string Html(std::string_view css_class = "") const;

 private:
  std::string title_;
  nlohmann::json traces_ = nlohmann::json::array();
  nlohmann::json layout_ = nlohmann::json::object();
  double first_x_ = 0;
  double last_x_ = 0;
  bool has_x_ = false;
};

/// A matrix with its numbers in the cells. Labels must have been escaped with PlotText.
/// @param format  of a number, in plotly.js's template: "%{z:.2f}"
Figure MatrixFigure(std::string title, nlohmann::json columns, nlohmann::json rows, nlohmann::json values,
                    nlohmann::json colorscale, const char* format);

/// Names down the left side, the first one on top; what is drawn lies at y = 0, 1, ... Names need not differ.
void SetRows(Figure& figure, const std::vector<std::string>& names);

/// Plain text for plotly.js.
std::string PlotText(std::string_view text);
/// The same, for an axis, where a long name would leave no room for the plot: at most 18 characters, "…" in the middle.
std::string PlotLabel(std::string_view text);

/// A row of figures that wraps on narrow pages.
std::string FigureGrid(std::string_view figures);

/// The legend of a group of plots: one key for all, in HTML.
class PlotKey {
 public:
  /// @param style  "line", "dash", "dots" or "band"; @param variable  the CSS variable without "var:"; @param text HTML
  PlotKey& Add(std::string_view style, std::string_view variable, std::string_view text);
  std::string Html() const;

 private:
  std::string items_;
};

/// The key above its plots; nothing when there are none.
std::string WithKey(const PlotKey& key, const std::string& figures);

}  // namespace oted
