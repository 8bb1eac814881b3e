/// @file
/// Columns of numbers and what drawing does to them: cutting out a window, and thinning that keeps
/// what the eye sees.
#pragma once

#include <algorithm>
#include <cmath>
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
  void add(double x_value, double y_value) {
    x.push_back(x_value);
    y.push_back(y_value);
  }
  void add_break() {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    if (!x.empty() && !std::isnan(y.back())) add(nan, nan);
  }
};

namespace detail {

/// Least and greatest finite value.
struct Extent {
  double from = std::numeric_limits<double>::infinity();
  double to = -std::numeric_limits<double>::infinity();

  void add(double value) {
    if (!std::isfinite(value)) return;
    from = std::min(from, value);
    to = std::max(to, value);
  }
  void add(const std::vector<double>& values) {
    for (const double value : values) add(value);
  }
  [[nodiscard]] bool empty() const { return from > to; }
  [[nodiscard]] double span() const { return to - from; }
};

[[nodiscard]] inline bool is_monotone(const std::vector<double>& x) {
  for (std::size_t i = 1; i < x.size(); ++i) {
    if (!(x[i] >= x[i - 1])) return false;
  }
  return true;
}

/// The part of a curve that a window shows, with one neighbour on each side so that lines reach the
/// window's edge.
[[nodiscard]] inline Curve cut(const Curve& curve, const Extent& x, const Extent& y) {
  const bool by_x_alone = is_monotone(curve.x);
  const auto inside = [&](std::size_t i) {
    const bool x_inside = curve.x[i] >= x.from && curve.x[i] <= x.to;
    return x_inside && (by_x_alone || (curve.y[i] >= y.from && curve.y[i] <= y.to));
  };
  Curve result;
  for (std::size_t i = 0; i < curve.size(); ++i) {
    if ((i > 0 && inside(i - 1)) || inside(i) || (i + 1 < curve.size() && inside(i + 1))) {
      result.add(curve.x[i], curve.y[i]);
    } else {
      result.add_break();
    }
  }
  return result;
}

/// The lowest and the highest point of each bucket, in their order: noise keeps its envelope.
[[nodiscard]] inline Curve thin_by_extremes(const Curve& curve, std::size_t most_points) {
  const std::size_t count = curve.size();
  const std::size_t buckets = std::max<std::size_t>(most_points / 2, 1);
  Curve result;
  result.add(curve.x.front(), curve.y.front());
  for (std::size_t bucket = 0; bucket < buckets; ++bucket) {
    const std::size_t begin = bucket * count / buckets;
    const std::size_t end = (bucket + 1) * count / buckets;
    std::size_t low = end;
    std::size_t high = end;
    bool gap = false;
    for (std::size_t i = begin; i < end; ++i) {
      if (!std::isfinite(curve.y[i])) {
        gap = true;
        continue;
      }
      if (low == end || curve.y[i] < curve.y[low]) low = i;
      if (high == end || curve.y[i] > curve.y[high]) high = i;
    }
    if (low != end) {
      const auto [first, second] = std::minmax(low, high);
      result.add(curve.x[first], curve.y[first]);
      if (second != first) result.add(curve.x[second], curve.y[second]);
    }
    if (gap) result.add_break();
  }
  result.add(curve.x.back(), curve.y.back());
  return result;
}

/// Leaves out points nearer to the last kept one than a share of the curve's size.
[[nodiscard]] inline Curve thin_by_distance(const Curve& curve, std::size_t most_points) {
  Extent x;
  Extent y;
  x.add(curve.x);
  y.add(curve.y);
  const double x_scale = x.span() > 0.0 ? 1.0 / x.span() : 0.0;
  const double y_scale = y.span() > 0.0 ? 1.0 / y.span() : 0.0;
  for (double distance = 2e-4;; distance *= 1.5) {
    Curve result;
    for (std::size_t i = 0; i < curve.size(); ++i) {
      if (!std::isfinite(curve.x[i]) || !std::isfinite(curve.y[i])) {
        result.add_break();
        continue;
      }
      const bool ends = i == 0 || i + 1 == curve.size() || std::isnan(curve.y[i + 1]);
      if (ends || result.y.empty() || std::isnan(result.y.back()) ||
          std::hypot((curve.x[i] - result.x.back()) * x_scale,
                     (curve.y[i] - result.y.back()) * y_scale) > distance) {
        result.add(curve.x[i], curve.y[i]);
      }
    }
    if (result.size() <= most_points || distance > 0.1) return result;
  }
}

/// At most about `most_points` points that look the same.
[[nodiscard]] inline Curve thin(const Curve& curve, std::size_t most_points) {
  if (curve.size() <= most_points) return curve;
  return is_monotone(curve.x) ? thin_by_extremes(curve, most_points)
                              : thin_by_distance(curve, most_points);
}

}  // namespace detail
}  // namespace esokit::examples
