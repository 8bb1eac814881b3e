/// @file
/// A figure as in a journal, drawn by gnuplot: PNG, SVG, its numbers as CSV, and the script.
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

#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "csv.hpp"
#include "figure_data.hpp"
#include "figure_layout.hpp"
#include "figure_script.hpp"
#include "gnuplot.hpp"
#include "panel.hpp"

namespace esokit::examples {

/// Panels in a grid. `write` makes NAME.png, NAME.svg, NAME_*.csv and NAME.gp with its NAME.dat.
class Figure {
 public:
  explicit Figure(std::string name, Grid grid = {})
      : name_(std::move(name)), grid_(std::move(grid)) {}

  /// Heading above all panels.
  Figure& title(std::string text) {
    title_ = std::move(text);
    return *this;
  }
  /// Text below the figure on the page; plain text.
  Figure& caption(std::string text) {
    caption_ = std::move(text);
    return *this;
  }
  /// What is to be seen, for readers who cannot see it; the caption if not given.
  Figure& alt(std::string text) {
    alt_ = std::move(text);
    return *this;
  }

  /// The panel at a place of the grid, counted from 0 at the top left; made when first asked for.
  Panel& panel(std::size_t row, std::size_t column, std::size_t row_span = 1,
               std::size_t column_span = 1) {
    for (Panel& panel : panels_) {
      if (panel.row_ == row && panel.column_ == column) return panel;
    }
    if (row + row_span > grid_.rows || column + column_span > grid_.columns) {
      std::fprintf(stderr, "figure %s: no panel at row %zu, column %zu\n", name_.c_str(), row,
                   column);
      std::abort();
    }
    Panel& panel = panels_.emplace_back();
    panel.row_ = row;
    panel.column_ = column;
    panel.row_span_ = row_span;
    panel.column_span_ = column_span;
    panel.name("r" + std::to_string(row + 1) + "c" + std::to_string(column + 1));
    return panel;
  }

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const std::string& caption() const { return caption_; }
  [[nodiscard]] const std::string& alt() const { return alt_.empty() ? caption_ : alt_; }

  /// Writes and draws everything into the folder; returns what went wrong.
  [[nodiscard]] std::optional<std::string> write(const std::filesystem::path& folder) const {
    if (auto error = find_mistake()) return "figure " + name_ + ": " + *error;
    const auto file = [&](const char* extension) { return folder / (name_ + extension); };
    for (const char* extension : {".png", ".svg"}) {
      std::error_code ignored;
      std::filesystem::remove(file(extension), ignored);
    }
    const std::vector<Panel> panels(panels_.begin(), panels_.end());
    for (const Panel& panel : panels) {
      if (auto error = FigureData::publish(panel, folder / (name_ + "_" + panel.name_))) {
        return error;
      }
    }
    FigureData data;
    const FigureScript script(name_, title_, grid_, panels, data);
    if (auto error = write_text(file(".dat"), data.text())) return error;
    if (auto error = write_text(file(".gp"), script.text())) return error;
    if (auto error = detail::run_gnuplot(file(".gp"))) return error;
    for (const char* extension : {".png", ".svg"}) {
      std::error_code unreadable;
      const auto size = std::filesystem::file_size(file(extension), unreadable);
      if (unreadable || size == 0) return "gnuplot did not write " + file(extension).string();
    }
    return offer_other_fonts(file(".svg"));
  }

 private:
  /// What gnuplot would stumble over, or draw as something else.
  [[nodiscard]] std::optional<std::string> find_mistake() const {
    if (panels_.empty()) return "has no panel";
    for (const Panel& panel : panels_) {
      const std::string where = "panel " + panel.name_ + ": ";
      if (panel.series_.empty() && !panel.map_ && panel.references_.empty()) {
        return where + "nothing to draw";
      }
      for (const auto& series : panel.series_) {
        const bool band = series.kind == Panel::Series::Kind::band;
        if (series.x.size() != series.y.size() || (band && series.x.size() != series.high.size())) {
          return where + "series '" + series.style.name + "' has columns of different lengths";
        }
        if (series.x.empty()) return where + "series '" + series.style.name + "' is empty";
      }
      if (!panel.map_) continue;
      const auto& map = *panel.map_;
      if (map.x.size() < 2 || map.y.size() < 2 || map.z.size() != map.x.size() * map.y.size()) {
        return where + "the map needs two or more x and y and a z for each pair";
      }
      if (!evenly_spaced(map.x) || !evenly_spaced(map.y)) {
        return where + "the map's x and y must rise in equal steps";
      }
      if (panel.log_x_ || panel.log_y_) return where + "a map has no logarithmic axes";
    }
    return std::nullopt;
  }

  static bool evenly_spaced(const std::vector<double>& nodes) {
    const double step = (nodes.back() - nodes.front()) / static_cast<double>(nodes.size() - 1);
    for (std::size_t i = 1; i < nodes.size(); ++i) {
      if (!(std::abs(nodes[i] - nodes[i - 1] - step) <= 1e-6 * step)) return false;
    }
    return true;
  }

  /// An SVG holds text, not shapes: name fonts of about the same width for readers without DejaVu.
  static std::optional<std::string> offer_other_fonts(const std::filesystem::path& svg) {
    auto text = read_text(svg);
    if (!text) return "cannot read " + svg.string();
    const std::string plain = "font-family=\"DejaVu Sans\"";
    const std::string offered = "font-family=\"DejaVu Sans, Verdana, Arial, sans-serif\"";
    for (auto at = text->find(plain); at != std::string::npos;
         at = text->find(plain, at + offered.size())) {
      text->replace(at, plain.size(), offered);
    }
    return write_text(svg, *text);
  }

  std::string name_, title_, caption_, alt_;
  Grid grid_;
  std::deque<Panel> panels_;  // a deque, as panel() hands out references
};

}  // namespace esokit::examples
