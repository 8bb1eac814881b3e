/// @file
/// One pair of axes of a figure: what is plotted in it and how its axes look.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "curve.hpp"
#include "plot_style.hpp"

namespace esokit::examples {

/// Collects what to draw; the Figure that it belongs to draws it. Things are drawn in the order in
/// which they are added, so put noisy curves first.
class Panel {
 public:
  // Written once, in panel.cpp: not in each program that draws.
  Panel();
  Panel(const Panel&);
  Panel(Panel&&) noexcept;
  ~Panel();

  Panel& title(std::string text);
  /// Axis labels; give the unit: "t (s)".
  Panel& x_label(std::string text);
  Panel& y_label(std::string text);
  /// Ends of the axes; without them x ends with the data, y at the next tick.
  Panel& x_range(double from, double to);
  Panel& y_range(double from, double to);
  Panel& x_range(Range range);
  Panel& y_range(Range range);
  Panel& x_tick(double distance);
  Panel& y_tick(double distance);
  Panel& log_x();
  Panel& log_y();
  /// The same length for a unit of x and of y.
  Panel& equal_axes();
  /// No numbers at the x axis, for a panel above one with the same axis.
  Panel& hide_x_numbers();
  Panel& legend(Legend place);
  /// Name of the panel in the figure's data file.
  Panel& name(std::string text);

  /// A line through the points; x may go back and forth (a path). NaN breaks it.
  Panel& line(Column x, Column y, Style style = {});
  Panel& line(const Curve& curve, Style style = {});
  /// Markers at the points.
  Panel& points(Column x, Column y, Style style = {});
  /// A filled band, e.g. mean plus and minus the standard deviation.
  Panel& band(Column x, Column low, Column high, Style style = {});
  /// A reference line across the panel.
  Panel& horizontal_line(double y, Style style = {.color = Color::grey, .dash = Dash::dashed});
  Panel& vertical_line(double x, Style style = {.color = Color::grey, .dash = Dash::dashed});
  /// Text in the panel at the point (x, y).
  Panel& note(double x, double y, std::string text);
  /// A zoom in a part of the panel.
  Panel& inset(Inset inset);

  /// A colour map under everything else; `z` holds a row of x values for each y,
  /// z[j * x.size() + i] = z(x[i], y[j]). x and y rise in equal steps.
  Panel& map(Column x, Column y, Column z, MapStyle style = {});

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
  Panel& set(Value& member, Value value);
  Panel& add(Series::Kind kind, Column x, Column y, Column high, Style style);

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
