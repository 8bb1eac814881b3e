// Compares what two runs of the firmware printed.
//
// usage: compare_runs [--exact] REFERENCE RUN
//
// With --exact the estimates of the open loop must agree bit for bit. All else (the closed loop,
// and images with fused multiply-adds, which round less often) may differ by a share of the largest
// magnitude that the quantity has in the run:
// - 2e-3. A rounding of y near 1 rad, 6e-8, is 1/1700 of the sensor's noise, and the noise moves no
//   estimate by more than its largest value. So 1/1700, and some for what returns through the loop.
// - 5e-2 for the adjustable bandwidth under a closed loop. It compares the magnitudes of two
//   innovations, so one rounding may choose the other gain for a sample; the two estimates then
//   differ by what the noise does.
//
// One line a comparison, "ok" or "FAILED" first. The status is 0 only if all agree.

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace {

using Row = std::vector<std::uint32_t>;
/// "open LinearEso" -> sample -> bits
using Run = std::map<std::string, std::map<int, Row>>;

bool read(const char* path, Run& run) {
  std::ifstream file(path);
  if (!file) {
    std::printf("FAILED cannot read %s\n", path);
    return false;
  }
  bool done = false;
  for (std::string text; std::getline(file, text);) {
    std::istringstream line(text);
    std::string kind;
    std::string name;
    int sample = 0;
    line >> kind;
    if (kind == "done") done = true;
    if (kind == "open" || kind == "closed") {
      line >> name >> sample;
    } else if (kind != "interrupt") {
      continue;
    }
    Row& row = run[name.empty() ? kind : kind + " " + name][sample];
    for (std::string word; line >> word;) {
      row.push_back(static_cast<std::uint32_t>(std::stoul(word, nullptr, 16)));
    }
  }
  if (!done) std::printf("FAILED %s does not end with \"done\"\n", path);
  return done;
}

double value(std::uint32_t bits) { return static_cast<double>(std::bit_cast<float>(bits)); }

struct Difference {
  bool same_shape = true;
  bool same_bits = true;
  double largest = 0;  // over the largest magnitude of its column
};

Difference compare(const std::map<int, Row>& reference, const std::map<int, Row>& run) {
  Difference result;
  std::vector<double> magnitude;
  std::vector<double> difference;
  if (reference.size() != run.size()) return {false, false, INFINITY};
  for (const auto& [sample, wanted] : reference) {
    const auto found = run.find(sample);
    if (found == run.end() || found->second.size() != wanted.size()) {
      return {false, false, INFINITY};
    }
    magnitude.resize(std::max(magnitude.size(), wanted.size()));
    difference.resize(magnitude.size());
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      const double a = value(wanted[i]);
      const double b = value(found->second[i]);
      if (wanted[i] != found->second[i]) result.same_bits = false;
      if (!std::isfinite(a) || !std::isfinite(b)) return {true, false, INFINITY};
      magnitude[i] = std::max(magnitude[i], std::abs(a));
      difference[i] = std::max(difference[i], std::abs(a - b));
    }
  }
  for (std::size_t i = 0; i < magnitude.size(); ++i) {
    if (difference[i] > 0) result.largest = std::max(result.largest, difference[i] / magnitude[i]);
  }
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  const bool exact = argc > 1 && std::string(argv[1]) == "--exact";
  if (argc != (exact ? 4 : 3)) {
    std::fputs("usage: compare_runs [--exact] REFERENCE RUN\n", stderr);
    return 2;
  }
  Run reference;
  Run run;
  if (!read(argv[argc - 2], reference) || !read(argv[argc - 1], run)) return 1;

  bool fine = !reference.empty();
  for (const auto& [name, rows] : reference) {
    const bool bits = exact && name.starts_with("open");
    const double bound = name == "closed AdjustableBandwidthEso" ? 5e-2 : 2e-3;
    const Difference found = compare(rows, run[name]);
    const bool ok = found.same_shape && (bits ? found.same_bits : found.largest <= bound);
    fine = fine && ok;
    std::printf("%-6s %s: ", ok ? "ok" : "FAILED", name.c_str());
    if (!found.same_shape) {
      std::printf("other samples\n");
    } else if (found.same_bits) {
      std::printf("bit for bit\n");
    } else {
      std::printf("differs by %.1e of the largest value, allowed %.0e\n", found.largest,
                  bits ? 0.0 : bound);
    }
  }
  return fine ? 0 : 1;
}
