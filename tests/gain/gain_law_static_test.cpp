// What is a gain law and what is none: what is declared is there, what is there is declared.
#include <gtest/gtest.h>
#include <esokit/sim/continuous_observer.hpp>

#include <esokit/gain/riccati_gain.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/predictor_corrector.hpp>

namespace gain_gain_law_static_test {

using esokit::ContinuousGainLaw;
using esokit::ContinuousGainLawTraits;
using esokit::GainKind;
using esokit::GainLaw;
using esokit::GainLawTraits;
using esokit::PredictorCorrector;
using esokit::PresetGainLaw;
using Gain = esokit::ScaledGain<2, double>;

template <class Law>
constexpr bool is_law = GainLaw<Law, 2, double>;

// ---- gain(e)

/// A law is no more than this.
struct Plain {
  [[nodiscard]] Gain gain(double) const noexcept { return {}; }
};
struct ByReference {
  Gain k{};
  [[nodiscard]] const Gain& gain(const double&) const noexcept { return k; }
};
struct Final final : Plain {};
struct Generic {
  template <class S>
  [[nodiscard]] esokit::ScaledGain<2, S> gain(const S&) const noexcept {
    return {};
  }
};
static_assert(is_law<Plain> && is_law<ByReference> && is_law<Final> && is_law<Generic>);
static_assert(GainLaw<Generic, 2, float>);
static_assert(!PresetGainLaw<Plain, 2, double>);
static_assert(esokit::gain_law_traits<Plain>.kind == GainKind::general);
static_assert(!esokit::gain_law_traits<Plain>.advances);

struct NotConst {
  Gain k{};
  Gain gain(double) noexcept { return k; }
};
struct NotNoexcept {
  [[nodiscard]] Gain gain(double) const { return {}; }
};
struct WrongSize {
  [[nodiscard]] esokit::ScaledGain<3, double> gain(double) const noexcept { return {}; }
};
struct WrongScalar {
  [[nodiscard]] esokit::ScaledGain<2, float> gain(double) const noexcept { return {}; }
};
struct NoArgument {
  [[nodiscard]] Gain gain() const noexcept { return {}; }
};
struct Nothing {};
struct ReturnsNothing {
  void gain(double) const noexcept {}
};
struct MoveOnly : Plain {
  MoveOnly() = default;
  MoveOnly(MoveOnly&&) = default;
  MoveOnly(const MoveOnly&) = delete;
};
class Hidden {
  [[nodiscard]] Gain gain(double) const noexcept { return {}; }
};
static_assert(!is_law<NotConst> && !is_law<NotNoexcept> && !is_law<WrongSize>);
static_assert(!is_law<WrongScalar> && !is_law<NoArgument> && !is_law<Nothing>);
static_assert(!is_law<ReturnsNothing> && !is_law<MoveOnly> && !is_law<Hidden> && !is_law<int>);

template <class Law>
concept MakesAnObserver = requires {
  typename PredictorCorrector<1, double, 1, Law>;
};
static_assert(MakesAnObserver<Plain>);  // what is no law ends in a sentence: tests/first_errors

// ---- traits

struct DeclaresNothing : Plain {
  static constexpr GainLawTraits traits{};
};
struct TraitsOfAnotherType : Plain {
  static constexpr bool traits = true;
};
struct TraitsOfTheOtherDomain : Plain {
  static constexpr ContinuousGainLawTraits traits{};
};
struct TraitsOfTheInstance : Plain {
  GainLawTraits traits{};
};
struct TraitsNotConstant : Plain {
  [[maybe_unused]] static GainLawTraits traits;
};
class TraitsHidden : public Plain {
  static constexpr GainLawTraits traits{};
};
static_assert(is_law<DeclaresNothing> && !is_law<TraitsOfAnotherType>);
static_assert(!is_law<TraitsOfTheOtherDomain> && !is_law<TraitsOfTheInstance>);
static_assert(!is_law<TraitsNotConstant> && !is_law<TraitsHidden>);

// ---- hooks: each as declared, not declared, declared and not there, with another signature

template <GainLawTraits Declared>
struct Declaring : Plain {
  static constexpr GainLawTraits traits = Declared;
};

constexpr GainLawTraits advances{.advances = true};
struct Advance : Declaring<advances> {
  void advance() noexcept {}
};
struct AdvanceUndeclared : Plain {
  void advance() noexcept {}
};
struct AdvanceThrows : Declaring<advances> {
  void advance() {}
};
struct AdvanceTakesTime : Declaring<advances> {
  void advance(double) noexcept {}
};
class AdvanceHidden : public Declaring<advances> {
  void advance() noexcept {}
};
struct AdvanceWithLaterMembers : Declaring<advances> {  // inherited traits hold for what is added
  void advance() noexcept {}
  void reset() noexcept {}
};
static_assert(is_law<Advance> && !is_law<AdvanceUndeclared> && !is_law<Declaring<advances>>);
static_assert(!is_law<AdvanceThrows> && !is_law<AdvanceTakesTime> && !is_law<AdvanceHidden>);
static_assert(!is_law<AdvanceWithLaterMembers>);

constexpr GainLawTraits accepts{.accepts = true};
struct Accept : Declaring<accepts> {
  void accept(double) noexcept {}
};
struct AcceptUndeclared : Plain {
  void accept(double) noexcept {}
};
struct AcceptByNonConstReference : Declaring<accepts> {
  void accept(double&) noexcept {}
};
struct AcceptWithoutInnovation : Declaring<accepts> {
  void accept() noexcept {}
};
struct AcceptUndeclaredOverloads : Plain {
  void accept(double) noexcept {}
  void accept(float) noexcept {}
};
struct AcceptUndeclaredTemplate : Plain {
  template <class S>
  void accept(S) noexcept {}
};
class AcceptUndeclaredAndHidden : public Plain {
  void accept(double) noexcept {}
};
struct AcceptUndeclaredInAFinalClass final : Plain {
  void accept(double) noexcept {}
};
static_assert(is_law<Accept> && !is_law<AcceptUndeclared> && !is_law<Declaring<accepts>>);
static_assert(!is_law<AcceptByNonConstReference> && !is_law<AcceptWithoutInnovation>);
static_assert(!is_law<AcceptUndeclaredOverloads> && !is_law<AcceptUndeclaredTemplate>);
static_assert(!is_law<AcceptUndeclaredAndHidden> && !is_law<AcceptUndeclaredInAFinalClass>);

constexpr GainLawTraits resets{.resets = true};
struct Reset : Declaring<resets> {
  void reset() noexcept {}
};
struct ResetUndeclared : Plain {
  void reset() noexcept {}
};
struct ResetToAValue : Declaring<resets> {
  void reset(double) noexcept {}
};
static_assert(is_law<Reset> && !is_law<ResetUndeclared> && !is_law<Declaring<resets>>);
static_assert(!is_law<ResetToAValue>);

constexpr GainLawTraits bridges{.bridges_gaps = true};
struct Limited : Declaring<bridges> {
  [[nodiscard]] int longest_gap(int asked) const noexcept { return asked; }
};
struct Bridge : Limited {
  [[nodiscard]] Gain gap_gain(double, unsigned) const noexcept { return {}; }
};
struct BridgeUndeclared : Plain {
  [[nodiscard]] Gain gap_gain(double, unsigned) const noexcept { return {}; }
};
struct BridgeWithoutInnovation : Limited {
  [[nodiscard]] Gain gap_gain(unsigned) const noexcept { return {}; }
};
struct BridgeNotConst : Limited {
  Gain gap_gain(double, unsigned) noexcept { return {}; }
};
struct BridgeThrows : Limited {
  [[nodiscard]] Gain gap_gain(double, unsigned) const { return {}; }
};
struct BridgeOfAnotherSize : Limited {
  [[nodiscard]] esokit::ScaledGain<3, double> gap_gain(double, unsigned) const noexcept {
    return {};
  }
};
struct BridgeAnyGap : Declaring<bridges> {
  [[nodiscard]] Gain gap_gain(double, unsigned) const noexcept { return {}; }
};
struct BridgeToANumber : BridgeAnyGap {
  [[nodiscard]] double longest_gap(int) const noexcept { return 1; }
};
struct BridgeLimitThrows : BridgeAnyGap {
  [[nodiscard]] int longest_gap(int asked) const { return asked; }
};
static_assert(is_law<Bridge> && !is_law<BridgeUndeclared> && !is_law<Limited>);
static_assert(!is_law<BridgeAnyGap> && !is_law<BridgeToANumber> && !is_law<BridgeLimitThrows>);
static_assert(!is_law<BridgeWithoutInnovation> && !is_law<BridgeNotConst>);
static_assert(!is_law<BridgeThrows> && !is_law<BridgeOfAnotherSize>);

struct BearsAny : Declaring<GainLawTraits{.bears_any_innovation = true}> {};
struct BearsAnyTheOldWay : Plain {
  [[maybe_unused]] static constexpr bool bears_any_innovation = true;
};
static_assert(is_law<BearsAny> && !is_law<BearsAnyTheOldWay>);

// ---- kinds

constexpr GainLawTraits preset{.kind = GainKind::preset};
struct Preset : Declaring<preset> {
  [[nodiscard]] Gain gain_before_measurement() const noexcept { return {}; }
};
struct PresetUndeclared : Plain {
  [[nodiscard]] Gain gain_before_measurement() const noexcept { return {}; }
};
struct PresetThrows : Declaring<preset> {
  [[nodiscard]] Gain gain_before_measurement() const { return {}; }
};
struct PresetNotConst : Declaring<preset> {
  Gain gain_before_measurement() noexcept { return {}; }
};
static_assert(is_law<Preset> && PresetGainLaw<Preset, 2, double>);
static_assert(!is_law<PresetUndeclared> && !is_law<Declaring<preset>>);
static_assert(!is_law<PresetThrows> && !is_law<PresetNotConst>);

constexpr GainLawTraits switched{.kind = GainKind::switched};
template <class Base>
struct TwoGains : Base {
  [[nodiscard]] Gain shrinking_gain() const noexcept { return {}; }
  [[nodiscard]] Gain otherwise_gain() const noexcept { return {}; }
};
struct Switched : TwoGains<Declaring<switched>> {
  [[nodiscard]] bool shrinks(double) const noexcept { return false; }
};
struct SwitchedUndeclared : TwoGains<Plain> {
  [[nodiscard]] bool shrinks(double) const noexcept { return false; }
};
struct SwitchedByText : TwoGains<Declaring<switched>> {
  [[nodiscard]] const char* shrinks(const char*) const noexcept { return ""; }
};
struct SwitchedOfAnotherKind : TwoGains<Declaring<preset>> {
  [[nodiscard]] bool shrinks(double) const noexcept { return false; }
  [[nodiscard]] Gain gain_before_measurement() const noexcept { return {}; }
};
static_assert(is_law<Switched> && !PresetGainLaw<Switched, 2, double>);
static_assert(!is_law<SwitchedUndeclared> && !is_law<Declaring<switched>>);
static_assert(!is_law<TwoGains<Declaring<switched>>> && !is_law<TwoGains<Plain>>);
static_assert(!is_law<SwitchedByText> && !is_law<SwitchedOfAnotherKind>);

constexpr GainLawTraits factored{.kind = GainKind::factored};
template <class Base>
struct OneGain : Base {
  [[nodiscard]] Gain linear_gain() const noexcept { return {}; }
};
struct Factored : OneGain<Declaring<factored>> {
  [[nodiscard]] double factor(double) const noexcept { return 1; }
};
struct FactoredUndeclared : OneGain<Plain> {
  [[nodiscard]] double factor(double) const noexcept { return 1; }
};
struct FactoredWithoutInnovation : OneGain<Declaring<factored>> {
  [[nodiscard]] double factor() const noexcept { return 1; }
};
struct OwnFactor : Plain {  // a name that is taken
  double factor = 1;
};
static_assert(is_law<Factored> && !is_law<FactoredUndeclared> && !is_law<Declaring<factored>>);
static_assert(!is_law<OneGain<Declaring<factored>>> && !is_law<FactoredWithoutInnovation>);
static_assert(!is_law<OneGain<Plain>> && !is_law<OwnFactor>);

// ---- misspelled hooks

struct Advances : Plain {
  void advances() noexcept {}
};
struct Accepts : Plain {
  void accepts(double) noexcept {}
};
struct Accepted : Plain {
  void accepted(double) noexcept {}
};
struct Resets : Plain {
  void resets() noexcept {}
};
struct BridgeGap : Plain {
  [[nodiscard]] Gain bridge_gap(double, unsigned) const noexcept { return {}; }
};
struct GainForGap : Plain {
  [[nodiscard]] Gain gain_for_gap(double, unsigned) const noexcept { return {}; }
};
struct PresetGain : Plain {
  [[nodiscard]] Gain preset_gain() const noexcept { return {}; }
};
struct Shrink : Plain {
  [[nodiscard]] bool shrink(double) const noexcept { return false; }
};
struct Factors : Plain {
  [[nodiscard]] double factors(double) const noexcept { return 1; }
};
struct CountsResets : Plain {  // a number is no hook
  int resets = 0;
  int accepted = 0;
};
static_assert(!is_law<Advances> && !is_law<Accepts> && !is_law<Accepted> && !is_law<Resets>);
static_assert(!is_law<BridgeGap> && !is_law<GainForGap> && !is_law<PresetGain>);
static_assert(!is_law<Shrink> && !is_law<Factors> && is_law<CountsResets>);

// ---- the library's own

static_assert(PresetGainLaw<esokit::ConstantGain<2, double>, 2, double>);
static_assert(PresetGainLaw<esokit::AlgebraicGain<2, double>, 2, double>);
static_assert(PresetGainLaw<esokit::RiccatiGain<2, double>, 2, double>);
static_assert(is_law<esokit::SwitchedGain<2, double>> && is_law<esokit::NonlinearGain<2, double>>);
static_assert(!PresetGainLaw<esokit::SwitchedGain<2, double>, 2, double>);
static_assert(!PresetGainLaw<esokit::NonlinearGain<2, double>, 2, double>);

// ---- continuous laws

template <class Law>
constexpr bool is_continuous_law = ContinuousGainLaw<Law, 2, double>;
using Column = esokit::Vector<double, 2>;

struct ContinuousPlain {
  [[nodiscard]] Column gain(double, double) const { return {}; }
};
struct BeginStepUndeclared : ContinuousPlain {
  void begin_step(double, double) {}
};
struct BeginStepMissing : ContinuousPlain {
  static constexpr ContinuousGainLawTraits traits{.begins_steps = true};
};
struct BeginStep : BeginStepMissing {
  void begin_step(double, double) {}
};
struct BeginStepWithoutTime : BeginStepMissing {
  void begin_step(double) {}
};
static_assert(is_continuous_law<ContinuousPlain> && is_continuous_law<BeginStep>);
static_assert(!is_continuous_law<BeginStepUndeclared> && !is_continuous_law<BeginStepMissing>);
static_assert(!is_continuous_law<BeginStepWithoutTime> && !is_continuous_law<Plain>);
static_assert(is_continuous_law<esokit::ContinuousSwitchedGain<2, double>>);

// ---- even gains

template <class Shape>
constexpr bool is_even_gain = esokit::EvenGain<Shape, double>;

struct EvenPlain {
  double operator()(double) const { return 1; }
};
struct Checked : EvenPlain {
  static constexpr esokit::EvenGainTraits traits{.validates = true};
  [[nodiscard]] esokit::Check<double> validate() const { return {}; }
};
struct CheckUndeclared : EvenPlain {
  [[nodiscard]] esokit::Check<double> validate() const { return {}; }
};
struct CheckMissing : EvenPlain {
  static constexpr esokit::EvenGainTraits traits{.validates = true};
};
struct CheckIsABool : CheckMissing {
  [[nodiscard]] bool validate() const { return true; }
};
struct Prepares : EvenPlain {
  static constexpr esokit::EvenGainTraits traits{.prepares = true};
  [[nodiscard]] EvenPlain prepared() const { return {}; }
};
struct PreparedUndeclared : EvenPlain {
  [[nodiscard]] EvenPlain prepared() const { return {}; }
};
struct PreparedIsNoFunction : EvenPlain {
  static constexpr esokit::EvenGainTraits traits{.prepares = true};
  [[nodiscard]] double prepared() const { return 1; }
};
static_assert(is_even_gain<EvenPlain> && is_even_gain<Checked> && is_even_gain<Prepares>);
static_assert(!is_even_gain<CheckUndeclared> && !is_even_gain<CheckMissing>);
static_assert(!is_even_gain<CheckIsABool> && !is_even_gain<PreparedUndeclared>);
static_assert(!is_even_gain<PreparedIsNoFunction> && !is_even_gain<int>);
static_assert(is_even_gain<double (*)(double)>);
static_assert(is_even_gain<esokit::FalGain<double>> && is_even_gain<esokit::PowerSumGain<double>>);

// ---- an archetype of each kind meets the concept, no more, and runs

template <class Law>
struct Kind : testing::Test {};
using Kinds = testing::Types<Plain, Final, Generic, Advance, Accept, Reset, Bridge, BearsAny,
                             Preset, Switched, Factored>;
TYPED_TEST_SUITE(Kind, Kinds);

TYPED_TEST(Kind, Runs) {
  auto observer = PredictorCorrector<1, double, 1, TypeParam>::make(
                      {.input_gain = 1, .sample_time = 1}, TypeParam{})
                      .value();
  EXPECT_EQ(observer.update(1, 2), esokit::StepStatus::ok);
  EXPECT_EQ(observer.predict(2), esokit::StepStatus::ok);
  EXPECT_EQ(observer.predict(2), esokit::StepStatus::ok);
  EXPECT_EQ(observer.correct(1), esokit::StepStatus::gap_bridged);
  // No gain: only the input counts.
  EXPECT_EQ(observer.template estimate<0>(), 6);
  EXPECT_EQ(observer.reset(3), esokit::StepStatus::ok);
  EXPECT_EQ(observer.template estimate<0>(), 3);
}

}  // namespace gain_gain_law_static_test
