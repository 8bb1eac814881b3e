/// @file
/// Writes a figure as a gnuplot script that a user can read and edit.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "csv.hpp"
#include "curve.hpp"
#include "figure_data.hpp"
#include "figure_layout.hpp"
#include "gnuplot.hpp"
#include "panel.hpp"
#include "plot_style.hpp"

namespace esokit::examples {

namespace detail {

[[nodiscard]] inline std::string color_hex(Color color) {
  switch (color) {
    case Color::blue:
      return "0072B2";
    case Color::vermillion:
      return "D55E00";
    case Color::green:
      return "009E73";
    case Color::purple:
      return "CC79A7";
    case Color::orange:
      return "E69F00";
    case Color::sky:
      return "56B4E9";
    case Color::grey:
      return "808080";
    case Color::automatic:
    case Color::black:
      break;
  }
  return "000000";
}

[[nodiscard]] inline std::string dash_text(Dash dash) {
  switch (dash) {
    case Dash::dashed:
      return "(9,4)";
    case Dash::dotted:
      return "(2,3)";
    case Dash::dash_dotted:
      return "(10,3,2,3)";
    case Dash::solid:
      break;
  }
  return "1";
}

[[nodiscard]] inline int marker_number(Marker marker) {
  switch (marker) {
    case Marker::open_circle:
      return 6;
    case Marker::square:
      return 5;
    case Marker::triangle:
      return 9;
    case Marker::cross:
      return 2;
    case Marker::dot:
    case Marker::circle:
      break;
  }
  return 7;
}

}  // namespace detail

/// The script's text; the curves that it draws go to a FigureData.
class FigureScript {
 public:
  FigureScript(const std::string& name, const std::string& title, const Grid& grid,
               const std::vector<Panel>& panels, FigureData& data)
      : data_file_(detail::gnuplot_quoted(name + ".dat")), data_(data) {
    std::size_t drawn = 0;
    std::vector<detail::Cell> cells;
    for (const Panel& panel : panels) {
      cells.push_back(cell(panel));
      drawn += panel.series_.size() * (1 + panel.insets_.size());
    }
    // About 14 bytes of SVG a point: this keeps a figure below 500 kB.
    most_points_ = std::clamp<std::size_t>(26'000 / std::max<std::size_t>(drawn, 1), 300, 4'000);
    layout_.emplace_back(grid, cells, title.empty() ? 0.0 : 28.0);

    begin(name, title);
    for (std::size_t i = 0; i < panels.size(); ++i) {
      const detail::Box box = layout_[0].box(cells[i]);
      add_panel(panels[i], box);
      for (const Inset& inset : panels[i].insets_) add_inset(panels[i], inset, box);
    }
    text_ += "unset multiplot\nset output\n}\n";
  }

  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  static std::string number(double value) { return number_text(value, 6); }
  static std::string quoted(const std::string& text) { return detail::gnuplot_quoted(text); }

  void put(std::initializer_list<std::string_view> parts) {
    for (const std::string_view part : parts) text_ += part;
    text_ += '\n';
  }

  std::string screen_x(double px) const { return number(px / layout_[0].width()); }
  std::string screen_y(double px) const { return number(px / layout_[0].height()); }

  static detail::Cell cell(const Panel& panel) {
    detail::Cell cell{panel.row_, panel.column_, panel.row_span_, panel.column_span_, {}};
    cell.margins.left = panel.y_label_.empty() ? 50.0 : 74.0;
    cell.margins.right = panel.map_ ? (panel.map_->style.label.empty() ? 76.0 : 98.0) : 18.0;
    cell.margins.top = 10.0 + (panel.title_.empty() ? 0.0 : 20.0) +
                       (panel.legend_ == Legend::above && has_legend(panel) ? 20.0 : 0.0);
    cell.margins.bottom = panel.hide_x_numbers_ ? 8.0 : (panel.x_label_.empty() ? 28.0 : 48.0);
    return cell;
  }

  static bool has_legend(const Panel& panel) {
    const auto named = [](const auto& item) { return !item.style.name.empty(); };
    return panel.legend_ != Legend::none &&
           (std::any_of(panel.series_.begin(), panel.series_.end(), named) ||
            std::any_of(panel.references_.begin(), panel.references_.end(), named));
  }

  void begin(const std::string& name, const std::string& title) {
    const std::string width = number(layout_[0].width());
    const std::string height = number(std::ceil(layout_[0].height()));
    put(
        {"# Written by an example of esokit. To change the figure, edit this and run in this "
         "folder:\n#   gnuplot ",
         name, ".gp"});
    put({"W = ", width, "; H = ", height});
    put({"set encoding utf8"});
    put({"do for [format in 'svg png'] {"});
    put({"if (format eq 'svg') {"});
    put(
        {"  set terminal svg size W,H dynamic enhanced font 'DejaVu Sans,12' background "
         "'#ffffff'"});
    put({"} else {"});
    put(
        {"  set terminal pngcairo size 2*W,2*H enhanced font 'DejaVu Sans,12' fontscale 1.5 \\\n"
         "    linewidth 2 pointscale 2 dashlength 2 background '#ffffff'"});
    put({"}"});
    put({"set output '", name, ".'.format"});
    put({"reset"});
    put({"set multiplot"});
    put({"set minussign"});
    put({"set clip one; set clip two"});
    put({"set border 15 linewidth 0.8 linecolor rgb '#404040'"});
    put({"set grid linetype 1 linecolor rgb '#dedede' linewidth 0.6"});
    if (!title.empty()) {
      put({"set label 1 ", quoted(title), " at screen 0.5,", screen_y(layout_[0].height() - 16.0),
           " center font ',14'"});
    }
  }

  // ---- axes ----

  void place(const detail::Box& box) {
    put({"set lmargin at screen ", screen_x(box.left), "; set rmargin at screen ",
         screen_x(box.right)});
    put({"set bmargin at screen ", screen_y(box.bottom), "; set tmargin at screen ",
         screen_y(box.top)});
  }

  static std::string range_text(const Range& range) {
    const auto end = [](const std::optional<double>& value) {
      return value ? number_text(*value, 12) : std::string("*");
    };
    return "[" + end(range.from) + ":" + end(range.to) + "]";
  }

  /// `font` is the size of the numbers, `shift` moves them nearer to the axis.
  void axis(const std::string& which, const std::string& label, const Range& range, bool log,
            const std::optional<double>& tick, std::string_view font = "11",
            std::string_view shift = "0,0") {
    put({"set ", which, "label ", quoted(label), which == "x" ? " offset 0,0.3" : ""});
    // The scale first: a change of scale drops the end of a range that it cannot show.
    put({log ? "set" : "unset", " logscale ", which});
    put({"set ", which, "range ", range_text(range)});
    put({"set format ", which, log ? " '10^{%L}'" : " '%h'"});
    put({"set ", which, "tics in scale 0.6,0.3 mirror ", tick ? number(*tick) : "autofreq",
         " offset ", shift, " font ',", font, "' textcolor rgb '#202020'"});
  }

  void legend(const Panel& panel, const detail::Box& box) {
    if (!has_legend(panel)) {
      put({"unset key"});
      return;
    }
    std::string where;
    switch (panel.legend_) {
      case Legend::top_left:
        where = "inside left top vertical Left reverse";
        break;
      case Legend::bottom_left:
        where = "inside left bottom vertical Left reverse";
        break;
      case Legend::bottom_right:
        where = "inside right bottom vertical Left reverse";
        break;
      case Legend::top_center:
        where = "inside center top horizontal Left reverse";
        break;
      case Legend::bottom_center:
        where = "inside center bottom horizontal Left reverse";
        break;
      case Legend::above:
        where = "at screen " + number((box.left + box.right) / 2.0 / layout_[0].width()) + "," +
                screen_y(box.top + 15.0) + " center center horizontal maxrows 1 Left reverse";
        break;
      case Legend::top_right:
      case Legend::none:
        where = "inside right top vertical Left reverse";
        break;
    }
    const std::string_view rows = panel.legend_ == Legend::above ? "" : " maxrows auto";
    const std::string_view background =
        panel.legend_ == Legend::above ? "" : " opaque fillcolor rgb '#ffffff'";
    put({"set key ", where, rows, " samplen 2.2 spacing 1.15 font ',11'", background});
  }

  /// The panel's ranges; with equal axes widened until they fill the box.
  static std::pair<Range, Range> ranges(const Panel& panel, const detail::Box& box) {
    if (!panel.equal_axes_) return {panel.x_range_, panel.y_range_};
    const auto data = [&panel](auto member, const Range& wish) {
      detail::Extent extent;
      for (const auto& series : panel.series_) extent.add(series.*member);
      const double spare = 0.04 * extent.span();
      return Range{wish.from.value_or(extent.from - spare), wish.to.value_or(extent.to + spare)};
    };
    Range x = data(&Panel::Series::x, panel.x_range_);
    Range y = data(&Panel::Series::y, panel.y_range_);
    const auto widen = [](Range& range, double factor) {
      const double more = (factor - 1.0) * (*range.to - *range.from) / 2.0;
      range = {*range.from - more, *range.to + more};
    };
    const double unit_x = box.width() / (*x.to - *x.from);
    const double unit_y = box.height() / (*y.to - *y.from);
    if (unit_x > unit_y) widen(x, unit_x / unit_y);
    if (unit_y > unit_x) widen(y, unit_y / unit_x);
    return {x, y};
  }

  /// 1, 2 or 5 times a power of ten, near to `step`.
  static double round_step(double step) {
    const double power = std::pow(10.0, std::floor(std::log10(step)));
    const double digit = step / power;
    return power * (digit < 1.5 ? 1.0 : digit < 3.5 ? 2.0 : digit < 7.5 ? 5.0 : 10.0);
  }

  // ---- what is drawn ----

  static std::string line_text(const Style& style) {
    const int transparency =
        static_cast<int>(std::lround(255.0 * (1.0 - std::clamp(style.opacity, 0.0, 1.0))));
    constexpr std::string_view digits = "0123456789ABCDEF";
    std::string color = "#";
    if (transparency > 0) {
      color += digits[static_cast<std::size_t>(transparency / 16)];
      color += digits[static_cast<std::size_t>(transparency % 16)];
    }
    color += detail::color_hex(style.color);
    return "linecolor rgb '" + color + "'";
  }

  static std::string title_text(const Style& style, bool with_title) {
    return with_title && !style.name.empty() ? "title " + quoted(style.name) : "notitle";
  }

  std::string series_text(const Panel::Series& series, const detail::Extent* x_window,
                          const detail::Extent* y_window) {
    using Kind = Panel::Series::Kind;
    const bool with_title = x_window == nullptr;
    const auto shown = [&](const std::vector<double>& y) {
      Curve curve{series.x, y};
      if (x_window != nullptr) curve = detail::cut(curve, *x_window, *y_window);
      return curve;
    };
    const Style& style = series.style;
    std::string text;
    const auto block = [&](std::size_t index) {
      return data_file_ + " index " + std::to_string(index) + " using ";
    };
    if (series.kind == Kind::band) {
      // Both edges take the same rows, so plain every-k-th thinning; bands are smooth.
      Curve low{series.x, series.y};
      Curve high{series.x, series.high};
      const std::size_t step = std::max<std::size_t>(1, low.size() / most_points_);
      Curve thin_low;
      Curve thin_high;
      for (std::size_t i = 0; i < low.size(); i += step) {
        thin_low.add(low.x[i], low.y[i]);
        thin_high.add(high.x[i], high.y[i]);
      }
      Style fill = style;
      fill.opacity = style.opacity < 1.0 ? style.opacity : 0.25;
      return block(data_.add_band(thin_low, thin_high)) + "1:2:3 with filledcurves " +
             line_text(fill) + " fillstyle solid noborder " + title_text(style, with_title);
    }
    if (series.kind == Kind::points) {
      Curve curve = shown(series.y);
      if (curve.size() > most_points_) curve = detail::thin(curve, most_points_);
      const double size = style.size * (style.marker == Marker::dot ? 0.45 : 0.75);
      return block(data_.add(curve)) + "1:2 with points pointtype " +
             std::to_string(detail::marker_number(style.marker)) + " pointsize " + number(size) +
             " linewidth " + number(style.width * 0.75) + " " + line_text(style) + " " +
             title_text(style, with_title);
    }
    const std::size_t index = data_.add(detail::thin(shown(series.y), most_points_));
    return block(index) + "1:2 with lines linewidth " + number(style.width) + " dashtype " +
           detail::dash_text(style.dash) + " " + line_text(style) + " " +
           title_text(style, with_title);
  }

  static std::string reference_text(const Panel::Reference& line, bool with_title) {
    return number_text(line.at, 12) + " with lines linewidth " + number(line.style.width * 0.75) +
           " dashtype " + detail::dash_text(line.style.dash) + " " + line_text(line.style) + " " +
           title_text(line.style, with_title);
  }

  void vertical_references(const Panel& panel) {
    for (const auto& line : panel.references_) {
      if (line.horizontal) continue;
      const std::string x = number_text(line.at, 12);
      put({"set arrow from first ", x, ",graph 0 to first ", x, ",graph 1 nohead linewidth ",
           number(line.style.width * 0.75), " dashtype ", detail::dash_text(line.style.dash), " ",
           line_text(line.style)});
    }
  }

  void plot(const std::vector<std::string>& items) {
    text_ += "plot \\\n  ";
    for (std::size_t i = 0; i < items.size(); ++i) {
      if (i > 0) text_ += ", \\\n  ";
      text_ += items[i];
    }
    text_ += "\n";
  }

  std::vector<std::string> items_of(const Panel& panel, const detail::Extent* x_window,
                                    const detail::Extent* y_window) {
    std::vector<std::string> items;
    for (const auto& line : panel.references_) {
      if (line.horizontal) items.push_back(reference_text(line, x_window == nullptr));
    }
    for (const auto& series : panel.series_) {
      items.push_back(series_text(series, x_window, y_window));
    }
    return items;
  }

  void clear() {
    put({"unset arrow; unset object"});
    put({"unset label; unset title; unset colorbox"});
  }

  void add_panel(const Panel& panel, const detail::Box& box) {
    put({"\n# panel: row ", std::to_string(panel.row_ + 1), ", column ",
         std::to_string(panel.column_ + 1)});
    place(box);
    put({"set autoscale xfix"});
    const auto [x_range, y_range] = ranges(panel, box);
    axis("x", panel.hide_x_numbers_ ? "" : panel.x_label_, x_range, panel.log_x_, panel.x_tick_);
    axis("y", panel.y_label_, y_range, panel.log_y_, panel.y_tick_);
    if (panel.hide_x_numbers_) put({"set format x ''"});
    legend(panel, box);
    if (!panel.title_.empty()) {
      const bool raised = panel.legend_ == Legend::above && has_legend(panel);
      put({"set label ", quoted(panel.title_), " at screen ",
           screen_x((box.left + box.right) / 2.0), ",", screen_y(box.top + (raised ? 32.0 : 12.0)),
           " center font ',12'"});
    }
    for (const auto& note : panel.notes_) {
      put({"set label ", quoted(note.text), " at first ", number_text(note.x, 12), ",",
           number_text(note.y, 12), " front font ',11'"});
    }
    vertical_references(panel);
    for (const Inset& inset : panel.insets_) mark(panel, inset, box);

    std::vector<std::string> items;
    if (panel.map_) {
      put({"set autoscale yfix"});
      items.push_back(map_text(*panel.map_, box));
    }
    for (std::string& item : items_of(panel, nullptr, nullptr)) items.push_back(std::move(item));
    // The grid would shine through a map.
    if (panel.map_) put({"unset grid"});
    plot(items);
    if (panel.map_) put({"set grid; set autoscale y"});
    clear();
  }

  // ---- colour maps ----

  std::string map_text(const Panel::Map& map, const detail::Box& box) {
    const MapStyle& style = map.style;
    Range range = style.range;
    detail::Extent extent;
    extent.add(map.z);
    if (style.symmetric && !extent.empty()) {
      const double most = range.to.value_or(std::max(std::abs(extent.from), std::abs(extent.to)));
      range = {-most, most};
    }
    put({style.palette == Palette::diverging
             ? "set palette defined (0 '#2166AC', 0.25 '#92C5DE', 0.5 '#F7F7F7', 0.75 '#F4A582', "
               "1 '#B2182B')"
             : "set palette defined (0 '#440154', 0.25 '#3B528B', 0.5 '#21918C', 0.75 '#5EC962', "
               "1 '#FDE725')"});
    put({"set cbrange ", range_text(range)});
    put({"set cblabel ", quoted(style.label), " offset 1.4,0"});
    put(
        {"set cbtics in scale 0.5 autofreq font ',11' textcolor rgb '#202020'; set format cb "
         "'%h'"});
    put({"set colorbox vertical user origin screen ", screen_x(box.right + 12.0), ",",
         screen_y(box.bottom), " size screen ", number(13.0 / layout_[0].width()), ",",
         number(box.height() / layout_[0].height())});

    std::size_t index = 0;
    if (style.smooth && map.x.size() > 1 && map.y.size() > 1) {
      const auto finer = [](const std::vector<double>& nodes) {
        const std::size_t parts = (240 + nodes.size() - 2) / (nodes.size() - 1);
        std::vector<double> result;
        for (std::size_t i = 0; i + 1 < nodes.size(); ++i) {
          for (std::size_t k = 0; k < parts; ++k) {
            const double share = static_cast<double>(k) / static_cast<double>(parts);
            result.push_back(nodes[i] + share * (nodes[i + 1] - nodes[i]));
          }
        }
        result.push_back(nodes.back());
        return std::pair(result, parts);
      };
      const auto [x, x_parts] = finer(map.x);
      const auto [y, y_parts] = finer(map.y);
      std::vector<double> z;
      z.reserve(x.size() * y.size());
      const std::size_t columns = map.x.size();
      for (std::size_t j = 0; j < y.size(); ++j) {
        const std::size_t row = std::min(j / y_parts, map.y.size() - 2);
        const double v = static_cast<double>(j - row * y_parts) / static_cast<double>(y_parts);
        for (std::size_t i = 0; i < x.size(); ++i) {
          const std::size_t column = std::min(i / x_parts, columns - 2);
          const double u = static_cast<double>(i - column * x_parts) / static_cast<double>(x_parts);
          const double* corner = &map.z[row * columns + column];
          z.push_back((1.0 - v) * ((1.0 - u) * corner[0] + u * corner[1]) +
                      v * ((1.0 - u) * corner[columns] + u * corner[columns + 1]));
        }
      }
      index = data_.add_map(x, y, z);
    } else {
      index = data_.add_map(map.x, map.y, map.z);
    }
    return data_file_ + " index " + std::to_string(index) + " using 1:2:3 with image notitle";
  }

  // ---- insets ----

  /// Letters of the longest number beside an axis.
  static std::size_t longest_number(const detail::Extent& range,
                                    const std::optional<double>& tick) {
    if (!tick || range.span() / *tick > 100.0) return 5;
    std::size_t longest = 0;
    for (double k = std::ceil(range.from / *tick); k * *tick <= range.to; k += 1.0) {
      longest = std::max(longest, number(k * *tick).size());
    }
    return longest;
  }

  /// The inset's window with both ends of both axes.
  static std::pair<detail::Extent, detail::Extent> window(const Panel& panel, const Inset& inset) {
    detail::Extent data_x;
    for (const auto& series : panel.series_) data_x.add(series.x);
    detail::Extent x;
    x.from = inset.x.from.value_or(data_x.from);
    x.to = inset.x.to.value_or(data_x.to);
    detail::Extent data_y;
    for (const auto& series : panel.series_) {
      for (std::size_t i = 0; i < series.x.size(); ++i) {
        if (series.x[i] >= x.from && series.x[i] <= x.to) data_y.add(series.y[i]);
      }
    }
    const double spare = data_y.empty() ? 0.0 : 0.06 * std::max(data_y.span(), 1e-12);
    detail::Extent y;
    y.from = inset.y.from.value_or(data_y.from - spare);
    y.to = inset.y.to.value_or(data_y.to + spare);
    return {x, y};
  }

  static detail::Box inset_box(const Inset& inset, const detail::Box& panel) {
    const double left = panel.left + inset.left * panel.width();
    const double bottom = panel.bottom + inset.bottom * panel.height();
    return {left, bottom, left + inset.width * panel.width(),
            bottom + inset.height * panel.height()};
  }

  /// The frame around what the inset shows, and the lines that join the two.
  void mark(const Panel& panel, const Inset& inset, const detail::Box& box) {
    if (!inset.frame) return;
    const std::pair<detail::Extent, detail::Extent> shown = window(panel, inset);
    const auto& x = shown.first;
    const auto& y = shown.second;
    if (x.empty() || y.empty()) return;
    const std::string thin = " linewidth 0.8 ";
    put({"set object rectangle from first ", number_text(x.from, 12), ",", number_text(y.from, 12),
         " to first ", number_text(x.to, 12), ",", number_text(y.to, 12),
         " front clip fillstyle empty border rgb '#606060'", thin});
    if (!inset.connect) return;

    // Where the frame lies, about: gnuplot extends the axes to the next tick.
    detail::Extent all_x;
    detail::Extent all_y;
    for (const auto& series : panel.series_) {
      all_x.add(series.x);
      all_y.add(series.y);
    }
    const std::pair<Range, Range> axes = ranges(panel, box);
    const auto share = [](double value, const Range& range, const detail::Extent& data, bool log) {
      double from = range.from.value_or(data.from);
      double to = range.to.value_or(data.to);
      if (log) {
        from = std::log(from);
        to = std::log(to);
        value = std::log(value);
      }
      return (value - from) / (to - from);
    };
    const auto pixel_x = [&](double value) {
      return box.left + box.width() * share(value, axes.first, all_x, panel.log_x_);
    };
    const auto pixel_y = [&](double value) {
      return box.bottom + box.height() * share(value, axes.second, all_y, panel.log_y_);
    };
    const detail::Box frame{pixel_x(x.from), pixel_y(y.from), pixel_x(x.to), pixel_y(y.to)};
    const detail::Box zoom = inset_box(inset, box);
    // Two opposite corners whose lines cross neither rectangle.
    const bool left = frame.left < zoom.left;
    const bool right = frame.right < zoom.right;
    const bool bottom = frame.bottom < zoom.bottom;
    const bool top = frame.top < zoom.top;
    const auto connect = [&](bool at_right, bool at_top) {
      put({"set arrow from first ", number_text(at_right ? x.to : x.from, 12), ",",
           number_text(at_top ? y.to : y.from, 12), " to screen ",
           screen_x(at_right ? zoom.right : zoom.left), ",",
           screen_y(at_top ? zoom.top : zoom.bottom), " nohead front linecolor rgb '#909090'",
           thin});
    };
    if (left != bottom) connect(false, false);
    if (left == top) connect(false, true);
    if (right == bottom) connect(true, false);
    if (right != top) connect(true, true);
  }

  void add_inset(const Panel& panel, const Inset& inset, const detail::Box& box) {
    const auto [x, y] = window(panel, inset);
    if (x.empty() || y.empty()) return;
    const detail::Box zoom = inset_box(inset, box);
    put({"\n# zoom"});
    place(zoom);
    const auto tick = [](const std::optional<double>& wish, const detail::Extent& range, bool log) {
      return wish || log ? wish : std::optional(round_step(range.span() / 3.5));
    };
    const auto x_tick = tick(inset.x_tick, x, panel.log_x_);
    const auto y_tick = tick(inset.y_tick, y, panel.log_y_);
    // White behind the inset's numbers, but not over the panel's border.
    const double numbers = 12.0 + 5.8 * static_cast<double>(longest_number(y, y_tick));
    put({"set object rectangle from screen ",
         screen_x(std::max(zoom.left - numbers, box.left + 1.0)), ",",
         screen_y(std::max(zoom.bottom - 17.0, box.bottom + 1.0)), " to screen ",
         screen_x(std::min(zoom.right + 9.0, box.right - 1.0)), ",",
         screen_y(std::min(zoom.top + 6.0, box.top - 1.0)),
         " behind fillcolor rgb '#ffffff' fillstyle solid noborder"});
    axis("x", "", {x.from, x.to}, panel.log_x_, x_tick, "9", "0,0.35");
    axis("y", "", {y.from, y.to}, panel.log_y_, y_tick, "9", "0.6,0");
    put({"unset key"});
    vertical_references(panel);
    plot(items_of(panel, &x, &y));
    clear();
  }

  std::string data_file_;
  FigureData& data_;
  std::vector<detail::Layout> layout_;
  std::size_t most_points_ = 4'000;
  std::string text_;
};

}  // namespace esokit::examples
