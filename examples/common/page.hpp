/// @file
/// The page that shows all results: figures, and tables of the papers' numbers beside ours.
#pragma once

#include <array>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "check.hpp"
#include "csv.hpp"
#include "html.hpp"
#include "results.hpp"

namespace esokit::examples {

/// Builds HTML from results; `out` is where their files lie, and the page too.
class Page {
 public:
  explicit Page(std::filesystem::path out) : out_(std::move(out)) {}

  [[nodiscard]] std::string overview_with_all(const std::vector<PaperResults>& papers) {
    begin("esokit: papers reproduced");
    put({"<h1>esokit: papers reproduced</h1>\n",
         "<p>Every figure and table below was computed by the programs in examples/, from the "
         "equations of the papers.</p>\n"});
    counts(papers);
    put({"</header>\n<main>\n"});
    failures(papers);
    misses(papers);
    contents(papers);
    for (const PaperResults& paper : papers) section(paper);
    put({"</main>\n</body>\n</html>\n"});
    return html_;
  }

  /// Name of the page of one paper, beside the page of all.
  static std::string file_of(const PaperResults& paper) { return paper.folder + ".html"; }

  [[nodiscard]] std::string one(const PaperResults& paper) {
    begin(title_of(paper) + " - esokit");
    put({"<p><a href=\"index.html\">All results</a></p>\n"});
    counts({paper});
    put({"</header>\n<main>\n"});
    section(paper);
    put({"</main>\n</body>\n</html>\n"});
    return html_;
  }

 private:
  using Outcome = Check::Outcome;

  void put(std::initializer_list<std::string_view> parts) {
    for (const std::string_view part : parts) html_ += part;
  }

  void begin(const std::string& title) {
    html_.clear();
    put(
        {"<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>",
         html_text(title), "</title>\n<style>", page_style,
         "</style>\n</head>\n<body>\n<header>\n"});
  }

  static std::string anchor(const PaperResults& paper) { return html_anchor(paper.folder); }
  static std::string anchor(const ExampleResults& example) {
    return html_anchor(example.folder.generic_string());
  }

  static const char* class_of(Outcome outcome) {
    switch (outcome) {
      case Outcome::pass:
        return "pass";
      case Outcome::fail:
        return "fail";
      case Outcome::known_miss:
        return "known_miss";
      case Outcome::reported:
        break;
    }
    return "reported";
  }
  static const char* mark_of(Outcome outcome) {
    switch (outcome) {
      case Outcome::pass:
        return "✓";
      case Outcome::fail:
        return "✗ failed";
      case Outcome::known_miss:
        return "≠ missed";
      case Outcome::reported:
        break;
    }
    return "reported";
  }

  // ---- overview ----

  void counts(const std::vector<PaperResults>& papers) {
    constexpr std::array kinds = {std::pair{Outcome::pass, "reproduced"},
                                  std::pair{Outcome::fail, "failed"},
                                  std::pair{Outcome::known_miss, "known not to reproduce"},
                                  std::pair{Outcome::reported, "reported only"}};
    put({"<ul class=\"counts\">\n"});
    for (const auto& [outcome, words] : kinds) {
      std::size_t total = 0;
      for (const PaperResults& paper : papers) {
        for (const ExampleResults& example : paper.examples) total += example.count(outcome);
      }
      put({"<li><b class=\"", class_of(outcome), "\">", std::to_string(total), "</b>numbers ",
           words, "</li>\n"});
    }
    put({"</ul>\n"});
  }

  template <class Visit>
  static void for_each_example(const std::vector<PaperResults>& papers, Visit visit) {
    for (const PaperResults& paper : papers) {
      for (const ExampleResults& example : paper.examples) visit(example);
    }
  }

  void row_item(const ExampleResults& example, const ResultRow& row) {
    put({"<li><a href=\"#", anchor(example), "\">", html_text(example.name),
         "</a>: ", html_text(row.fields[0]), ", ", html_text(row.fields[1]), ": "});
    if (!row.fields[2].empty()) put({"paper ", html_text(row.fields[2]), ", "});
    put({"ours ", html_text(shorter(row.fields[3])), "."});
    if (!row.fields[7].empty()) {
      put({" <span class=\"quiet\">", html_text(row.fields[7]), "</span>"});
    }
    put({"</li>\n"});
  }

  void failures(const std::vector<PaperResults>& papers) {
    bool any = false;
    for_each_example(papers, [&](const ExampleResults& example) {
      for (const ResultRow& row : example.rows) {
        if (row.outcome != Outcome::fail) continue;
        if (!any) {
          put(
              {"<section class=\"plainly failed\">\n<h2>Failed: these numbers must reproduce, and "
               "did not</h2>\n<ul>\n"});
        }
        any = true;
        row_item(example, row);
      }
    });
    if (any) put({"</ul>\n</section>\n"});
  }

  void misses(const std::vector<PaperResults>& papers) {
    put({"<section class=\"plainly\">\n<h2>What does not reproduce</h2>\n<ul>\n"});
    bool any = false;
    for_each_example(papers, [&](const ExampleResults& example) {
      bool explained = false;
      for (const ContentItem& item : example.items) {
        if (item.kind != "not_reproduced") continue;
        explained = true;
        put({"<li><a href=\"#", anchor(example), "\">", html_text(example.folder.generic_string()),
             "</a>: ", html_text(item.text), "</li>\n"});
      }
      any = any || explained;
      // Where the example says it in words, its rows need not be listed one by one up here.
      for (const ResultRow& row : example.rows) {
        if (row.outcome != Outcome::known_miss || explained) continue;
        row_item(example, row);
        any = true;
      }
    });
    if (!any) put({"<li>Nothing is known not to reproduce.</li>\n"});
    put({"</ul>\n</section>\n"});
  }

  void contents(const std::vector<PaperResults>& papers) {
    put({"<nav aria-label=\"Contents\">\n<ul>\n"});
    for (const PaperResults& paper : papers) {
      put({"<li><a href=\"#", anchor(paper), "\">", html_text(title_of(paper)),
           "</a> <span class=\"quiet\">(<a href=\"", html_address(file_of(paper)),
           "\">a page of its own</a>)</span>\n"});
      thumbnails(paper);
      put({"<ul>\n"});
      for (const ExampleResults& example : paper.examples) {
        put({"<li><a href=\"#", anchor(example), "\">", html_text(title_of(example)),
             "</a> <span class=\"quiet\">", std::to_string(example.count(Outcome::pass)), " of ",
             std::to_string(example.rows.size() - example.count(Outcome::reported)),
             " compared numbers reproduced</span></li>\n"});
      }
      put({"</ul></li>\n"});
    }
    put({"</ul>\n</nav>\n"});
  }

  void thumbnails(const PaperResults& paper) {
    put({"<div class=\"thumbs\">\n"});
    for (const ExampleResults& example : paper.examples) {
      for (const ContentItem& item : example.items) {
        if (item.kind != "figure") continue;
        put({"<a href=\"#", anchor(example), "\"><img loading=\"lazy\" src=\"",
             html_address(std::filesystem::path((example.folder / item.name).string() + ".png")),
             "\" width=\"176\" height=\"116\" alt=\"", html_text(item.alt), "\"></a>\n"});
      }
    }
    put({"</div>\n"});
  }

  // ---- papers and examples ----

  static std::string title_of(const PaperResults& paper) {
    return paper.title.empty() ? paper.folder : paper.title;
  }
  static std::string title_of(const ExampleResults& example) {
    return example.title.empty() ? example.name : example.name + ": " + example.title;
  }

  void section(const PaperResults& paper) {
    put({"<section id=\"", anchor(paper), "\">\n<h2>", html_text(title_of(paper)), "</h2>\n"});
    put({"<p class=\"quiet\">", html_text(paper.citation)});
    if (paper.link.starts_with("https://")) {
      put({" <a href=\"", html_text(paper.link), "\">", html_text(paper.link), "</a>"});
    }
    put({"</p>\n"});
    for (const ExampleResults& example : paper.examples) article(example);
    put({"</section>\n"});
  }

  void article(const ExampleResults& example) {
    put({"<article id=\"", anchor(example), "\">\n<h3>", html_text(title_of(example)), "</h3>\n"});
    if (!example.description.empty()) put({"<p>", html_text(example.description), "</p>\n"});
    for (const ContentItem& item : example.items) {
      if (item.kind == "figure") {
        figure(example, item);
      } else if (item.kind == "table") {
        table(example, item);
      } else if (item.kind == "comparison") {
        comparison(example, item);
      } else if (item.kind == "remark") {
        put({"<p>", html_text(item.text), "</p>\n"});
      } else if (item.kind == "not_reproduced") {
        put({"<p class=\"plainly\"><b>Not reproduced.</b> ", html_text(item.text), "</p>\n"});
      }
    }
    all_checks(example);
    put({"</article>\n"});
  }

  /// Width and height, so that the page does not jump while it loads.
  static std::optional<std::pair<unsigned, unsigned>> png_size(const std::filesystem::path& file) {
    std::ifstream stream(file, std::ios::binary);
    std::array<char, 24> head{};
    if (!stream.read(head.data(), static_cast<std::streamsize>(head.size()))) return std::nullopt;
    const auto number = [&head](std::size_t at) {
      unsigned value = 0;
      for (std::size_t i = at; i < at + 4; ++i) {
        value = value * 256U + static_cast<unsigned char>(head[i]);
      }
      return value;
    };
    return std::pair(number(16), number(20));
  }

  void figure(const ExampleResults& example, const ContentItem& item) {
    const std::filesystem::path stem = example.folder / item.name;
    const auto file = [&stem](const char* extension) {
      return std::filesystem::path(stem.string() + extension);
    };
    const auto size = png_size(out_ / file(".png"));
    if (!size) throw std::runtime_error("cannot read " + (out_ / file(".png")).string());
    put({"<figure>\n<a href=\"", html_address(file(".svg")), "\"><img loading=\"lazy\" src=\"",
         html_address(file(".png")), "\" width=\"", std::to_string(size->first / 2), "\" height=\"",
         std::to_string(size->second / 2), "\" alt=\"", html_text(item.alt), "\"></a>\n",
         "<figcaption>", html_text(item.text), "<br>\n<a href=\"", html_address(file(".svg")),
         "\">SVG</a> · <a href=\"", html_address(file(".gp")), "\">gnuplot script</a> · data:"});
    for (const auto& data : data_files(example, item.name)) {
      put({" <a href=\"", html_address(example.folder / data), "\">", html_text(data), "</a>"});
    }
    put({"</figcaption>\n</figure>\n"});
  }

  [[nodiscard]] std::set<std::string> data_files(const ExampleResults& example,
                                                 const std::string& figure) const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(out_ / example.folder)) {
      std::string name = entry.path().filename().string();
      if (name.starts_with(figure + "_") && name.ends_with(".csv")) names.insert(std::move(name));
    }
    return names;
  }

  void table(const ExampleResults& example, const ContentItem& item) {
    const auto rows = detail::read_csv(out_ / example.folder / item.name, 0);
    put({"<div class=\"table\"><table>\n<caption>", html_text(item.text),
         "</caption>\n<thead><tr>"});
    for (const std::string& cell : rows[0]) put({"<th scope=\"col\">", html_text(cell), "</th>"});
    put({"</tr></thead>\n<tbody>\n"});
    for (std::size_t i = 1; i < rows.size(); ++i) {
      put({"<tr>"});
      for (const std::string& cell : rows[i]) put({"<td>", html_text(cell), "</td>"});
      put({"</tr>\n"});
    }
    put({"</tbody></table></div>\n"});
  }

  /// Columns as Report::comparison writes them: case, then paper, ours and verdict of each metric.
  void comparison(const ExampleResults& example, const ContentItem& item) {
    const auto rows = detail::read_csv(out_ / example.folder / item.name, 0);
    const std::size_t metrics = (rows[0].size() - 1) / 3;
    put({"<div class=\"table\"><table>\n<caption>", html_text(item.text),
         "</caption>\n<thead><tr><th rowspan=\"2\" scope=\"col\">case</th>"});
    for (std::size_t k = 0; k < metrics; ++k) {
      const std::string& heading = rows[0][1 + 3 * k];
      put({"<th class=\"group\" colspan=\"2\" scope=\"colgroup\">",
           html_text(heading.substr(0, heading.rfind(", paper"))), "</th>"});
    }
    put({"</tr>\n<tr>"});
    for (std::size_t k = 0; k < metrics; ++k) {
      put({"<th scope=\"col\">paper</th><th scope=\"col\">ours</th>"});
    }
    put({"</tr></thead>\n<tbody>\n"});
    for (std::size_t i = 1; i < rows.size(); ++i) {
      put({"<tr><th scope=\"row\">", html_text(rows[i][0]), "</th>"});
      for (std::size_t k = 0; k < metrics; ++k) {
        const std::string& verdict = rows[i][3 + 3 * k];
        const Outcome outcome = verdict == "ok"       ? Outcome::pass
                                : verdict == "FAILED" ? Outcome::fail
                                : verdict == "missed" ? Outcome::known_miss
                                                      : Outcome::reported;
        put({"<td>", html_text(rows[i][1 + 3 * k]), "</td><td>", html_text(rows[i][2 + 3 * k])});
        if (outcome != Outcome::reported) {
          put({" <span class=\"", class_of(outcome), "\">", mark_of(outcome), "</span>"});
        }
        put({"</td>"});
      }
      put({"</tr>\n"});
    }
    put({"</tbody></table></div>\n"});
  }

  static std::string shorter(const std::string& number) {
    char* end = nullptr;
    const double value = std::strtod(number.c_str(), &end);
    return end == number.c_str() ? number : number_text(value, 6);
  }

  static std::string percent(const std::string& share) {
    if (share.empty()) return {};
    return number_text(100.0 * std::strtod(share.c_str(), nullptr), 3) + " %";
  }

  void all_checks(const ExampleResults& example) {
    if (example.rows.empty()) return;
    put({"<details>\n<summary>All ", std::to_string(example.rows.size()),
         " numbers, with tolerances (<a href=\"", html_address(example.folder / "summary.csv"),
         "\">summary.csv</a>)</summary>\n<div class=\"table\"><table>\n<thead><tr>"});
    for (const char* heading :
         {"case", "metric", "paper", "ours", "error", "tolerance", "result", "note"}) {
      put({"<th scope=\"col\">", heading, "</th>"});
    }
    put({"</tr></thead>\n<tbody>\n"});
    for (const ResultRow& row : example.rows) {
      const CsvRow& fields = row.fields;
      // Without a relative error the tolerance is absolute.
      const std::string tolerance = fields[4].empty() ? fields[5] : percent(fields[5]);
      put({"<tr><td>", html_text(fields[0]), "</td><td>", html_text(fields[1]), "</td><td>",
           html_text(shorter(fields[2])), "</td><td>", html_text(shorter(fields[3])), "</td><td>",
           percent(fields[4]), "</td><td>", html_text(tolerance), "</td><td class=\"",
           class_of(row.outcome), "\">", mark_of(row.outcome), "</td><td class=\"text\">",
           html_text(fields[7]), "</td></tr>\n"});
    }
    put({"</tbody></table></div>\n</details>\n"});
  }

  std::filesystem::path out_;
  std::string html_;
};

}  // namespace esokit::examples
