/// @file
/// RecordingScalar: a scalar that notes each operation, so that one call of a step gives the list
/// of operations of which the step consists. For the workstation; `target/recorder.hpp` records
/// whole objects with it.
#pragma once

#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <esokit/core/lanes.hpp>
#include <esokit/core/scalar.hpp>
#include <type_traits>
#include <vector>

namespace esokit {

/// What an Instruction computes, from the results a, b and c of earlier ones.
enum class Operation : unsigned char {
  constant,              ///< the number `value`; of a condition 1 or 0
  argument,              ///< argument number a of the list
  add,                   ///< a + b
  subtract,              ///< a - b
  multiply,              ///< a b
  divide,                ///< a / b
  negate,                ///< -a
  magnitude,             ///< abs(a)
  square_root,           ///< sqrt(a)
  power,                 ///< a to the power of b
  exponential,           ///< e^a
  exponential_less_one,  ///< e^a - 1
  sine,                  ///< sin(a)
  cosine,                ///< cos(a)
  tangent,               ///< tan(a)
  arc_tangent,           ///< atan(a)
  hyperbolic_tangent,    ///< tanh(a)
  choose,                ///< b if the condition a holds, else c
  less,                  ///< a < b; from here on a condition
  greater,               ///< a > b
  at_most,               ///< a <= b
  at_least,              ///< a >= b
  finite,                ///< neither NaN nor infinite
  both,                  ///< a and b
  either,                ///< a or b
  opposite               ///< not a
};

/// True if an operation gives a condition, not a number.
constexpr bool is_condition(Operation operation) noexcept { return operation >= Operation::less; }

/// One line of an OperationList.
struct Instruction {
  Operation operation = Operation::constant;  ///< what is done
  int a = -1;        ///< index of the first operand, or number of the argument; -1: none
  int b = -1;        ///< index of the second operand
  int c = -1;        ///< index of the third operand
  double value = 0;  ///< of a constant; a double holds a float
};

/// The operations of one call, in their order. Equal operations are one.
struct OperationList {
  std::vector<Instruction> instructions{};  ///< an operand comes before what needs it

  /// The conditions of which the call asked `all(condition)`: if one does not hold, the call takes
  /// another way, of which this list knows nothing.
  std::vector<int> checks{};
  /// True if the call looked at a single lane of a number that is no constant. Then what it did
  /// next may depend on the number, and the list is not the call.
  bool was_looked_into = false;

  /// Notes an operation. @return its index, that of an equal one if there is one
  // Not inlined, as what follows that notes: a flattened step would hold it at each operation.
  [[gnu::__noinline__]] int note(const Instruction& given) {
    for (std::size_t i = 0; i < instructions.size(); ++i) {
      const Instruction& one = instructions[i];
      if (one.operation == given.operation && one.a == given.a && one.b == given.b &&
          one.c == given.c &&
          std::bit_cast<std::uint64_t>(one.value) == std::bit_cast<std::uint64_t>(given.value)) {
        return static_cast<int>(i);
      }
    }
    instructions.push_back(given);
    return static_cast<int>(instructions.size()) - 1;
  }

  /// Whether the sign of a result is never minus: not of a zero either. (NaN has none that counts.)
  [[nodiscard]] bool is_never_negative(int index) const {
    const Instruction& one = instructions[static_cast<std::size_t>(index)];
    switch (one.operation) {
      case Operation::constant:
        return !std::signbit(one.value);
      case Operation::magnitude:
      case Operation::exponential:
        return true;
      case Operation::square_root:
        return is_never_negative(one.a);
      case Operation::add:
      case Operation::divide:
        return is_never_negative(one.a) && is_never_negative(one.b);
      case Operation::multiply:
        return one.a == one.b || (is_never_negative(one.a) && is_never_negative(one.b));
      case Operation::choose:
        return is_never_negative(one.b) && is_never_negative(one.c);
      default:
        return false;
    }
  }

  /// Whether a result is never the zero with a minus: adding zero leaves it bit for bit.
  [[nodiscard]] bool is_never_minus_zero(int index) const {
    const Instruction& one = instructions[static_cast<std::size_t>(index)];
    if (is_never_negative(index)) return true;
    switch (one.operation) {
      case Operation::add:  // both would have to be
        return is_never_minus_zero(one.a) || is_never_minus_zero(one.b);
      case Operation::subtract:
        return is_never_minus_zero(one.a);
      case Operation::choose:
        return is_never_minus_zero(one.b) && is_never_minus_zero(one.c);
      default:
        return false;
    }
  }
};

namespace detail {

/// What is known of a recorded number or condition: the list and its index there; without a list it
/// is a constant.
struct Noted {
  OperationList* list = nullptr;
  int index = -1;

  [[nodiscard]] bool known() const noexcept { return list == nullptr; }
  void look() const noexcept {
    if (list != nullptr) list->was_looked_into = true;
  }
};

/// The index of an operand; a constant is noted in `list`.
inline int operand(OperationList& list, const Noted& noted, double value) {
  return noted.known() ? list.note({.value = value}) : noted.index;
}

}  // namespace detail

/// The result of a comparison of recording scalars.
class RecordedCondition {
 public:
  /// @cond
  constexpr explicit RecordedCondition(bool holds) noexcept : holds_(holds) {}
  RecordedCondition(bool holds, const detail::Noted& noted) noexcept
      : holds_(holds), noted_(noted) {}
  [[nodiscard]] const detail::Noted& noted() const noexcept { return noted_; }
  [[nodiscard]] bool holds() const noexcept { return holds_; }
  /// @endcond

  /// Does not compile: both ways of a branch would have to be recorded.
  template <std::same_as<bool> Result>
  explicit operator Result() const {
    static_assert(!std::same_as<Result, bool>,
                  "esokit: a branch on a value cannot be recorded: instead of if, ?:, min and max "
                  "write select(condition, a, b)");
    return false;
  }

  /// Whether it holds in a lane; the list says that it was looked into.
  [[nodiscard]] bool operator[](int) const noexcept {
    noted_.look();
    return holds_;
  }

  /// Noted. @{
  friend RecordedCondition operator&&(const RecordedCondition& a, const RecordedCondition& b) {
    if (a.noted_.known()) return a.holds_ ? b : a;
    if (b.noted_.known()) return b.holds_ ? a : b;
    return a.with(Operation::both, b, a.holds_ && b.holds_);
  }
  friend RecordedCondition operator||(const RecordedCondition& a, const RecordedCondition& b) {
    if (a.noted_.known()) return a.holds_ ? a : b;
    if (b.noted_.known()) return b.holds_ ? b : a;
    return a.with(Operation::either, b, a.holds_ || b.holds_);
  }
  friend RecordedCondition operator!(const RecordedCondition& a) {
    if (a.noted_.known()) return RecordedCondition(!a.holds_);
    OperationList& list = *a.noted_.list;
    return {!a.holds_, {&list, list.note({.operation = Operation::opposite, .a = a.noted_.index})}};
  }
  /// @}

  /// True, and a check of the list: in a step a condition that does not hold in every lane is a
  /// fault. Of a constant condition what it is.
  friend bool all(const RecordedCondition& condition) {
    if (condition.noted_.known()) return condition.holds_;
    condition.noted_.list->checks.push_back(condition.noted_.index);
    return true;
  }

 private:
  [[nodiscard, gnu::__noinline__]] RecordedCondition with(Operation operation,
                                                          const RecordedCondition& b,
                                                          bool holds) const {
    OperationList& list = *noted_.list;
    return {holds,
            {&list, list.note({.operation = operation, .a = noted_.index, .b = b.noted_.index})}};
  }

  bool holds_;
  detail::Noted noted_;
};

/// A number that remembers how it was computed. Operations on constants are done at once, in V;
/// all others are noted in the list from which their operands come.
///
/// To the library it is a pack of two equal lanes: whatever works on packs, by `select` instead of
/// branches, can be recorded as it is.
/// @tparam V float or double
template <std::floating_point V>
class RecordingScalar {
  static_assert(sizeof(V) <= sizeof(double), "esokit: a recording scalar is of float or double");
  using Self = RecordingScalar;

 public:
  using value_type = V;  ///< what it records

  /// Zero.
  constexpr RecordingScalar() noexcept = default;
  /// A constant. From V or an integer by itself, as C++ converts them beside a V, too; another
  /// floating type would not be computed in V.
  template <class Number>
  requires(std::is_arithmetic_v<Number>) constexpr explicit(!std::is_same_v<Number, V> &&
                                                            !std::is_integral_v<Number>)
      RecordingScalar(Number value) noexcept
      : value_(static_cast<V>(value)) {}
  /// Argument number `number` of a list. @param value with which the constants beside it are made
  RecordingScalar(OperationList& list, int number, V value)
      : value_(value), noted_{&list, list.note({.operation = Operation::argument, .a = number})} {}

  /// Whether it is a constant.
  [[nodiscard]] bool is_constant() const noexcept { return noted_.known(); }
  /// The constant.
  [[nodiscard]] V value() const noexcept { return value_; }
  /// Its index in a list; a constant is noted there.
  [[nodiscard]] int index_in(OperationList& list) const {
    return detail::operand(list, noted_, static_cast<double>(value_));
  }

  /// The number of a lane; if it is no constant, the list says that it was looked into. @{
  [[nodiscard]] V& operator[](int) noexcept {
    noted_.look();
    return value_;
  }
  [[nodiscard]] const V& operator[](int) const noexcept {
    noted_.look();
    return value_;
  }
  /// @}

  /// abs(x), noted.
  [[nodiscard]] Self magnitude() const { return with(Operation::magnitude, std::fabs(value_)); }

  /// Noted, but for a zero that changes nothing. @{
  friend Self operator+(const Self& a, const Self& b) {
    if (b.adds_nothing_to(a)) return a;
    if (a.adds_nothing_to(b)) return b;
    return a.with(Operation::add, b, a.value_ + b.value_);
  }
  friend Self operator-(const Self& a, const Self& b) {
    if (b.is_constant() && (-b).adds_nothing_to(a)) return a;
    return a.with(Operation::subtract, b, a.value_ - b.value_);
  }
  friend Self operator*(const Self& a, const Self& b) {
    return a.with(Operation::multiply, b, a.value_ * b.value_);
  }
  friend Self operator/(const Self& a, const Self& b) {
    return a.with(Operation::divide, b, a.value_ / b.value_);
  }
  friend Self operator-(const Self& a) { return a.with(Operation::negate, -a.value_); }
  friend Self(abs)(const Self& a) { return a.magnitude(); }
  friend Self fabs(const Self& a) { return a.magnitude(); }
  friend Self sqrt(const Self& a) { return a.with(Operation::square_root, std::sqrt(a.value_)); }
  friend Self exp(const Self& a) { return a.with(Operation::exponential, std::exp(a.value_)); }
  friend Self expm1(const Self& a) {
    return a.with(Operation::exponential_less_one, std::expm1(a.value_));
  }
  friend Self sin(const Self& a) { return a.with(Operation::sine, std::sin(a.value_)); }
  friend Self cos(const Self& a) { return a.with(Operation::cosine, std::cos(a.value_)); }
  friend Self tan(const Self& a) { return a.with(Operation::tangent, std::tan(a.value_)); }
  friend Self atan(const Self& a) { return a.with(Operation::arc_tangent, std::atan(a.value_)); }
  friend Self tanh(const Self& a) {
    return a.with(Operation::hyperbolic_tangent, std::tanh(a.value_));
  }
  friend Self pow(const Self& a, const Self& b) {
    return a.with(Operation::power, b, std::pow(a.value_, b.value_));
  }
  /// C++ computes the power of a float and an integer in double.
  template <std::integral Exponent>
  requires(sizeof(V) < sizeof(double)) friend Self pow(const Self&, Exponent) = delete;
  friend Self& operator+=(Self& a, const Self& b) { return a = a + b; }
  friend Self& operator-=(Self& a, const Self& b) { return a = a - b; }
  friend Self& operator*=(Self& a, const Self& b) { return a = a * b; }
  friend Self& operator/=(Self& a, const Self& b) { return a = a / b; }
  friend RecordedCondition operator<(const Self& a, const Self& b) {
    return a.compared(Operation::less, b, a.value_ < b.value_);
  }
  friend RecordedCondition operator>(const Self& a, const Self& b) {
    return a.compared(Operation::greater, b, a.value_ > b.value_);
  }
  friend RecordedCondition operator<=(const Self& a, const Self& b) {
    return a.compared(Operation::at_most, b, a.value_ <= b.value_);
  }
  friend RecordedCondition operator>=(const Self& a, const Self& b) {
    return a.compared(Operation::at_least, b, a.value_ >= b.value_);
  }
  friend RecordedCondition is_finite(const Self& a) {
    const bool holds = esokit::is_finite(a.value_);
    if (a.is_constant()) return RecordedCondition(holds);
    OperationList& list = *a.noted_.list;
    return {holds, {&list, list.note({.operation = Operation::finite, .a = a.noted_.index})}};
  }
  friend Self select(const RecordedCondition& condition, const Self& a, const Self& b) {
    return chosen(condition, a, b);
  }
  /// @}

 private:
  /// Whether it is a zero, and a noted `other` plus it has the bits of `other`.
  [[nodiscard]] bool adds_nothing_to(const Self& other) const {
    if (!is_constant() || other.is_constant() || value_ < V(0) || value_ > V(0) ||
        std::isnan(value_)) {
      return false;
    }
    return std::signbit(value_) || other.noted_.list->is_never_minus_zero(other.noted_.index);
  }
  [[nodiscard, gnu::__noinline__]] static Self chosen(const RecordedCondition& condition,
                                                      const Self& a, const Self& b) {
    Self chosen = condition.holds() ? a : b;
    if (condition.noted().known()) return chosen;
    OperationList& list = *condition.noted().list;
    const int first = a.index_in(list);
    const int second = b.index_in(list);
    const int index = first == second ? first
                                      : list.note({.operation = Operation::choose,
                                                   .a = condition.noted().index,
                                                   .b = first,
                                                   .c = second});
    chosen.noted_ = {&list, index};
    return chosen;
  }
  [[nodiscard, gnu::__noinline__]] Self with(Operation operation, V value) const {
    Self result(static_cast<double>(value));
    if (!is_constant()) {
      result.noted_ = {noted_.list, noted_.list->note({.operation = operation, .a = noted_.index})};
    }
    return result;
  }
  [[nodiscard, gnu::__noinline__]] detail::Noted both(Operation operation, const Self& b) const {
    if (is_constant() && b.is_constant()) return {};
    OperationList& list = is_constant() ? *b.noted_.list : *noted_.list;
    const int first = index_in(list);
    const int second = b.index_in(list);
    return {&list, list.note({.operation = operation, .a = first, .b = second})};
  }
  [[nodiscard, gnu::__noinline__]] Self with(Operation operation, const Self& b, V value) const {
    Self result(static_cast<double>(value));
    result.noted_ = both(operation, b);
    return result;
  }
  [[nodiscard, gnu::__noinline__]] RecordedCondition compared(Operation operation, const Self& b,
                                                              bool holds) const {
    return {holds, both(operation, b)};
  }

  V value_{};
  detail::Noted noted_;
};

/// `select` where both are constants.
template <std::floating_point V>
[[nodiscard]] RecordingScalar<V> select(const RecordedCondition& condition, V a, V b) {
  return select(condition, RecordingScalar<V>(a), RecordingScalar<V>(b));
}

/// To the library a pack of two lanes.
template <class V>
inline constexpr int lane_count<RecordingScalar<V>> = 2;

/// Conditions that are shortcuts must not become checks.
template <class V>
inline constexpr bool records<RecordingScalar<V>> = true;

namespace detail {

template <class V>
struct AbsoluteValue<RecordingScalar<V>> {
  static RecordingScalar<V> of(const RecordingScalar<V>& value) { return value.magnitude(); }
};

}  // namespace detail
}  // namespace esokit
