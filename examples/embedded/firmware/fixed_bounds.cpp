// The table of README.md: what rounding does at most to the disturbance of LinearEso<2> in fixed
// point, as a share of what half a count of y does, over omega_o T and bits. Above 1 it is refused.
#include <cstdio>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/fixed_point.hpp>
#include <string>

namespace {

std::string share(double bandwidth, int bits_of_y, int innovation_bits) {
  const auto observer =
      esokit::LinearEso<2>::make(
          {.observer_bandwidth = bandwidth, .input_gain = 50, .sample_time = 1e-3, .max_gap = 4})
          .value();
  const int most = (1 << (bits_of_y - 1)) - 1;
  esokit::FixedPointOptions options{
      .y = {.unit = 1.0 / most, .most = most},
      .u = {.unit = 0.01 * bandwidth * bandwidth / 50 / 10, .most = 1000},
      .innovation_bits = innovation_bits};
  const auto code = esokit::to_fixed_c(observer, options);
  if (!code) return "refused";
  const esokit::FixedBound& d = code->estimates[2];
  char text[40];
  std::snprintf(text, sizeof text, "%.2g", d.deviation / d.half_count);
  return text;
}

}  // namespace

int main() {
  std::puts("| omega_o T | y of 12 bits, innovation of 32 | 12, 16 | 16, 32 | 16, 16 |");
  std::puts("|---:|---:|---:|---:|---:|");
  for (const double bandwidth : {1.0, 5.0, 20.0, 100.0, 300.0, 700.0}) {
    std::printf("| %g | %s | %s | %s | %s |\n", bandwidth * 1e-3, share(bandwidth, 12, 32).c_str(),
                share(bandwidth, 12, 16).c_str(), share(bandwidth, 16, 32).c_str(),
                share(bandwidth, 16, 16).c_str());
  }
  return 0;
}
