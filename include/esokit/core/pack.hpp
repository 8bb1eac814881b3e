/// @file
/// Pack: several floats or doubles that are processed at once (SIMD), as one scalar of the
/// library.
#pragma once

#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <esokit/core/lanes.hpp>
#include <esokit/core/scalar.hpp>
#include <initializer_list>

namespace esokit {

namespace detail {

/// Bytes of the vector registers that the compiler may use.
inline constexpr int register_bytes =
#if defined(__AVX512F__)
    64;
#elif defined(__AVX__)
    32;
#else
    16;
#endif

/// Numbers in one register.
template <class S>
inline constexpr int register_lanes = register_bytes / static_cast<int>(sizeof(S));

/// `Count` numbers in as many registers as they need, in the compiler's vector types. A vector type
/// wider than a register would be passed to functions by different ABI rules (-Wpsabi).
template <class S, int Count>
struct Registers {
  typedef S Register __attribute__((__vector_size__(sizeof(S) * Count)));

  // GCC and Clang both allow an element of a vector type to be accessed through a pointer to its
  // element type.
  [[nodiscard]] S& operator[](int lane) noexcept { return reinterpret_cast<S*>(&value)[lane]; }
  [[nodiscard]] const S& operator[](int lane) const noexcept {
    return reinterpret_cast<const S*>(&value)[lane];
  }

  /// Applies f to the registers of all `from`, one register after the other.
  template <class Function, class... From>
  ESOKIT_INLINE static constexpr Registers each(Function&& f, const From&... from) noexcept {
    return {Register(f(from.value...))};
  }

  /// Bitwise `and` of all registers.
  [[nodiscard]] ESOKIT_INLINE constexpr Register every() const noexcept { return value; }

  ESOKIT_INLINE constexpr void assign(const Registers& from) noexcept { value = from.value; }

  Register value;
};

// Two halves instead of an array, because GCC 12 keeps an array in memory.
template <class S, int Count>
requires(Count > register_lanes<S>) struct Registers<S, Count> {
  using Half = Registers<S, Count / 2>;
  using Register = typename Half::Register;

  [[nodiscard]] S& operator[](int lane) noexcept {
    return lane < Count / 2 ? low[lane] : high[lane - Count / 2];
  }
  [[nodiscard]] const S& operator[](int lane) const noexcept {
    return lane < Count / 2 ? low[lane] : high[lane - Count / 2];
  }
  template <class Function, class... From>
  ESOKIT_INLINE static constexpr Registers each(Function&& f, const From&... from) noexcept {
    return {Half::each(f, from.low...), Half::each(f, from.high...)};
  }
  [[nodiscard]] ESOKIT_INLINE constexpr Register every() const noexcept {
    return low.every() & high.every();
  }
  ESOKIT_INLINE constexpr void assign(const Registers& from) noexcept {
    low.assign(from.low);
    high.assign(from.high);
  }

  Half low;
  Half high;
};

template <class S>
using BitsOf = std::conditional_t<sizeof(S) == 4, std::int32_t, std::int64_t>;

/// True if all bits of a register are set.
template <class Bits>
ESOKIT_INLINE constexpr bool all_bits(const Bits& bits) noexcept {
  constexpr int words = sizeof(Bits) / sizeof(std::int64_t);
  if constexpr (words < 2) {
    using Word = std::conditional_t<words == 1, std::uint64_t, std::uint32_t>;
    return std::bit_cast<Word>(bits) == static_cast<Word>(-1);
  } else {
    // Read by subscript: an array of the words would go through memory.
    const auto word = std::bit_cast<typename Registers<std::int64_t, words>::Register>(bits);
#if defined(__AVX__)
    if constexpr (words == 4) {
      if (!std::is_constant_evaluated()) {
        typedef long long Words __attribute__((__vector_size__(32)));
        return __builtin_ia32_ptestc256(std::bit_cast<Words>(word), Words{-1, -1, -1, -1}) != 0;
      }
    }
#endif
    std::int64_t every = -1;
    unroll<words>([&](auto i) ESOKIT_INLINE_LAMBDA { every &= word[int{i}]; });
    return every == -1;
  }
}

}  // namespace detail

/// Number of lanes that fill one vector register of the compile target: 4 doubles with AVX2.
template <std::floating_point S>
inline constexpr int default_lanes = detail::register_lanes<S>;

/// The result of a comparison of packs, lane by lane.
template <class S, int Count>
class PackMask {
  using Bits = detail::Registers<detail::BitsOf<S>, Count>;
  using Register = typename Bits::Register;

 public:
  /// @cond
  ESOKIT_INLINE constexpr explicit PackMask(const Bits& bits) noexcept : bits_(bits) {}
  [[nodiscard]] ESOKIT_INLINE constexpr const Bits& bits() const noexcept { return bits_; }
  /// @endcond

  /// Whether the comparison holds in a lane.
  [[nodiscard]] bool operator[](int lane) const noexcept { return bits_[lane] != 0; }

  /// Lane by lane.
  /// @{
  ESOKIT_INLINE friend constexpr PackMask operator&&(const PackMask& a,
                                                     const PackMask& b) noexcept {
    return PackMask(
        Bits::each([](auto x, auto y) ESOKIT_INLINE_LAMBDA { return x & y; }, a.bits_, b.bits_));
  }
  ESOKIT_INLINE friend constexpr PackMask operator||(const PackMask& a,
                                                     const PackMask& b) noexcept {
    return PackMask(
        Bits::each([](auto x, auto y) ESOKIT_INLINE_LAMBDA { return x | y; }, a.bits_, b.bits_));
  }
  ESOKIT_INLINE friend constexpr PackMask operator!(const PackMask& a) noexcept {
    return PackMask(Bits::each([](auto x) ESOKIT_INLINE_LAMBDA { return ~x; }, a.bits_));
  }
  /// @}

  /// True if the comparison holds in every lane.
  ESOKIT_INLINE friend constexpr bool all(const PackMask& mask) noexcept {
    return detail::all_bits(mask.bits_.every());
  }

 private:
  Bits bits_;
};

/// `Count` floats or doubles, each of them (a lane) belonging to another plant: a scalar of the
/// library that computes all lanes at once.
///
/// Observers and controllers of packs: `Packed` (core/packed.hpp).
/// @tparam S float or double @tparam Count a power of two; more than `default_lanes` take several
///         registers, fewer leave part of a register idle
template <std::floating_point S, int Count = default_lanes<S>>
class Pack {
  static_assert(std::same_as<S, float> || std::same_as<S, double>,
                "esokit: a pack is made of float or double");
  static_assert(Count >= 2 && Count <= 64 && std::has_single_bit(static_cast<unsigned>(Count)),
                "esokit: a pack has 2, 4, 8, .. 64 lanes");

  using Values = detail::Registers<S, Count>;
  using Bits = detail::Registers<detail::BitsOf<S>, Count>;
  using Register = typename Values::Register;
  using BitRegister = typename Bits::Register;

 public:
  using value_type = S;                ///< of a lane
  using Mask = PackMask<S, Count>;     ///< what a comparison gives
  static constexpr int lanes = Count;  ///< number of lanes

  /// Zero.
  constexpr Pack() noexcept : Pack(0.0) {}
  /// The same number in every lane.
  ESOKIT_INLINE constexpr explicit Pack(double value) noexcept
      : values_(Values::each(
            [value]() ESOKIT_INLINE_LAMBDA { return Register{} + static_cast<S>(value); })) {}
  /// One number for each lane.
  constexpr Pack(const Array<S, Count>& values) noexcept : values_(std::bit_cast<Values>(values)) {}

  /// *this = from, register by register.
  ESOKIT_INLINE constexpr void assign(const Pack& from) noexcept { values_.assign(from.values_); }

  /// The number of a lane.
  /// @{
  [[nodiscard]] S& operator[](int lane) noexcept { return values_[lane]; }
  [[nodiscard]] const S& operator[](int lane) const noexcept { return values_[lane]; }
  /// @}

  /// Lane by lane.
  /// @{
  ESOKIT_INLINE friend constexpr Pack operator+(const Pack& a, const Pack& b) noexcept {
    return each([](auto x, auto y) ESOKIT_INLINE_LAMBDA { return x + y; }, a, b);
  }
  ESOKIT_INLINE friend constexpr Pack operator-(const Pack& a, const Pack& b) noexcept {
    return each([](auto x, auto y) ESOKIT_INLINE_LAMBDA { return x - y; }, a, b);
  }
  ESOKIT_INLINE friend constexpr Pack operator*(const Pack& a, const Pack& b) noexcept {
    return each([](auto x, auto y) ESOKIT_INLINE_LAMBDA { return x * y; }, a, b);
  }
  ESOKIT_INLINE friend constexpr Pack operator/(const Pack& a, const Pack& b) noexcept {
    return each([](auto x, auto y) ESOKIT_INLINE_LAMBDA { return x / y; }, a, b);
  }
  ESOKIT_INLINE friend constexpr Pack operator-(const Pack& a) noexcept {
    return each([](auto x) ESOKIT_INLINE_LAMBDA { return -x; }, a);
  }
  ESOKIT_INLINE friend constexpr Mask operator<(const Pack& a, const Pack& b) noexcept {
    return test([](auto x, auto y) ESOKIT_INLINE_LAMBDA { return x < y; }, a, b);
  }
  ESOKIT_INLINE friend constexpr Mask operator>(const Pack& a, const Pack& b) noexcept {
    return test([](auto x, auto y) ESOKIT_INLINE_LAMBDA { return x > y; }, a, b);
  }
  ESOKIT_INLINE friend constexpr Mask operator<=(const Pack& a, const Pack& b) noexcept {
    return test([](auto x, auto y) ESOKIT_INLINE_LAMBDA { return x <= y; }, a, b);
  }
  ESOKIT_INLINE friend constexpr Mask operator>=(const Pack& a, const Pack& b) noexcept {
    return test([](auto x, auto y) ESOKIT_INLINE_LAMBDA { return x >= y; }, a, b);
  }
  /// @}

  /// `mask ? a : b`, lane by lane.
  ESOKIT_INLINE friend constexpr Pack select(const Mask& mask, const Pack& a,
                                             const Pack& b) noexcept {
    return Pack(FromRegisters{}, Values::each(
                                     [](auto m, auto x, auto y) ESOKIT_INLINE_LAMBDA {
                                       return std::bit_cast<Register>(
                                           BitRegister((std::bit_cast<BitRegister>(x) & m) |
                                                       (std::bit_cast<BitRegister>(y) & ~m)));
                                     },
                                     mask.bits(), a.values_, b.values_));
  }

  /// See detail::upper_one; not by masks, which take four times as many operations. @{
  ESOKIT_INLINE static constexpr Pack larger_of(const Pack& a, const Pack& b) noexcept {
    return Pack(FromRegisters{},
                Values::each([](auto x, auto y) ESOKIT_INLINE_LAMBDA { return x < y ? y : x; },
                             a.values_, b.values_));
  }
  ESOKIT_INLINE static constexpr Pack smaller_of(const Pack& a, const Pack& b) noexcept {
    return Pack(FromRegisters{},
                Values::each([](auto x, auto y) ESOKIT_INLINE_LAMBDA { return y < x ? y : x; },
                             a.values_, b.values_));
  }
  /// @}

  /// Neither NaN nor infinite. Tests bits, so it also holds under -ffast-math.
  ESOKIT_INLINE friend constexpr Mask is_finite(const Pack& a) noexcept {
    [[maybe_unused]] constexpr auto exponent =
        std::bit_cast<detail::BitsOf<S>>(detail::unbounded<S>());
    if (std::is_constant_evaluated()) {  // GCC 12 folds no `and` of vectors
      return Mask(
          by_bits<Bits>(a, [&](auto bits) { return (bits & exponent) != exponent ? -1 : 0; }));
    }
#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
    Pack looked_at = a;
#if defined(__clang__)
    asm("" : "+m"(looked_at));  // see detail::opaque
#endif
    return test(
        [](auto x)
            ESOKIT_INLINE_LAMBDA { return (std::bit_cast<BitRegister>(x) & exponent) != exponent; },
        looked_at);
#else
    // x - x is zero for a finite number, else NaN. This needs no constants, which GCC would load
    // anew for each pack.
    return test(
        [](auto x) ESOKIT_INLINE_LAMBDA {
          const auto zero = x - x;
          return zero == zero;
        },
        a);
#endif
  }

  /// abs(a), lane by lane.
  [[nodiscard]] ESOKIT_INLINE constexpr Pack magnitude() const noexcept {
    [[maybe_unused]] constexpr auto rest = (std::numeric_limits<detail::BitsOf<S>>::max)();
    if (std::is_constant_evaluated()) {
      return Pack(FromRegisters{}, by_bits<Values>(*this, [&](auto bits) { return bits & rest; }));
    }
    return each(
        [](auto x) ESOKIT_INLINE_LAMBDA {
          return std::bit_cast<Register>(BitRegister(std::bit_cast<BitRegister>(x) & rest));
        },
        *this);
  }

  /// The functions of the standard library, lane by lane.
  /// @{
  ESOKIT_INLINE friend constexpr Pack(abs)(const Pack& x) noexcept { return x.magnitude(); }
  friend Pack exp(const Pack& x) noexcept {
    return lane_by_lane([](S a) { return std::exp(a); }, x);
  }
  friend Pack expm1(const Pack& x) noexcept {
    return lane_by_lane([](S a) { return std::expm1(a); }, x);
  }
  friend Pack sqrt(const Pack& x) noexcept {
    return lane_by_lane([](S a) { return std::sqrt(a); }, x);
  }
  friend Pack pow(const Pack& x, const Pack& p) noexcept {
    return lane_by_lane([](S a, S b) { return std::pow(a, b); }, x, p);
  }
  /// @}

 private:
  struct FromRegisters {};

  /// f of the bits of each lane, at compile time.
  template <class To, class Function>
  static constexpr To by_bits(const Pack& a, Function&& f) noexcept {
    auto bits = std::bit_cast<Array<detail::BitsOf<S>, Count>>(a.values_);
    for (auto& lane : bits) lane = f(lane);
    return std::bit_cast<To>(bits);
  }

  ESOKIT_INLINE constexpr Pack(FromRegisters, const Values& values) noexcept : values_(values) {}

  template <class Function, class... Packs>
  ESOKIT_INLINE static constexpr Pack each(Function&& f, const Packs&... packs) noexcept {
    return Pack(FromRegisters{}, Values::each(f, packs.values_...));
  }
  template <class Function, class... Packs>
  ESOKIT_INLINE static constexpr Mask test(Function&& f, const Packs&... packs) noexcept {
    return Mask(Bits::each(f, packs.values_...));
  }
  template <class Function, class... Packs>
  static Pack lane_by_lane(Function&& f, const Packs&... packs) noexcept {
    Pack result;
    for (int i = 0; i < Count; ++i) result[i] = f(packs[i]...);
    return result;
  }

  Values values_;
};

/// Number of lanes of a Pack.
template <class S, int Count>
inline constexpr int lane_count<Pack<S, Count>> = Count;

namespace detail {

template <class S, int Count>
struct AbsoluteValue<Pack<S, Count>> {
  ESOKIT_INLINE static constexpr Pack<S, Count> of(const Pack<S, Count>& value) noexcept {
    return value.magnitude();
  }
};

}  // namespace detail
}  // namespace esokit
