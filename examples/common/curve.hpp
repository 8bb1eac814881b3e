/// @file
/// Columns of numbers and what drawing does to them: cutting out a window, thinning that keeps what
/// the eye sees, and lines of equal value.
#pragma once

#include <concepts>
#include <cstddef>
#include <initializer_list>
#include <limits>
#include <ranges>
#include <type_traits>
#include <utility>
#include <vector>

namespace esokit::examples {

/// A column of numbers, made from any range of arithmetic values (copied).
class Column {
 public:
  Column() = default;
  Column(std::initializer_list<double> values) : values_(values) {}
  Column(std::vector<double> values) : values_(std::move(values)) {}

  template <std::ranges::input_range Values>
  requires(std::is_arithmetic_v<std::ranges::range_value_t<Values>> &&
           !std::same_as<std::remove_cvref_t<Values>, Column> &&
           !std::same_as<std::remove_cvref_t<Values>, std::vector<double>>)
      Column(const Values& values) {
    for (const auto value : values) values_.push_back(static_cast<double>(value));
  }

  [[nodiscard]] const std::vector<double>& values() const { return values_; }
  [[nodiscard]] std::vector<double> take() && { return std::move(values_); }

 private:
  std::vector<double> values_;
};

/// Points in drawing order; a NaN breaks the line.
struct Curve {
  std::vector<double> x;
  std::vector<double> y;

  [[nodiscard]] std::size_t size() const { return x.size(); }
  void add(double x_value, double y_value);
  void add_break();
};

/// The line z(x, y) = level, with breaks between its parts. `z` holds a row of x values for each y,
/// z[j * x.size() + i] = z(x[i], y[j]). Cells with a NaN corner are left out.
[[nodiscard]] Curve contour(const std::vector<double>& x, const std::vector<double>& y,
                            const std::vector<double>& z, double level);

namespace detail {

/// Least and greatest finite value.
struct Extent {
  double from = std::numeric_limits<double>::infinity();
  double to = -std::numeric_limits<double>::infinity();

  void add(double value);
  void add(const std::vector<double>& values);
  [[nodiscard]] bool empty() const { return from > to; }
  [[nodiscard]] double span() const { return to - from; }
};

/// The part of a curve that a window shows, with one neighbour on each side so that lines reach the
/// window's edge.
[[nodiscard]] Curve cut(const Curve& curve, const Extent& x, const Extent& y);

/// At most about `most_points` points that look the same.
[[nodiscard]] Curve thin(const Curve& curve, std::size_t most_points);

}  // namespace detail
}  // namespace esokit::examples
