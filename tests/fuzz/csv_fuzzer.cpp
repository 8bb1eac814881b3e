// libFuzzer: any text through the log reader of the examples. What it refuses it must refuse by
// LogError.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>

#include "common/log_file.hpp"

namespace {

void require(bool holds, const char* text) {
  if (holds) return;
  std::fprintf(stderr, "csv_fuzzer: %s\n", text);
  std::abort();
}

void read_as_log(std::string_view text, char separator, bool stamps) {
  try {
    const esokit::examples::LogFile log(
        esokit::examples::LogSource("log", text), {"1", "y"}, separator,
        stamps ? std::optional<std::size_t>(0) : std::optional<std::size_t>());
    require(log.rows() > 0, "a log without rows");
    require(log.column(0).size() == log.rows() && log.column(1).size() == log.rows(), "columns");
    for (std::size_t i = 1; i < log.rows(); ++i) require(log.line(i) > log.line(i - 1), "lines");
    // Stamps begin at zero, whatever they are.
    for (std::size_t i = 0; stamps && i < log.rows(); ++i) {
      const double first = log.column(0)[i];
      if (!std::isfinite(first)) continue;  // refused below
      require(!(first > 0) && !(first < 0), "the first stamp is not zero");
      break;
    }
    esokit::examples::check_time(log, log.column(0));
    const double step = esokit::examples::median_step(log.column(0));
    require(step > 0, "times that rise have a positive step");
  } catch (const esokit::examples::LogError& error) {
    require(*error.what() != '\0', "an error without text");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  read_as_log(text, '\0', false);
  read_as_log(text, '\0', true);
  read_as_log(text, ' ', true);
  return 0;
}
