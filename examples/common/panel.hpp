/// @file
/// One pair of axes of a figure: what is plotted in it and how its axes look.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "curve.hpp"
#include "plot_style.hpp"

namespace esokit::examples {

/// Collects what to draw; the Figure that it belongs to draws it. Things are drawn in the order in
/// which they are added, so put noisy curves first.
class Panel {
 public:
  Panel& title(std::string text) { return set(title_, std::move(text)); }
  /// Axis labels; give the unit: "t (s)".
  Panel& x_label(std::string text) { return set(x_label_, std::move(text)); }
  Panel& y_label(std::string text) { return set(y_label_, std::move(text)); }
  /// Ends of the axes; without them x ends with the data, y at the next tick.
  Panel& x_range(double from, double to) { return set(x_range_, Range{from, to}); }
  Panel& y_range(double from, double to) { return set(y_range_, Range{from, to}); }
  Panel& x_range(Range range) { return set(x_range_, range); }
  Panel& y_range(Range range) { return set(y_range_, range); }
  Panel& x_tick(double distance) { return set(x_tick_, std::optional(distance)); }
  Panel& y_tick(double distance) { return set(y_tick_, std::optional(distance)); }
  Panel& log_x() { return set(log_x_, true); }
  Panel& log_y() { return set(log_y_, true); }
  /// The same length for a unit of x and of y.
  Panel& equal_axes() { return set(equal_axes_, true); }
  /// No numbers at the x axis, for a panel above one with the same axis.
  Panel& hide_x_numbers() { return set(hide_x_numbers_, true); }
  Panel& legend(Legend place) { return set(legend_, place); }
  /// Name of the panel's data file: FIGURE_NAME.csv.
  Panel& name(std::string text) { return set(name_, std::move(text)); }

  /// A line through the points; x may go back and forth (a path). NaN breaks it.
  Panel& line(Column x, Column y, Style style = {}) {
    return add(Series::Kind::line, std::move(x), std::move(y), {}, std::move(style));
  }
  Panel& line(const Curve& curve, Style style = {}) {
    return line(Column(curve.x), Column(curve.y), std::move(style));
  }
  /// Markers at the points.
  Panel& points(Column x, Column y, Style style = {}) {
    return add(Series::Kind::points, std::move(x), std::move(y), {}, std::move(style));
  }
  /// A filled band, e.g. mean plus and minus the standard deviation.
  Panel& band(Column x, Column low, Column high, Style style = {}) {
    return add(Series::Kind::band, std::move(x), std::move(low), std::move(high), std::move(style));
  }
  /// A reference line across the panel.
  Panel& horizontal_line(double y, Style style = {.color = Color::grey, .dash = Dash::dashed}) {
    references_.push_back({y, true, std::move(style)});
    return *this;
  }
  Panel& vertical_line(double x, Style style = {.color = Color::grey, .dash = Dash::dashed}) {
    references_.push_back({x, false, std::move(style)});
    return *this;
  }
  /// Text in the panel at the point (x, y).
  Panel& note(double x, double y, std::string text) {
    notes_.push_back({x, y, std::move(text)});
    return *this;
  }
  /// A zoom in a part of the panel.
  Panel& inset(Inset inset) {
    insets_.push_back(inset);
    return *this;
  }

  /// A colour map under everything else; `z` holds a row of x values for each y,
  /// z[j * x.size() + i] = z(x[i], y[j]). x and y rise in equal steps.
  Panel& map(Column x, Column y, Column z, MapStyle style = {}) {
    map_ = Map{std::move(x).take(), std::move(y).take(), std::move(z).take(), std::move(style)};
    return *this;
  }

 private:
  friend class Figure;
  friend class FigureData;
  friend class FigureScript;

  struct Series {
    enum class Kind { line, points, band };
    Kind kind;
    std::vector<double> x, y, high;
    Style style;
  };
  struct Reference {
    double at;
    bool horizontal;
    Style style;
  };
  struct Note {
    double x, y;
    std::string text;
  };
  struct Map {
    std::vector<double> x, y, z;
    MapStyle style;
  };

  template <class Value>
  Panel& set(Value& member, Value value) {
    member = std::move(value);
    return *this;
  }

  Panel& add(Series::Kind kind, Column x, Column y, Column high, Style style) {
    if (style.color == Color::automatic) {
      const auto used = static_cast<std::size_t>(
          std::count_if(series_.begin(), series_.end(),
                        [](const Series& other) { return other.kind != Series::Kind::band; }));
      style.color = detail::automatic_colors[used % detail::automatic_colors.size()];
    }
    series_.push_back(
        {kind, std::move(x).take(), std::move(y).take(), std::move(high).take(), std::move(style)});
    return *this;
  }

  std::string title_, x_label_, y_label_, name_;
  Range x_range_, y_range_;
  std::optional<double> x_tick_, y_tick_;
  bool log_x_ = false;
  bool log_y_ = false;
  bool equal_axes_ = false;
  bool hide_x_numbers_ = false;
  Legend legend_ = Legend::top_right;
  std::vector<Series> series_;
  std::vector<Reference> references_;
  std::vector<Note> notes_;
  std::vector<Inset> insets_;
  std::optional<Map> map_;

  // Place in the grid, given by the figure.
  std::size_t row_ = 0, column_ = 0, row_span_ = 1, column_span_ = 1;
};

}  // namespace esokit::examples
