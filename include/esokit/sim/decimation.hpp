/// @file
/// Which rows of a long recording to draw.
#pragma once

#include <algorithm>
#include <cstddef>
#include <esokit/core/language.hpp>
#include <span>
#include <vector>

namespace esokit::sim {

/// 0, stride, 2 stride, .. below count, and the last row. A stride of 0 counts as 1.
inline std::vector<std::size_t> every_nth(std::size_t count, std::size_t stride) {
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < count; i += std::max<std::size_t>(stride, 1)) rows.push_back(i);
  if (count > 0 && rows.back() != count - 1) rows.push_back(count - 1);
  return rows;
}

/// Cuts the rows into `buckets` parts of equal length and keeps the first row, the last row, and
/// the rows of the smallest and the largest value of each part, so that noise and peaks look as
/// they do in the whole recording. Ascending, at most 2 buckets + 2 rows.
template <class ScalarType>
std::vector<std::size_t> peak_preserving_rows(std::span<const ScalarType> values,
                                              std::size_t buckets) {
  const std::size_t count = values.size();
  if (count == 0) return {};
  std::vector<std::size_t> rows{0, count - 1};
  const std::size_t parts = std::min(buckets, count);
  for (std::size_t part = 0; part < parts; ++part) {
    // count / parts first, so that the product cannot overflow.
    const auto edge = [&](std::size_t i) {
      return i * (count / parts) + i * (count % parts) / parts;
    };
    const auto begin = values.begin() + static_cast<std::ptrdiff_t>(edge(part));
    const auto end = values.begin() + static_cast<std::ptrdiff_t>(edge(part + 1));
    const auto [low, high] = std::minmax_element(begin, end);
    rows.push_back(static_cast<std::size_t>(low - values.begin()));
    rows.push_back(static_cast<std::size_t>(high - values.begin()));
  }
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  return rows;
}

}  // namespace esokit::sim
