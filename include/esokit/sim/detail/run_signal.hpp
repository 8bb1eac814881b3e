/// @file
/// The reference and the disturbance of a run: a number or a function of time.
#pragma once

#include <concepts>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/sim/signal.hpp>
#include <functional>
#include <type_traits>
#include <utility>

namespace esokit::sim {

namespace detail {

/// The result of a function of time: a number, or a vector of at most `Count`.
template <class Value, class ScalarType, int Count>
concept SignalValue = std::convertible_to<Value, ScalarType> ||
    (esokit::detail::vector_size<std::remove_cvref_t<Value>> >= 1 &&
     esokit::detail::vector_size<std::remove_cvref_t<Value>> <= Count);

}  // namespace detail

/// A constant or a function of t (s), with `Count` elements.
///
/// With `Derivatives` the elements are (s, s', ..): a plain number stands for (s, 0, ..), a vector
/// may be shorter, and a DifferentiableSignal also gives its derivatives. Without, the elements are
/// channels.
template <Scalar ScalarType, int Count, bool Derivatives = false>
class RunSignal {
  template <class Value>
  static constexpr bool fits = detail::SignalValue<Value, ScalarType, Count> &&
                               (Derivatives || Count == 1 ||
                                esokit::detail::vector_size<std::remove_cvref_t<Value>> == Count);

 public:
  using Time = LaneScalar<ScalarType>;      ///< t, s
  using Value = Vector<ScalarType, Count>;  ///< its value

  /// Zero.
  RunSignal() = default;

  /// A constant.
  RunSignal(const ScalarType& value) requires(Derivatives || Count == 1) { constant_(0) = value; }
  /// A constant.
  RunSignal(const Value& value) requires(Count > 1) : constant_(value), plain_(false) {}

  /// f(t).
  template <class F>
  requires std::invocable<const F&, Time> RunSignal(F f)
      : plain_(std::convertible_to<std::invoke_result_t<const F&, Time>, ScalarType>) {
    using Result = std::invoke_result_t<const F&, Time>;
    static_assert(fits<Result>,
                  "esokit: the function must give one number, one per channel, or no more "
                  "derivatives than the controller takes");
    if constexpr (Derivatives && Count > 1 && DifferentiableSignal<F, Time> &&
                  std::same_as<ScalarType, Time>) {
      plain_ = false;
      function_ = [f = std::move(f)](const Time& t, Value& value) {
        const auto all = f.template derivatives<Count>(t);
        for (int i = 0; i < Count; ++i) value(i) = all[static_cast<std::size_t>(i)];
      };
    } else {
      function_ = [f = std::move(f)](const Time& t, Value& value) {
        if constexpr (std::convertible_to<Result, ScalarType>) {
          value(0) = static_cast<ScalarType>(f(t));
        } else {
          const auto given = f(t);
          for (int i = 0; i < esokit::detail::vector_size<std::remove_cvref_t<Result>>; ++i) {
            value(i) = static_cast<ScalarType>(given(i));
          }
        }
      };
    }
  }

  /// From a plain signal, the same in every lane.
  template <Scalar Plain>
  requires(lane_count<ScalarType> > 1 && std::same_as<Plain, LaneScalar<ScalarType>>)
      RunSignal(const RunSignal<Plain, Count, Derivatives>& plain)
      : plain_(plain.plain()) {
    const auto all_lanes = [plain](const Time& t, Value& value) {
      const auto numbers = plain(t);
      for (int i = 0; i < Count; ++i) {
        for (int lane = 0; lane < lane_count<ScalarType>; ++lane) value(i)[lane] = numbers(i);
      }
    };
    if (plain.constant()) {
      all_lanes(Time(0), constant_);
    } else {
      function_ = all_lanes;
    }
  }

  /// The value at t.
  [[nodiscard]] Value operator()(const Time& t) const {
    Value value;
    write(t, value);
    return value;
  }
  /// The same into `value`, which is zero or was written before: a loop has no numbers to copy.
  void write(const Time& t, Value& value) const {
    if (function_) {
      function_(t, value);
    } else {
      value = constant_;
    }
  }

  /// True if it gives one number; derivatives, if needed, are then zero.
  [[nodiscard]] bool plain() const noexcept { return plain_; }
  /// True if it is constant, not a function.
  [[nodiscard]] bool constant() const noexcept { return !function_; }

 private:
  Value constant_{};
  std::function<void(const Time&, Value&)> function_;  ///< writes the same elements each time
  bool plain_ = true;
};

}  // namespace esokit::sim
