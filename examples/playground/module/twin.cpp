// The same lines, native: simulates each line of a file of settings and writes every number.
//   playground_twin SETTINGS OUT
#include <cstdio>
#include <cstring>
#include <fstream>

#include "play.hpp"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: playground_twin SETTINGS OUT\n");
    return 2;
  }
  std::ifstream in(argv[1]);
  std::ofstream out(argv[2], std::ios::binary);
  std::string line;
  const auto write = [&](const double* values, std::size_t count) {
    const double length = static_cast<double>(count);
    out.write(reinterpret_cast<const char*>(&length), sizeof length);
    out.write(reinterpret_cast<const char*>(values),
              static_cast<std::streamsize>(count * sizeof(double)));
  };
  while (std::getline(in, line)) {
    playground::Settings settings;
    if (!playground::read_settings(line, settings)) {
      std::fprintf(stderr, "not a setting: %s\n", line.c_str());
      return 1;
    }
    const auto result = playground::play(settings);
    if (!result.refusal.empty()) std::printf("%s: %s\n", line.c_str(), result.refusal.c_str());
    for (const auto& signal : result.signals) write(signal.data(), signal.size());
    for (const auto& numbers : result.numbers) write(numbers.data(), numbers.size());
    for (const auto& curve : result.curves) write(curve.data(), curve.size());
  }
  return in.eof() && out ? 0 : 1;
}
