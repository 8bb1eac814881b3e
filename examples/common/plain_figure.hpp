/// @file
/// A figure as SVG where gnuplot or Python is missing: the same panels, curves and words, plainer.
#pragma once

#include <string>

namespace esokit::examples {

/// Insets, maps and contours are left out.
/// @param description, numbers what draw_figure.py reads, and the CSV beside it
[[nodiscard]] std::string plain_svg(const std::string& description, const std::string& numbers);

}  // namespace esokit::examples
