#include "oted/report/figure.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

namespace oted {

using nlohmann::json;

std::string PlotText(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&') {
      escaped += "&amp;";
    } else if (c == '<') {
      escaped += "&lt;";
    } else if (c == '>') {
      escaped += "&gt;";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string PlotLabel(std::string_view text) {
  constexpr size_t kMost = 18, kHead = 10, kTail = 7;
  // Bytes that begin a character, so that none is cut.
  std::vector<size_t> starts;
  for (size_t i = 0; i < text.size(); ++i) {
    if ((static_cast<unsigned char>(text[i]) & 0xC0) != 0x80) starts.push_back(i);
  }
  if (starts.size() <= kMost) return PlotText(text);
  return PlotText(text.substr(0, starts[kHead])) + "…" + PlotText(text.substr(starts[starts.size() - kTail]));
}

void Figure::AddCurve(const json& points, const std::string& name, const LineStyle& style) {
  if (points.empty()) return;
  json x = json::array();
  json y = json::array();
  for (const json& point : points) {
    x.push_back(point.at(0));
    y.push_back(point.at(1));
    const double at = point.at(0).get<double>();
    first_x_ = has_x_ ? std::min(first_x_, at) : at;
    last_x_ = has_x_ ? std::max(last_x_, at) : at;
    has_x_ = true;
  }
  json trace = {{"type", "scatter"},
                {"mode", points.size() == 1 ? "markers" : "lines"},
                {"x", std::move(x)},
                {"y", std::move(y)},
                {"name", PlotText(name)},
                {"opacity", style.opacity},
                {"line", {{"color", style.color}, {"width", style.width}, {"dash", style.dash}}},
                {"marker", {{"color", style.color}, {"size", 6}}}};
  traces_.push_back(std::move(trace));
}

void Figure::AddBand(const json& mean, const json& spread, const std::string& color) {
  if (mean.empty() || mean.size() != spread.size()) return;
  json steps = json::array(), low = json::array(), high = json::array();
  for (size_t i = 0; i < mean.size(); ++i) {
    if (!mean[i].at(1).is_number() || !spread[i].at(1).is_number()) continue;
    const double center = mean[i].at(1), half = spread[i].at(1);
    steps.push_back(mean[i].at(0));
    low.push_back(center - half);
    high.push_back(center + half);
  }
  AddRange(steps, low, high, color);
}

void Figure::AddRange(const json& steps, const json& low, const json& high, const std::string& color, double opacity) {
  // Along one curve and back along the other.
  json x = steps, y = high;
  for (size_t i = steps.size(); i-- > 0;) {
    x.push_back(steps[i]);
    y.push_back(low[i]);
  }
  traces_.push_back({{"type", "scatter"},
                     {"mode", "lines"},
                     {"fill", "toself"},
                     {"fillcolor", color},
                     {"opacity", opacity},
                     {"line", {{"width", 0}, {"color", color}}},
                     {"hoverinfo", "skip"},
                     {"x", std::move(x)},
                     {"y", std::move(y)}});
}

void Figure::AddMarkers(json x, json y, const std::vector<std::string>& texts, json marker) {
  json escaped = json::array();
  for (const std::string& text : texts) escaped.push_back(PlotText(text));
  traces_.push_back({{"type", "scatter"},
                     {"mode", "markers"},
                     {"x", std::move(x)},
                     {"y", std::move(y)},
                     {"hovertext", std::move(escaped)},
                     {"hoverinfo", "text"},
                     {"marker", std::move(marker)}});
}

void Figure::AddLevel(double y, const std::string& name, const LineStyle& style) {
  if (!has_x_) return;
  AddCurve({{first_x_, y}, {std::max(last_x_, first_x_ + 1), y}}, name, style);
}

void Figure::SetXTitle(std::string_view text) { layout_["xaxis"]["title"]["text"] = text; }

void Figure::SetValueRange(double low, double high) {
  traces_.back()["zmin"] = low;
  traces_.back()["zmax"] = high;
}

std::string Figure::Html(std::string_view css_class) const {
  if (traces_.empty()) return "";
  std::string spec = json{{"data", traces_}, {"layout", layout_}}.dump(-1, ' ', false, json::error_handler_t::replace);
  // Inside a script element the parser looks for "</script" and "<!--".
  for (size_t at = 0; (at = spec.find('<', at)) != std::string::npos;) spec.replace(at, 1, "\\u003c");
  return fmt::format(
      "<figure class=\"{}\"><figcaption>{}</figcaption><div class=\"plot\"></div>"
      "<script type=\"application/json\">{}</script></figure>\n",
      css_class, title_, spec);
}

Figure MatrixFigure(std::string title, json columns, json rows, json values, json colorscale, const char* format) {
  Figure figure(std::move(title));
  figure.AddTrace({{"type", "heatmap"},
                   {"x", std::move(columns)},
                   {"y", std::move(rows)},
                   {"z", std::move(values)},
                   {"colorscale", std::move(colorscale)},
                   {"texttemplate", format},
                   {"textfont", {{"color", "var:--text"}}},
                   {"hoverinfo", "skip"},
                   {"xgap", 3},
                   {"ygap", 3},
                   {"showscale", false}});
  figure.layout() = {{"xaxis", {{"type", "category"}, {"showgrid", false}}},
                     {"yaxis", {{"type", "category"}, {"autorange", "reversed"}, {"showgrid", false}}}};
  return figure;
}

void SetRows(Figure& figure, const std::vector<std::string>& names) {
  json places = json::array(), labels = json::array();
  for (size_t i = 0; i < names.size(); ++i) {
    places.push_back(i);
    labels.push_back(PlotLabel(names[i]));
  }
  figure.layout()["height"] = 70 + 30 * names.size();
  figure.layout()["yaxis"] = {{"range", {static_cast<double>(names.size()) - 0.5, -0.5}},
                              {"tickvals", std::move(places)},
                              {"ticktext", std::move(labels)},
                              {"showgrid", false}};
}

std::string FigureGrid(std::string_view figures) {
  return figures.empty() ? "" : fmt::format("<div class=\"grid\">{}</div>\n", figures);
}

PlotKey& PlotKey::Add(std::string_view style, std::string_view variable, std::string_view text) {
  items_ += fmt::format("<li><i class=\"{}\" style=\"--c:var({})\"></i>{}</li>", style, variable, text);
  return *this;
}

std::string PlotKey::Html() const { return "<ul class=\"key\">" + items_ + "</ul>\n"; }

std::string WithKey(const PlotKey& key, const std::string& figures) {
  return figures.empty() ? "" : key.Html() + figures;
}

}  // namespace oted
