// Which controller, observer and adapter can be written as C: the table of README.md, row by row.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <esokit/target/c_code.hpp>

namespace esokit_test {
namespace target_writable_test {
namespace {

using namespace esokit;
using detail::Writable;

using Lag = ModelEso<ModelParts{.order = 1, .actuator = 1}>;
struct Gravity {
  template <class E>
  auto operator()(const E& x) const noexcept {
    using std::sin;
    return -9.81 * sin(x(0));
  }
};

template <class Observer>
constexpr bool in_loops = Writable<Observer>&& Writable<Adrc<Observer>>&&
    Writable<Adrc<Observer, ErrorBased>>&& Writable<DisturbanceCompensator<Observer>>;
template <class Observer>
constexpr bool first_row =
    in_loops<Observer>&& in_loops<DelayedInput<Observer, 3>>&& in_loops<OutlierGate<Observer>>&&
        in_loops<WrappedOutput<Observer>>&& in_loops<Measured<Observer>>;
template <class... Observers>
constexpr bool all_in_first_row = (first_row<Observers> && ...);
template <class... Observers>
constexpr bool all_guarded = (in_loops<Guarded<Observers>> && ...);
template <class... Observers>
constexpr bool all_predictive = (Writable<PredictiveAdrc<Observers>> && ...);

static_assert(
    all_in_first_row<LinearEso<2>, LinearEso<1, double, 2>, LinearEso<2, double, 1, PoleSet>,
                     HalfGainEso<2>, ReducedOrderEso<2>, CascadeEso<2, 2>, AlgebraicEso<2>,
                     AdjustableBandwidthEso<2>, NonlinearEso<2>, ExtendedStateFilter<2>, Lag>);
static_assert(in_loops<KnownModel<LinearEso<2>, Gravity>>);
static_assert(all_guarded<LinearEso<2>, HalfGainEso<2>, CascadeEso<2, 2>>);
static_assert(!Writable<Guarded<Lag>>);
static_assert(all_predictive<LinearEso<2>, HalfGainEso<2>, ReducedOrderEso<2>, CascadeEso<2, 2>,
                             AlgebraicEso<2>, ExtendedStateFilter<2>, Lag>);
static_assert(!Writable<PredictiveAdrc<AdjustableBandwidthEso<2>>>);
static_assert(!Writable<PredictiveAdrc<NonlinearEso<2>>>);
static_assert(!PredictableObserver<DelayedInput<LinearEso<2>, 3>>);  // no PredictiveAdrc at all
static_assert(!Writable<MimoAdrc<LinearEso<1>, LinearEso<1>>>);
static_assert(!Writable<VariableTime<LinearEso<2>>>);

TEST(Writable, IsTheTableOfTheReadme) {
  EXPECT_TRUE((all_in_first_row<LinearEso<1>, LinearEso<3>>));
}

}  // namespace
}  // namespace target_writable_test
}  // namespace esokit_test
