/// @file
/// The pages that show all results: a front page, and one page a paper.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <optional>
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

  /// One or two screens: a card a paper.
  [[nodiscard]] std::string overview(const std::vector<PaperResults>& papers) {
    begin("esokit: papers reproduced");
    put({"<h1>esokit: papers reproduced</h1>\n",
         "<p>Every figure and table was computed by the programs in examples/, from the equations "
         "of the papers. A <b>printed number</b> stands in a paper: it is met, missed, or not "
         "judged (where no tolerance can be given). An <b>own check</b> compares with a formula or "
         "an independent run, or demands what must hold; it passes or fails. The two are never "
         "added up.</p>\n</header>\n<main>\n"});
    for (const PaperResults& paper : papers) failures(paper, true);
    put({"<ul class=\"cards\">\n"});
    for (const PaperResults& paper : papers) {
      put({"<li><a href=\"", html_address(file_of(paper)), "\">"});
      cover(paper);
      put({"<b>", html_text(title_of(paper)), "</b></a>\n"});
      counts(paper);
      put({"</li>\n"});
    }
    put({"</ul>\n</main>\n</body>\n</html>\n"});
    return html_;
  }

  /// Name of the page of one paper, beside the front page.
  static std::string file_of(const PaperResults& paper) { return paper.folder + ".html"; }

  [[nodiscard]] std::string one(const PaperResults& paper) {
    begin(title_of(paper) + " - esokit");
    put({"<p><a href=\"index.html\">All results</a></p>\n<h1>", html_text(title_of(paper)),
         "</h1>\n<p class=\"quiet\">", html_text(paper.citation)});
    if (paper.link.starts_with("https://")) {
      put({" <a href=\"", html_text(paper.link), "\">", html_text(paper.link), "</a>"});
    }
    const std::filesystem::path readme = std::filesystem::path(paper.folder) / "README.txt";
    const bool linked = std::filesystem::exists(out_ / readme);
    put({"</p>\n<p class=\"quiet\">What it is, when it helps and how to choose: "});
    if (linked) put({"<a href=\"", html_address(readme), "\">"});
    put({"examples/", html_text(paper.folder), "/README.md", linked ? "</a>" : "", "</p>\n"});
    counts(paper);
    put(
        {"<p class=\"quiet\">Two ways to run: a <b>continuous simulation</b>, as in the papers, "
         "integrates plant and observer as one differential equation; a <b>sampled observer</b> "
         "runs once a sample, as it does in a controller.</p>\n</header>\n<main>\n"});
    failures(paper, false);
    claims(paper);
    misses(paper);
    corrections(paper);
    contents(paper);
    for (const ExampleResults& example : paper.examples) {
      if (!example.addition) article(example, Part::of_paper);
    }
    if (has_additions(paper)) {
      if (!paper.link.empty()) put({"<h2 id=\"additions\">Own additions</h2>\n"});
      for (const ExampleResults& example : paper.examples) {
        if (example.addition) {
          article(example, Part::all);
        } else if (has_additions(example)) {
          article(example, Part::additions);
        }
      }
    }
    put({"<h2 id=\"numbers\">All numbers, with tolerances</h2>\n"});
    for (const ExampleResults& example : paper.examples) all_checks(example);
    put({"</main>\n</body>\n</html>\n"});
    return html_;
  }

 private:
  using Outcome = Check::Outcome;
  enum class Part { of_paper, additions, all };

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
  static const char* mark_of(const ResultRow& row) {
    const bool printed = !row.fields[2].empty();
    switch (row.outcome) {
      case Outcome::pass:
        return printed ? "✓ met" : "✓ passed";
      case Outcome::fail:
        return "✗ failed";
      case Outcome::known_miss:
        return "≠ missed";
      case Outcome::reported:
        break;
    }
    return printed ? "not judged" : "shown";
  }

  // ---- what the pages begin with ----

  void number(std::size_t count, const char* words, const char* kind) {
    put({" <span class=\"", count == 0 ? "reported" : kind, "\">", std::to_string(count), " ",
         words, "</span>"});
  }

  void counts(const PaperResults& paper) {
    const Counts all = count(paper);
    put({"<p class=\"counts\">"});
    if (all.met + all.missed + all.not_judged > 0) {
      put({"<span>Printed numbers:"});
      number(all.met, "met,", "pass");
      number(all.missed, "missed,", "known_miss");
      number(all.not_judged, "not judged", "reported");
      put({"</span>\n"});
    }
    if (all.passed + all.failed > 0) {
      put({"<span>Own checks:"});
      number(all.passed, "passed,", "pass");
      number(all.failed, "failed", "fail");
      put({"</span>\n"});
    }
    if (all.passed + all.failed + all.met + all.missed + all.not_judged == 0) {
      put({"<span class=\"reported\">Nothing is compared here.</span>"});
    }
    put({"</p>\n"});
  }

  template <class Visit>
  static void for_each_item(const PaperResults& paper, std::string_view kind, Visit visit) {
    for (const ExampleResults& example : paper.examples) {
      for (const ContentItem& item : example.items) {
        if (item.kind == kind) visit(example, item);
      }
    }
  }

  void failures(const PaperResults& paper, bool from_front_page) {
    const std::string page = from_front_page ? html_address(file_of(paper)) : std::string();
    bool any = false;
    for (const ExampleResults& example : paper.examples) {
      for (const ResultRow& row : example.rows) {
        if (row.outcome != Outcome::fail) continue;
        if (!any) put({"<section class=\"plainly failed\">\n<h2>Failed</h2>\n<ul>\n"});
        any = true;
        put({"<li><a href=\"", page, "#", anchor(example), "\">", html_text(example.name),
             "</a>: ", html_text(row.fields[0]), ", ", html_text(row.fields[1]), ": ours ",
             html_text(shorter(row.fields[3])), ". <span class=\"quiet\">",
             html_text(row.fields[7]), "</span></li>\n"});
      }
    }
    if (any) put({"</ul>\n</section>\n"});
  }

  void misses(const PaperResults& paper) {
    bool any = false;
    for (const ExampleResults& example : paper.examples) {
      bool explained = false;
      const auto begin_item = [&](std::string_view kind) {
        if (!any) {
          put(
              {"<section class=\"plainly\">\n<h2 id=\"misses\">What does not "
               "reproduce</h2>\n<ul>\n"});
        }
        any = true;
        put({"<li><b>", kind.empty() ? miss_text(Miss::printed_number) : kind, ":</b> "});
      };
      const auto end_item = [&] {
        put({" <a href=\"#", anchor(example), "\">", html_text(example.name), "</a></li>\n"});
      };
      for (const ContentItem& item : example.items) {
        if (item.kind != "not_reproduced") continue;
        explained = true;
        begin_item(item.name);
        put({html_text(item.text)});
        end_item();
      }
      // Where the example says it in words, its rows need not be listed one by one up here.
      for (const ResultRow& row : example.rows) {
        if (row.outcome != Outcome::known_miss || explained) continue;
        begin_item(miss_text(*miss_in(row.fields[7])));
        put({html_text(row.fields[0]), ", ", html_text(row.fields[1]), ": paper ",
             html_text(row.fields[2]), ", ours ", html_text(shorter(row.fields[3])), "."});
        end_item();
      }
    }
    if (any) put({"</ul>\n</section>\n"});
  }

  void claims(const PaperResults& paper) {
    bool any = false;
    for_each_item(paper, "claim", [&](const ExampleResults& example, const ContentItem& item) {
      if (!any) {
        begin_table("What the paper claims, and whether it holds here",
                    {"claim", "in the paper", "here", "shown in"}, true);
      }
      any = true;
      const char* kind = item.alt == "holds"        ? "pass"
                         : item.alt == "not tested" ? "reported"
                                                    : "known_miss";
      put({"<tr><td class=\"text\">", html_text(item.text), "</td><td class=\"text narrow\">",
           html_text(item.name), "</td><td class=\"text\"><b class=\"", kind, "\">",
           html_text(item.alt), ".</b> ", html_text(item.more),
           "</td><td class=\"text narrow\"><a href=\"#", anchor(example), "\">",
           html_text(item.figure.empty() ? example.name : item.figure), "</a></td></tr>\n"});
    });
    if (any) end_table();
  }

  void corrections(const PaperResults& paper) {
    bool any = false;
    for_each_item(paper, "correction", [&](const ExampleResults&, const ContentItem& item) {
      if (!any) {
        begin_table("Corrections of printed formulas",
                    {"where", "printed", "correct", "how one knows"}, true);
      }
      any = true;
      put({"<tr><td class=\"text narrow\">", html_text(item.name), "</td><td class=\"text\">",
           html_text(item.text), "</td><td class=\"text\">", html_text(item.alt),
           "</td><td class=\"text\">", html_text(item.more), "</td></tr>\n"});
    });
    if (any) end_table();
  }

  void contents(const PaperResults& paper) {
    put({"<nav aria-label=\"Contents\">\n<ul>\n"});
    for (const ExampleResults& example : paper.examples) {
      put({"<li><a href=\"#", anchor(example), "\">", html_text(title_of(example)), "</a>",
           example.addition && !paper.link.empty() ? " <span class=\"quiet\">(own addition)</span>"
                                                   : "",
           "</li>\n"});
    }
    put({"</ul>\n</nav>\n"});
  }

  /// The top left panel of the paper's cover figure.
  void cover(const PaperResults& paper) {
    std::string wanted;
    for_each_item(paper, "cover", [&](const ExampleResults&, const ContentItem& item) {
      if (wanted.empty()) wanted = item.name;
    });
    bool shown = false;
    for_each_item(paper, "figure", [&](const ExampleResults& example, const ContentItem& item) {
      if (shown || (!wanted.empty() && item.name != wanted)) return;
      shown = true;
      const auto file = example.folder / (item.name + ".png");
      const auto size = png_size(out_ / file).value_or(std::pair(0U, 0U));
      const auto part = [](unsigned pixels, const std::string& panels) {
        return std::to_string(pixels /
                              std::max(1U, static_cast<unsigned>(std::atoi(panels.c_str()))));
      };
      put({"<svg role=\"img\" aria-label=\"", html_text(item.alt), "\" viewBox=\"0 0 ",
           part(size.first, item.figure), " ", part(size.second, item.more), "\"><image href=\"",
           html_address(file), "\" width=\"", std::to_string(size.first), "\" height=\"",
           std::to_string(size.second), "\"/></svg>\n"});
    });
  }

  // ---- papers and examples ----

  static bool has_additions(const ExampleResults& example) {
    return example.addition || std::any_of(example.items.begin(), example.items.end(),
                                           [](const auto& item) { return item.addition; });
  }
  static bool has_additions(const PaperResults& paper) {
    return std::any_of(paper.examples.begin(), paper.examples.end(),
                       [](const auto& example) { return has_additions(example); });
  }

  static std::string title_of(const PaperResults& paper) {
    return paper.title.empty() ? paper.folder : paper.title;
  }
  static std::string title_of(const ExampleResults& example) {
    return example.title.empty() ? example.name : example.title;
  }

  void article(const ExampleResults& example, Part part) {
    const bool later = part == Part::additions;
    put({"<article id=\"", anchor(example), later ? "-additions" : "", "\">\n<h3>",
         html_text(title_of(example)), later ? ": additions" : "", " <span class=\"quiet\">",
         html_text(example.name), "</span></h3>\n"});
    if (!later && !example.description.empty()) {
      put({"<p>", html_text(example.description), "</p>\n"});
    }
    for (const ContentItem& item : example.items) {
      if (part != Part::all && item.addition != later) continue;
      if (item.kind == "figure") {
        figure(example, item);
      } else if (item.kind == "table" || item.kind == "comparison") {
        table(example, item);
      } else if (item.kind == "diagram") {
        put({"<figure><img src=\"", html_address(example.folder / (item.name + ".svg")),
             "\" alt=\"", html_text(item.text), "\"><figcaption>", html_text(item.text),
             "</figcaption></figure>\n"});
      } else if (item.kind == "remark") {
        put({"<p>", html_text(item.text), "</p>\n"});
      }
    }
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
    put({"<figure>\n<a href=\"",
         html_address(file(".svg")),
         "\"><img loading=\"lazy\" src=\"",
         html_address(file(".png")),
         "\" width=\"",
         std::to_string(size->first / 2),
         "\" height=\"",
         std::to_string(size->second / 2),
         "\" alt=\"",
         html_text(item.alt),
         "\"></a>\n",
         "<figcaption>",
         html_text(item.text),
         "<br>\n<a href=\"",
         html_address(file(".svg")),
         "\">SVG</a> · <a href=\"",
         html_address(file(".gp")),
         "\">gnuplot script</a> · <a href=\"",
         html_address(file(".csv")),
         "\">data</a></figcaption>\n</figure>\n"});
  }

  void begin_table(std::string_view caption, const CsvRow& headings, bool text = false) {
    put({"<figure class=\"tab\"><figcaption>", html_text(caption),
         "</figcaption><div class=\"table\" tabindex=\"0\"><table>\n<thead><tr>"});
    for (const std::string& heading : headings) {
      put({text ? "<th class=\"text\" scope=\"col\">" : "<th scope=\"col\">", html_text(heading),
           "</th>"});
    }
    put({"</tr></thead>\n<tbody>\n"});
  }
  void end_table() { put({"</tbody></table></div></figure>\n"}); }

  /// A comparison's verdicts become marks behind our numbers; one that is too wide for a window is
  /// split between metrics.
  void table(const ExampleResults& example, const ContentItem& item) {
    const auto rows = detail::read_csv(out_ / example.folder / item.name, 0);
    const bool compared = item.kind == "comparison";
    constexpr std::size_t widest = 10;
    const auto ends_metric = [&](std::size_t c) {
      return !compared || rows[0][c].ends_with(", result");
    };
    std::size_t from = 1;
    for (bool first = true; first || from < rows[0].size(); first = false) {
      std::size_t to = from;
      for (std::size_t c = from; c < rows[0].size() && (c - from < widest || to == from); ++c) {
        if (ends_metric(c)) to = c + 1;
      }
      if (to == from) to = rows[0].size();
      CsvRow headings{rows[0][0]};
      for (std::size_t c = from; c < to; ++c) {
        if (!compared || !ends_metric(c)) headings.push_back(rows[0][c]);
      }
      begin_table(first ? item.text : item.text + " (continued)", headings);
      for (std::size_t r = 1; r < rows.size(); ++r) {
        put({"<tr><th scope=\"row\">", html_text(rows[r][0]), "</th>"});
        for (std::size_t c = from; c < to; ++c) {
          if (compared && ends_metric(c)) continue;
          put({"<td>", html_text(rows[r][c])});
          if (compared && ends_metric(c + 1)) verdict(rows[r][c + 1]);
          put({"</td>"});
        }
        put({"</tr>\n"});
      }
      end_table();
      from = to;
    }
  }

  void verdict(std::string_view words) {
    if (words == "ok") put({" <span class=\"pass\" title=\"met\">✓</span>"});
    if (words == "FAILED") put({" <span class=\"fail\">✗ failed</span>"});
    if (words == "missed") put({" <span class=\"known_miss\">≠ missed</span>"});
  }

  static std::string shorter(const std::string& number) {
    char* end = nullptr;
    const double value = std::strtod(number.c_str(), &end);
    return end == number.c_str() ? number : shown_text(value);
  }

  static std::string percent(const std::string& share) {
    if (share.empty()) return {};
    return number_text(100.0 * std::strtod(share.c_str(), nullptr), 3) + " %";
  }

  void all_checks(const ExampleResults& example) {
    if (example.rows.empty()) return;
    put({"<details>\n<summary>", html_text(title_of(example)), ": ",
         std::to_string(example.rows.size()), " rows (<a href=\"",
         html_address(example.folder / "summary.csv"), "\">summary.csv</a>)</summary>\n"});
    begin_table("", {"case", "metric", "paper", "reference", "ours", "error", "tolerance", "result",
                     "note"});
    for (const ResultRow& row : example.rows) {
      const CsvRow& fields = row.fields;
      // Without a relative error the tolerance is absolute.
      const std::string tolerance = fields[4].empty() ? fields[5] : percent(fields[5]);
      put({"<tr><td class=\"text\">",
           html_text(fields[0]),
           "</td><td class=\"text\">",
           html_text(fields[1]),
           "</td><td>",
           html_text(fields[2]),
           "</td><td>",
           html_text(reference_in(fields[7])),
           "</td><td>",
           html_text(shorter(fields[3])),
           "</td><td>",
           percent(fields[4]),
           "</td><td>",
           html_text(tolerance),
           "</td><td class=\"",
           class_of(row.outcome),
           "\">",
           mark_of(row),
           "</td><td class=\"text\">",
           html_text(fields[7]),
           "</td></tr>\n"});
    }
    end_table();
    put({"</details>\n"});
  }

  /// The number of a note that reference_note began.
  static std::string reference_in(const std::string& note) {
    constexpr std::string_view prefix = "reference ";
    if (!note.starts_with(prefix)) return {};
    return note.substr(prefix.size(), note.find(' ', prefix.size()) - prefix.size());
  }

  std::filesystem::path out_;
  std::string html_;
};

}  // namespace esokit::examples
