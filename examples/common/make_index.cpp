/// @file
/// Writes index.html, the page of all results, into the examples' output folder.

#include <cstdio>
#include <exception>
#include <filesystem>

#include "command_line.hpp"
#include "csv.hpp"
#include "page.hpp"
#include "results.hpp"

int main(int argc, char** argv) {
  namespace examples = esokit::examples;
  const std::filesystem::path out =
      examples::output_folder(argc, argv, "Writes index.html from the examples' results in");
  try {
    const std::string page = examples::Page(out).overview_with_all(examples::read_results(out));
    if (const auto error = examples::write_text(out / "index.html", page)) {
      std::fprintf(stderr, "make_index: %s\n", error->c_str());
      return 1;
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_index: %s\n", error.what());
    return 1;
  }
  std::printf("%s\n", std::filesystem::absolute(out / "index.html").lexically_normal().c_str());
  return 0;
}
