#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <system_error>

#include "common/report.hpp"
#include "common/system.hpp"
#include "from_log/page_template.hpp"  // common/page.html, by CMake
#include "from_log/parts/page.hpp"

namespace from_log {
namespace {

using esokit::examples::Figure;
using esokit::examples::path_of;

std::string base64(const std::string& bytes) {
  constexpr const char* digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t three = 0;
    for (std::size_t j = i; j < i + 3; ++j) {
      three = three << 8U | (j < bytes.size() ? static_cast<unsigned char>(bytes[j]) : 0U);
    }
    for (int j = 0; j < 4; ++j) out += digits[three >> (18 - 6 * j) & 63U];
    if (i + 1 >= bytes.size()) out[out.size() - 2] = '=';
    if (i + 2 >= bytes.size()) out[out.size() - 1] = '=';
  }
  return out;
}

/// A folder that goes with it.
class Scratch {
 public:
  Scratch() = default;
  ~Scratch() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_of(path_), ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_ = esokit::examples::new_scratch_folder();
};

/// As an image that is in the page itself; what is said in its place if no file can be written.
std::string image_of(const Figure& figure, const std::string& scratch) {
  if (!scratch.empty() && figure.write(scratch, "svg")) {
    std::ifstream file(scratch + "/" + figure.name() + ".svg", std::ios::binary);
    const std::string svg{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    return "<label class=\"zoom\"><input type=\"checkbox\" aria-label=\"larger\"><img "
           "src=\"data:image/svg+xml;base64," +
           base64(svg) + "\" alt=\"" + escaped(figure.caption()) + "\"></label>\n";
  }
  return "<p>Not drawn: no file could be written.</p>\n";
}

void replace(std::string& text, const std::string& mark, const std::string& by) {
  const auto at = text.find(mark);
  if (at != std::string::npos) text.replace(at, mark.size(), by);
}

}  // namespace

std::string new_file(const std::string& folder, const std::string& stem,
                     const std::string& ending) {
  std::error_code problem;
  std::filesystem::create_directories(path_of(folder), problem);
  for (int number = 1; number < 100'000; ++number) {
    const std::string file =
        (path_of(folder) /
         path_of(stem + (number > 1 ? "-" + std::to_string(number) : "") + ending))
            .string();
    // Two runs at the same time cannot take the same name.
    if (esokit::examples::create_new(file)) return file;
    if (errno != EEXIST) {
      std::fprintf(stderr, "from_log: cannot write %s: %s\n", file.c_str(), std::strerror(errno));
      break;
    }
  }
  return {};
}

std::string Page::write(const std::string& folder, const std::string& stem) const {
  const Scratch scratch;
  std::string html = page_template;
  replace(html, "$title", escaped(title_) + " - esokit");
  replace(html, "$header", header());
  replace(html, "$main",
          main([&](const Figure& figure) { return image_of(figure, scratch.path()); }));
  const std::string file = new_file(folder, stem, ".html");
  if (file.empty() || !esokit::examples::write_text(file, html)) return {};
  return std::filesystem::absolute(path_of(file)).lexically_normal().string();
}

void Page::add_to(esokit::examples::Report& report) const {
  for (const Item& item : items_) {
    switch (item.kind) {
      case Kind::table:
        report.table(item.name, item.text, item.rows[0], {item.rows.begin() + 1, item.rows.end()});
        break;
      case Kind::figure:
        report.add(item.figures[0]);
        break;
      case Kind::box:
      case Kind::bad_box:
        report.remark(item.text + ":");
        for (const auto& line : item.rows[0]) report.remark(line);
        break;
      default:
        break;
    }
  }
}

}  // namespace from_log
