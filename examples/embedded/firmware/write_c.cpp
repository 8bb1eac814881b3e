// Writes the C of an observer and of a controller with it, eso.[hc] and loop.[hc], into the folder
// that is given: written_c.cpp runs them on the targets.
#include <cstdio>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>
#include <fstream>
#include <string>

namespace {

template <class Config>
bool write(const std::string& folder, const std::string& name, const Config& made) {
  if (!made) return false;
  const auto code = esokit::to_c(*made, {.name = name, .self_test_samples = 10000});
  if (!code) return false;
  std::ofstream header(folder + "/" + name + ".h");
  std::ofstream source(folder + "/" + name + ".c");
  header << code->header;
  source << code->source;
  return header.good() && source.good();
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
  if (!written) std::fputs("no C was written\n", stderr);
  return written ? 0 : 1;
}
