/// @file
/// Standard normal numbers that are the same with every standard library.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/core/language.hpp>
#include <random>

namespace esokit::sim {

/// Normal random numbers with mean 0 and variance 1. std::mt19937_64 is specified to the bit,
/// std::normal_distribution is not, so the numbers are computed here by Marsaglia's polar method.
/// It draws pairs (2 U - 1, 2 U - 1), U from the upper 53 bits, until a pair lies within the unit
/// circle; the first of the pair is returned first. Only the last digits of `log` depend on the
/// platform.
///
/// Always computed in double, so that a float simulation gets the same noise.
class Gaussian {
 public:
  /// @param seed any number; equal seeds give equal sequences
  explicit Gaussian(std::uint64_t seed) : engine_(seed), seed_(seed) {}

  /// The next number.
  double next() {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    double first = 0.0;
    double second = 0.0;
    double square = 0.0;
    do {
      first = signed_uniform();
      second = signed_uniform();
      square = first * first + second * second;
    } while (square >= 1.0 || square == 0.0);
    const double factor = std::sqrt(-2.0 * std::log(square) / square);
    spare_ = second * factor;
    has_spare_ = true;
    return first * factor;
  }

  /// A number in [0, 1), from the same sequence; for events that occur with a given probability.
  double uniform() { return (signed_uniform() + 1.0) / 2.0; }

  /// Restarts the sequence.
  void reset() {
    engine_.seed(seed_);
    has_spare_ = false;
  }

 private:
  /// A number in [-1, 1), a multiple of 2^-52.
  double signed_uniform() {
    constexpr double two_to_minus_52 = 1.0 / 4503599627370496.0;
    return static_cast<double>(engine_() >> 11u) * two_to_minus_52 - 1.0;
  }

  std::mt19937_64 engine_;
  std::uint64_t seed_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace esokit::sim
