/// @file
/// Lines of equal value through a grid of numbers (marching squares).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "curve.hpp"

namespace esokit::examples {

/// The line z(x, y) = level, with breaks between its parts. `z` holds a row of x values for each y,
/// z[j * x.size() + i] = z(x[i], y[j]). Cells with a NaN corner are left out.
[[nodiscard]] inline Curve contour(const std::vector<double>& x, const std::vector<double>& y,
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

}  // namespace esokit::examples
