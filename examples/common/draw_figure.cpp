#include <filesystem>
#include <system_error>

#include "csv.hpp"
#include "figure.hpp"
#include "plain_figure.hpp"
#include "system.hpp"

namespace esokit::examples {
namespace {

/// The script of the sources; an installed program has one beside it.
std::filesystem::path draw_script() {
  std::error_code none;
  const auto installed =
      this_program().parent_path().parent_path() / "share" / "esokit" / "draw_figure.py";
  return std::filesystem::exists(installed, none) ? installed : path_of(ESOKIT_DRAW_FIGURE);
}

}  // namespace

bool Figure::write(const std::string& folder, const std::string& formats) const {
  const auto texts = text(folder, formats);
  if (!texts || !write_text(folder + "/" + name_ + ".csv", texts->numbers)) return false;
  // Where something is missing, this is said once.
  static bool able = true;
  able = (able || formats != "svg") && run_python(draw_script(), texts->description);
  return able || (formats == "svg" && write_text(folder + "/" + name_ + ".svg",
                                                 plain_svg(texts->description, texts->numbers)));
}

}  // namespace esokit::examples
