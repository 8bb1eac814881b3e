/// @file
/// The data of a figure: a CSV file for the reader, and one file of thinned curves for gnuplot.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "csv.hpp"
#include "curve.hpp"
#include "panel.hpp"

namespace esokit::examples {

/// Collects gnuplot's data blocks, which a script addresses by their number.
class FigureData {
 public:
  /// Longer series are published with every k-th row.
  static constexpr std::size_t most_csv_rows = 5'000;

  /// Adds a block and returns its index. Numbers that are not finite break a line.
  std::size_t add(const Curve& curve) {
    std::string block;
    for (std::size_t i = 0; i < curve.size(); ++i) {
      const bool finite = std::isfinite(curve.x[i]) && std::isfinite(curve.y[i]);
      // An empty line breaks the line also where gnuplot would skip a missing number.
      block += finite ? number_text(curve.x[i], 7) + ' ' + number_text(curve.y[i], 7) + '\n' : "\n";
      if (!finite && block.ends_with("\n\n\n")) block.pop_back();  // two would end the block
    }
    return add_block(std::move(block));
  }

  std::size_t add_band(const Curve& low, const Curve& high) {
    std::string block;
    for (std::size_t i = 0; i < low.size(); ++i) {
      block += number_text(low.x[i], 7) + ' ' + number_text(low.y[i], 7) + ' ' +
               number_text(high.y[i], 7) + '\n';
    }
    return add_block(std::move(block));
  }

  std::size_t add_map(const std::vector<double>& x, const std::vector<double>& y,
                      const std::vector<double>& z) {
    std::string block;
    for (std::size_t j = 0; j < y.size(); ++j) {
      for (std::size_t i = 0; i < x.size(); ++i) {
        block += number_text(x[i], 7) + ' ' + number_text(y[j], 7) + ' ' +
                 number_text(z[j * x.size() + i], 6) + '\n';
      }
    }
    return add_block(std::move(block));
  }

  [[nodiscard]] const std::string& text() const { return text_; }

  /// The numbers of all panels as one CSV text, a row a point.
  [[nodiscard]] static std::string publish(const std::vector<Panel>& panels) {
    std::string text = csv_line({"panel", "series", "x", "y", "z"});
    for (const Panel& panel : panels) {
      const auto put = [&](const std::string& series, const std::vector<double>& x,
                           const std::vector<double>& y) {
        const std::string start = csv_field(panel.name_) + ',' + csv_field(series) + ',';
        const std::size_t step = (x.size() + most_csv_rows - 1) / most_csv_rows;
        for (std::size_t i = 0; i < x.size(); i += step) {
          text += start + number_text(x[i], 7) + ',' + number_text(y[i], 7) + ",\n";
        }
      };
      for (std::size_t i = 0; i < panel.series_.size(); ++i) {
        const auto& series = panel.series_[i];
        const std::string& wish =
            series.style.column.empty() ? series.style.name : series.style.column;
        const std::string name = plain(wish, "series " + std::to_string(i + 1));
        const bool band = series.kind == Panel::Series::Kind::band;
        put(band ? name + " low" : name, series.x, series.y);
        if (band) put(name + " high", series.x, series.high);
      }
      if (!panel.map_) continue;
      const auto& map = *panel.map_;
      const std::string start = csv_field(panel.name_) + ',' + csv_field(map.style.column) + ',';
      for (std::size_t k = 0; k < map.z.size(); ++k) {
        text += start + number_text(map.x[k % map.x.size()], 7) + ',' +
                number_text(map.y[k / map.x.size()], 7) + ',' + number_text(map.z[k], 7) + '\n';
      }
    }
    return text;
  }

 private:
  /// A label without gnuplot's braces.
  static std::string plain(std::string text, const std::string& fallback) {
    std::erase_if(text, [](char c) { return c == '{' || c == '}'; });
    return text.empty() ? fallback : text;
  }

  std::size_t add_block(std::string block) {
    // gnuplot counts blocks: one without a line would shift all that follow.
    if (block.find_first_not_of('\n') == std::string::npos) block = "nan nan nan\n";
    text_ += block + "\n\n";
    return blocks_++;
  }

  std::string text_;
  std::size_t blocks_ = 0;
};

}  // namespace esokit::examples
