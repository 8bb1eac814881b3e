/// @file
/// What somebody writes by hand who wants speed: registers of GCC and Clang, with minimum and
/// maximum as instructions. The references of packs and of Monte Carlo.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <esokit/core/pack.hpp>
#include <esokit/gain/constant_gain.hpp>

namespace esokit::benchmarks {

/// A vector register of the compile target.
template <class S>
struct Raw {
  static constexpr int lanes = default_lanes<S>;
  typedef S Register __attribute__((vector_size(sizeof(S) * lanes)));
};
template <class S>
using RawRegister = typename Raw<S>::Register;

template <class R>
ESOKIT_INLINE R raw_minimum(R a, R b) noexcept {
  return a < b ? a : b;
}
template <class R>
ESOKIT_INLINE R raw_maximum(R a, R b) noexcept {
  return a > b ? a : b;
}

/// Whether no number is NaN or infinite.
template <class R>
ESOKIT_INLINE bool raw_finite(R x) noexcept {
  const R zero = x - x;
  const auto fine = zero == zero;
#if defined(__AVX__)
  typedef long long Words __attribute__((vector_size(32)));
  return __builtin_ia32_ptestc256(std::bit_cast<Words>(fine), Words{-1, -1, -1, -1}) != 0;
#elif defined(__SSE2__)
  typedef char Bytes __attribute__((vector_size(16)));
  return __builtin_ia32_pmovmskb128(std::bit_cast<Bytes>(fine)) == 0xffff;
#else
  for (std::size_t i = 0; i < sizeof(R) / sizeof(fine[0]); ++i) {
    if (fine[i] == 0) return false;
  }
  return true;
#endif
}

/// The observer of LinearEso<2> on the scaled chain. One test for all faults, by the squares of the
/// new state; it keeps the estimate, the innovation and a status.
template <class S>
struct RawEso2 {
  using R = RawRegister<S>;
  R x0{}, x1{}, x2{}, innovation{};
  R k0, k1, k2, scaled_input_gain;
  bool good = true;

  ESOKIT_INLINE bool update(const R& y, const R& u) noexcept {
    const R driven = x2 + scaled_input_gain * u;
    const R half_way = x1 + driven;
    const R p0 = x0 + half_way;
    const R p1 = half_way + driven;
    const R e = y - p0;
    const R n0 = p0 + k0 * e;
    const R n1 = p1 + k1 * e;
    const R n2 = x2 + k2 * e;
    if (!raw_finite(n0 * n0 + n1 * n1 + n2 * n2)) [[unlikely]] {
      good = false;
      return false;
    }
    x0 = n0;
    x1 = n1;
    x2 = n2;
    innovation = e;
    return true;
  }
};

template <class S>
RawEso2<S> raw_eso() {
  const auto gain =
      current_gain<3, S>(EqualSampledPoles<3, S>::from_bandwidth(60, S(1e-3)).weights());
  using R = RawRegister<S>;
  return {.k0 = R{} + gain[0],
          .k1 = R{} + gain[1],
          .k2 = R{} + gain[2],
          .scaled_input_gain = R{} + static_cast<S>(1e-6)};
}

/// The loop of Adrc<LinearEso<2>> around it: the law, a test of u, the limits; it keeps the u that
/// was asked for and the last one. `Rate`: with a limit of the rate, too.
template <class S, bool Rate>
struct RawAdrc2 {
  using R = RawRegister<S>;
  struct Rates {
    R step, low, high;
  };
  struct None {};
  RawEso2<S> observer;
  R w0, w1, w2, lower, upper;
  R requested{}, last{};
  [[no_unique_address]] std::conditional_t<Rate, Rates, None> rates{};

  ESOKIT_INLINE R update(const R& y, const R& r) noexcept {
    if (!observer.update(y, last)) [[unlikely]]
      return last;
    R u = w0 * (r - observer.x0) - (w1 * observer.x1 + w2 * observer.x2);
    if (!raw_finite(u)) [[unlikely]]
      return last;
    requested = u;
    if constexpr (Rate) {
      u = raw_minimum(raw_maximum(u, rates.low), rates.high);
      rates.low = raw_minimum(raw_maximum(lower, R(u - rates.step)), upper);
      rates.high = raw_maximum(raw_minimum(upper, R(u + rates.step)), lower);
    } else {
      u = raw_minimum(raw_maximum(u, lower), upper);
    }
    last = u;
    return u;
  }
};

template <class S, bool Rate>
RawAdrc2<S, Rate> raw_adrc() {
  using R = RawRegister<S>;
  const auto all = [](double x) { return R{} + static_cast<S>(x); };
  RawAdrc2<S, Rate> made{.observer = raw_eso<S>(),
                         .w0 = all(12.5),
                         .w1 = all(5e3),
                         .w2 = all(1e6),
                         .lower = all(-1e3),
                         .upper = all(1e3)};
  if constexpr (Rate) made.rates = {.step = all(1e2), .low = all(-1e2), .high = all(1e2)};
  return made;
}

}  // namespace esokit::benchmarks
