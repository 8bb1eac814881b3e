/// @file
/// Counter-based random numbers: number k of run r is a function of (seed, stream, r, k) only, so
/// that runs may be computed in any order, on any thread and in any lane.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/core/pack.hpp>
#include <esokit/core/scalar.hpp>
#include <limits>
#include <type_traits>

namespace esokit::sim {

namespace detail {

/// Threefry-2x64 with 13 rounds: J. Salmon, M. Moraes, R. Dror, D. Shaw, "Parallel random numbers:
/// as easy as 1, 2, 3", SC 2011, doi:10.1145/2063384.2063405. With 13 rounds it passes BigCrush. It
/// uses only sums, rotations and `xor`, which AVX2 has for 64-bit words (it has no 64-bit product).
class Threefry {
 public:
  explicit constexpr Threefry(std::uint64_t key0, std::uint64_t key1) noexcept
      : key_{key0, key1, 0x1BD11BDAA9FC1A22u ^ key0 ^ key1} {}

  /// Replaces the two counters by two words of 64 random bits.
  /// @tparam Word std::uint64_t or a vector of them
  template <class Word>
  ESOKIT_INLINE constexpr void operator()(Word& x0, Word& x1) const noexcept {
    constexpr std::array rotation = {16, 42, 12, 31, 16, 32, 24, 21};
    x0 = x0 + key_[0];
    x1 = x1 + key_[1];
    esokit::detail::unroll<13>([&](auto round) ESOKIT_INLINE_LAMBDA {
      constexpr int by = rotation[static_cast<std::size_t>(int{round} % 8)];
      x0 = x0 + x1;
      x1 = ((x1 << by) | (x1 >> (64 - by))) ^ x0;
      if constexpr (int{round} % 4 == 3) {
        constexpr auto i = static_cast<std::size_t>(int{round} / 4 + 1);
        x0 = x0 + key_[i % 3];
        x1 = x1 + (key_[(i + 1) % 3] + i);
      }
    });
  }

 private:
  std::array<std::uint64_t, 3> key_;
};

/// sqrt of a number or of a register, correctly rounded.
template <class Real>
ESOKIT_INLINE Real square_root(const Real& x) noexcept {
  if constexpr (std::is_same_v<Real, double>) {
#if defined(__SSE2__) && defined(_WIN32) && defined(__GNUC__)
    // The sqrt of MinGW's library rounds twice: one root in 4,000 is not that of a register.
    typedef double Two __attribute__((__vector_size__(16)));
    return __builtin_ia32_sqrtpd(Two{x, x})[0];
#else
    return std::sqrt(x);
#endif
  } else {
    constexpr int lanes = sizeof(Real) / sizeof(double);
#if defined(__AVX__)
    if constexpr (lanes == 4) return __builtin_ia32_sqrtpd256(x);
#endif
#if defined(__SSE2__)
    if constexpr (lanes == 2) return __builtin_ia32_sqrtpd(x);
#endif
    Real root = x;
    for (int i = 0; i < lanes; ++i) root[i] = std::sqrt(root[i]);
    return root;
  }
}

/// log of a positive normal number, accurate to 1 ulp; with the polynomial of fdlibm (e_log.c).
template <class Word, class Real>
ESOKIT_INLINE Real logarithm(const Real& x) noexcept {
  // x = 2^k (1 + f), 1 + f in sqrt(1/2) .. sqrt(2)
  constexpr std::uint64_t half_root = 0x3FE6A09E667F3BCDu;  // of sqrt(1/2)
  const Word shifted = std::bit_cast<Word>(x) - half_root;
  // k + 1023, from the last digits of 2^52 + k + 1023.
  const Real k =
      std::bit_cast<Real>(((shifted + 0x3FF0000000000000u) >> 52u) | 0x4330000000000000u) -
      4503599627371519.0;
  const Real f = std::bit_cast<Real>((shifted & 0x000FFFFFFFFFFFFFu) + half_root) - 1.0;
  const Real s = f / (f + 2.0);
  const Real z = s * s;
  const Real w = z * z;
  const Real odd = w * (3.999999999940941908e-01 +
                        w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01));
  const Real even = z * (6.666666666666735130e-01 +
                         w * (2.857142874366239149e-01 +
                              w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)));
  const Real square = f * f * 0.5;
  return k * 6.93147180369123816490e-01 -
         ((square - (s * (square + (odd + even)) + k * 1.90821492927058770002e-10)) - f);
}

/// cos and sin of quarter_turns pi / 2 for abs(quarter_turns) up to 1/2, accurate to a few ulp;
/// with the polynomials of fdlibm (k_cos.c, k_sin.c).
template <class Real>
ESOKIT_INLINE void cosine_and_sine(const Real& quarter_turns, Real& cosine, Real& sine) noexcept {
  const Real x = quarter_turns * 1.5707963267948966;
  const Real z = x * x;
  sine =
      x +
      x * (z *
           (-1.66666666666666324348e-01 +
            z * (8.33333333332248946124e-03 +
                 z * (-1.98412698298579493134e-04 +
                      z * (2.75573137070700676789e-06 +
                           z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))))));
  cosine =
      (z *
       (z * (4.16666666666666019037e-02 +
             z * (-1.38888888888741095749e-03 +
                  z * (2.48015872894767294178e-05 +
                       z * (-2.75573143513906633035e-07 +
                            z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))))) -
        0.5)) +
      1.0;
}

/// Two independent standard normal numbers from a word of random bits (Box-Muller method), without
/// a branch, so that the result is the same in a register and alone. 40 bits give the radius, which
/// is at most 7.45 standard deviations, 24 bits the angle.
template <class Word, class Real>
ESOKIT_INLINE void normal_pair(const Word& bits, Real& first, Real& second) noexcept {
  constexpr std::uint64_t one = 0x3FF0000000000000u;  // bits of 1.0
  const Real share = 2.0 - std::bit_cast<Real>(((bits >> 12u) & 0x000FFFFFFFFFF000u) | one);
  const Real radius = square_root<Real>(logarithm<Word, Real>(share) * -2.0);
  // An angle in the quarter circle around the first axis; the last two bits select one of the four
  // quarters.
  const Real turn =
      std::bit_cast<Real>(((bits << 28u) & 0x000FFFFFC0000000u) | one) - (1.5 - 0x1p-23);
  Real cosine;
  Real sine;
  cosine_and_sine<Real>(turn, cosine, sine);
  const Word other_axis = Word{} - (bits & 1u);
  const Word opposite = (bits & 2u) << 62u;
  const Word c = std::bit_cast<Word>(cosine);
  const Word s = std::bit_cast<Word>(sine);
  const Word swapped = (c ^ s) & other_axis;
  first = radius * std::bit_cast<Real>((c ^ swapped) ^ opposite);
  second = radius * std::bit_cast<Real>((s ^ swapped) ^ opposite);
}

}  // namespace detail

/// The purpose of random numbers: numbers of one run for different purposes are independent.
enum class RandomStream : std::uint64_t {
  noise = 0,             ///< measurement noise; output i uses noise + i
  losses = 1u << 20u,    ///< which measurements are missing
  jitter = 2u << 20u,    ///< jitter of the sample time
  variation = 3u << 20u  ///< of plant and controller from run to run
};

/// The random numbers of a run, or of the runs in the lanes of a pack. Each call gives one number
/// for each lane. Lane i has the numbers of run `run` + i for any number of lanes (bit for bit with
/// -ffp-contract=off: the compiler must not fuse products and sums). Number k is a function of
/// (seed, stream, run, k) only.
///
/// Threefry-2x64-13 generates the bits, the Box-Muller method converts them: 3 ns per number with
/// AVX2. Always computed in double.
template <Scalar S = double>
class CountedGaussian {
 public:
  /// @param seed any number @param stream the purpose @param run number of the run in the first
  /// lane
  /// @param index number of the output, if there are several
  CountedGaussian(std::uint64_t seed, RandomStream stream, std::uint64_t run,
                  int index = 0) noexcept
      : generator_(seed, static_cast<std::uint64_t>(stream) + static_cast<std::uint64_t>(index)),
        run_(run) {}

  /// The next normal number: mean 0, variance 1.
  ESOKIT_INLINE S next() noexcept {
    if (left_ == 0) [[unlikely]]
      fill();
    return numbers_[static_cast<std::size_t>(size - left_--)];
  }

  /// The next number, uniform in [0, 1), from the same sequence.
  S uniform() noexcept {
    S number;
    for (int lane = 0; lane < lane_count<S>; ++lane) {
      std::uint64_t first = run_ + static_cast<std::uint64_t>(lane);
      std::uint64_t second = ~uniforms_;  // independent of the normal numbers
      generator_(first, second);
      constexpr int digits = std::numeric_limits<LaneScalar<S>>::digits;  // digits of the scalar
      const double share = std::ldexp(static_cast<double>(first >> (64 - digits)), -digits);
      esokit::detail::set_lane(number, static_cast<LaneScalar<S>>(share), lane);
    }
    ++uniforms_;
    return number;
  }

 private:
  static constexpr int blocks = 8;         ///< calls of the generator at a time
  static constexpr int size = 4 * blocks;  ///< numbers per lane that they give

  [[gnu::__noinline__]] void fill() noexcept {
    if constexpr (lane_count<S> == 1) {
      fill_lanes<std::uint64_t, double>(
          run_, [](S& number, double value) { number = static_cast<S>(value); });
    } else {
      constexpr int register_lanes = esokit::detail::register_lanes<double>;
      constexpr int width = lane_count<S> < register_lanes ? lane_count<S> : register_lanes;
      using Words = esokit::detail::Registers<std::uint64_t, width>;
      using Word = typename Words::Register;
      using Real = typename esokit::detail::Registers<double, width>::Register;
      for (int from = 0; from < lane_count<S>; from += width) {
        Words runs;
        for (int i = 0; i < width; ++i) runs[i] = run_ + static_cast<std::uint64_t>(from + i);
        fill_lanes<Word, Real>(runs.value,
                               [from](S& number, const Real& value) ESOKIT_INLINE_LAMBDA {
                                 for (int i = 0; i < width; ++i)
                                   number[from + i] = static_cast<LaneScalar<S>>(value[i]);
                               });
      }
    }
    next_ += blocks;
    left_ = size;
  }

  template <class Word, class Real, class Put>
  ESOKIT_INLINE void fill_lanes(const Word& runs, const Put& put) noexcept {
    for (int i = 0; i < blocks; ++i) {
      Word words[2] = {runs, Word{} + (next_ + static_cast<std::uint64_t>(i))};
      generator_(words[0], words[1]);
      for (int k = 0; k < 2; ++k) {
        Real first;
        Real second;
        detail::normal_pair(words[k], first, second);
        const auto at = static_cast<std::size_t>(4 * i + 2 * k);
        put(numbers_[at], first);
        put(numbers_[at + 1], second);
      }
    }
  }

  detail::Threefry generator_;
  std::uint64_t run_;
  std::uint64_t next_ = 0;      ///< next value of the generator's second counter
  std::uint64_t uniforms_ = 0;  ///< number of uniform numbers so far
  int left_ = 0;
  std::array<S, size> numbers_;
};

}  // namespace esokit::sim
