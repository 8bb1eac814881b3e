/// @file
/// Writes index.html, the front page, and one page a paper into the examples' output
/// folder.

#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "csv.hpp"
#include "page.hpp"
#include "results.hpp"

int main(int argc, char** argv) {
  namespace examples = esokit::examples;
  const std::filesystem::path out =
      examples::output_folder(argc, argv, "Writes index.html from the examples' results in");
  try {
    const auto papers = examples::read_results(out);
    examples::Page page(out);
    std::vector<std::pair<std::string, std::string>> files;
    for (const auto& paper : papers) files.emplace_back(page.file_of(paper), page.one(paper));
    files.emplace_back("index.html", page.overview(papers));
    for (const auto& [name, text] : files) {
      if (const auto error = examples::write_text(out / name, text)) {
        std::fprintf(stderr, "make_index: %s\n", error->c_str());
        return 1;
      }
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_index: %s\n", error.what());
    return 1;
  }
  std::printf("%s\n", std::filesystem::absolute(out / "index.html").lexically_normal().c_str());
  return 0;
}
