#include "figure.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <system_error>
#include <utility>

#include "csv.hpp"
#include "figure_data.hpp"
#include "figure_layout.hpp"
#include "figure_script.hpp"
#include "gnuplot.hpp"

namespace esokit::examples {
namespace {

bool evenly_spaced(const std::vector<double>& nodes) {
  const double step = (nodes.back() - nodes.front()) / static_cast<double>(nodes.size() - 1);
  for (std::size_t i = 1; i < nodes.size(); ++i) {
    if (!(std::abs(nodes[i] - nodes[i - 1] - step) <= 1e-6 * step)) return false;
  }
  return true;
}

/// An SVG holds text, not shapes: name fonts of about the same width for readers without DejaVu.
std::optional<std::string> offer_other_fonts(const std::filesystem::path& svg) {
  auto text = read_text(svg);
  if (!text) return "cannot read " + svg.string();
  const std::string plain = "font-family=\"DejaVu Sans\"";
  const std::string offered = "font-family=\"DejaVu Sans, Verdana, Arial, sans-serif\"";
  for (auto at = text->find(plain); at != std::string::npos;
       at = text->find(plain, at + offered.size())) {
    text->replace(at, plain.size(), offered);
  }
  return write_text(svg, *text);
}

}  // namespace

Figure::Figure(std::string name, Grid grid) : name_(std::move(name)), grid_(std::move(grid)) {}
Figure::Figure(Figure&&) noexcept = default;
Figure::~Figure() = default;

Figure& Figure::title(std::string text) {
  title_ = std::move(text);
  return *this;
}
Figure& Figure::caption(std::string text) {
  caption_ = std::move(text);
  return *this;
}
Figure& Figure::alt(std::string text) {
  alt_ = std::move(text);
  return *this;
}

Panel& Figure::panel(std::size_t row, std::size_t column, std::size_t row_span,
                     std::size_t column_span) {
  for (Panel& panel : panels_) {
    if (panel.row_ == row && panel.column_ == column) return panel;
  }
  if (row + row_span > grid_.rows || column + column_span > grid_.columns) {
    std::fprintf(stderr, "figure %s: no panel at row %zu, column %zu\n", name_.c_str(), row,
                 column);
    std::abort();
  }
  Panel& panel = panels_.emplace_back();
  panel.row_ = row;
  panel.column_ = column;
  panel.row_span_ = row_span;
  panel.column_span_ = column_span;
  panel.name("r" + std::to_string(row + 1) + "c" + std::to_string(column + 1));
  return panel;
}

std::optional<std::string> Figure::write(const std::filesystem::path& folder) const {
  if (auto error = find_mistake()) return "figure " + name_ + ": " + *error;
  const auto file = [&](const char* extension) { return folder / (name_ + extension); };
  for (const char* extension : {".png", ".svg"}) {
    std::error_code ignored;
    std::filesystem::remove(file(extension), ignored);
  }
  const std::vector<Panel> panels(panels_.begin(), panels_.end());
  if (auto error = write_text(file(".csv"), FigureData::publish(panels))) return error;
  FigureData data;
  const FigureScript script(name_, title_, grid_, panels, data);
  if (auto error = write_text(file(".dat"), data.text())) return error;
  if (auto error = write_text(file(".gp"), script.text())) return error;
  if (auto error = detail::run_gnuplot(file(".gp"))) return error;
  for (const char* extension : {".png", ".svg"}) {
    std::error_code unreadable;
    const auto size = std::filesystem::file_size(file(extension), unreadable);
    if (unreadable || size == 0) return "gnuplot did not write " + file(extension).string();
  }
  return offer_other_fonts(file(".svg"));
}

/// What gnuplot would stumble over, or draw as something else.
std::optional<std::string> Figure::find_mistake() const {
  if (panels_.empty()) return "has no panel";
  for (const Panel& panel : panels_) {
    const std::string where = "panel " + panel.name_ + ": ";
    if (panel.series_.empty() && !panel.map_ && panel.references_.empty()) {
      return where + "nothing to draw";
    }
    for (const auto& series : panel.series_) {
      const bool band = series.kind == Panel::Series::Kind::band;
      if (series.x.size() != series.y.size() || (band && series.x.size() != series.high.size())) {
        return where + "series '" + series.style.name + "' has columns of different lengths";
      }
      if (series.x.empty()) return where + "series '" + series.style.name + "' is empty";
    }
    if (!panel.map_) continue;
    const auto& map = *panel.map_;
    if (map.x.size() < 2 || map.y.size() < 2 || map.z.size() != map.x.size() * map.y.size()) {
      return where + "the map needs two or more x and y and a z for each pair";
    }
    if (!evenly_spaced(map.x) || !evenly_spaced(map.y)) {
      return where + "the map's x and y must rise in equal steps";
    }
    if (panel.log_x_ || panel.log_y_) return where + "a map has no logarithmic axes";
  }
  return std::nullopt;
}

}  // namespace esokit::examples
