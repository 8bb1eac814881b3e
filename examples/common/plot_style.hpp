/// @file
/// How things look in a figure: colours, dashes, markers, legends, palettes.
#pragma once

#include <optional>
#include <string>

namespace esokit::examples {

/// Colours that colour-blind readers tell apart (Okabe and Ito).
enum class Color { automatic, blue, vermillion, green, purple, orange, sky, black, grey };

enum class Dash { solid, dashed, dotted, dash_dotted };

enum class Marker { dot, circle, open_circle, square, triangle, cross };

enum class Legend {
  none,
  top_left,
  top_right,
  bottom_left,
  bottom_right,
  top_center,
  bottom_center,
  above  ///< in one line above the panel, where it hides nothing
};

/// Diverging: blue, white, red, for numbers whose sign matters. Sequential: dark to bright.
enum class Palette { diverging, sequential };

/// How one series is drawn. Text may use gnuplot's marks: `z_3`, `z_{31}`, `10^{-3}`, UTF-8.
struct Style {
  std::string name = {};           ///< legend entry; empty: not in the legend
  Color color = Color::automatic;  ///< automatic: the next one of the panel
  Dash dash = Dash::solid;
  double width = 1.6;  ///< of the line, in px
  Marker marker = Marker::dot;
  double size = 1.0;        ///< of the marker
  double opacity = 1.0;     ///< 0 to 1
  std::string column = {};  ///< heading in the CSV; empty: made from the name
};

/// From and to; a missing end is found from the data.
struct Range {
  std::optional<double> from = {};
  std::optional<double> to = {};
};

/// A zoom: axes of their own in a part of the panel, with the same series.
struct Inset {
  double left = 0.5;  ///< left edge of the inset's axes, as a share of the panel's width
  double bottom = 0.5;
  double width = 0.4;
  double height = 0.4;
  Range x = {};  ///< what is shown; missing ends of y are found from the series inside x
  Range y = {};
  bool frame = true;                  ///< draw the zoomed region in the panel
  bool connect = true;                ///< join that frame with the inset by thin lines
  std::optional<double> x_tick = {};  ///< distance of the ticks
  std::optional<double> y_tick = {};
};

/// How a map z(x, y) is drawn.
struct MapStyle {
  std::string label = {};  ///< of the colour bar, with its unit
  Palette palette = Palette::sequential;
  Range range = {};          ///< of the colours; values beyond take the end colours
  bool symmetric = false;    ///< the colours centred on zero
  bool smooth = false;       ///< draw bilinear values between the computed points
  std::string column = "z";  ///< heading in the CSV
};

}  // namespace esokit::examples
