#include "curve.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace esokit::examples {

void Curve::add(double x_value, double y_value) {
  x.push_back(x_value);
  y.push_back(y_value);
}

void Curve::add_break() {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  if (!x.empty() && !std::isnan(y.back())) add(nan, nan);
}

Curve contour(const std::vector<double>& x, const std::vector<double>& y,
              const std::vector<double>& z, double level) {
  const std::size_t columns = x.size();
  const std::size_t rows = y.size();
  if (columns < 2 || rows < 2 || z.size() != columns * rows) return {};

  // A crossing lies on a grid edge, named by its lower node and direction (0: along x, 1: along y).
  using Edge = std::pair<std::size_t, int>;
  std::map<Edge, std::vector<Edge>> neighbours;
  const auto point = [&](const Edge& edge) {
    const auto [node, along_y] = edge;
    const std::size_t i = node % columns;
    const std::size_t j = node / columns;
    const std::size_t other = along_y != 0 ? node + columns : node + 1;
    const double share = (level - z[node]) / (z[other] - z[node]);
    return along_y != 0 ? std::pair(x[i], y[j] + share * (y[j + 1] - y[j]))
                        : std::pair(x[i] + share * (x[i + 1] - x[i]), y[j]);
  };
  const auto join = [&](const Edge& a, const Edge& b) {
    neighbours[a].push_back(b);
    neighbours[b].push_back(a);
  };

  for (std::size_t j = 0; j + 1 < rows; ++j) {
    for (std::size_t i = 0; i + 1 < columns; ++i) {
      const std::size_t node = j * columns + i;
      const std::array<double, 4> corners = {z[node], z[node + 1], z[node + columns + 1],
                                             z[node + columns]};
      bool finite = true;
      std::array<bool, 4> above{};
      double mean = 0.0;
      for (std::size_t k = 0; k < 4; ++k) {
        finite = finite && std::isfinite(corners[k]);
        above[k] = corners[k] > level;
        mean += corners[k] / 4.0;
      }
      if (!finite) continue;
      // Counter-clockwise from the bottom; edge k lies between corners k and k + 1.
      const std::array<Edge, 4> edges = {Edge{node, 0}, Edge{node + 1, 1}, Edge{node + columns, 0},
                                         Edge{node, 1}};
      std::vector<std::size_t> crossed;
      for (std::size_t k = 0; k < 4; ++k) {
        if (above[k] != above[(k + 1) % 4]) crossed.push_back(k);
      }
      if (crossed.size() == 2) join(edges[crossed[0]], edges[crossed[1]]);
      if (crossed.size() == 4) {
        // A saddle: the middle decides which corners belong together.
        const bool first_corner_alone = above[0] != (mean > level);
        join(edges[0], edges[first_corner_alone ? 3 : 1]);
        join(edges[2], edges[first_corner_alone ? 1 : 3]);
      }
    }
  }

  Curve curve;
  const auto follow = [&](Edge edge) {
    curve.add_break();
    while (true) {
      const auto [px, py] = point(edge);
      curve.add(px, py);
      auto& links = neighbours[edge];
      if (links.empty()) return;
      const Edge next = links.back();
      links.pop_back();
      std::erase(neighbours[next], edge);
      edge = next;
    }
  };
  // Open lines from their ends first; what is left then are closed ones.
  for (const auto& [edge, links] : neighbours) {
    if (links.size() == 1) follow(edge);
  }
  for (const auto& [edge, links] : neighbours) {
    if (!links.empty()) follow(edge);
  }
  return curve;
}

namespace detail {

void Extent::add(double value) {
  if (!std::isfinite(value)) return;
  from = std::min(from, value);
  to = std::max(to, value);
}

void Extent::add(const std::vector<double>& values) {
  for (const double value : values) add(value);
}

namespace {

bool is_monotone(const std::vector<double>& x) {
  for (std::size_t i = 1; i < x.size(); ++i) {
    if (!(x[i] >= x[i - 1])) return false;
  }
  return true;
}

/// The lowest and the highest point of each bucket, in their order: noise keeps its envelope.
Curve thin_by_extremes(const Curve& curve, std::size_t most_points) {
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
Curve thin_by_distance(const Curve& curve, std::size_t most_points) {
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

}  // namespace

Curve cut(const Curve& curve, const Extent& x, const Extent& y) {
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

Curve thin(const Curve& curve, std::size_t most_points) {
  if (curve.size() <= most_points) return curve;
  return is_monotone(curve.x) ? thin_by_extremes(curve, most_points)
                              : thin_by_distance(curve, most_points);
}

}  // namespace detail
}  // namespace esokit::examples
