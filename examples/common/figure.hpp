/// @file
/// A figure as in a journal: described here, drawn by gnuplot with draw_figure.py.
///
/// ```
/// Figure figure("fig3", {.rows = 2, .columns = 2});
/// figure.caption("Sim1A: tracking without noise.");
/// figure.panel(0, 0)
///     .x_label("t (s)").y_label("e (m)")
///     .line(t, error_1, {.name = "p = 1"})
///     .line(t, error_2, {.name = "p = 2", .dash = Dash::dashed})
///     .inset({.left = 0.5, .bottom = 0.4, .x = {3.4, 3.8}});
/// report.add(figure);
/// ```
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace esokit::examples {

/// Colours that colour-blind readers tell apart (Okabe and Ito); automatic: the panel's next one.
enum class Color { automatic, blue, vermillion, green, purple, orange, sky, black, grey };
enum class Dash { solid, dashed, dotted, dash_dotted };
enum class Marker { dot, circle, open_circle, square, triangle, cross };
/// `above`: in one line above the panel, where it hides nothing.
enum class Legend { none, top_left, top_right, bottom_left, bottom_right, above };

/// How one series is drawn. Text may use gnuplot's marks: `z_3`, `z_{31}`, `10^{-3}`, UTF-8.
struct Style {
  std::string name = {};  ///< legend entry; empty: not in the legend
  Color color = Color::automatic;
  Dash dash = Dash::solid;
  double width = 1.6;  ///< of the line, in px
  Marker marker = Marker::dot;
  double size = 1.0;        ///< of the marker
  double opacity = 1.0;     ///< 0 to 1
  std::string column = {};  ///< name in the CSV; empty: made from the legend entry
};

/// From and to; a missing end is found from the data.
struct Range {
  std::optional<double> from = {};
  std::optional<double> to = {};
};

/// A zoom: axes of their own in a part of the panel, with the same series.
struct Inset {
  double left = 0.5;  ///< place and size of the inset's axes, as shares of the panel's
  double bottom = 0.5;
  double width = 0.4;
  double height = 0.4;
  Range x = {};         ///< what is shown, of x
  bool frame = true;    ///< draw the zoomed region in the panel
  bool connect = true;  ///< join that frame with the inset by thin lines
};

/// A column of numbers, made from any range of numbers (copied).
struct Column : std::vector<double> {
  using vector::vector;
  Column(std::vector<double> values) : vector(std::move(values)) {}
  template <class Values>
  requires requires(const Values& values) { static_cast<double>(*values.begin()); }
  Column(const Values& values) : vector(values.begin(), values.end()) {}
};

/// Points in drawing order; a NaN breaks the line.
struct Curve {
  std::vector<double> x, y;

  [[nodiscard]] std::size_t size() const { return x.size(); }
  void add(double x_value, double y_value);
};

/// One pair of axes. Things are drawn in the order in which they are added: noisy curves first.
class Panel {
 public:
  Panel& title(const std::string& text) { return set("title", text); }
  /// Axis labels; give the unit: "t (s)".
  Panel& x_label(const std::string& text) { return set("x_label", text); }
  Panel& y_label(const std::string& text) { return set("y_label", text); }
  /// Ends of the axes; without them x ends with the data, y at the next tick.
  Panel& x_range(double from, double to) { return set("x_range", Range{from, to}); }
  Panel& y_range(double from, double to) { return set("y_range", Range{from, to}); }
  Panel& y_range(const Range& range) { return set("y_range", range); }
  Panel& x_tick(double distance) { return set("x_tick", Range{distance}); }
  Panel& y_tick(double distance) { return set("y_tick", Range{distance}); }
  Panel& log_x() { return set("x_log", "1"); }
  Panel& log_y() { return set("y_log", "1"); }
  /// No numbers at the x axis, for a panel above one with the same axis.
  Panel& hide_x_numbers() { return set("x_hidden", "1"); }
  Panel& legend(Legend place);
  /// Name of the panel in the figure's data file.
  Panel& name(const std::string& text);

  /// A line through the points; x may go back and forth (a path). NaN breaks it.
  Panel& line(const Column& x, const Column& y, Style style = {});
  Panel& line(const Curve& curve, const Style& style = {}) { return line(curve.x, curve.y, style); }
  /// Markers at the points.
  Panel& points(const Column& x, const Column& y, Style style = {});
  /// A filled band, e.g. mean plus and minus the standard deviation.
  Panel& band(const Column& x, const Column& low, const Column& high, Style style = {});
  /// A reference line across the panel.
  Panel& horizontal_line(double y,
                         const Style& style = {.color = Color::grey, .dash = Dash::dashed});
  Panel& vertical_line(double x, const Style& style = {.color = Color::grey, .dash = Dash::dashed});
  /// Text in the panel at the point (x, y).
  Panel& note(double x, double y, const std::string& text);
  Panel& inset(const Inset& inset);
  /// A colour map under everything else, from blue (-most) over white (0) to red; z holds a row of
  /// x values for each y, z[j * x.size() + i] = z(x[i], y[j]). x and y rise in equal steps.
  Panel& map(const Column& x, const Column& y, const Column& z, double most, Style style);
  /// The line where such a z is 0.
  Panel& contour(const Column& x, const Column& y, const Column& z, Style style);

 private:
  friend class Figure;

  /// `more` is the upper edge of a band, or z.
  struct Series {
    Curve curve;
    Column more;
    std::string column;
  };

  Panel& set(const char* key, const std::string& value);
  Panel& set(const char* key, const Range& range);
  Panel& draw(const char* kind, const Style& style, double at);
  Panel& add(const char* kind, Style style, Series series, double at = 0.0);

  std::string name_;
  std::string description_;  ///< what draw_figure.py reads
  std::vector<Series> series_;
  std::vector<Range> zooms_;
  std::size_t row_ = 0, column_ = 0, colors_ = 0;
};

/// The grid of a figure.
struct Grid {
  std::size_t rows = 1;
  std::size_t columns = 1;
  double panel_height = 190.0;  ///< of a panel's axes, px; the figure is 900 px wide
};

/// A figure as draw_figure.py reads it: how it looks, and its numbers, thinned to what is seen.
struct FigureText {
  std::string description;
  std::string numbers;
};

/// Panels in a grid.
class Figure {
 public:
  explicit Figure(std::string name, Grid grid = {});
  Figure(const Figure&);
  Figure(Figure&&) noexcept;
  ~Figure();

  /// Heading above all panels.
  Figure& title(std::string text);
  /// Text below the figure on the page, and for readers who cannot see it; plain text.
  Figure& caption(std::string text);

  /// The panel at a place of the grid, counted from 0 at the top left; made when first asked for.
  Panel& panel(std::size_t row, std::size_t column, std::size_t row_span = 1,
               std::size_t column_span = 1);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const Grid& grid() const { return grid_; }
  [[nodiscard]] const std::string& caption() const { return caption_; }

  /// @return none if columns have no or different lengths; stderr says which
  [[nodiscard]] std::optional<FigureText> text(const std::string& folder,
                                               const std::string& formats) const;

  /// Writes NAME.csv, the numbers, and draws NAME.png and NAME.svg by a script NAME.gp. False if
  /// that failed; stderr says why.
  /// @param formats "svg" alone takes a third of the time
  [[nodiscard]] bool write(const std::string& folder, const std::string& formats = "svg png") const;

 private:
  std::string name_, title_, caption_;
  Grid grid_;
  std::deque<Panel> panels_;  // a deque, as panel() hands out references
};

}  // namespace esokit::examples
