/// @file
/// Minimises a function of a few variables: a scan of a grid, then the simplex method.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <esokit/core/language.hpp>
#include <utility>
#include <vector>

namespace esokit::detail {

/// The result of a search.
struct SearchPoint {
  double value = 0.0;
  std::vector<double> at{};
};

/// The simplex method of Nelder and Mead (Computer J. 7 (1965) 308-313).
/// @param size size of the first simplex in each coordinate
template <class Function>
SearchPoint simplex_search(const Function& f, const std::vector<double>& start,
                           const std::vector<double>& size, int evaluations,
                           double tolerance = 1e-6) {
  const std::size_t n = start.size();
  std::vector<SearchPoint> s;
  const auto asked = [&](std::vector<double> x) {
    --evaluations;
    const double value = f(x);
    return SearchPoint{value, std::move(x)};
  };
  s.push_back(asked(start));
  for (std::size_t i = 0; i < n; ++i) {
    auto x = start;
    x[i] += size[i];
    s.push_back(asked(std::move(x)));
  }
  const auto less = [](const SearchPoint& a, const SearchPoint& b) { return a.value < b.value; };
  const auto along = [&](double by) {
    // Moves from the mean of all points except the worst, away from the worst.
    std::vector<double> x(n);
    for (std::size_t j = 0; j < n; ++j) {
      double mean = 0.0;
      for (std::size_t i = 0; i < n; ++i) mean += s[i].at[j] / static_cast<double>(n);
      x[j] = mean + by * (mean - s[n].at[j]);
    }
    return asked(std::move(x));
  };
  while (evaluations > 0) {
    std::sort(s.begin(), s.end(), less);
    double extent = 0.0;
    for (std::size_t j = 0; j < n; ++j)
      extent = (std::max)(extent, (std::abs)(s[n].at[j] - s[0].at[j]));
    if (s[n].value - s[0].value < tolerance && extent < 1e-2) break;
    auto mirrored = along(1.0);
    if (less(mirrored, s[0])) {
      auto further = along(2.0);
      s[n] = less(further, mirrored) ? std::move(further) : std::move(mirrored);
    } else if (less(mirrored, s[n - 1])) {
      s[n] = std::move(mirrored);
    } else {
      const bool outside = less(mirrored, s[n]);
      auto nearer = along(outside ? 0.5 : -0.5);
      if (less(nearer, outside ? mirrored : s[n])) {
        s[n] = std::move(nearer);
      } else {
        for (std::size_t i = 1; i <= n; ++i) {
          for (std::size_t j = 0; j < n; ++j) s[i].at[j] = 0.5 * (s[i].at[j] + s[0].at[j]);
          s[i] = asked(s[i].at);
        }
      }
    }
  }
  return *std::min_element(s.begin(), s.end(), less);
}

/// The best points of an even grid between `low` and `high` with `points` values per coordinate: up
/// to `count`, each at least two steps away from the better ones.
template <class Function>
std::vector<SearchPoint> grid_search(const Function& f, const std::vector<double>& low,
                                     const std::vector<double>& high,
                                     const std::vector<int>& points, std::size_t count) {
  struct Node {
    double value;
    std::vector<int> index;
  };
  const auto place = [&](const std::vector<int>& index) {
    std::vector<double> x(low.size());
    for (std::size_t j = 0; j < x.size(); ++j) {
      x[j] = points[j] > 1 ? low[j] + (high[j] - low[j]) * index[j] / (points[j] - 1) : low[j];
    }
    return x;
  };
  std::vector<Node> nodes;
  std::vector<int> index(low.size(), 0);
  for (bool more = true; more;) {
    nodes.push_back({f(place(index)), index});
    more = false;
    for (std::size_t j = 0; j < index.size() && !more; ++j) {
      if (++index[j] < points[j]) {
        more = true;
      } else {
        index[j] = 0;
      }
    }
  }
  std::sort(nodes.begin(), nodes.end(),
            [](const Node& a, const Node& b) { return a.value < b.value; });
  std::vector<SearchPoint> best;
  std::vector<const Node*> taken;
  for (const Node& node : nodes) {
    const auto close = [&](const Node* other) {
      for (std::size_t j = 0; j < node.index.size(); ++j) {
        if ((std::abs)(node.index[j] - other->index[j]) > 1) return false;
      }
      return true;
    };
    if (std::any_of(taken.begin(), taken.end(), close)) continue;
    taken.push_back(&node);
    best.push_back({node.value, place(node.index)});
    if (best.size() == count) break;
  }
  return best;
}

}  // namespace esokit::detail
