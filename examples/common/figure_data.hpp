/// @file
/// The data of a figure: CSV files for the reader, and one file of thinned curves for gnuplot.
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
  static constexpr std::size_t most_csv_rows = 20'000;

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

  /// The panel's numbers as CSV: a file for each set of series that share their x.
  [[nodiscard]] static std::optional<std::string> publish(const Panel& panel,
                                                          const std::filesystem::path& stem) {
    std::vector<bool> written(panel.series_.size(), false);
    int files = 0;
    for (std::size_t first = 0; first < panel.series_.size(); ++first) {
      if (written[first]) continue;
      const auto& x = panel.series_[first].x;
      CsvRow header{plain(panel.x_label_, "x")};
      std::vector<const std::vector<double>*> columns{&x};
      for (std::size_t i = first; i < panel.series_.size(); ++i) {
        const auto& series = panel.series_[i];
        if (written[i] || series.x != x) continue;
        written[i] = true;
        const std::string fallback = plain(series.style.name, "series " + std::to_string(i + 1));
        std::string name = series.style.column.empty() ? fallback : series.style.column;
        if (std::find(header.begin(), header.end(), name) != header.end()) {
          name += " " + std::to_string(i + 1);
        }
        const bool band = series.kind == Panel::Series::Kind::band;
        header.push_back(band ? name + " low" : name);
        columns.push_back(&series.y);
        if (band) {
          header.push_back(name + " high");
          columns.push_back(&series.high);
        }
      }
      std::string text = csv_line(header);
      const std::size_t step = (x.size() + most_csv_rows - 1) / most_csv_rows;
      for (std::size_t row = 0; row < x.size(); row += step) {
        CsvRow line;
        for (const auto* column : columns) line.push_back(number_text((*column)[row]));
        text += csv_line(line);
      }
      ++files;
      const std::string suffix = files == 1 ? ".csv" : "_" + std::to_string(files) + ".csv";
      if (auto error = write_text(stem.string() + suffix, text)) return error;
    }
    return publish_map(panel, stem);
  }

 private:
  static std::optional<std::string> publish_map(const Panel& panel,
                                                const std::filesystem::path& stem) {
    if (!panel.map_) return std::nullopt;
    const auto& map = *panel.map_;
    std::string text =
        csv_line({plain(panel.x_label_, "x"), plain(panel.y_label_, "y"), map.style.column});
    for (std::size_t j = 0; j < map.y.size(); ++j) {
      for (std::size_t i = 0; i < map.x.size(); ++i) {
        text += csv_line({number_text(map.x[i]), number_text(map.y[j]),
                          number_text(map.z[j * map.x.size() + i])});
      }
    }
    return write_text(stem.string() + "_map.csv", text);
  }

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
