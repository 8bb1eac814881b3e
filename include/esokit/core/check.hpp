/// @file
/// The rules by which configs are checked, each with its error text.
#pragma once

#include <concepts>
#include <cstdlib>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <limits>

namespace esokit {

/// Outcome of a check: success, or the error of the value.
template <Scalar S>
using Check = Expected<void, Error<S>>;

namespace detail {

struct AnyMember;
template <class...>
inline constexpr bool takes_names_only = false;

}  // namespace detail

/// The first member of a config, which takes no room. With it the values of a config have names,
/// `{.observer_bandwidth = 100.0, ..}`: a list without names does not compile, as numbers in
/// another order would.
/// Declare it `[[no_unique_address]]` in a config of numbers. Not in one with a string or a vector:
/// Clang 14 crashes at a constant of that struct outside a function.
/// @tparam Config the struct itself, so that no two at one address are of one type
template <class Config>
struct ByName {
  // Not = default: Clang 16 would clear a byte for it, in which another member lies.
  constexpr ByName() noexcept {}
  /// Does not compile.
  template <class... Values>
  requires(sizeof...(Values) > 0 &&
           !(std::same_as<Values, detail::AnyMember> || ...)) constexpr ByName(const Values&...) {
    static_assert(detail::takes_names_only<Values...>,
                  "esokit: write the names of the settings, {.observer_bandwidth = 100.0, ..}: "
                  "without them nobody sees a wrong order");
  }
};

namespace detail {

/// Smallest positive normal number of the scalar; for autodiff types that of double.
template <Scalar S>
constexpr S smallest_normal() noexcept {
  return S((std::numeric_limits<TableScalar<S>>::min)());
}

/// The larger of the two, or the one that is not finite. Not std::max, because `<algorithm>` takes
/// longer to compile than a controller.
template <PlainScalar S>
constexpr S larger(const S& a, const S& b) noexcept {
  return is_finite(a) && (!is_finite(b) || a < b) ? b : a;
}

template <PlainScalar S, int Rows, int Columns>
constexpr S largest_magnitude(const Matrix<S, Rows, Columns>& matrix) noexcept {
  S largest(0);
  for (const S& element : matrix) largest = larger(largest, absolute(element));
  return largest;
}

template <PlainScalar S, int Rows, int Columns>
constexpr bool all_finite(const Matrix<S, Rows, Columns>& matrix) noexcept {
  for (const S& element : matrix) {
    if (!is_finite(element)) return false;
  }
  return true;
}

/// value <= limit, where one of them was computed from other numbers. Settings that are exactly at
/// a limit in decimals are so in binary but for a few roundings: six halves of a digit, of the
/// largest number that went into it. What must not be passed is clamped afterwards.
/// @param size the largest number that went into them, if they are smaller than it
template <Scalar S>
[[gnu::__noinline__]] constexpr bool at_most(const S& value, const S& limit,
                                             const S& size = S(0.0)) noexcept {
  if (!all(is_finite(value))) return false;
  if (all(value <= limit)) return true;
  const S largest = upper_one(upper_one(absolute(value), absolute(limit)), absolute(size));
  return all(value - limit <= S(3.0) * rounding<S>() * largest);
}
/// value < limit, so that what is at the limit in decimals is refused.
template <Scalar S>
constexpr bool below(const S& value, const S& limit, const S& size = S(0.0)) noexcept {
  return all(is_finite(value)) && !at_most(limit, value, size);
}
/// The same number, perhaps computed in two ways.
template <Scalar S>
constexpr bool same(const S& a, const S& b) noexcept {
  return at_most(a, b) && at_most(b, a);
}

/// A normal number, neither infinite nor lost in the subnormals.
template <Scalar S>
constexpr bool normal(const S& value) {
  return all(is_finite(value)) && all(absolute(value) >= smallest_normal<S>());
}

}  // namespace detail

/// The rules of a config, in the order in which they are written: the first broken rule is the
/// error, later ones do not change it.
///
///     Rules<S> rules;
///     rules.positive("sample_time", config.sample_time).finite("gains", config.gains);
///     if (!rules) return rules.error();
///
/// All rules are evaluated, because a comparison costs less than a branch; a rule that computes
/// with a value checked by an earlier rule belongs in `and_then`. A list of values is checked
/// element by element, and the error has the index.
template <Scalar S>
class [[nodiscard]] Rules {
 public:
  /// True if no rule is broken so far.
  [[nodiscard]] constexpr explicit operator bool() const noexcept { return outcome_.has_value(); }

  /// The first broken rule; aborts if there is none.
  [[nodiscard]] constexpr const Error<S>& error() const noexcept { return outcome_.error(); }

  /// Lets a function that returns `Check` return its rules.
  constexpr operator const Check<S>&() const noexcept { return outcome_; }

  // Each rule tests finiteness by bits before it compares: under -ffast-math a comparison with NaN
  // may go either way. They are out of line, because `make` is not time-critical and firmware
  // contains each rule many times. They are not marked cold, because GCC compiles what follows a
  // cold call for size.

  /// Neither NaN nor infinite.
  [[gnu::__noinline__]] constexpr Rules& finite(const char* field, const S& value, int index = -1) {
    return demand(all(is_finite(value)), field, value, "must be finite", index);
  }

  /// Finite and above zero.
  [[gnu::__noinline__]] constexpr Rules& positive(const char* field, const S& value,
                                                  int index = -1) {
    return demand(all(is_finite(value)) && all(value > S(0.0)), field, value,
                  "must be finite and positive", index);
  }

  /// Finite and zero or above.
  [[gnu::__noinline__]] constexpr Rules& not_negative(const char* field, const S& value,
                                                      int index = -1) {
    return demand(all(is_finite(value)) && all(value >= S(0.0)), field, value,
                  "must be finite and not negative", index);
  }

  /// Finite and not zero; either sign.
  [[gnu::__noinline__]] constexpr Rules& nonzero(const char* field, const S& value,
                                                 int index = -1) {
    return demand(all(is_finite(value)) && all(detail::absolute(value) > S(0.0)), field, value,
                  "must be finite and not zero (negative is fine)", index);
  }

  /// Usable as a divisor: neither it nor its inverse is zero, subnormal or infinite.
  [[gnu::__noinline__]] constexpr Rules& invertible(const char* field, const S& value,
                                                    int index = -1) {
    nonzero(field, value, index);
    if (!outcome_) return *this;
    return representable(field, value, S(S(1.0) / value),
                         "has an inverse that the scalar cannot hold", index);
  }

  /// Finite and above a limit, which the error carries.
  [[gnu::__noinline__]] constexpr Rules& above(const char* field, const S& value, const S& limit) {
    return demand(all(is_finite(value)) && all(value > limit),
                  {field, value, "must be finite and above", -1, limit, true});
  }

  /// `derived` is a normal number: neither zero, subnormal nor infinite. The error names the config
  /// field from which it was computed.
  [[gnu::__noinline__]] constexpr Rules& representable(const char* field, const S& value,
                                                       const S& derived, const char* rule,
                                                       int index = -1) {
    return demand(detail::normal(derived), field, value, rule, index);
  }

  /// Zero, as in a config that does not mention the field.
  [[gnu::__noinline__]] constexpr Rules& left_out(const char* field, const S& value,
                                                  const char* rule) {
    return demand(all(is_finite(value)) && !all(detail::absolute(value) > S(0.0)), field, value,
                  rule);
  }

  /// Each element of a list.
  /// @{
  template <class List>
  requires(!std::convertible_to<List, S>) constexpr Rules& finite(const char* field,
                                                                  const List& values) {
    return each(values, [&](const S& value, int i) { finite(field, value, i); });
  }
  template <class List>
  requires(!std::convertible_to<List, S>) constexpr Rules& positive(const char* field,
                                                                    const List& values) {
    return each(values, [&](const S& value, int i) { positive(field, value, i); });
  }
  template <class List>
  requires(!std::convertible_to<List, S>) constexpr Rules& not_negative(const char* field,
                                                                        const List& values) {
    return each(values, [&](const S& value, int i) { not_negative(field, value, i); });
  }
  /// @}

  /// A rule of your own: an error of `value` unless `kept`.
  constexpr Rules& demand(bool kept, const char* field, const S& value, const char* rule,
                          int index = -1) {
    if (!kept) break_by(field, value, rule, index);
    return *this;
  }

  /// The same with a complete error, which may carry a limit.
  constexpr Rules& demand(bool kept, const Error<S>& error) {
    if (!kept) break_by(error);
    return *this;
  }

  /// The outcome of another function: a `Check`, `Rules` or an `Expected`.
  template <class Outcome>
  constexpr Rules& all_of(const Outcome& outcome) {
    if (!outcome) break_by(outcome.error());
    return *this;
  }

  /// The rules of a function, which is called only if no rule was broken before.
  template <class F>
  constexpr Rules& and_then(const F& rules) {
    return outcome_ ? all_of(rules()) : *this;
  }

 private:
  ESOKIT_COLD constexpr void break_by(const char* field, const S& value, const char* rule,
                                      int index) {
    if (outcome_) outcome_ = Error<S>{field, value, rule, index};
  }

  ESOKIT_COLD constexpr void break_by(const Error<S>& error) {
    if (outcome_) outcome_ = error;
  }

  template <class List, class F>
  constexpr Rules& each(const List& values, const F& rule) {
    int i = 0;
    for (const S& value : values) rule(value, i++);
    return *this;
  }

  Check<S> outcome_{};
};

namespace detail {

/// In a `make`: packs have another one.
template <class S>
consteval bool refuses_packs() {
  static_assert(
      !PackScalar<S>,
      "esokit: packs are made lane by lane: Packed<LinearEso<2>, 4>::make (core/packed.hpp)");
  return true;
}

/// `retune` of every type that has `make` and `adopt`.
template <class T>
Check<typename T::scalar_type> retune(T& object, const typename T::Config& config) {
  const auto fresh = T::make(config);
  if (!fresh) return fresh.error();
  return object.adopt(*fresh);
}

}  // namespace detail

}  // namespace esokit
