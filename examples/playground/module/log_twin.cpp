// The same lines, native: what each line of a file of logs gives, as JSON, a line each.
//   playground_log_twin LOGS FOLDER OUT
// A line of LOGS is a file below FOLDER and the options of from_log.
#include <cstdio>
#include <fstream>
#include <iterator>
#include <sstream>

#include "from_log/parts/from_log.hpp"
#include "log.hpp"

namespace {

std::string json_text(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    if (c == '\n') {
      out += "\\n";
    } else if (static_cast<unsigned char>(c) >= 0x20) {
      out += c;
    } else {
      char code[8];
      std::snprintf(code, sizeof code, "\\u%04x", static_cast<unsigned>(c));
      out += code;
    }
  }
  return out + '"';
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: playground_log_twin LOGS FOLDER OUT\n");
    return 2;
  }
  std::ifstream in(argv[1]);
  std::ofstream out(argv[3], std::ios::binary);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string file, arguments;
    words >> file;
    arguments = file.substr(file.rfind('/') + 1);
    for (std::string word; words >> word;) arguments += '\0' + word;
    std::ifstream log(std::string(argv[2]) + "/" + file, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(log), std::istreambuf_iterator<char>()};
    std::string error;
    playground::LogResult result;
    try {
      result = playground::study_log(arguments, bytes, [](const char*, double) {});
    } catch (const from_log::LogError& problem) {
      error = problem.what();
    }
    out << "{\"error\":" << json_text(error) << ",\"status\":" << result.status
        << ",\"header\":" << json_text(result.header) << ",\"main\":" << json_text(result.main)
        << ",\"code\":" << json_text(result.code) << ",\"address\":" << json_text(result.address)
        << ",\"taken\":" << json_text(result.taken) << ",\"figures\":[";
    const char* comma = "";
    for (const auto& figure : result.figures) {
      out << comma << "{\"description\":" << json_text(figure.description)
          << ",\"numbers\":" << json_text(figure.numbers) << "}";
      comma = ",";
    }
    out << "]}\n";
  }
  return in.eof() && out ? 0 : 1;
}
