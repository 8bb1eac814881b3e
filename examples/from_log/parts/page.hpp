/// @file
/// One HTML file that needs no other: text, tables, figures, code.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "common/csv.hpp"
#include "common/figure.hpp"

namespace esokit::examples {
class Report;
}

namespace from_log {

/// What a page shows, in its order.
class Page {
 public:
  explicit Page(std::string title) : title_(std::move(title)) {}

  Page& heading(std::string text) { return add({.kind = Kind::heading, .text = std::move(text)}); }
  Page& text(std::string text) { return add({.kind = Kind::text, .text = std::move(text)}); }
  /// A box with a list that nobody overlooks.
  Page& box(std::string heading, std::vector<std::string> items, bool bad) {
    return add({.kind = bad ? Kind::bad_box : Kind::box,
                .text = std::move(heading),
                .rows = {std::move(items)}});
  }
  /// The first row is the heading; the first column is text.
  Page& table(std::string name, std::string caption, std::vector<esokit::examples::CsvRow> rows) {
    return add({.kind = Kind::table,
                .text = std::move(caption),
                .name = std::move(name),
                .rows = std::move(rows)});
  }
  Page& figure(const esokit::examples::Figure& figure) {
    return add({.kind = Kind::figure, .figures = {figure}});
  }
  /// @param heading where it is given the code is folded away below it
  Page& code(std::string text, std::string heading = {}) {
    return add({.kind = Kind::code, .text = std::move(text), .name = std::move(heading)});
  }

  /// Its heading, as HTML.
  [[nodiscard]] std::string header() const;
  /// All below it. @param drawn what shows a figure
  [[nodiscard]] std::string main(
      const std::function<std::string(const esokit::examples::Figure&)>& drawn) const;

  /// Writes FOLDER/STEM.html, or STEM-2.html and so on where that is there: never over a file.
  /// @return what was written; empty if that failed, stderr says why
  [[nodiscard]] std::string write(const std::string& folder, const std::string& stem) const;

  /// Its texts, tables and figures, as an article of the gallery.
  void add_to(esokit::examples::Report& report) const;

 private:
  enum class Kind { heading, text, box, bad_box, table, figure, code };
  struct Item {
    Kind kind;
    std::string text = {};
    std::string name = {};
    std::vector<esokit::examples::CsvRow> rows = {};
    std::vector<esokit::examples::Figure> figures = {};
  };

  Page& add(Item item) {
    items_.push_back(std::move(item));
    return *this;
  }

  std::string title_;
  std::vector<Item> items_;
};

/// Text as HTML has it.
[[nodiscard]] std::string escaped(const std::string& text);

/// A file FOLDER/STEM + ENDING that was not there before: STEM-2, STEM-3 where it was.
[[nodiscard]] std::string new_file(const std::string& folder, const std::string& stem,
                                   const std::string& ending);

}  // namespace from_log
