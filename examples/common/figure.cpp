#include "figure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

#include "csv.hpp"

namespace esokit::examples {
namespace {

std::string text_of(double value) { return number_text(value, 12); }
std::string text_of(std::optional<double> value) { return value ? text_of(*value) : "*"; }

/// Adds about `most` of the rows, so that the curve looks the same. Of each part it takes the
/// lowest and the highest, so that noise keeps its envelope, those farthest left and right, and
/// where a gap starts.
void keep(std::set<std::size_t>& kept, const Curve& curve, const std::vector<std::size_t>& rows,
          std::size_t most) {
  const std::size_t parts = rows.size() <= most ? rows.size() : most / 4;
  for (std::size_t part = 0; part < parts; ++part) {
    std::optional<std::array<std::size_t, 4>> ends;
    for (std::size_t r = part * rows.size() / parts; r < (part + 1) * rows.size() / parts; ++r) {
      const std::size_t i = rows[r];
      if (!std::isfinite(curve.x[i]) || !std::isfinite(curve.y[i])) {
        if (i > 0 && std::isfinite(curve.y[i - 1])) kept.insert(i);
        continue;
      }
      if (!ends) ends = {i, i, i, i};
      if (curve.y[i] < curve.y[(*ends)[0]]) (*ends)[0] = i;
      if (curve.y[i] > curve.y[(*ends)[1]]) (*ends)[1] = i;
      if (curve.x[i] < curve.x[(*ends)[2]]) (*ends)[2] = i;
      if (curve.x[i] > curve.x[(*ends)[3]]) (*ends)[3] = i;
    }
    if (ends) kept.insert(ends->begin(), ends->end());
  }
}

/// The points of a map, with a gap after each row, by which gnuplot sees a grid.
std::pair<Curve, Column> grid(const Column& x, const Column& y, const Column& z) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  std::pair<Curve, Column> result;
  for (std::size_t j = 0; j < y.size(); ++j) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      result.first.add(x[i], y[j]);
      result.second.push_back(z[j * x.size() + i]);
    }
    result.first.add(nan, nan);
    result.second.push_back(nan);
  }
  return result;
}

}  // namespace

void Curve::add(double x_value, double y_value) {
  x.push_back(x_value);
  y.push_back(y_value);
}

Panel& Panel::set(const char* key, const std::string& value) {
  description_ += csv_line({key, value});
  return *this;
}
Panel& Panel::set(const char* key, const Range& range) {
  description_ += csv_line({key, text_of(range.from), text_of(range.to)});
  return *this;
}
Panel& Panel::legend(Legend place) {
  return set("legend", std::to_string(static_cast<int>(place)));
}
Panel& Panel::name(const std::string& text) {
  name_ = text;
  return *this;
}
Panel& Panel::line(const Column& x, const Column& y, Style style) {
  return add("line", std::move(style), {{x, y}, {}, {}});
}
Panel& Panel::points(const Column& x, const Column& y, Style style) {
  return add("points", std::move(style), {{x, y}, {}, {}});
}
Panel& Panel::band(const Column& x, const Column& low, const Column& high, Style style) {
  if (style.opacity == 1.0) style.opacity = 0.25;
  return add("band", std::move(style), {{x, low}, high, {}});
}
Panel& Panel::horizontal_line(double y, const Style& style) { return draw("horizontal", style, y); }
Panel& Panel::vertical_line(double x, const Style& style) { return draw("vertical", style, x); }
Panel& Panel::note(double x, double y, const std::string& text) {
  description_ += csv_line({"note", text_of(x), text_of(y), text});
  return *this;
}
Panel& Panel::inset(const Inset& inset) {
  description_ += csv_line({"inset", text_of(inset.left), text_of(inset.bottom),
                            text_of(inset.width), text_of(inset.height), text_of(inset.x.from),
                            text_of(inset.x.to), inset.frame ? "1" : "", inset.connect ? "1" : ""});
  zooms_.push_back(inset.x);
  return *this;
}
Panel& Panel::map(const Column& x, const Column& y, const Column& z, double most, Style style) {
  auto [curve, values] = grid(x, y, z);
  return add("map", std::move(style), {std::move(curve), std::move(values), {}}, most);
}
Panel& Panel::contour(const Column& x, const Column& y, const Column& z, Style style) {
  auto [curve, values] = grid(x, y, z);
  return add("contour", std::move(style), {std::move(curve), std::move(values), {}});
}

Panel& Panel::draw(const char* kind, const Style& style, double at) {
  const auto number = [](auto value) { return std::to_string(static_cast<int>(value)); };
  description_ += csv_line({"draw", kind, text_of(at), style.name, number(style.color),
                            number(style.dash), text_of(style.width), number(style.marker),
                            text_of(style.size), text_of(style.opacity)});
  return *this;
}

Panel& Panel::add(const char* kind, Style style, Series series, double at) {
  constexpr std::array automatic = {Color::blue,   Color::vermillion, Color::green, Color::purple,
                                    Color::orange, Color::sky,        Color::black};
  if (style.color == Color::automatic) style.color = automatic[colors_ % automatic.size()];
  if (series.more.empty()) ++colors_;
  series.column = style.column.empty() ? style.name : style.column;
  // A label without gnuplot's braces.
  std::erase_if(series.column, [](char c) { return c == '{' || c == '}'; });
  if (series.column.empty()) series.column = "series " + std::to_string(series_.size() + 1);
  series_.push_back(std::move(series));
  return draw(kind, style, at);
}

Figure::Figure(std::string name, Grid grid) : name_(std::move(name)), grid_(grid) {}
Figure::Figure(const Figure&) = default;
Figure::Figure(Figure&&) noexcept = default;
Figure::~Figure() = default;

Figure& Figure::title(std::string text) {
  title_ = std::move(text);
  return *this;
}
Figure& Figure::caption(std::string text) {
  caption_ = std::move(text);
  return *this;
}

Panel& Figure::panel(std::size_t row, std::size_t column, std::size_t row_span,
                     std::size_t column_span) {
  for (Panel& panel : panels_) {
    if (panel.row_ == row && panel.column_ == column) return panel;
  }
  Panel& panel = panels_.emplace_back();
  panel.row_ = row;
  panel.column_ = column;
  panel.name_ = "r" + std::to_string(row + 1) + "c" + std::to_string(column + 1);
  panel.description_ = csv_line({"panel", std::to_string(row), std::to_string(column),
                                 std::to_string(row_span), std::to_string(column_span)});
  return panel;
}

std::optional<FigureText> Figure::text(const std::string& folder,
                                       const std::string& formats) const {
  // Two empty lines end a series, one is a gap in a line: so gnuplot reads this file too.
  std::string numbers = "panel,series,x,y,z\n";
  std::string description =
      csv_line({"figure", folder, name_, title_, std::to_string(grid_.rows),
                std::to_string(grid_.columns), text_of(grid_.panel_height), formats});
  // Many curves have small panels.
  std::size_t count = 1;
  for (const Panel& panel : panels_) count += panel.series_.size();
  const std::size_t most = std::clamp<std::size_t>(60'000 / count, 1'200, 4'000);
  for (const Panel& panel : panels_) {
    description += panel.description_;
    for (const auto& series : panel.series_) {
      const auto& curve = series.curve;
      const auto& more = series.more;
      if (curve.x.empty() || curve.x.size() != curve.y.size() ||
          (!more.empty() && more.size() != curve.size())) {
        std::fprintf(stderr, "figure %s, panel %s: columns of no or different lengths\n",
                     name_.c_str(), panel.name_.c_str());
        return std::nullopt;
      }
      numbers += "\n\n";
      std::vector<std::size_t> all(curve.size());
      for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
      std::set<std::size_t> kept(all.begin(), all.end());
      if (more.empty()) {
        kept.clear();
        keep(kept, curve, all, most);
      }
      for (const Range& zoom : panel.zooms_) {
        auto rows = all;
        std::erase_if(rows, [&](std::size_t i) {
          return curve.x[i] < zoom.from.value_or(curve.x[i]) ||
                 curve.x[i] > zoom.to.value_or(curve.x[i]);
        });
        keep(kept, curve, rows, most);
      }
      // gnuplot counts series: one without a row would shift all that follow.
      if (std::none_of(curve.y.begin(), curve.y.end(), [](double y) { return std::isfinite(y); })) {
        numbers += csv_line({panel.name_, series.column, "nan", "nan", ""});
      }
      for (const std::size_t i : kept) {
        if (std::isfinite(curve.x[i]) && std::isfinite(curve.y[i])) {
          numbers += csv_field(panel.name_) + ',' + csv_field(series.column) + ',' +
                     number_text(curve.x[i], 7) + ',' + number_text(curve.y[i], 7) + ',' +
                     (more.empty() ? "" : number_text(more[i], 7));
        }
        numbers += '\n';
      }
    }
  }
  return FigureText{std::move(description), std::move(numbers)};
}

}  // namespace esokit::examples
