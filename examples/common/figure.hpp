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

#include <cstddef>
#include <deque>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "panel.hpp"

namespace esokit::examples {

/// Size and grid of a figure.
struct Grid {
  std::size_t rows = 1;
  std::size_t columns = 1;
  double width = 900.0;                     ///< of the whole figure, px
  double panel_height = 190.0;              ///< of a panel's axes, px, where the row's weight is 1
  std::vector<double> row_weights = {};     ///< heights relative to panel_height; empty: all 1
  std::vector<double> column_weights = {};  ///< shares of the width; empty: all equal
};

/// Panels in a grid. `write` makes NAME.png, NAME.svg, NAME.csv and NAME.gp with its NAME.dat.
class Figure {
 public:
  explicit Figure(std::string name, Grid grid = {});
  Figure(Figure&&) noexcept;
  ~Figure();

  /// Heading above all panels.
  Figure& title(std::string text);
  /// Text below the figure on the page; plain text.
  Figure& caption(std::string text);
  /// What is to be seen, for readers who cannot see it; the caption if not given.
  Figure& alt(std::string text);

  /// The panel at a place of the grid, counted from 0 at the top left; made when first asked for.
  Panel& panel(std::size_t row, std::size_t column, std::size_t row_span = 1,
               std::size_t column_span = 1);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const Grid& grid() const { return grid_; }
  [[nodiscard]] const std::string& caption() const { return caption_; }
  [[nodiscard]] const std::string& alt() const { return alt_.empty() ? caption_ : alt_; }

  /// Writes and draws everything into the folder; returns what went wrong.
  [[nodiscard]] std::optional<std::string> write(const std::filesystem::path& folder) const;

 private:
  [[nodiscard]] std::optional<std::string> find_mistake() const;

  std::string name_, title_, caption_, alt_;
  Grid grid_;
  std::deque<Panel> panels_;  // a deque, as panel() hands out references
};

}  // namespace esokit::examples
