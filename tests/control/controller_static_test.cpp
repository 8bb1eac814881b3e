// What a controller has to offer: every controller of esokit and a lambda do, look-alikes do not.
#include <gtest/gtest.h>

#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/controller.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/observer/linear_eso.hpp>

namespace control_controller_static_test {

using namespace esokit;
using Eso = LinearEso<2>;
using Pair = Vector<double, 2>;

static_assert(Controller<Adrc<Eso>, double> && Controller<Adrc<Eso, ErrorBased>, double>);
static_assert(Controller<Adrc<LinearEso<2, float>>, float>);
static_assert(Controller<Packed<Adrc<Eso>, 4>, Pack<double, 4>>);
static_assert(Controller<Packed<Adrc<VariableTime<Eso>>, 4>, Pack<double, 4>>);
static_assert(Controller<Adrc<VariableTime<Eso>>, double>);
static_assert(Controller<PredictiveAdrc<Eso>, double>);
static_assert(Controller<DisturbanceCompensator<Eso>, double>);
static_assert(Controller<MimoAdrc<Eso, LinearEso<1>>, Pair>);
static_assert(controller_traits<Adrc<VariableTime<Eso>>>.varies_time);
static_assert(!controller_traits<Adrc<Eso>>.varies_time);

// What was applied, or measured, is never a third argument: a plain number does not compile.
template <class C, class Signal = double>
constexpr bool takes_a_third = requires(C c, Signal y) {
  c.update(y, y, y);
}
|| requires(C c, Signal y, double number) { c.update(y, y, number); }
|| requires(C c, Signal y, int whole) { c.update(y, y, whole); }
|| requires(C c, double y, Vector<double, 2> r) { c.update(y, r, y); }
|| requires(C c, double y) { c.update(y, {y, y}, y); };
using Told = Measured<Eso>;
static_assert(!takes_a_third<Adrc<Told>> && !takes_a_third<Adrc<Told, ErrorBased>>);
static_assert(!takes_a_third<Adrc<Eso>>);
static_assert(!takes_a_third<PredictiveAdrc<Told>> && !takes_a_third<DisturbanceCompensator<Told>>);
static_assert(!takes_a_third<MimoAdrc<Told, LinearEso<1>>, Pair>);

// One's own: a function, a lambda, a class; the channels need not be as many.
using Function = double (*)(double, double);
constexpr auto lambda = [](double y, double r) { return r - y; };
struct Pid {
  double update(double y, double r) { return r - y; }
};
struct TwoInputs {
  Pair operator()(double y, double r) const { return {r - y, 0.0}; }
};
static_assert(Controller<Function, double> && Controller<decltype(lambda), double>);
static_assert(Controller<Pid, double> && !Controller<Pid, Pair>);
static_assert(Controller<TwoInputs, double, Pair> && !Controller<TwoInputs, double>);

// Nothing to call, the wrong arguments or result, private, no copies.
struct Nothing {};
struct NoReference {
  double update(double y);
};
struct GivesNothing {
  void update(double y, double r);
};
class Private {
  double update(double y, double r);
};
struct NoCopy : Pid {
  NoCopy(const NoCopy&) = delete;
};
struct Constant {
  double update(double y, double r) const;
};
static_assert(!Controller<Nothing, double> && !Controller<NoReference, double>);
static_assert(!Controller<GivesNothing, double> && !Controller<Private, double>);
static_assert(!Controller<NoCopy, double> && Controller<Constant, double>);
static_assert(!Controller<decltype([](double y) { return y; }), double>);

// Declared, and not there or of another signature.
template <ControllerTraits declared>
struct Declares : Pid {
  using scalar_type = double;
  static constexpr int order = 2;
  static constexpr ControllerTraits traits = declared;
};
static_assert(Controller<Declares<ControllerTraits{}>, double>);
static_assert(!Controller<Declares<ControllerTraits{.two_phases = true}>, double>);
static_assert(!Controller<Declares<ControllerTraits{.takes_derivatives = true}>, double>);
static_assert(!Controller<Declares<ControllerTraits{.knows_sample_time = true}>, double>);
static_assert(!Controller<Declares<ControllerTraits{.varies_time = true}>, double>);
static_assert(!Controller<Declares<ControllerTraits{.observes = true}>, double>);

struct KnowsTime : Declares<ControllerTraits{.knows_sample_time = true, .varies_time = true}> {
  double sample_time() const;
  Check<double> elapsed(double seconds);
};
struct TellsNoError : KnowsTime {
  void elapsed(double seconds);
};
struct ForgetsConst : KnowsTime {
  double sample_time();
};
static_assert(Controller<KnowsTime, double>);
static_assert(!Controller<TellsNoError, double> && !Controller<ForgetsConst, double>);

struct TwoPhases : Declares<ControllerTraits{.two_phases = true}> {
  double control(double y);
  void prepare(double next_reference);
  void set_reference(double reference);
};
struct NoFirstReference : Declares<ControllerTraits{.two_phases = true}> {
  double control(double y);
  void prepare(double next_reference);
};
static_assert(Controller<TwoPhases, double> && !Controller<NoFirstReference, double>);

// The traits are what they are called, public and constant.
struct HiddenTraits : Pid {
 private:
  static constexpr ControllerTraits traits{};
};
struct OtherTraits : Pid {
  static constexpr int traits = 1;
};
static_assert(!Controller<HiddenTraits, double> && !Controller<OtherTraits, double>);

TEST(Controller, KnowsItsSampleTime) {
  const Eso::Config eso{.observer_bandwidth = 50, .input_gain = 2, .sample_time = 3e-3};
  EXPECT_EQ(Adrc<Eso>::make({.observer = eso, .controller_bandwidth = 5})->sample_time(), 3e-3);
  EXPECT_EQ(PredictiveAdrc<Eso>::make({.observer = eso, .controller_bandwidth = 5})->sample_time(),
            3e-3);
  EXPECT_EQ(DisturbanceCompensator<Eso>::make({.observer = eso})->sample_time(), 3e-3);
  MimoAdrc<Eso>::Config one{.observers = {{.observer_bandwidth = 50, .sample_time = 3e-3}},
                            .controller_bandwidths = {5}};
  one.input_matrix(0, 0) = 2;
  EXPECT_EQ(MimoAdrc<Eso>::make(one)->sample_time(), 3e-3);
}

}  // namespace control_controller_static_test
