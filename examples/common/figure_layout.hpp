/// @file
/// Where the panels of a figure are, in px from its lower left corner.
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

#include "figure.hpp"

namespace esokit::examples {

namespace detail {

struct Box {
  double left = 0.0, bottom = 0.0, right = 0.0, top = 0.0;
  [[nodiscard]] double width() const { return right - left; }
  [[nodiscard]] double height() const { return top - bottom; }
};

/// Room around a panel's axes for numbers and labels, px.
struct Margins {
  double left = 0.0, bottom = 0.0, right = 0.0, top = 0.0;
};

/// A panel's cells and needs.
struct Cell {
  std::size_t row = 0, column = 0, row_span = 1, column_span = 1;
  Margins margins;
};

/// Axes of one row share their top and bottom, axes of one column their left and right.
class Layout {
 public:
  Layout(const Grid& grid, const std::vector<Cell>& cells, double top_room)
      : left_(grid.columns, 0.0),
        right_(grid.columns, 0.0),
        top_(grid.rows, 0.0),
        bottom_(grid.rows, 0.0) {
    std::vector<double> before(grid.columns, 0.0);
    std::vector<double> after(grid.columns, 0.0);
    std::vector<double> above(grid.rows, 0.0);
    std::vector<double> below(grid.rows, 0.0);
    for (const Cell& cell : cells) {
      const auto widen = [](double& room, double need) { room = std::max(room, need); };
      widen(before[cell.column], cell.margins.left);
      widen(after[cell.column + cell.column_span - 1], cell.margins.right);
      widen(above[cell.row], cell.margins.top);
      widen(below[cell.row + cell.row_span - 1], cell.margins.bottom);
    }
    const auto sum = [](const std::vector<double>& values) {
      return std::accumulate(values.begin(), values.end(), 0.0);
    };
    const auto weight = [](const std::vector<double>& weights, std::size_t i) {
      return i < weights.size() ? weights[i] : 1.0;
    };

    width_ = grid.width;
    double column_weight_sum = 0.0;
    for (std::size_t i = 0; i < grid.columns; ++i) {
      column_weight_sum += weight(grid.column_weights, i);
    }
    const double unit = (width_ - sum(before) - sum(after)) / column_weight_sum;
    double x = 0.0;
    for (std::size_t i = 0; i < grid.columns; ++i) {
      left_[i] = x + before[i];
      right_[i] = left_[i] + unit * weight(grid.column_weights, i);
      x = right_[i] + after[i];
    }

    height_ = top_room + sum(above) + sum(below);
    for (std::size_t i = 0; i < grid.rows; ++i) {
      height_ += grid.panel_height * weight(grid.row_weights, i);
    }
    double y = height_ - top_room;
    for (std::size_t i = 0; i < grid.rows; ++i) {
      top_[i] = y - above[i];
      bottom_[i] = top_[i] - grid.panel_height * weight(grid.row_weights, i);
      y = bottom_[i] - below[i];
    }
  }

  [[nodiscard]] double width() const { return width_; }
  [[nodiscard]] double height() const { return height_; }
  [[nodiscard]] Box box(const Cell& cell) const {
    return {left_[cell.column], bottom_[cell.row + cell.row_span - 1],
            right_[cell.column + cell.column_span - 1], top_[cell.row]};
  }

 private:
  double width_ = 0.0;
  double height_ = 0.0;
  std::vector<double> left_, right_, top_, bottom_;
};

}  // namespace detail
}  // namespace esokit::examples
