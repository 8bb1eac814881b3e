// The same as fixed_point_test.cpp by hand, for as long as you want: fixed_point_play --seed 7
// --count 1000000000. Status 1 if a bound was exceeded.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <esokit/observer/linear_eso.hpp>
#include <target/fixed_play.hpp>

using namespace esokit_test;

namespace {

/// Steps of chance in pieces, and the adversary after each.
template <class Y>
bool plays(const char* name, double bandwidth, double time, const FixedPointOptions& options,
           std::uint64_t seed, long count) {
  const auto observer =
      LinearEso<2>::make(
          {.observer_bandwidth = bandwidth, .input_gain = 50, .sample_time = time, .max_gap = 5})
          .value();
  const auto code = to_fixed_c(observer, options).value();
  const Folder folder;
  FixedInC<Y> in_c(folder, code.code);
  if (!in_c.loaded()) return false;
  FixedPlay<Y> play(in_c, code, options, seed);
  double chance = 0;
  double adversary = 0;
  const int horizon = static_cast<int>(40 / (bandwidth * time));
  for (long done = 0; done < count;) {
    const long piece = std::min(count - done, 50000000L);
    chance = std::max(chance, play.by_chance(piece));
    for (std::size_t row = 0; row < 3; ++row) {
      adversary = std::max(adversary, play.by_adversary(row, horizon, 64));
    }
    done += piece;
  }
  std::printf("%-22s %12ld steps: %.3f of the bound by chance, %.3f by an adversary\n", name, count,
              chance, adversary);
  std::fflush(stdout);
  return chance <= 1 && adversary <= 1 && adversary >= 0.3;
}

}  // namespace

int main(int argc, char** argv) {
  std::uint64_t seed = 1;
  long count = 10000000;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--seed") == 0) {
      seed = std::strtoull(argv[i + 1], nullptr, 10);
    } else if (std::strcmp(argv[i], "--count") == 0) {
      count = std::strtol(argv[i + 1], nullptr, 10);
    } else {
      std::fprintf(stderr, "usage: fixed_point_play [--seed N] [--count STEPS]\n");
      return 2;
    }
  }
  FixedPointOptions plain;
  plain.y = {6.283185307 / 4096, 2048};
  plain.u = {12.0 / 1000, 1000};
  plain.code.name = "eso";
  FixedPointOptions narrow = plain;
  narrow.innovation_bits = 16;
  FixedPointOptions counter = plain;
  counter.y.most = 30;
  counter.y.counter_bits = 16;
  bool fine = plays<std::int32_t>("32 bits", 100, 1e-3, plain, seed, count);
  fine = plays<std::int32_t>("16 bits", 100, 1e-3, narrow, seed + 1, count) && fine;
  fine = plays<std::uint16_t>("a counter", 100, 1e-3, counter, seed + 2, count) && fine;
  fine = plays<std::uint16_t>("slow, a counter", 10, 5e-5, counter, seed + 3, count) && fine;
  return fine ? 0 : 1;
}
