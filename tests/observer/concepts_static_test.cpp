// What is an observer for whom. An archetype of each concept has what the concept asks for and
// nothing more, goes through every consumer, and does there what LinearEso does; without any one
// of its members it is refused, and so is what declares one thing and has another.
#include <gtest/gtest.h>

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/sim/closed_loop.hpp>
#include <support/friction.hpp>
#include <support/numbers.hpp>

namespace esokit_test {
namespace observer_concepts_static_test {

using esokit::Adrc;
using esokit::Check;
using esokit::DelayedInput;
using esokit::Error;
using esokit::ErrorBased;
using esokit::Expected;
using esokit::GainKind;
using esokit::KnownModel;
using esokit::LevelledObserver;
using esokit::LinearEso;
using esokit::LoopObserver;
using esokit::ObserverTraits;
using esokit::PredictableObserver;
using esokit::RestartingObserver;
using esokit::SampledLinearObserver;
using esokit::ShiftableDisturbance;
using esokit::ShiftableOutput;
using esokit::StepStatus;
using esokit::VariableTime;
using esokit::WrappedOutput;

using Rubbing = Friction<1, double>;

/// The member that an archetype goes without.
enum class Without {
  nothing,
  make,
  adopt,
  update,
  predict,
  correct,
  reset_to_y,
  reset_to_state,
  estimate,
  estimate_of_row,
  total_disturbance,
  applied_input,
  equilibrium,
  max_gap,
  input_gain,
  sample_time,
  missed,
  restarts,
  level_estimate,
  shift_output,
  shift_disturbance,
  revise_input,
  scaled_estimate,
  correction_gain,
  preview,
  gain_law,
  level_gain,
  model,
};

using S = double;
using Truth = LinearEso<2>;

/// Exactly what LoopObserver asks for, W left out.
template <Without W = Without::nothing>
class Loop {
 public:
  static constexpr int order = 2;
  static constexpr int size = 3;
  using scalar_type = S;
  using Estimate = esokit::Vector<S, 3>;
  struct Config {
    S input_gain{};
    S sample_time{};
    int max_gap = 100;
  };

  static Expected<Loop, Error<S>> make(const Config& config) requires(W != Without::make) {
    const auto truth = Truth::make(of(config));
    if (!truth) return truth.error();
    return Loop(*truth);
  }
  Check<S> adopt(const Loop& fresh) requires(W != Without::adopt) {
    return truth_.adopt(fresh.truth_);
  }
  StepStatus update(S y, S u) noexcept requires(W != Without::update) {
    return truth_.update(y, u);
  }
  StepStatus predict(S u) noexcept requires(W != Without::predict) { return truth_.predict(u); }
  StepStatus correct(S y) noexcept requires(W != Without::correct) { return truth_.correct(y); }
  StepStatus reset(S y) noexcept requires(W != Without::reset_to_y) { return truth_.reset(y); }
  StepStatus reset(const Estimate& z) noexcept requires(W != Without::reset_to_state) {
    return truth_.reset(z);
  }
  Estimate estimate() const noexcept requires(W != Without::estimate) { return truth_.estimate(); }
  template <int Row>
  S estimate() const noexcept requires(W != Without::estimate_of_row) {
    return truth_.estimate<Row>();
  }
  S total_disturbance() const noexcept requires(W != Without::total_disturbance) {
    return truth_.total_disturbance();
  }
  S applied_input() const noexcept requires(W != Without::applied_input) {
    return truth_.applied_input();
  }
  Estimate equilibrium(S y, S u) const noexcept requires(W != Without::equilibrium) {
    return truth_.equilibrium(y, u);
  }
  S input_gain() const noexcept requires(W != Without::input_gain) { return truth_.input_gain(); }
  S sample_time() const noexcept requires(W != Without::sample_time) {
    return truth_.sample_time();
  }
  int missed() const noexcept requires(W != Without::missed) { return truth_.missed(); }
  int max_gap() const noexcept requires(W != Without::max_gap) { return truth_.max_gap(); }

 protected:
  explicit Loop(const Truth& truth) noexcept : truth_(truth) {}

  static Truth::Config of(const Config& config) {
    return {.observer_bandwidth = 40,
            .input_gain = config.input_gain,
            .sample_time = config.sample_time,
            .max_gap = config.max_gap};
  }
  /// The same for what adds to it.
  template <class Derived>
  static Expected<Derived, Error<S>> make_as(const Config& config) {
    const auto truth = Truth::make(of(config));
    if (!truth) return truth.error();
    return Derived(*truth);
  }

  Truth truth_;
};

/// Exactly what RestartingObserver asks for.
template <Without W = Without::nothing>
class Restarting : public Loop<> {
 public:
  static Expected<Restarting, Error<S>> make(const Config& config) {
    return make_as<Restarting>(config);
  }
  bool restarts() const noexcept requires(W != Without::restarts) { return truth_.restarts(); }

 protected:
  friend Loop<>;
  using Loop<>::Loop;
};

/// Exactly what LevelledObserver and RestartingObserver ask for.
class Levelled : public Restarting<> {
 public:
  static constexpr int levels = 1;
  static Expected<Levelled, Error<S>> make(const Config& config) {
    return make_as<Levelled>(config);
  }
  Estimate level_estimate(int level) const noexcept { return truth_.level_estimate(level); }

 private:
  friend Loop<>;
  explicit Levelled(const Truth& truth) noexcept : Restarting<>(truth) {}
};

/// Exactly what ShiftableOutput asks for.
template <Without W = Without::nothing>
class OutputShifting : public Loop<> {
 public:
  static constexpr int levels = 1;
  static Expected<OutputShifting, Error<S>> make(const Config& config) {
    return make_as<OutputShifting>(config);
  }
  Estimate level_estimate(int level) const noexcept requires(W != Without::level_estimate) {
    return truth_.level_estimate(level);
  }
  StepStatus shift_output(S offset) noexcept requires(W != Without::shift_output) {
    return truth_.shift_output(offset);
  }

 private:
  friend Loop<>;
  using Loop<>::Loop;
};

/// Exactly what ShiftableDisturbance asks for.
template <Without W = Without::nothing>
class DisturbanceShifting : public Loop<> {
 public:
  static Expected<DisturbanceShifting, Error<S>> make(const Config& config) {
    return make_as<DisturbanceShifting>(config);
  }
  StepStatus shift_disturbance(S offset) noexcept requires(W != Without::shift_disturbance) {
    return truth_.shift_disturbance(offset);
  }

 private:
  friend Loop<>;
  using Loop<>::Loop;
};

/// Exactly what PredictableObserver asks for, of a gain of this kind.
template <GainKind Kind, Without W = Without::nothing>
class Predictable {
 public:
  static constexpr ObserverTraits traits{.is_predictable = true, .gain_kind = Kind};
  static constexpr int order = 2;
  static constexpr int size = 3;
  static constexpr int levels = 1;
  using scalar_type = S;
  using Estimate = esokit::Vector<S, 3>;
  using Config = Loop<>::Config;
  static Expected<Predictable, Error<S>> make(const Config& config) requires(W != Without::make) {
    const auto truth = Truth::make(of(config));
    if (!truth) return truth.error();
    return Predictable(*truth);
  }
  Check<S> adopt(const Predictable& fresh) requires(W != Without::adopt) {
    return truth_.adopt(fresh.truth_);
  }
  StepStatus predict(S u) noexcept requires(W != Without::predict) { return truth_.predict(u); }
  StepStatus correct(S y) noexcept requires(W != Without::correct) { return truth_.correct(y); }
  StepStatus revise_input(S u) noexcept requires(W != Without::revise_input) {
    return truth_.revise_input(u);
  }
  StepStatus reset(S y) noexcept requires(W != Without::reset_to_y) { return truth_.reset(y); }
  StepStatus reset(const Estimate& z) noexcept requires(W != Without::reset_to_state) {
    return truth_.reset(z);
  }
  Estimate estimate() const noexcept requires(W != Without::estimate) { return truth_.estimate(); }
  template <int Row>
  S scaled_estimate() const noexcept requires(W != Without::scaled_estimate) {
    return truth_.scaled_estimate<Row>();
  }
  Estimate equilibrium(S y, S u) const noexcept requires(W != Without::equilibrium) {
    return truth_.equilibrium(y, u);
  }
  S finite_probe(const esokit::Array<S, 3>& x) const noexcept { return truth_.finite_probe(x); }
  S input_gain() const noexcept requires(W != Without::input_gain) { return truth_.input_gain(); }
  S sample_time() const noexcept requires(W != Without::sample_time) {
    return truth_.sample_time();
  }
  int missed() const noexcept requires(W != Without::missed) { return truth_.missed(); }
  bool restarts() const noexcept requires(W != Without::restarts) { return truth_.restarts(); }
  esokit::ScaledGain<3, S> correction_gain(S e) const noexcept
      requires(W != Without::correction_gain) {
    return truth_.correction_gain(e);
  }
  Truth::Preview preview() const noexcept
      requires(Kind == GainKind::preset && W != Without::preview) {
    return truth_.preview();
  }

  /// Both of the kinds whose law is looked into, made of the one gain.
  struct TwoGains {
    esokit::ScaledGain<3, S> gain;
    bool shrinks(S e) const noexcept { return e < 0; }
    const esokit::ScaledGain<3, S>& shrinking_gain() const noexcept { return gain; }
    const esokit::ScaledGain<3, S>& otherwise_gain() const noexcept { return gain; }
  };
  struct OneGain {
    esokit::ScaledGain<3, S> gain;
    S factor(S) const noexcept { return 1; }
    const esokit::ScaledGain<3, S>& linear_gain() const noexcept { return gain; }
  };
  using Law = std::conditional_t<Kind == GainKind::switched, TwoGains, OneGain>;
  Law gain_law() const noexcept
      requires((Kind == GainKind::switched || Kind == GainKind::factored) &&
               W != Without::gain_law) {
    return {truth_.gain_law().gain_before_measurement()};
  }

 private:
  explicit Predictable(const Truth& truth) noexcept : truth_(truth) {}
  static Truth::Config of(const Config& config) {
    return {.observer_bandwidth = 40,
            .input_gain = config.input_gain,
            .sample_time = config.sample_time,
            .max_gap = config.max_gap};
  }
  Truth truth_;
};

/// Exactly what SampledLinearObserver asks for.
template <Without W = Without::nothing>
struct Gains {
  static constexpr ObserverTraits traits{.acts_by_gain = true};
  static constexpr int order = 2;
  static constexpr int extension = 1;
  static constexpr int size = 3;
  static constexpr int levels = 1;
  using scalar_type = S;
  Truth truth;
  esokit::ScaledGain<3, S> level_gain(int level) const requires(W != Without::level_gain) {
    return truth.level_gain(level);
  }
  S input_gain() const requires(W != Without::input_gain) { return truth.input_gain(); }
  S sample_time() const requires(W != Without::sample_time) { return truth.sample_time(); }
  const auto& model() const requires(W != Without::model) { return truth.model(); }
};

// ---- LoopObserver

static_assert(LoopObserver<Loop<>>);
static_assert(!LoopObserver<Loop<Without::make>> && !LoopObserver<Loop<Without::adopt>>);
static_assert(!LoopObserver<Loop<Without::update>> && !LoopObserver<Loop<Without::predict>>);
static_assert(!LoopObserver<Loop<Without::correct>> && !LoopObserver<Loop<Without::reset_to_y>>);
static_assert(!LoopObserver<Loop<Without::reset_to_state>>);
static_assert(!LoopObserver<Loop<Without::estimate>>);
static_assert(!LoopObserver<Loop<Without::estimate_of_row>>);
static_assert(!LoopObserver<Loop<Without::total_disturbance>>);
static_assert(!LoopObserver<Loop<Without::applied_input>>);
static_assert(!LoopObserver<Loop<Without::equilibrium>> && !LoopObserver<Loop<Without::max_gap>>);
static_assert(!LoopObserver<Loop<Without::input_gain>>);
static_assert(!LoopObserver<Loop<Without::sample_time>> && !LoopObserver<Loop<Without::missed>>);
// An archetype is no more than its concept.
static_assert(!RestartingObserver<Loop<>> && !ShiftableOutput<Loop<>>);
static_assert(!ShiftableDisturbance<Loop<>> && !PredictableObserver<Loop<>>);
static_assert(!SampledLinearObserver<Loop<>>);
static_assert(LoopObserver<Restarting<>> && RestartingObserver<Restarting<>>);
static_assert(!RestartingObserver<Restarting<Without::restarts>>);
static_assert(!ShiftableOutput<Restarting<>> && !ShiftableDisturbance<Restarting<>>);
static_assert(LoopObserver<OutputShifting<>> && ShiftableOutput<OutputShifting<>>);
static_assert(!LevelledObserver<Loop<>> && LevelledObserver<OutputShifting<>>);
static_assert(LevelledObserver<OutputShifting<Without::shift_output>>);
static_assert(!ShiftableOutput<OutputShifting<Without::level_estimate>>);
static_assert(!ShiftableOutput<OutputShifting<Without::shift_output>>);
static_assert(!RestartingObserver<OutputShifting<>> && !ShiftableDisturbance<OutputShifting<>>);
static_assert(LoopObserver<DisturbanceShifting<>> && ShiftableDisturbance<DisturbanceShifting<>>);
static_assert(!ShiftableDisturbance<DisturbanceShifting<Without::shift_disturbance>>);
static_assert(!RestartingObserver<DisturbanceShifting<>> &&
              !ShiftableOutput<DisturbanceShifting<>>);

/// Loop with one thing changed; what Derived hides is what counts.
template <class Derived>
struct Changed : Loop<> {
  static Expected<Derived, Error<S>> make(const Config&);
};
struct Unchanged : Changed<Unchanged> {};
struct UpdateTellsNothing : Changed<UpdateTellsNothing> {
  void update(S, S) noexcept;
};
struct UpdateTellsABool : Changed<UpdateTellsABool> {
  bool update(S, S) noexcept;
};
struct UpdateWithoutInput : Changed<UpdateWithoutInput> {
  StepStatus update(S) noexcept;
};
struct AdoptTellsABool : Changed<AdoptTellsABool> {
  bool adopt(const AdoptTellsABool&);
};
struct MissedNotConst : Changed<MissedNotConst> {
  int missed() noexcept;
};
struct EstimateOfAnotherSize : Changed<EstimateOfAnotherSize> {
  esokit::Vector<S, 4> estimate() const noexcept;
  template <int Row>
  S estimate() const noexcept;
};
struct NoDisturbanceRow : Changed<NoDisturbanceRow> {
  static constexpr int size = 2;
};
struct OrderZero : Changed<OrderZero> {
  static constexpr int order = 0;
};
struct IntegerScalar : Changed<IntegerScalar> {
  using scalar_type = int;
};
struct ConfigWithoutInputGain : Loop<> {
  struct Config {
    S sample_time{};
    int max_gap = 100;
  };
  static Expected<ConfigWithoutInputGain, Error<S>> make(const Config&);
  Check<S> adopt(const ConfigWithoutInputGain&);
};
struct ConfigWithoutMaxGap : Loop<> {
  struct Config {
    S input_gain{};
    S sample_time{};
  };
  static Expected<ConfigWithoutMaxGap, Error<S>> make(const Config&);
  Check<S> adopt(const ConfigWithoutMaxGap&);
};
struct ConfigOfAnotherScalar : Loop<> {
  struct Config {
    float input_gain{};
    float sample_time{};
    int max_gap = 100;
  };
  static Expected<ConfigOfAnotherScalar, Error<S>> make(const Config&);
  Check<S> adopt(const ConfigOfAnotherScalar&);
};
struct MakesItsBase : Loop<> {};
static_assert(LoopObserver<Unchanged> && !LoopObserver<UpdateTellsNothing>);
static_assert(!LoopObserver<UpdateTellsABool> && !LoopObserver<UpdateWithoutInput>);
static_assert(!LoopObserver<AdoptTellsABool> && !LoopObserver<MissedNotConst>);
static_assert(!LoopObserver<EstimateOfAnotherSize> && !LoopObserver<NoDisturbanceRow>);
static_assert(!LoopObserver<OrderZero> && !LoopObserver<IntegerScalar>);
static_assert(!LoopObserver<ConfigWithoutInputGain> && !LoopObserver<ConfigWithoutMaxGap>);
static_assert(!LoopObserver<ConfigOfAnotherScalar> && !LoopObserver<MakesItsBase>);
static_assert(!LoopObserver<int> && !LoopObserver<void> && !LoopObserver<esokit::Limits<double>>);

// ---- traits

template <class Derived, ObserverTraits Declared>
struct Declaring : Changed<Derived> {
  static constexpr ObserverTraits traits = Declared;
};
#define ESOKIT_OBSERVER(Name, Declared) struct Name : Declaring<Name, ObserverTraits Declared>

ESOKIT_OBSERVER(DeclaresNothing, {}){};
struct TraitsOfAGainLaw : Changed<TraitsOfAGainLaw> {
  static constexpr esokit::GainLawTraits traits{};
};
struct TraitsOfTheInstance : Changed<TraitsOfTheInstance> {
  ObserverTraits traits{};
};
static_assert(LoopObserver<DeclaresNothing> && !LoopObserver<TraitsOfAGainLaw>);
static_assert(!LoopObserver<TraitsOfTheInstance>);

ESOKIT_OBSERVER(Wraps, {.wraps_output = true}) { S wrap(S) const; };
ESOKIT_OBSERVER(WrapMissing, {.wraps_output = true}){};
ESOKIT_OBSERVER(WrapUndeclared, {}) { S wrap(S) const; };
ESOKIT_OBSERVER(WrapNotConst, {.wraps_output = true}) { S wrap(S); };
ESOKIT_OBSERVER(WrapTellsNothing, {.wraps_output = true}) { void wrap(S) const; };
static_assert(LoopObserver<Wraps> && !LoopObserver<WrapMissing> && !LoopObserver<WrapUndeclared>);
static_assert(!LoopObserver<WrapNotConst> && !LoopObserver<WrapTellsNothing>);

ESOKIT_OBSERVER(Fills, {.delays_input = true}) { void fill_input(S); };
ESOKIT_OBSERVER(FillMissing, {.delays_input = true}){};
ESOKIT_OBSERVER(FillUndeclared, {}) { void fill_input(S); };
ESOKIT_OBSERVER(FillWithNothing, {.delays_input = true}) { void fill_input(); };
static_assert(LoopObserver<Fills> && !LoopObserver<FillMissing>);
static_assert(!LoopObserver<FillUndeclared> && !LoopObserver<FillWithNothing>);

ESOKIT_OBSERVER(Varies, {.varies_time = true}) {
  Check<S> set_step_time(S);
  esokit::Expected<int, esokit::Error<S>> elapsed(S);
  S step_time() const;
  bool bridges(int) const;
};
ESOKIT_OBSERVER(TimeMissing, {.varies_time = true}){};
ESOKIT_OBSERVER(TimeNotSaid, {.varies_time = true}) { Check<S> set_step_time(S); };
ESOKIT_OBSERVER(TimeUndeclared, {}) { Check<S> set_step_time(S); };
ESOKIT_OBSERVER(TimeTellsNothing, {.varies_time = true}) {
  void set_step_time(S);
  esokit::Expected<int, esokit::Error<S>> elapsed(S);
  S step_time() const;
  bool bridges(int) const;
};
static_assert(LoopObserver<Varies> && !LoopObserver<TimeMissing> && !LoopObserver<TimeNotSaid>);
ESOKIT_OBSERVER(TimeDoesNotPass, {.varies_time = true}) {
  Check<S> set_step_time(S);
  S step_time() const;
  bool bridges(int) const;
};
static_assert(!LoopObserver<TimeUndeclared> && !LoopObserver<TimeTellsNothing>);
static_assert(!LoopObserver<TimeDoesNotPass>);

ESOKIT_OBSERVER(Gates, {.gates_outliers = true}) { bool accepts(S) const; };
ESOKIT_OBSERVER(GateMissing, {.gates_outliers = true}){};
ESOKIT_OBSERVER(GateUndeclared, {}) { bool accepts(S) const; };
ESOKIT_OBSERVER(GateNotConst, {.gates_outliers = true}) { bool accepts(S); };
ESOKIT_OBSERVER(GateMisspelled, {}) { bool accept(S) const; };
static_assert(LoopObserver<Gates> && !LoopObserver<GateMissing> && !LoopObserver<GateUndeclared>);
static_assert(!LoopObserver<GateNotConst> && !LoopObserver<GateMisspelled>);

ESOKIT_OBSERVER(Blanks, {.blanks_estimate = true}) { bool blanked() const; };
ESOKIT_OBSERVER(BlankedMissing, {.blanks_estimate = true}){};
ESOKIT_OBSERVER(BlankedUndeclared, {}) { bool blanked() const; };
static_assert(LoopObserver<Blanks> && !LoopObserver<BlankedMissing> &&
              !LoopObserver<BlankedUndeclared>);

ESOKIT_OBSERVER(ChainMissing, {.publishes_chain = true}){};
ESOKIT_OBSERVER(GainMissing, {.acts_by_gain = true}){};
ESOKIT_OBSERVER(AdaptedMissing, {.adapts = true}){};
ESOKIT_OBSERVER(TimeMisspelled, {}) { Check<S> set_sample_time(S); };
static_assert(!LoopObserver<ChainMissing> && !LoopObserver<GainMissing>);
static_assert(!LoopObserver<AdaptedMissing> && !LoopObserver<TimeMisspelled>);

/// Adrc would take the scaled estimates of the base.
struct PublishesSomethingElse : LinearEso<2> {
  static Expected<PublishesSomethingElse, Error<S>> make(const Config&);
  S total_disturbance() const noexcept { return 0; }
};
struct SaysThatItDoes : PublishesSomethingElse {
  static constexpr ObserverTraits traits{.publishes_chain = false};
  static Expected<SaysThatItDoes, Error<S>> make(const Config&);
};
static_assert(!LoopObserver<PublishesSomethingElse>);
static_assert(esokit::ObserverAsDeclared<SaysThatItDoes>);

// ---- PredictableObserver

template <Without W, GainKind Kind = GainKind::preset>
constexpr bool refused = !PredictableObserver<Predictable<Kind, W>>;
static_assert(PredictableObserver<Predictable<GainKind::general>>);
static_assert(PredictableObserver<Predictable<GainKind::preset>>);
static_assert(PredictableObserver<Predictable<GainKind::switched>>);
static_assert(PredictableObserver<Predictable<GainKind::factored>>);
static_assert(!LoopObserver<Predictable<GainKind::preset>>);
static_assert(refused<Without::make> && refused<Without::adopt> && refused<Without::predict>);
static_assert(refused<Without::correct> && refused<Without::revise_input>);
static_assert(refused<Without::reset_to_y> && refused<Without::reset_to_state>);
static_assert(refused<Without::estimate> && refused<Without::scaled_estimate>);
static_assert(refused<Without::input_gain> && refused<Without::sample_time>);
static_assert(refused<Without::missed> && refused<Without::restarts>);
static_assert(refused<Without::correction_gain> && refused<Without::preview>);
static_assert(refused<Without::correction_gain, GainKind::general>);
static_assert(refused<Without::gain_law, GainKind::switched>);
static_assert(refused<Without::gain_law, GainKind::factored>);
static_assert(!PredictableObserver<DelayedInput<LinearEso<2>, 2>>);
static_assert(!PredictableObserver<WrappedOutput<LinearEso<2>>>);
static_assert(!PredictableObserver<VariableTime<LinearEso<2>>>);
static_assert(!PredictableObserver<KnownModel<LinearEso<2>, Rubbing>>);

// ---- SampledLinearObserver

static_assert(SampledLinearObserver<Gains<>>);
static_assert(!SampledLinearObserver<Gains<Without::level_gain>>);
static_assert(!SampledLinearObserver<Gains<Without::model>>);
static_assert(!SampledLinearObserver<Gains<Without::input_gain>>);
static_assert(!SampledLinearObserver<Gains<Without::sample_time>>);
static_assert(!SampledLinearObserver<DelayedInput<LinearEso<2>, 2>>);
static_assert(!SampledLinearObserver<KnownModel<LinearEso<2>, Rubbing>>);
static_assert(SampledLinearObserver<WrappedOutput<LinearEso<2>>>);
static_assert(SampledLinearObserver<VariableTime<LinearEso<2>>>);
static_assert(!SampledLinearObserver<esokit::NonlinearEso<2>>);
struct Nominal {
  S operator()(const esokit::Vector<S, 2>& x, S, S) const { return -x(0); }
};
static_assert(SampledLinearObserver<esokit::ExtendedStateFilter<2>>);
static_assert(!SampledLinearObserver<esokit::ExtendedStateFilter<2, S, 1, Nominal>>,
              "its gains do not tell what the model does");
static_assert(!SampledLinearObserver<esokit::AdjustableBandwidthEso<2>>);

// ---- the library's own

template <class O>
constexpr bool is_everything =
    LoopObserver<O> && RestartingObserver<O> && ShiftableOutput<O> && ShiftableDisturbance<O> &&
    PredictableObserver<O> && esokit::observer_traits<O>.bears_regular_gaps;
static_assert(is_everything<LinearEso<2>> && is_everything<LinearEso<3, float, 2>>);
static_assert(is_everything<esokit::CascadeEso<2, 3>>);
static_assert(is_everything<esokit::NonlinearEso<2>>);
static_assert(is_everything<esokit::AdjustableBandwidthEso<2>>);
static_assert(is_everything<esokit::ExtendedStateFilter<2>>);
static_assert(LoopObserver<esokit::AlgebraicEso<2>> &&
              PredictableObserver<esokit::AlgebraicEso<2>>);
static_assert(!esokit::observer_traits<esokit::AlgebraicEso<2>>.publishes_chain);
static_assert(!esokit::observer_traits<esokit::AlgebraicEso<2>>.bears_regular_gaps);
static_assert(!esokit::observer_traits<VariableTime<esokit::AlgebraicEso<2>>>.bears_regular_gaps);
static_assert(!esokit::observer_traits<VariableTime<LinearEso<2>>>.publishes_chain);
static_assert(!esokit::observer_traits<KnownModel<LinearEso<2>, Rubbing>>.publishes_chain);
static_assert(esokit::observer_traits<DelayedInput<LinearEso<2>, 2>>.publishes_chain);

// ---- adapters are not what they adapt, and have no answer that is not theirs

template <class O>
constexpr bool is_its_observer =
    std::is_convertible_v<O&, typename O::Adapted&> || std::derived_from<O, typename O::Adapted>;
using Delayed = DelayedInput<LinearEso<2>, 2>;
using Wrapped = WrappedOutput<LinearEso<2>>;
using Timed = VariableTime<LinearEso<2>>;
using Known = KnownModel<LinearEso<2>, Rubbing>;
using Gated = esokit::OutlierGate<LinearEso<2>>;
static_assert(!is_its_observer<Delayed> && !is_its_observer<Wrapped>);
static_assert(!is_its_observer<Timed> && !is_its_observer<Known> && !is_its_observer<Gated>);
static_assert(std::same_as<decltype(std::declval<Delayed&>().observer()), const LinearEso<2>&>);

template <class O>
concept RevisesInput = requires(O& o) {
  o.revise_input(S());
};
template <class O>
concept TellsScaledEstimate = requires(const O& o) {
  o.template scaled_estimate<0>();
};
template <class O>
concept PreviewsCorrection = requires(const O& o) {
  o.preview();
}
|| requires(const O& o) { o.correction_gain(S()); }
|| requires(const O& o) { o.gain_law(); };
template <class O>
concept UpdatesWeighted = requires(O& o) {
  o.update_weighted(S(), S(), S());
};
template <class O>
concept Rearms = requires(O& o) {
  o.rearm();
};
static_assert(RevisesInput<Wrapped> && RevisesInput<Timed>);
static_assert(!RevisesInput<Delayed> && !RevisesInput<Known>);
static_assert(TellsScaledEstimate<Delayed> && !TellsScaledEstimate<Known>);
static_assert(!PreviewsCorrection<Delayed> && !PreviewsCorrection<Wrapped>);
static_assert(!PreviewsCorrection<Timed> && !PreviewsCorrection<Known>);
static_assert(!ShiftableOutput<Wrapped> && LevelledObserver<Wrapped>);
static_assert(ShiftableOutput<Delayed> && ShiftableOutput<Timed> && ShiftableOutput<Known>);
static_assert(ShiftableDisturbance<Delayed> && ShiftableDisturbance<Wrapped>);
static_assert(ShiftableDisturbance<Timed> && ShiftableDisturbance<Known>);
static_assert(RestartingObserver<Delayed> && RestartingObserver<Wrapped>);
static_assert(ShiftableOutput<Gated> && ShiftableDisturbance<Gated> && RestartingObserver<Gated>);
static_assert(!PreviewsCorrection<Gated> && !PredictableObserver<Gated>);
static_assert(esokit::observer_traits<Gated>.publishes_chain);
static_assert(LoopObserver<WrappedOutput<Gated>> && LoopObserver<DelayedInput<Gated, 2>>);
using Filter = esokit::ExtendedStateFilter<2>;
static_assert(!UpdatesWeighted<DelayedInput<Filter, 2>>, "it would skip the delay");
static_assert(Rearms<VariableTime<esokit::AlgebraicEso<2>>> && !Rearms<Delayed>);
// Nests hand on what an adapter in them is asked for.
using Told = esokit::Measured<LinearEso<2>, 1, 2>;
static_assert(!is_its_observer<Told> && RevisesInput<Told> && TellsScaledEstimate<Told>);
static_assert(esokit::observer_traits<DelayedInput<Told, 2>>.takes_measured);
static_assert(!esokit::observer_traits<Delayed>.takes_measured);
static_assert(PredictableObserver<Told> && !PredictableObserver<WrappedOutput<Told>>);
// A filter with a gate knows its next correction only after y; what is not a chain with one
// constant has no load to be told.
static_assert(
    !esokit::observer_traits<esokit::Measured<esokit::ExtendedStateFilter<2>>>.is_predictable);
static_assert(esokit::ShiftableLoad<LinearEso<2>> && !esokit::ShiftableLoad<Loop<>>);
struct ClaimsMeasured : LinearEso<2> {
  static constexpr esokit::ObserverTraits traits{.takes_measured = true};
};
static_assert(!esokit::ObserverAsDeclared<ClaimsMeasured>);
struct HidesMeasured : LinearEso<2> {
  void revise_measured();
};
static_assert(!esokit::ObserverAsDeclared<HidesMeasured>);
static_assert(esokit::observer_traits<DelayedInput<Timed, 2>>.varies_time);
static_assert(esokit::observer_traits<VariableTime<WrappedOutput<Delayed>>>.wraps_output);
static_assert(esokit::observer_traits<VariableTime<WrappedOutput<Delayed>>>.delays_input);
static_assert(LoopObserver<KnownModel<Wrapped, Rubbing>>);
static_assert(LoopObserver<WrappedOutput<Known>> && LoopObserver<DelayedInput<Known, 2>>);
// Around an archetype an adapter has no more than the archetype.
static_assert(!RestartingObserver<DelayedInput<Loop<>, 2>>);
static_assert(!LevelledObserver<DelayedInput<Loop<>, 2>>);
static_assert(!ShiftableDisturbance<WrappedOutput<OutputShifting<>>>);

// ---- known models

struct ModelOfYours {
  S operator()(const esokit::Vector<S, 3>& z) const { return -z(0); }
};
struct ModelThatChecks : ModelOfYours {
  static constexpr esokit::PlantModelTraits traits{.validates = true};
  [[nodiscard]] Check<S> validate() const { return {}; }
};
struct ModelCheckUndeclared : ModelOfYours {
  [[nodiscard]] Check<S> validate() const { return {}; }
};
struct ModelCheckMissing : ModelOfYours {
  static constexpr esokit::PlantModelTraits traits{.validates = true};
};
struct ModelOfNothing {
  S operator()() const { return 0; }
};
static_assert(esokit::PlantModel<ModelOfYours, LinearEso<2>>);
static_assert(esokit::PlantModel<ModelThatChecks, LinearEso<2>>);
static_assert(!esokit::PlantModel<ModelCheckUndeclared, LinearEso<2>>);
static_assert(!esokit::PlantModel<ModelCheckMissing, LinearEso<2>>);
static_assert(!esokit::PlantModel<ModelOfNothing, LinearEso<2>>);

// ---- consumers take what their concept says, and no less

template <class O>
concept GoesIntoAdrc = requires {
  typename Adrc<O>;
};
template <class O>
concept CanBeWrapped = requires {
  typename WrappedOutput<O>;
};
template <class O>
concept CanBeTimed = requires {
  typename VariableTime<O>;
};
template <class O>
concept CanBeGated = requires {
  typename esokit::OutlierGate<O>;
};
template <class O>
concept CanHaveAModel = requires {
  typename KnownModel<O, Rubbing>;
};
template <class O>
concept CanBeAChannel = requires {
  typename esokit::MimoAdrc<O, O>;
};
static_assert(GoesIntoAdrc<Loop<>> && CanBeWrapped<OutputShifting<>> && CanBeTimed<Restarting<>>);
static_assert(CanBeGated<Levelled> && CanHaveAModel<DisturbanceShifting<>>);
static_assert(CanBeAChannel<DisturbanceShifting<>>);
// What they refuse ends in a sentence, tests/first_errors/needs_*.cpp; this is what they ask.
static_assert(!LoopObserver<Loop<Without::update>> && !ShiftableOutput<Loop<>>);
static_assert(!RestartingObserver<Loop<>> && !LevelledObserver<Restarting<>>);
static_assert(!RestartingObserver<OutputShifting<>> && !ShiftableDisturbance<Loop<>>);
static_assert(!LoopObserver<Predictable<GainKind::preset>>);

// ---- archetypes run: everywhere with the numbers of LinearEso

constexpr double period = 0.01;
Loop<>::Config small() { return {.input_gain = 2, .sample_time = period}; }
Truth::Config full() { return {.observer_bandwidth = 40, .input_gain = 2, .sample_time = period}; }

/// The same steps by both; a sample without a measurement and a bad one among them.
template <class One, class Other>
void agree(One& one, Other& other) {
  Random random(5);
  for (int k = 0; k < 60; ++k) {
    const double y = k == 20 ? hidden_nan<double>() : random.uniform(-1, 1);
    ASSERT_NEAR(one.update(y, 0.5), other.update(y, 0.5), 1e-9) << k;
    ASSERT_EQ(one.status(), other.status()) << k;
    if (k % 9 == 8) {
      ASSERT_NEAR(one.update_without_measurement(0.5), other.update_without_measurement(0.5), 1e-9);
    }
  }
}

template <class Archetype, class Full, class Settings>
void adrc_agrees(const Settings& archetype, const typename Full::Config& full) {
  auto one = Adrc<Archetype>::make({.observer = archetype, .controller_bandwidth = 5}).value();
  auto other = Adrc<Full>::make({.observer = full, .controller_bandwidth = 5}).value();
  agree(one, other);
  EXPECT_EQ(one.start(0.25, 1), StepStatus::ok);
  EXPECT_EQ(other.start(0.25, 1), StepStatus::ok);
  agree(one, other);
}

TEST(LoopObserver, RunsInEveryConsumer) {
  adrc_agrees<Loop<>, Truth>(small(), full());
  adrc_agrees<DelayedInput<Loop<>, 2>, DelayedInput<Truth, 2>>(
      DelayedInput<Loop<>, 2>::Config{.observer = small(), .delay = 1},
      {.observer = full(), .delay = 1});

  auto error_based =
      Adrc<Loop<>, ErrorBased>::make({.observer = small(), .controller_bandwidth = 5}).value();
  auto error_truth =
      Adrc<Truth, ErrorBased>::make({.observer = full(), .controller_bandwidth = 5}).value();
  agree(error_based, error_truth);
  ASSERT_TRUE(error_based.retune({.observer = small(), .controller_bandwidth = 6}));
  ASSERT_TRUE(error_truth.retune({.observer = full(), .controller_bandwidth = 6}));
  agree(error_based, error_truth);

  auto compensator = esokit::DisturbanceCompensator<Loop<>>::make({.observer = small()}).value();
  auto truth = esokit::DisturbanceCompensator<Truth>::make({.observer = full()}).value();
  agree(compensator, truth);
  EXPECT_NEAR(compensator.compensation(), truth.compensation(), 1e-9);

  static_assert(esokit::sim::SampledObserverModel<Loop<>>);
}

TEST(RestartingObserver, RunsInVariableTime) {
  adrc_agrees<VariableTime<Restarting<>>, VariableTime<Truth>>(
      VariableTime<Restarting<>>::Config{.observer = small(), .ratio = 4},
      {.observer = full(), .ratio = 4});
  auto one = VariableTime<Restarting<>>::make({.observer = small(), .ratio = 4}).value();
  auto other = VariableTime<Truth>::make({.observer = full(), .ratio = 4}).value();
  for (int k = 0; k < 20; ++k) {
    const double dt = period * (1 + 0.1 * k);
    ASSERT_TRUE(one.set_step_time(dt));
    ASSERT_TRUE(other.set_step_time(dt));
    EXPECT_EQ(one.update(0.1 * k, 1), other.update(0.1 * k, 1));
    if (k == 7) {
      EXPECT_EQ(one.predict(1), other.predict(1));
    }
    EXPECT_EQ(one.estimate(), other.estimate());
  }
}

TEST(LevelledObserver, RunsInOutlierGate) {
  using One = esokit::OutlierGate<Levelled>;
  adrc_agrees<One, Gated>(One::Config{.observer = small(), .threshold = 0.5},
                          {.observer = full(), .threshold = 0.5});
}

TEST(ShiftableOutput, RunsInWrappedOutput) {
  adrc_agrees<WrappedOutput<OutputShifting<>>, WrappedOutput<Truth>>(
      WrappedOutput<OutputShifting<>>::Config{.observer = small(), .period = 6},
      {.observer = full(), .period = 6});
  auto one = WrappedOutput<OutputShifting<>>::make({.observer = small(), .period = 6}).value();
  auto other = WrappedOutput<Truth>::make({.observer = full(), .period = 6}).value();
  for (int k = 0; k < 80; ++k) {  // some turns
    EXPECT_EQ(one.update(0.3 * k, 1), other.update(0.3 * k, 1));
    EXPECT_EQ(one.estimate(), other.estimate());
  }
  EXPECT_LE(std::abs(one.estimate()(0)), 3);
}

TEST(ShiftableDisturbance, RunsInKnownModelAndMimoAdrc) {
  const Rubbing model{1.5};
  adrc_agrees<KnownModel<DisturbanceShifting<>, Rubbing>, KnownModel<Truth, Rubbing>>(
      typename KnownModel<DisturbanceShifting<>, Rubbing>::Config{.observer = small(),
                                                                  .model = model},
      {.observer = full(), .model = model});
  auto one = KnownModel<DisturbanceShifting<>, Rubbing>::make({.observer = small()}).value();
  auto other = KnownModel<Truth, Rubbing>::make({.observer = full()}).value();
  one.update(1, 2);
  other.update(1, 2);
  ASSERT_TRUE(one.retune({.observer = small(), .model = model}));
  ASSERT_TRUE(other.retune({.observer = full(), .model = model}));
  EXPECT_EQ(one.estimate(), other.estimate());
  EXPECT_EQ(one.residual_disturbance(), other.residual_disturbance());

  const auto mimo = [](auto settings, auto type) {
    using O = typename decltype(type)::type;
    settings.input_gain = 0;
    typename esokit::MimoAdrc<O, O>::Config config{.observers = {settings, settings},
                                                   .controller_bandwidths = {5, 5}};
    config.input_matrix = {{2, 1}, {0, 3}};
    auto controller = esokit::MimoAdrc<O, O>::make(config).value();
    esokit::Vector<double, 2> u;
    for (int k = 0; k < 30; ++k) {
      u = controller.update({0.1 * k, 1 - 0.02 * k}, {1.0, 1.0});
      if (k == 20) {
        config.input_matrix = {{3, 1}, {0, 2}};
        EXPECT_TRUE(controller.retune(config));
      }
    }
    return u;
  };
  const auto u = mimo(small(), std::type_identity<DisturbanceShifting<>>{});
  const auto expected = mimo(full(), std::type_identity<Truth>{});
  EXPECT_NEAR(u(0), expected(0), 1e-9);
  EXPECT_NEAR(u(1), expected(1), 1e-9);
}

template <GainKind Kind>
void predictive_agrees() {
  auto one = esokit::PredictiveAdrc<Predictable<Kind>>::make(
                 {.observer = small(), .controller_bandwidth = 5})
                 .value();
  auto other =
      esokit::PredictiveAdrc<Truth>::make({.observer = full(), .controller_bandwidth = 5}).value();
  Random random(6);
  for (int k = 0; k < 80; ++k) {
    const double y = k == 20 ? hidden_nan<double>() : random.uniform(-1, 1);
    if (k % 9 == 8) {
      ASSERT_NEAR(one.control_without_measurement(), other.control_without_measurement(), 1e-9);
    } else {
      ASSERT_NEAR(one.control(y), other.control(y), 1e-9) << k;
    }
    ASSERT_EQ(one.prepare(0.5), other.prepare(0.5));
    if (k == 30) {
      ASSERT_EQ(one.applied(3), other.applied(3));
    }
    if (k == 40) {
      ASSERT_EQ(one.start(0.5, 1), other.start(0.5, 1));
    }
    if (k == 50) {
      ASSERT_TRUE(one.retune({.observer = small(), .controller_bandwidth = 6}));
      ASSERT_TRUE(other.retune({.observer = full(), .controller_bandwidth = 6}));
    }
    if (k == 60) {
      ASSERT_EQ(one.reset(0.25), other.reset(0.25));
    }
  }
}

TEST(PredictableObserver, OfEachKindRunsInPredictiveAdrc) {
  predictive_agrees<GainKind::general>();
  predictive_agrees<GainKind::preset>();
  predictive_agrees<GainKind::switched>();
  predictive_agrees<GainKind::factored>();
}

TEST(SampledLinearObserver, IsAnalysed) {
  const Truth truth = Truth::make(full()).value();
  const Gains<> gains{truth};
  EXPECT_EQ(esokit::observer_system(gains).a, esokit::observer_system(truth).a);
  EXPECT_EQ(esokit::estimation_system(gains).b, esokit::estimation_system(truth).b);
  EXPECT_EQ(esokit::error_system(gains).d, esokit::error_system(truth).d);
}

}  // namespace observer_concepts_static_test
}  // namespace esokit_test
