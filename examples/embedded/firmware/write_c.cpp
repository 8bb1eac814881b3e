// Writes the C of an observer and of a controller with it, eso.[hc] and loop.[hc], into the folder
// that is given: written_c.cpp runs them on the targets. The same in fixed point for
// written_fixed.cpp, and the two controllers of fixed_drive.cpp.
#include <cstdio>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/fixed_point.hpp>
#include <filesystem>
#include <fstream>
#include <string>

#include "fixed_drive.hpp"

namespace {

bool write(const std::string& folder, const std::string& name, const esokit::CCode& code) {
  std::ofstream header(folder + "/" + name + ".h");
  std::ofstream source(folder + "/" + name + ".c");
  header << code.header;
  source << code.source;
  return header.good() && source.good();
}

template <class Config>
bool write(const std::string& folder, const std::string& name, const Config& made) {
  if (!made) return false;
  const auto code = esokit::to_c(*made, {.name = name, .self_test_samples = 10000});
  if (!code) return false;
  return write(folder, name, *code);
}

template <class Made>
bool write_fixed(const std::string& folder, const std::string& name, const Made& made,
                 esokit::FixedPointOptions options, int innovation_bits = 32, int samples = 1000) {
  if (!made) return false;
  options.code.name = name;
  options.code.self_test_samples = samples;
  options.innovation_bits = innovation_bits;
  const auto code = esokit::to_fixed_c(*made, options);
  if (!code) {
    std::fprintf(stderr, "%s: %s = %g: %s %g\n", name.c_str(), code.error().field,
                 static_cast<double>(code.error().value), code.error().rule,
                 static_cast<double>(code.error().limit));
    return false;
  }
  return write(folder, name, code->code);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  using Eso = esokit::LinearEso<2, float>;
  using Loop = esokit::Adrc<Eso>;
  const Eso::Config config{
      .observer_bandwidth = 100.0f, .input_gain = 50.0f, .sample_time = 1e-3f, .max_gap = 10};
  const bool written = write(argv[1], "eso", Eso::make(config)) &&
                       write(argv[1], "loop",
                             Loop::make({.observer = config,
                                         .controller_bandwidth = 15.0f,
                                         .limits = {.lower = -5.0f, .upper = 5.0f}}));
  // 12 bits of y, 1000 counts of u for 5 V.
  const esokit::FixedPointOptions counts{.y = {.unit = 6.2831853 / 4096, .most = 2047},
                                         .u = {.unit = 5.0 / 1000, .most = 1000}};
  auto opens = counts;
  opens.code.settings_in_struct = true;
  auto limited = Loop::Config{.observer = config,
                              .controller_bandwidth = 15.0f,
                              .limits = {.lower = -5.0f, .upper = 5.0f, .rate = 500.0f}};
  const bool in_counts = write_fixed(argv[1], "eso_fixed", Eso::make(config), counts) &&
                         write_fixed(argv[1], "eso_fixed16", Eso::make(config), counts, 16) &&
                         write_fixed(argv[1], "eso_open", Eso::make(config), opens) &&
                         write_fixed(argv[1], "loop_fixed", Loop::make(limited), counts) &&
                         write_fixed(argv[1], "position", drive::Position::make(drive::position()),
                                     drive::position_counts()) &&
                         write_fixed(argv[1], "current", drive::Current::make(drive::current()),
                                     drive::current_counts());
  // For an AVR, whose 2 KiB of RAM hold the tables: in a folder of their own.
  auto small = config;
  small.max_gap = 2;
  limited.observer.max_gap = 2;
  const std::string avr = std::string(argv[1]) + "/avr";
  std::filesystem::create_directories(avr);
  const bool for_avr = write_fixed(avr, "eso_fixed", Eso::make(small), counts, 32, 10) &&
                       write_fixed(avr, "eso_fixed16", Eso::make(small), counts, 16, 10) &&
                       write_fixed(avr, "loop_fixed", Loop::make(limited), counts, 32, 10);
  if (!written || !in_counts || !for_avr) std::fputs("no C was written\n", stderr);
  return written && in_counts && for_avr ? 0 : 1;
}
