// What must hold at compile time: sizes, types, what cannot be written.
#include <gtest/gtest.h>

#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/dual.hpp>
#include <support/pack.hpp>
#include <type_traits>

namespace observer_observer_static_test {

using esokit::CascadeEso;
using esokit::LinearEso;
using esokit::StepStatus;

// Three states, three gains, pole, b0 and its scaled form, T and 1/T, innovation, last input, four
// counters.
static_assert(sizeof(LinearEso<2, float>) <= 60);
static_assert(sizeof(LinearEso<2>) <= 112);
static_assert(sizeof(CascadeEso<2, 1, float>) == sizeof(LinearEso<2, float>));

static_assert(std::is_trivially_copyable_v<LinearEso<2, float>>);
static_assert(std::is_trivially_copyable_v<CascadeEso<2, 3>>);
static_assert(!std::is_polymorphic_v<LinearEso<2>>);
static_assert(!std::is_default_constructible_v<LinearEso<2>>, "only make() makes one");
static_assert(std::is_copy_constructible_v<CascadeEso<2, 3>> &&
              std::is_copy_assignable_v<CascadeEso<2, 3>>);

// Everything that runs in the loop.
template <class T>
constexpr bool steps_are_noexcept =
    noexcept(std::declval<T&>()
                 .update(std::declval<typename T::scalar_type>(),
                         std::declval<typename T::scalar_type>())) && noexcept(std::declval<T&>().predict(std::declval<typename T::scalar_type>())) && noexcept(std::
                                                                                                                                                                    declval<
                                                                                                                                                                        T&>()
                                                                                                                                                                        .correct(std::
                                                                                                                                                                                     declval<typename T::scalar_type>())) && noexcept(std::declval<const T&>()
                                                                                                                                                                                                                                          .estimate()) && noexcept(std::
                                                                                                                                                                                                                                                                       declval<
                                                                                                                                                                                                                                                                           const T&>()
                                                                                                                                                                                                                                                                           .total_disturbance()) && noexcept(std::
                                                                                                                                                                                                                                                                                                                 declval<
                                                                                                                                                                                                                                                                                                                     const T&>()
                                                                                                                                                                                                                                                                                                                     .innovation()) && noexcept(std::
                                                                                                                                                                                                                                                                                                                                                    declval<
                                                                                                                                                                                                                                                                                                                                                        T&>()
                                                                                                                                                                                                                                                                                                                                                        .reset(
                                                                                                                                                                                                                                                                                                                                                            std::declval<typename T::
                                                                                                                                                                                                                                                                                                                                                                             scalar_type>())) && noexcept(std::declval<T&>()
                                                                                                                                                                                                                                                                                                                                                                                                              .reset(
                                                                                                                                                                                                                                                                                                                                                                                                                  std::declval<
                                                                                                                                                                                                                                                                                                                                                                                                                      const typename T::
                                                                                                                                                                                                                                                                                                                                                                                                                          Estimate&>()));
static_assert(steps_are_noexcept<LinearEso<2>>);
static_assert(steps_are_noexcept<CascadeEso<2, 3, float>>);
static_assert(steps_are_noexcept<LinearEso<2, esokit_test::Dual>>);

// Template contract: sizes first, then scalar, then extension.
static_assert(std::is_same_v<LinearEso<2>, LinearEso<2, double, 1>>);
static_assert(std::is_same_v<CascadeEso<2, 3>, CascadeEso<2, 3, double, 1>>);
static_assert(LinearEso<3, float, 2>::size == 5 && LinearEso<3, float, 2>::order == 3 &&
              LinearEso<3, float, 2>::extension == 2 && CascadeEso<1, 4>::levels == 4);
static_assert(std::is_same_v<LinearEso<2, float>::scalar_type, float>);

// A float config takes float literals; a double would narrow.
template <class Config>
concept TakesDouble = requires(double bandwidth) {
  Config{.observer_bandwidth = bandwidth};
};
static_assert(TakesDouble<LinearEso<2>::Config>);
static_assert(!TakesDouble<LinearEso<2, float>::Config>);

// Status flags are bits of their own.
static_assert(!has(StepStatus::ok, StepStatus::measurement_rejected));
static_assert(has(StepStatus::measurement_rejected | StepStatus::input_rejected,
                  StepStatus::input_rejected));
static_assert(!has(StepStatus::measurement_rejected | StepStatus::gap_bridged,
                   StepStatus::restarted));

TEST(StepStatus, FlagsDoNotOverlap) {
  const StepStatus flags[] = {
      StepStatus::measurement_rejected, StepStatus::input_rejected, StepStatus::prediction_dropped,
      StepStatus::gap_bridged,          StepStatus::restarted,      StepStatus::state_rejected};
  StepStatus sum = StepStatus::ok;
  for (const StepStatus flag : flags) {
    EXPECT_FALSE(has(sum, flag));
    sum |= flag;
    EXPECT_TRUE(has(sum, flag));
  }
}

}  // namespace observer_observer_static_test
