#include "from_log/parts/page.hpp"

#include <algorithm>
#include <cctype>

namespace from_log {
using esokit::examples::CsvRow;
using esokit::examples::Figure;

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

namespace {

std::string html_of_table(const std::string& caption, const std::vector<CsvRow>& rows) {
  std::string text = "<figure class=\"tab\"><figcaption>" + escaped(caption) +
                     "</figcaption><div class=\"table\" tabindex=\"0\"><table>\n<thead><tr>";
  // A column without a number is one of words.
  std::vector<bool> words(rows[0].size());
  for (std::size_t c = 0; c < words.size(); ++c) {
    words[c] = std::none_of(rows.begin() + 1, rows.end(), [c](const CsvRow& row) {
      return !row[c].empty() &&
             (std::isdigit(static_cast<unsigned char>(row[c][0])) != 0 || row[c][0] == '-');
    });
    text += std::string("<th scope=\"col\"") + (words[c] ? " class=\"text\">" : ">") +
            escaped(rows[0][c]) + "</th>";
  }
  text += "</tr></thead>\n<tbody>\n";
  for (std::size_t i = 1; i < rows.size(); ++i) {
    text += "<tr>";
    for (std::size_t c = 0; c < rows[i].size(); ++c) {
      text += (c == 0     ? "<th scope=\"row\">"
               : words[c] ? "<td class=\"text\">"
                          : "<td>") +
              escaped(rows[i][c]) + (c == 0 ? "</th>" : "</td>");
    }
    text += "</tr>\n";
  }
  return text + "</tbody></table></div></figure>\n";
}

}  // namespace

std::string Page::header() const { return "<h1>" + escaped(title_) + "</h1>\n"; }

std::string Page::main(const std::function<std::string(const Figure&)>& drawn) const {
  std::string main;
  for (const Item& item : items_) {
    switch (item.kind) {
      case Kind::heading:
        main += "<h2>" + escaped(item.text) + "</h2>\n";
        break;
      case Kind::text:
        main += "<p>" + escaped(item.text) + "</p>\n";
        break;
      case Kind::box:
      case Kind::bad_box:
        main += std::string("<section class=\"plainly") +
                (item.kind == Kind::bad_box ? " failed" : "") + "\">\n<h2>" + escaped(item.text) +
                "</h2>\n<ul>\n";
        for (const auto& line : item.rows[0]) main += "<li>" + escaped(line) + "</li>\n";
        main += "</ul>\n</section>\n";
        break;
      case Kind::table:
        main += html_of_table(item.text, item.rows);
        break;
      case Kind::figure:
        main += "<figure>\n" + drawn(item.figures[0]) + "<figcaption>" +
                escaped(item.figures[0].caption()) + "</figcaption>\n</figure>\n";
        break;
      case Kind::code:
        if (!item.name.empty())
          main += "<details>\n<summary>" + escaped(item.name) + "</summary>\n";
        main += "<pre tabindex=\"0\"><code>" + escaped(item.text) + "</code></pre>\n";
        if (!item.name.empty()) main += "</details>\n";
        break;
    }
  }
  return main;
}

}  // namespace from_log
