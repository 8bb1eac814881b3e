/// @file
/// RecordedDesign: all that a text of another language needs of a finished controller or observer,
/// recorded from its own calls.
#pragma once

#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/gain/riccati_gain.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <esokit/target/list_writer.hpp>
#include <esokit/target/recorder.hpp>
#include <limits>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace esokit {

/// How a text of another language is to be written.
struct CodeOptions {
  std::string name = "controller";  ///< begins every name and the files: an identifier of C
  std::string comment{};            ///< at the head: which machine, which design; no marks of a
                                    ///< comment
  int self_test_samples = 100;      ///< samples of the self-test, 1 .. 10000
  bool watched = false;  ///< keeps what a HealthMonitor looks at: innovation, and u that was asked

  /// Gains, those of the law, and limits in a struct that can be changed while it runs, instead of
  /// constants: in C, for gains that do not depend on the innovation or the time.
  bool settings_in_struct = false;
  std::string settings_name = "design";  ///< of that struct, behind `name`: an identifier
};

namespace detail {

/// The rules of a loop: plain numbers.
struct LoopRules {
  unsigned hold_left = 0;
  unsigned missing_limit = 0;
  int divider = 1;
  bool has_safe_input = false;
  bool stays_safe = false;
  double hold_input = 0;
  double safe_input = 0;
};

/// An OutlierGate: its settings, and what it has seen.
struct GateNumbers {
  double threshold = 0;  ///< 0: there is no gate
  double running_factor = 0;
  double mean = 0;
  unsigned most_in_a_row = 0;
  unsigned count = 0;
  bool open = true;
};

/// A gain law that goes on at each sample, around lists of its own: the schedule of AlgebraicEso or
/// the recursion of ExtendedStateFilter.
enum class RunningLaw : unsigned char { none, schedule, filter };

/// What such a law counts.
struct LawNumbers {
  RunningLaw kind = RunningLaw::none;
  unsigned start = 0;      ///< of a schedule: its first sample,
  unsigned least_age = 0;  ///< the samples before it may settle, and as long estimates are blanked,
  unsigned age = 0;        ///< the samples so far,
  bool pending = false;    ///< whether the last one was not corrected,
  bool settled = false;    ///< whether it stands, for ever if no sample is missing,
  double decay = 0;        ///< p,
  double shift = 0;        ///< 1 - p
  double contraction = 0;  ///< and that of the poles in the end
  unsigned since = 0;      ///< of a filter: what happened since the last step,
  bool returns = false;    ///< whether the recursion ends at a limit,
  bool watches = false;    ///< whether it refuses outliers
};

/// Its count of turns.
struct TurnNumbers {
  double y = 0;
  double turns = 0;
  double motion = 0;
  unsigned samples = 0;
  unsigned gaps = 0;
  unsigned doubts = 0;
  bool begun = false;
};

/// A WrappedOutput.
struct WrapNumbers {
  double period = 0;  ///< 0: there is none
  double inverse_period = 0;
  double most_turns = 0;  ///< more cannot be told apart
  TurnNumbers count{};
  bool gated = false;  ///< around a gate: the rest counts over all measurements
  TurnNumbers heard{};
  unsigned heard_at = 0;
  unsigned heard_steady = 0;
  unsigned heard_rejected = 0;
  std::string angle{};  ///< the estimate that the law subtracts from the reference
};

/// A Guarded: its bound, in the scaling of the states, and its leak.
struct GuardNumbers {
  bool on = false;
  int levels = 1;
  double bound = 0;  ///< 0: there is none
  double leak = 0;
  double trust = 1;
  double bound_as_given = 0;  ///< of `by_input`
  bool by_input = false;      ///< unit of u: the bound follows b0
  double gain = 1;            ///< b0 of the observer
  double inverse_gain = 1;
  double gain_ratio = 1;  ///< see Guarded, as what follows
  double told_ratio = 1;
  double input_factor = 1;
  double weight_up = 1;
  double weight_down = 1;
  unsigned release_samples = 0;
  unsigned release_left = 0;
  unsigned settling_samples = 0;
  unsigned settling_left = 0;
  unsigned pin = 0;
  unsigned side = 0;  ///< 1: upper, 2: lower
  bool held = false;
  bool unsettled = false;
  bool gated = false;
  bool frozen = false;
};

/// One of the disturbances of a Measured.
struct MeasuredPathNumbers {
  double gain = 0;
  std::array<double, 2> share{};  ///< of a sample in which the older and the newer w arrive,
  std::array<double, 2> late{};   ///< and what the lag does in these
  std::array<double, 2> reached{};
  std::vector<double> memory{};  ///< the newest last
  double lagged = 0;
  double last = 0;
  unsigned lost = 0;
};

/// A Measured.
struct MeasuredNumbers {
  bool on = false;
  unsigned most_lost = 0;
  double told = 0;
  std::vector<MeasuredPathNumbers> paths{};
};

/// A KnownModel.
struct KnownNumbers {
  bool on = false;
  bool around_angle = false;  ///< a WrappedOutput is inside
};

/// A finished design as lists and counts, without its type.
struct RecordedDesign {
  CodeOptions options{};
  bool single = false;         ///< float
  bool is_controller = false;  ///< else an observer
  std::vector<NamedCall> names{};
  std::vector<RecordedCall> calls{};   ///< one for each name
  std::vector<std::string> members{};  ///< a name for each number of the object
  std::vector<bool> live{};            ///< whether its state needs it
  std::vector<bool> settings{};        ///< whether it is a setting, see CodeOptions; or empty
  std::vector<double> numbers{};       ///< what it is at first
  int size = 0;                        ///< N: rows of the estimate
  int order = 0;                       ///< the row of the disturbance
  std::string first_state{};           ///< the predicted measurement
  double sample_time = 0;
  double input_gain = 0;
  std::vector<std::vector<double>> gap_gains{};  ///< all gains after 1, 2, .. samples
  bool gain_is_kept = true;    ///< without a gap they are the first row, else computed by the list
  std::vector<double> line{};  ///< of DelayedInput: the inputs, the newest last
  GateNumbers gate{};
  LawNumbers law{};
  WrapNumbers wrap{};
  GuardNumbers guard{};
  MeasuredNumbers measured{};
  KnownNumbers known{};
  int max_gap = 0;  ///< missing samples that are bridged
  LoopRules loop{};
  double lower = 0;
  double upper = 0;
  bool error_based = false;
  bool softens = false;
  bool compensates = false;                      ///< r is the output of another controller
  bool predictive = false;                       ///< in two phases
  unsigned hold = 0;                             ///< of one of these: samples of its start hold
  std::vector<std::array<double, 3>> samples{};  ///< y, r or u, and the result
};

/// What is private in a controller and an observer, and is recorded apart.
struct RecordAccess {
  template <class C>
  static auto& loop(C& c) noexcept {
    return c.loop_;
  }
  /// u of the law for the present estimate, before the limits; as if no start hold were left.
  template <class C, class S>
  static S law(C& c, const S& reference) noexcept {
    c.loop_.mode_ = LoopMode::running;
    if constexpr (requires { c.judged(reference); }) {
      return c.judged(reference);
    } else {
      return c.command(reference);
    }
  }
  /// The output of the loop for a u that is wanted.
  template <class Loop, class S>
  static S limited(Loop& loop, const S& wanted) noexcept {
    return loop.limited(wanted);
  }
  template <class C>
  static bool softens(const C& c) noexcept {
    if constexpr (requires { c.soft_; }) {
      return c.soft_.on();
    } else {
      return false;
    }
  }
  /// The law as designed again.
  template <class C>
  static void harden(C& c) noexcept {
    if constexpr (requires { c.soft_; }) c.soft_.reset();
  }
  template <class Loop>
  static LoopRules rules(const Loop& loop) noexcept {
    return {loop.hold_left_,
            loop.set_.missing_limit,
            loop.set_.divider,
            loop.set_.has_safe_input,
            loop.set_.stay_safe,
            static_cast<double>(loop.set_.hold_input),
            static_cast<double>(loop.set_.safe_input)};
  }

  /// Gains, those of the law, and limits, with the beginning of their names. @param c a controller
  /// or an observer
  template <class Number, class C>
  static void find_settings(C& c, std::vector<std::pair<const Number*, const char*>>& found) {
    const auto take = [&](auto& part, const char* name) {
      for (Number* one : numbers_of<Number>(part)) found.emplace_back(one, name);
    };
    if constexpr (requires { c.loop_; }) {
      take(c.loop_.limiter_, "limit");
      const Number* last = &c.loop_.limiter_.last();
      std::erase_if(found, [last](const auto& one) { return one.first == last; });
      if constexpr (requires { c.law_; }) {
        take(c.law_, "law");
        take(c.weights_, "law");
      }
      if constexpr (requires { c.gain_; }) take(c.gain_, "law");
      find_settings(core(c.observer()), found);
    } else if constexpr (requires { c.laws_; }) {
      for (auto& law : c.laws_) take(law, "gain");
    }
  }

  // ---- A controller in two phases.

  /// The lists around which its text goes.
  template <class Number, int Size, class Add>
  static void add_phases(const Add& add) {
    using Numbers = std::vector<Number>;
    const auto armed = [](auto& c) {
      (void)(all(is_finite(c.blind_)) && all(is_finite(c.offset_)) && all(is_finite(c.slope_)));
      return Numbers{};
    };
    add("control_by", {"y"}, true,
        [](auto& c, const auto& in) { return Numbers{c.control(in[0])}; });
    add("control_blind", {}, true,
        [](auto& c, const auto&) { return Numbers{c.control_without_measurement()}; });
    add("refer", {"r"}, false, [](auto& c, const auto& in) {
      for (Number& one : c.reference_) one = Number(0.0);
      c.reference_[0] = in[0];
      return Numbers{};
    });
    add("take_output", {"u"}, false, [](auto& c, const auto& in) {
      c.output_ = in[0];
      return Numbers{};
    });
    add("track", {}, false, [](auto& c, const auto&) {
      c.limiter_.track(c.output_);
      return Numbers{};
    });
    add("revise", {"u"}, false, [](auto& c, const auto& in) {
      (void)c.observer_.revise_input(in[0]);
      return Numbers{};
    });
    add("arm_restart", {}, false, [armed](auto& c, const auto&) {
      using O = std::remove_cvref_t<decltype(c.observer_)>;
      typename O::Preview next{};
      for (Number& one : next.offset) one = Number(0.0);
      next.slope = O::by_rows(O::standing(Number(1.0)));
      c.look_ahead();
      c.arm_by(next);
      return armed(c);
    });
    add("arm_hold", {}, false, [](auto& c, const auto&) {
      c.look_ahead();
      c.settle_for(Number(0.0));
      return Numbers{};
    });
    add("arm_blind", {}, false, [](auto& c, const auto&) {
      c.look_ahead();
      c.settle_for_blind();
      return Numbers{};
    });
    std::vector<std::string> gains;
    for (int i = 1; i <= Size; ++i) gains.push_back("k" + std::to_string(i));
    add("arm_by", gains, false, [armed](auto& c, const auto& in) {
      ScaledGain<Size, Number> gain{};
      for (std::size_t i = 0; i < gain.size(); ++i) gain[i] = in[i];
      c.look_ahead();
      c.arm_by(gain);
      return armed(c);
    });
  }
  template <class C>
  static unsigned hold_left(const C& c) noexcept {
    return c.hold_left_;
  }
  template <class C>
  static const auto& limiter(const C& c) noexcept {
    return c.limiter_;
  }
  template <class C>
  static auto& observer_of(C& c) noexcept {
    return c.observer_;
  }

  /// The gain laws of all levels.
  template <class O>
  static auto laws(O& o) noexcept -> decltype((o.laws_)) {
    return o.laws_;
  }
  /// A correction with gains from elsewhere, `gains[level][row]`.
  template <class O, class S, class Gains>
  static void correct(O& o, const S& y, const Gains& gains) noexcept {
    typename O::Correction step{o.kept_.states};
    const bool fine = o.correct_by(
        step, y, [&](auto level, const S&) -> const auto& { return gains[std::size_t{level}]; });
    if (fine && all(is_finite(o.probe(step.states)))) o.commit(step);
  }

  // ---- Laws that run.

  template <class Law>
  static constexpr RunningLaw kind_of = [] {
    if constexpr (requires(Law law) { law.least_age_; }) {
      return RunningLaw::schedule;
    } else if constexpr (requires(Law law) { law.now_.factor; }) {
      return RunningLaw::filter;
    } else {
      return RunningLaw::none;
    }
  }();
  template <class O>
  using LawOf = std::remove_cvref_t<decltype(std::declval<O&>().laws_[0])>;

  // ---- A known model.

  template <class O>
  static constexpr bool knows = requires(O& o) {
    o.rest_.inverse_gain;
  };
  /// The observer in a KnownModel, or the object itself.
  template <class O>
  static auto& core(O& o) noexcept {
    if constexpr (knows<O>) {
      return o.observer_;
    } else {
      return o;
    }
  }
  /// The input of the observer in it for a u.
  template <class O, class S>
  static S driven(O& o, const S& u) noexcept {
    return o.accepted(u);
  }
  /// At rest at y under u: `at` is y, u and, of an angle, y without whole turns. @param
  /// around_angle see KnownNumbers
  template <class O, class Numbers>
  static void rest(O& o, const Numbers& at, [[maybe_unused]] bool around_angle) noexcept {
    auto state = o.equilibrium(at[0], at[1]);
    const bool wraps = at.size() > 2;
    if constexpr (knows<O>) {
      if (wraps && !around_angle) state(0) = at[2];
      state = o.without_known(state);
    }
    if (wraps) state(0) = at[2];
    (void)core(o).reset(state);
  }

  /// The law stands: no call moves it.
  template <class O>
  static O& at_rest(O& any) noexcept {
    auto& o = core(any);
    using Law = LawOf<std::remove_cvref_t<decltype(o)>>;
    if constexpr (kind_of<Law> == RunningLaw::schedule) o.laws_[0].settled_ = true;
    if constexpr (kind_of<Law> == RunningLaw::filter) o.laws_[0].since_ = std::int8_t{9};
    return any;
  }
  template <class O>
  static LawNumbers law_numbers(const O& o) noexcept {
    LawNumbers numbers;
    numbers.kind = kind_of<LawOf<O>>;
    const auto& law = o.laws_[0];
    if constexpr (kind_of<LawOf<O>> == RunningLaw::schedule) {
      numbers.start = law.start_index_;
      numbers.least_age = law.least_age_;
      numbers.age = law.age_;
      numbers.pending = law.pending_;
      numbers.settled = law.settled_;
      numbers.decay = static_cast<double>(law.decay_);
      numbers.shift = static_cast<double>(law.shift_.contraction);
      numbers.contraction = static_cast<double>(law.final_poles_.contraction);
    } else if constexpr (kind_of<LawOf<O>> == RunningLaw::filter) {
      numbers.since = static_cast<unsigned>(law.since_ & 127);
      numbers.returns = law.mode_ != RiccatiMode::recursive;
      numbers.settled = law.mode_ == RiccatiMode::frozen && law.stands();
      numbers.watches = law.is_watched();
    }
    return numbers;
  }
  /// The lists around which its text goes. @param law a recorded law
  template <class Law, class Add>
  static void add_law(const Add& add) {
    using S = typename Law::scalar_type;
    if constexpr (kind_of<Law> == RunningLaw::schedule) {
      constexpr int size =
          std::tuple_size_v<std::remove_cvref_t<decltype(std::declval<Law>().gain_)>>;
      using Poles = EqualSampledPoles<size, S>;
      const auto nothing = S(0.0);
      add("schedule_restart", {}, false,
          [=](Law& law, const auto&) { return law.restart(), nothing; });
      add("anchor_begin", {}, false, [=](Law& law, const auto&) {
        law.power_ = S(1.0);
        law.bracket_ = S(0.0);
        return nothing;
      });
      add("anchor_take", {"power", "contraction"}, false, [=](Law& law, const auto& in) {
        return Law::anchor_take(law.power_, law.bracket_, in[0], in[1]), nothing;
      });
      add("anchor_contraction", {"power", "contraction"}, true,
          [](Law&, const auto& in) { return S(in[1] + in[0] * in[1]); });
      add("anchor_power", {"power", "contraction"}, true,
          [](Law& law, const auto& in) { return law.squared(in[0], in[1]); });
      add("anchor_end", {"count"}, false, [=](Law& law, const auto& in) {
        law.bracket_ = law.bracket(in[0], law.bracket_);
        return nothing;
      });
      add("schedule_next", {}, false, [=](Law& law, const auto&) {
        law.push();
        law.set_gain();
        return nothing;
      });
      add("schedule_settle", {}, false, [=](Law& law, const auto&) {
        if (all(law.settled_below_ >= std::get<0>(law.ratios_u_))) law.stand();
        return nothing;
      });
      add("present_poles", {}, true,
          [](Law& law, const auto&) { return law.present_poles().contraction; });
      add("joined_poles", {"a", "b"}, true,
          [](Law&, const auto& in) { return Poles::joined(in[0], in[1]); });
    } else if constexpr (kind_of<Law> == RunningLaw::filter) {
      const auto nothing = S(0.0);
      add("filter_corrected", {}, false,
          [=](Law& law, const auto&) { return law.recur_usually(true), nothing; });
      add("filter_missed", {}, false,
          [=](Law& law, const auto&) { return law.recur_usually(false), nothing; });
      add("filter_at_ceiling", {}, false, [=](Law& law, const auto&) {
        if (all(!(law.now_.factor.variance(0) < law.ceiling()))) law.recur_at_ceiling();
        return nothing;
      });
      add("filter_to_limit", {}, false, [=](Law& law, const auto&) {
        if (law.now_.factor.near(law.limit_.factor, S(1e-3))) law.now_ = law.limit_;
        return nothing;
      });
    }
  }
  /// u of the law for given estimates, where the observer does not always publish its own.
  template <class C, class Numbers>
  static auto law_for(C& c, const Numbers& in) noexcept {
    auto& o = c.observer();
    o.laws_[0].age_ = std::uint32_t{0};  // it publishes what it keeps
    const auto kept = o.rest_.published;
    std::size_t next = 1;
    for (auto& given : o.rest_.published) given = in[next++];
    const auto u = law(c, in[0]);
    o.rest_.published = kept;
    return u;
  }
  template <class O>
  static constexpr bool blanks = requires(O& o) {
    o.rest_.published;
  };
  /// An estimate as it is computed, whether it is published or not.
  template <int Row, class O>
  static auto estimate(const O& o) noexcept {
    if constexpr (blanks<O>) {
      return static_cast<const typename O::Base&>(o).template estimate<Row>();
    } else {
      return o.template estimate<Row>();
    }
  }
  /// The place of a number among those that are published while estimates are blanked, or -1.
  template <class O, class S>
  static int place_in_published(const O& o, const S* at) noexcept {
    int place = -1;
    if constexpr (blanks<O>) {
      for (std::size_t i = 0; i < o.rest_.published.size(); ++i) {
        if (at == &o.rest_.published[i]) place = static_cast<int>(i);
      }
    }
    return place;
  }
  /// Not written: a table of the first gains, a nominal model.
  template <class O>
  static constexpr bool is_plain = [] {
    if constexpr (kind_of<LawOf<O>> == RunningLaw::filter) {
      return LawOf<O>::table_size == 0 && !O::has_model;
    } else {
      return true;
    }
  }();
  /// A y that the filter's gate accepts, as a check.
  template <class O, class S>
  static void judge(O& o, const S& y) noexcept {
    const S e = y - o.predicted_measurement();
    (void)all(e * e <= o.rest_.set.outlier_threshold * o.innovation_variance());
  }

  template <class O>
  static WrapNumbers wrap(const O& o) noexcept {
    using S = typename O::scalar_type;
    const auto number = [](const S& x) { return static_cast<double>(x); };
    WrapNumbers wrap;
    wrap.period = number(o.period_);
    wrap.inverse_period = number(o.inverse_period_);
    wrap.most_turns = number(S(1) / (S(8) * rounding<S>()));
    const auto counted = [&](const auto& c) {
      return TurnNumbers{number(c.y), number(c.turns), number(c.motion), c.samples,
                         c.gaps,      c.doubts,        c.begun};
    };
    wrap.count = counted(o.count_);
    if constexpr (O::gated) {
      wrap.gated = true;
      wrap.heard = counted(o.heard_.count);
      wrap.heard_at = o.heard_.at;
      wrap.heard_steady = o.heard_.steady;
      wrap.heard_rejected = o.heard_.rejected;
    }
    return wrap;
  }

  /// Whether it has a trust, and nothing but dhat itself to guard.
  template <class O>
  static constexpr bool guards_a_chain = [] {
    if constexpr (requires { O::on_chain; }) {
      return O::on_chain && O::gates;
    } else {
      return true;
    }
  }();
  template <class O>
  static GuardNumbers guard(const O& o) noexcept {
    using S = typename O::scalar_type;
    const bool bounds = o.limit_ < (std::numeric_limits<S>::max)();
    const auto& set = o.set_;
    const auto& now = o.weights_;
    const auto number = [](const S& x) { return static_cast<double>(x); };
    return {true,
            O::levels,
            bounds ? number(o.limit_) : 0.0,
            number(set.leak),
            number(now.trust),
            number(set.bound),
            set.unit == DisturbanceUnit::input,
            number(o.configured_gain()),
            number(set.inverse_gain),
            number(o.gain_ratio_),
            number(o.told_ratio_),
            number(o.input_factor_),
            number(now.up),
            number(now.down),
            set.release_samples,
            now.release_left,
            static_cast<unsigned>(set.settling_samples),
            static_cast<unsigned>(now.settling_left),
            static_cast<unsigned>(now.pin),
            now.side > 0   ? 1u
            : now.side < 0 ? 2u
                           : 0u,
            now.held,
            now.unsettled,
            now.gated,
            now.frozen};
  }

  /// What Guarded does with the states on the chain: y of a prediction, a plant that stands at y
  /// with the disturbance of each level, a disturbance in the unit of u under another b0.
  /// @{
  template <class O, class Numbers>
  static auto predicted_y(const O& o, const Numbers& in) noexcept {
    typename O::State x{};
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = in[i];
    return o.model_.predict(x, o.model_.drive(in[x.size()]))[0];
  }
  template <class O, class Numbers>
  static void stand_at(O& o, const Numbers& in) noexcept {
    auto still = o.kept_.states;
    std::size_t next = 1;
    for (auto& level : still) {
      for (auto& x : level) x = std::remove_cvref_t<decltype(x)>(0.0);
      level[0] = in[0];
      level[O::order] = in[next++];
    }
    (void)o.shift_to(still);
  }
  template <class O, class S>
  static void scale_found(O& o, const S& change) noexcept {
    auto scaled = o.kept_.states;
    for (auto& level : scaled) level[O::order] = level[O::order] * change;
    (void)o.shift_to(scaled);
  }
  /// @}
  /// Where a load acts in the states of a model, which takes design work.
  template <class O>
  static auto load_column(const O& o) noexcept {
    if constexpr (model_traits<typename O::PlantModel>.is_chain) {
      return Empty{};
    } else {
      return o.model_.constant_column();
    }
  }
  /// `shift_load` with it.
  template <class O, class Column, class S>
  static void load(O& o, const Column& column, const S& offset) noexcept {
    if constexpr (std::is_same_v<Column, Empty>) {
      (void)o.shift_load(offset);
    } else {
      auto next = o.kept_.states;
      const S scaled = o.model_.scaled_constant(offset);
      for (auto& state : next) {
        for (std::size_t i = 0; i < column.size(); ++i) state[i] = state[i] + S(column[i]) * scaled;
      }
      (void)o.shift_to(next);
    }
  }
  struct Empty {};
  template <class O>
  static MeasuredNumbers measured(const O& o) {
    const auto number = [](const auto& x) { return static_cast<double>(x); };
    MeasuredNumbers all{true, static_cast<unsigned>(o.most_lost_), number(o.told_), {}};
    for (std::size_t w = 0; w < o.paths_.size(); ++w) {
      const auto& path = o.paths_[w];
      MeasuredPathNumbers numbers;
      numbers.gain = number(path.input_.gain);
      for (std::size_t i = 0; i < 2; ++i) {
        numbers.share[i] = number(path.share_[i]);
        numbers.late[i] = number(path.late_[i]);
        numbers.reached[i] = number(path.reached_[i]);
      }
      for (int age = path.whole_ + 1; age >= 0; --age) {
        numbers.memory.push_back(number(path.before(age)));
      }
      numbers.lagged = number(path.lagged_);
      numbers.last = number(o.last_[w]);
      numbers.lost = static_cast<unsigned>(o.lost_[w]);
      all.paths.push_back(numbers);
    }
    return all;
  }

  /// What a monitor computes from its settings alone, and of the controller that it watches.
  template <class M, class C>
  static auto health(const M& m, const C& c) noexcept {
    using S = typename M::scalar_type;
    struct Numbers {
      S weight, hair, largest_square, range, pole, slow, middle, least_against, least, step, forget;
      S input_gain, of_noise;
      int divider;
    } numbers;
    const S b = c.observer().input_gain();
    numbers.range = absolute(b) * m.range_;
    numbers.weight = m.weight_;
    numbers.hair = static_cast<S>(1e-4) * m.range_;
    numbers.largest_square = m.largest_square();
    numbers.pole = m.pole_;
    numbers.slow = m.slow_;
    numbers.middle = b * m.middle(c.limiter());
    numbers.least_against = m.larger(static_cast<S>(0.02) * numbers.range, S(3) * m.least_);
    numbers.least = m.least_;
    numbers.step = m.step_;
    numbers.forget = m.forget_;
    numbers.input_gain = b;
    numbers.of_noise = m.health_.innovation_of_noise;
    numbers.divider = m.divider_;
    return numbers;
  }

  /// What a profile computes from its settings alone.
  template <class P>
  static auto profile(const P& p) noexcept {
    using S = typename P::scalar_type;
    struct Numbers {
      std::array<S, P::order> limits{}, roots_of_limits{}, roots_of_peaks{};
      S shortest_time, sample_time, longer;
    } numbers;
    for (int i = 1; i <= P::order; ++i) {
      const auto row = static_cast<std::size_t>(i - 1);
      numbers.limits[row] = p.config_.limits[row];
      numbers.roots_of_limits[row] = p.root(p.config_.limits[row], i);
      numbers.roots_of_peaks[row] = p.root(p.peak(i), i);
    }
    numbers.shortest_time = p.config_.shortest_time;
    numbers.sample_time = p.config_.sample_time;
    numbers.longer = p.longer;
    return numbers;
  }

  /// The inputs of a DelayedInput that are still needed, the newest last.
  template <class O>
  static std::vector<double> line(const O& o) {
    std::vector<double> inputs;
    const int length = static_cast<int>(o.inputs_.size());
    for (int age = o.delay_; age >= 0; --age) {
      const int at = (o.newest_ - age + length) % length;
      inputs.push_back(static_cast<double>(o.inputs_[static_cast<std::size_t>(at)]));
    }
    return inputs;
  }
  template <class O>
  static GateNumbers gate(const O& o) noexcept {
    return {static_cast<double>(o.threshold_),
            static_cast<double>(o.running_factor_),
            static_cast<double>(o.mean_),
            o.most_in_a_row_,
            o.count_,
            o.open_};
  }
};

// ---- Adapters: what they count and choose is text of each language; the lists are of what they
// adapt.

// A delay acts on u and a gate on y, so that their order does not matter.

template <class Observer>
struct IsDelayed : std::false_type {};
template <class Observer, int Capacity>
struct IsDelayed<DelayedInput<Observer, Capacity>> : std::true_type {};
template <class Observer>
struct IsGate : std::false_type {};
template <class Observer>
struct IsGate<OutlierGate<Observer>> : std::true_type {};
template <class Observer>
struct IsWrapped : std::false_type {};
template <class Observer>
struct IsWrapped<WrappedOutput<Observer>> : std::true_type {};
template <class Observer>
struct IsGuarded : std::false_type {};
template <class Observer>
struct IsGuarded<Guarded<Observer>> : std::true_type {};
template <class Observer>
struct IsMeasured : std::false_type {};
template <class Observer, int Count, int Delay>
struct IsMeasured<Measured<Observer, Count, Delay>> : std::true_type {};
template <class Observer>
struct IsKnown : std::false_type {};
template <class Observer, class Model>
struct IsKnown<KnownModel<Observer, Model>> : std::true_type {};
template <class Observer>
inline constexpr bool is_adapter =
    IsDelayed<Observer>::value || IsGate<Observer>::value || IsWrapped<Observer>::value ||
    IsGuarded<Observer>::value || IsMeasured<Observer>::value;
/// Told at one place, and inside a WrappedOutput: around it the angle is read otherwise.
template <class Observer>
inline constexpr bool measures_plainly = [] {
  if constexpr (IsMeasured<Observer>::value) {
    using Inside = typename Observer::Adapted;
    return !observer_traits<Inside>.takes_measured && !observer_traits<Inside>.wraps_output &&
           measures_plainly<Inside>;
  } else if constexpr (IsGuarded<Observer>::value) {
    return !observer_traits<typename Observer::Adapted>.takes_measured;
  } else if constexpr (is_adapter<Observer> || IsKnown<Observer>::value) {
    return measures_plainly<typename Observer::Adapted>;
  } else {
    return true;
  }
}();
/// What the adapters around an observer count and choose.
template <class Observer>
void take_adapters(RecordedDesign& design, const Observer& observer) {
  if constexpr (IsDelayed<Observer>::value) design.line = RecordAccess::line(observer);
  if constexpr (IsGate<Observer>::value) design.gate = RecordAccess::gate(observer);
  if constexpr (IsGuarded<Observer>::value) design.guard = RecordAccess::guard(observer);
  if constexpr (IsWrapped<Observer>::value) design.wrap = RecordAccess::wrap(observer);
  if constexpr (IsMeasured<Observer>::value) design.measured = RecordAccess::measured(observer);
  if constexpr (IsKnown<Observer>::value) {
    design.known = {true, observer_traits<typename Observer::Adapted>.wraps_output};
  }
  if constexpr (is_adapter<Observer> || IsKnown<Observer>::value)
    take_adapters(design, observer.observer());
}

/// An observer without the adapter around it, and a controller around the observer without it.
/// @{
template <class Object>
struct WithoutAdapter {
  using type = Object;
};
template <class Observer, int Capacity>
struct WithoutAdapter<DelayedInput<Observer, Capacity>> {
  using type = typename WithoutAdapter<Observer>::type;
};
template <class Observer>
struct WithoutAdapter<OutlierGate<Observer>> {
  using type = typename WithoutAdapter<Observer>::type;
};
template <class Observer>
struct WithoutAdapter<WrappedOutput<Observer>> {
  using type = typename WithoutAdapter<Observer>::type;
};
template <class Observer>
struct WithoutAdapter<Guarded<Observer>> {
  using type = typename WithoutAdapter<Observer>::type;
};
template <class Observer, int Count, int Delay>
struct WithoutAdapter<Measured<Observer, Count, Delay>> {
  using type = typename WithoutAdapter<Observer>::type;
};
/// What is known is recorded with the observer.
template <class Observer, class Model>
struct WithoutAdapter<KnownModel<Observer, Model>> {
  using type = KnownModel<typename WithoutAdapter<Observer>::type, Model>;
};
template <class Observer, class Form>
struct WithoutAdapter<Adrc<Observer, Form>> {
  using type = Adrc<typename WithoutAdapter<Observer>::type, Form>;
};
template <class Observer>
struct WithoutAdapter<DisturbanceCompensator<Observer>> {
  using type = DisturbanceCompensator<typename WithoutAdapter<Observer>::type>;
};
template <class Observer>
struct WithoutAdapter<ControlLoop<Observer>> {
  using type = ControlLoop<typename WithoutAdapter<Observer>::type>;
};

template <class To, class From>
void take_off_adapter(To& to, const From& from) {
  if constexpr (std::is_same_v<To, From>) {
    to = from;
  } else if constexpr (is_adapter<From>) {
    take_off_adapter(to, from.observer());
  } else if constexpr (!std::is_empty_v<To>) {
    LaneAccess::with_members(to, [&](auto&... into) {
      LaneAccess::with_members(
          from, [&](const auto&... out_of) { (take_off_adapter(into, out_of), ...); });
    });
  }
}
/// @}

// ---- What can be written.

/// A law whose gain after a gap is a row of a table.
template <class Law>
concept GapGainsAreATable = gain_law_traits<Law>
.bridges_gaps && !gain_law_traits<Law>.advances && requires { typename WithScalar<Law, float>; };

template <class Observer>
using CoreOf = std::remove_cvref_t<decltype(RecordAccess::core(std::declval<Observer&>()))>;
/// PredictorCorrector with such laws, or with one that runs.
template <class Core>
concept HasWrittenGains = requires(const Core& o) {
  requires GapGainsAreATable<std::remove_cvref_t<decltype(RecordAccess::laws(o)[0])>> ||
      (RecordAccess::kind_of<std::remove_cvref_t<decltype(RecordAccess::laws(o)[0])>> !=
           RunningLaw::none &&
       RecordAccess::is_plain<Core>);
};

/// An observer whose lists are recorded, perhaps with a known model. What a schedule publishes is
/// not what is known of its estimate.
template <class Observer>
concept HasLists = can_be_recorded<Observer> && HasWrittenGains<CoreOf<Observer>> &&
    !(IsKnown<Observer>::value && RecordAccess::blanks<CoreOf<Observer>>);

/// False for what is refused because the function of a KnownModel is typed on one scalar.
template <class Object>
inline constexpr bool knows_in_general = true;
template <class Observer>
requires is_adapter<Observer>
inline constexpr bool knows_in_general<Observer> = knows_in_general<typename Observer::Adapted>;
template <class Observer, class Model>
inline constexpr bool knows_in_general<KnownModel<Observer, Model>> =
    can_be_recorded<typename WithoutAdapter<KnownModel<Observer, Model>>::type> ||
    !can_be_recorded<typename WithoutAdapter<Observer>::type>;
template <class Observer, class Form>
inline constexpr bool knows_in_general<Adrc<Observer, Form>> = knows_in_general<Observer>;
template <class Observer>
inline constexpr bool knows_in_general<DisturbanceCompensator<Observer>> =
    knows_in_general<Observer>;

/// The same, perhaps in an adapter.
template <class Observer>
concept WritableObserver = HasLists<typename WithoutAdapter<Observer>::type> &&
    measures_plainly<Observer> && RecordAccess::guards_a_chain<Observer>;

template <class C>
struct ObserverOfController;
template <class Observer, class Form>
struct ObserverOfController<Adrc<Observer, Form>> {
  using type = Observer;
  static constexpr bool error_based = std::is_same_v<Form, ErrorBased>;
};
template <class Observer>
struct ObserverOfController<DisturbanceCompensator<Observer>> {
  using type = Observer;
  static constexpr bool error_based = false;
};
/// A controller around such an observer.
template <class C>
concept WritableController = WritableObserver<typename ObserverOfController<C>::type>;

/// The rules for the options.
template <class V>
[[nodiscard]] Rules<V> checked_options(const CodeOptions& options) {
  const auto letter = [](char c) {
    return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_';
  };
  const auto is_identifier = [&](const std::string& name) {
    bool fine = !name.empty() && letter(name[0]);
    for (const char c : name) {
      fine = fine && (letter(c) || std::isdigit(static_cast<unsigned char>(c)) != 0);
    }
    return fine;
  };
  bool ends = false;
  for (const char* mark : {"/*", "*/", "(*", "*)"}) {
    ends = ends || options.comment.find(mark) != std::string::npos;
  }
  Rules<V> rules;
  rules.require(is_identifier(options.name), "name", V(0), "must be an identifier of C")
      .require(is_identifier(options.settings_name), "settings_name", V(0),
               "must be an identifier of C")
      .require(1 <= options.self_test_samples && options.self_test_samples <= 10000,
               "self_test_samples", static_cast<V>(options.self_test_samples), "must be 1 .. 10000")
      .require(!ends, "comment", V(0), "must not begin or end a comment");
  return rules;
}

/// For recording alone: packs of them run one by one.
template <class Observer, class T>
struct WithScalarOf<PredictiveAdrc<Observer>, T> {
  using type = PredictiveAdrc<WithScalar<Observer, T>>;
};

/// A controller in two phases around one that has a table of gains and one level.
template <class C>
struct PredictiveOf {};
template <class Observer>
struct PredictiveOf<PredictiveAdrc<Observer>> {
  using type = Observer;
};
template <class C>
concept WritablePredictive = HasLists<typename PredictiveOf<C>::type> && requires {
  requires PredictiveOf<C>::type::levels == 1;
  requires observer_traits<typename PredictiveOf<C>::type>
  .gain_kind == GainKind::preset;
  requires observer_traits<typename PredictiveOf<C>::type>
  .measures_first_row;
  requires !observer_traits<typename PredictiveOf<C>::type>.blanks_estimate;
  requires !observer_traits<typename PredictiveOf<C>::type>.gates_outliers;
};

/// Records a subject without its adapter.
/// @tparam Subject the observer or controller @tparam Observer its observer, perhaps itself
template <class Subject, class Observer>
class DesignRecorder {
 public:
  using V = typename Observer::scalar_type;
  using Number = typename Recorder<Subject>::Number;
  using Numbers = std::vector<Number>;
  using Core = CoreOf<Observer>;
  static constexpr int size = Observer::size;
  static constexpr int gains = size * Observer::levels;

  DesignRecorder(const Subject& subject, const CodeOptions& options)
      : subject_(subject), recorder_(subject) {
    design.options = options;
    design.single = sizeof(V) == sizeof(float);
  }

  RecordedDesign design;

  void add(const std::string& name, std::vector<std::string> arguments, bool has_output,
           typename Recorder<Subject>::Call call) {
    recorder_.add(static_cast<int>(arguments.size()), std::move(call));
    design.names.push_back({name, std::move(arguments), has_output});
  }

  /// Records the calls of the observer, names the numbers. @param of the observer of a recorded
  /// subject @param name_of gives the name of a number, or ""
  template <class Of, class NameOf>
  [[nodiscard]] Check<V> record(const Of& of, const NameOf& name_of) {
    // Without one nothing is rejected.
    design.wrap.gated = design.wrap.gated && (design.gate.threshold > 0 || design.law.watches);
    add_observer(of);
    const auto closed = recorder_.record();
    if (!closed) return closed.error();
    auto recorded = closed;
    if (design.options.settings_in_struct) {
      if (!design.gain_is_kept) {
        return Error<V>{"settings_in_struct", V(1),
                        "needs gains that depend neither on the innovation nor on the time"};
      }
      if (design.softens) {
        return Error<V>{"settings_in_struct", V(1), "is not written for a law that softens"};
      }
      recorder_.keep_open([](auto& c) {
        std::vector<std::pair<const Number*, const char*>> found;
        RecordAccess::find_settings<Number>(c, found);
        std::vector<const Number*> numbers;
        for (const auto& [number, name] : found) numbers.push_back(number);
        return numbers;
      });
      recorded = recorder_.record();
      if (!recorded) return recorded.error();
      for (std::size_t i = 0; i < closed->moves.size(); ++i) {
        design.settings.push_back(recorded->moves[i] && !closed->moves[i]);
      }
    }
    auto object = Recorder<Subject>::as_recorded(subject_);
    const auto numbers = numbers_of<Number>(object);
    auto& core = RecordAccess::core(of(object));
    const Number* first = &core.predicted_measurement();
    using Model = typename Core::PlantModel;
    std::vector<std::pair<const Number*, const char*>> settings;
    if (!design.settings.empty()) RecordAccess::find_settings<Number>(object, settings);
    ListWriter writer(c_language, design.single);
    writer.live.assign(numbers.size(), false);
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const auto state = numbers[i] - first;
      std::string name = name_of(object, numbers[i]);
      if (numbers[i] == &core.applied_input()) {
        name = "u_applied";
      } else if (numbers[i] == &of(object).applied_input()) {
        name = "u_given";  // without what is known
      }
      if (numbers[i] == &core.innovation()) name = "innovation";
      for (int row = 0; row < size && 0 <= state && state < gains; ++row) {
        if (Model::state_of_row(row) != state % size) continue;
        name = "z" + std::to_string(row + 1);
        if (state >= size) name += "_level" + std::to_string(state / size + 1);
        if (state == 0) design.first_state = name;
      }
      const int published = RecordAccess::place_in_published(core, numbers[i]);
      if (published >= 0) name = "published_" + std::to_string(published);
      writer.live[i] = name[0] == 'z' || name[0] == 'p' || name == "u_applied" ||
                       name == "u_given" || name == "u_last" ||
                       (design.options.watched && (name == "innovation" || name == "u_asked")) ||
                       (design.guard.on && name == "innovation");
      for (const auto& [number, begins] : settings) {
        if (number == numbers[i] && name.empty()) name = begins + std::to_string(i);
      }
      design.members.push_back(name.empty() ? "x" + std::to_string(i) : name);
    }
    writer.find_live(*recorded);
    design.live = writer.live;
    design.numbers = recorded->numbers;
    for (const auto& call : recorded->calls) design.calls.push_back(call[0]);
    if (auto ok = take_angle(); !ok) return ok;
    return take_gains(RecordAccess::core(of(subject_)));
  }

 private:
  template <class OfAny>
  void add_observer(const OfAny& of_any) {
    using Law = std::remove_cvref_t<decltype(RecordAccess::laws(std::declval<const Core&>())[0])>;
    constexpr RunningLaw runs = RecordAccess::kind_of<Law>;
    const auto all_of = [of_any](auto& c) -> auto& { return RecordAccess::at_rest(of_any(c)); };
    const auto of = [all_of](auto& c) -> auto& { return RecordAccess::core(all_of(c)); };
    if constexpr (RecordAccess::knows<Observer>) {
      add("drive", {"u"}, true, [all_of](auto& c, const Numbers& in) {
        return Numbers{RecordAccess::driven(all_of(c), in[0])};
      });
    }
    design.gain_is_kept = runs == RunningLaw::none && gain_law_traits<Law>.kind == GainKind::preset;
    if constexpr (runs != RunningLaw::none) {
      using Recorded = std::remove_cvref_t<decltype(RecordAccess::laws(
          RecordAccess::core(of_any(std::declval<typename Recorder<Subject>::Recorded&>())))[0])>;
      RecordAccess::add_law<Recorded>(
          [&](const char* name, std::vector<std::string> arguments, bool has_output, auto call) {
            add(name, std::move(arguments), has_output, [=](auto& c, const Numbers& in) {
              const Number output = call(RecordAccess::laws(RecordAccess::core(of_any(c)))[0], in);
              return has_output ? Numbers{output} : Numbers{};
            });
          });
    }
    if constexpr (runs == RunningLaw::schedule) {
      add("correct_long", {"y", "contraction", "samples"}, false, [of](auto& c, const Numbers& in) {
        const EqualSampledPoles<size, Number> poles{in[1]};
        RecordAccess::correct(
            of(c), in[0],
            Array<ScaledGain<size, Number>, 1>{long_step_gain<size, Number>(poles, in[2])});
        return Numbers{};
      });
    }
    if constexpr (runs == RunningLaw::filter) {
      if (design.law.watches) {
        add("fits", {"y"}, false, [of](auto& c, const Numbers& in) {
          RecordAccess::judge(of(c), in[0]);
          return Numbers{};
        });
      }
    }
    if constexpr (ShiftableOutput<Core>) {
      if (design.wrap.period > 0) {
        add("shift", {"offset"}, false, [of](auto& c, const Numbers& in) {
          (void)of(c).shift_output(in[0]);
          return Numbers{};
        });
      }
    }
    if constexpr (ShiftableLoad<Core>) {
      if (design.measured.on) {
        const auto column = RecordAccess::load_column(RecordAccess::core(of_any(subject_)));
        add("load", {"offset"}, false, [of, column](auto& c, const Numbers& in) {
          RecordAccess::load(of(c), column, in[0]);
          return Numbers{};
        });
      }
    }
    if constexpr (model_traits<typename Core::PlantModel>.is_chain && size == Observer::order + 1) {
      if (design.guard.on) {
        std::vector<std::string> states;
        for (int i = 1; i <= size; ++i) states.push_back("x" + std::to_string(i));
        states.push_back("u");
        add("predicted_y", states, true, [of](auto& c, const Numbers& in) {
          return Numbers{RecordAccess::predicted_y(of(c), in)};
        });
        std::vector<std::string> found{"y"};
        for (int i = 1; i <= Observer::levels; ++i) found.push_back("d" + std::to_string(i));
        add("stand_at", found, false, [of](auto& c, const Numbers& in) {
          RecordAccess::stand_at(of(c), in);
          return Numbers{};
        });
        if (design.guard.by_input) {
          add("scale_found", {"change"}, false, [of](auto& c, const Numbers& in) {
            RecordAccess::scale_found(of(c), in[0]);
            return Numbers{};
          });
          add("scaled_bound", {"bound"}, true, [of](auto& c, const Numbers& in) {
            return Numbers{of(c).model().scaled_disturbance(in[0])};
          });
        }
      }
    }
    add("observe", {"y", "u"}, false, [of](auto& c, const Numbers& in) {
      (void)of(c).update(in[0], in[1]);
      return Numbers{};
    });
    add("predict_step", {"u"}, false, [of](auto& c, const Numbers& in) {
      (void)of(c).predict(in[0]);
      return Numbers{};
    });
    std::vector<std::string> arguments{"y"};
    for (int i = 1; i <= gains; ++i) arguments.push_back("k" + std::to_string(i));
    if constexpr (runs == RunningLaw::none)
      add("correct_by", arguments, false, [of](auto& c, const Numbers& in) {
        Array<ScaledGain<size, Number>, Observer::levels> given{};
        std::size_t next = 1;
        for (auto& level : given) {
          for (Number& k : level) k = in[next++];
        }
        RecordAccess::correct(of(c), in[0], given);
        return Numbers{};
      });
    if (!design.gain_is_kept) {
      add("correct_step", {"y"}, false, [of](auto& c, const Numbers& in) {
        (void)of(c).correct(in[0]);
        return Numbers{};
      });
    }
    add("restart_at", {"y"}, false, [of](auto& c, const Numbers& in) {
      (void)of(c).reset(in[0]);
      return Numbers{};
    });
    unroll<size>([&](auto row) {
      add("estimate_" + std::to_string(int{row}), {}, true, [all_of](auto& c, const Numbers&) {
        return Numbers{RecordAccess::estimate<int{decltype(row)::value}>(all_of(c))};
      });
    });
  }

  /// Where the law of an angle subtracts an estimate from the reference, the difference becomes its
  /// argument: the text takes off whole turns. A law on physical estimates gets a reference without
  /// them.
  [[nodiscard]] Check<V> take_angle() {
    if (!(design.wrap.period > 0) || !design.is_controller || design.error_based ||
        design.compensates) {
      return {};
    }
    const Error<V> refused{"soften", V(1), "of an angle is not written for this observer"};
    if constexpr (RecordAccess::blanks<Core> || RecordAccess::knows<Observer>) {
      if (design.softens) return refused;
      return {};
    }
    for (std::size_t i = 0; i < design.names.size(); ++i) {
      if (design.names[i].name != "law") continue;
      auto& list = design.calls[i].list.instructions;
      const int of_call = static_cast<int>(design.members.size());
      int reference = -1;
      int difference = -1;
      for (std::size_t k = 0; k < list.size(); ++k) {
        const Instruction& one = list[k];
        const int at = static_cast<int>(k);
        if (one.operation == Operation::argument) {
          if (one.a == of_call) reference = at;
          continue;
        }
        if (reference < 0 || (one.a != reference && one.b != reference && one.c != reference)) {
          continue;
        }
        const bool subtracts =
            one.operation == Operation::subtract && one.a == reference &&
            list[static_cast<std::size_t>(one.b)].operation == Operation::argument;
        if (!subtracts || difference >= 0) return refused;
        difference = at;
      }
      if (difference < 0) return refused;
      Instruction& one = list[static_cast<std::size_t>(difference)];
      design.wrap.angle =
          design.members[static_cast<std::size_t>(list[static_cast<std::size_t>(one.b)].a)];
      one = {.operation = Operation::argument, .a = of_call};
      design.names[i].arguments[0] = "error";
    }
    return {};
  }

  [[nodiscard]] Check<V> take_gains(const Core& observer) {
    design.size = size;
    design.max_gap = observer.max_gap();
    design.order = Observer::order;
    design.sample_time = static_cast<double>(observer.sample_time());
    design.input_gain = static_cast<double>(observer.input_gain());
    if constexpr (RecordAccess::kind_of<
                      std::remove_cvref_t<decltype(RecordAccess::laws(observer)[0])>> ==
                  RunningLaw::none) {
      return take_table(observer);
    }
    return {};
  }

  [[nodiscard]] Check<V> take_table(const Core& observer) {
    for (int elapsed = 1; elapsed <= observer.max_gap() + 1; ++elapsed) {
      std::vector<double> row;
      for (const auto& law : RecordAccess::laws(observer)) {
        const auto gap = static_cast<unsigned>(elapsed);
        const auto gain =
            elapsed == 1 ? ScaledGain<size, V>(law.gain(V(0))) : law.gap_gain(V(0), gap);
        const auto other = elapsed == 1 ? gain : law.gap_gain(V(1), gap);
        for (std::size_t i = 0; i < gain.size(); ++i) {
          row.push_back(static_cast<double>(gain[i]));
          const bool same = !(gain[i] < other[i]) && !(gain[i] > other[i]);
          if (!same) {
            return Error<V>{"gap_gain", other[i],
                            "depends on the innovation: no table can hold it"};
          }
        }
      }
      design.gap_gains.push_back(row);
    }
    return {};
  }

  Subject subject_;
  Recorder<Subject> recorder_;
};

/// Samples for the self-test: what y is does not matter. @param step gives the result for y and r
template <class V, class Step>
std::vector<std::array<double, 3>> self_test_samples(int count, Step&& step) {
  std::vector<std::array<double, 3>> samples;
  for (int k = 0; k < count; ++k) {
    const V r = static_cast<V>((k / 10) % 2 == 0 ? 1.0 : -0.5);
    const V y = static_cast<V>(0.25 * ((k * 37) % 16) - 1.5);
    samples.push_back(
        {static_cast<double>(y), static_cast<double>(r), static_cast<double>(step(y, r))});
  }
  return samples;
}

template <class Object>
auto without_adapter(const Object& object) {
  auto bare = blank<typename WithoutAdapter<Object>::type>();
  take_off_adapter(bare, object);
  return bare;
}

/// The design of a controller.
template <WritableController C>
Expected<RecordedDesign, Error<typename C::scalar_type>> recorded_design(
    const C& controller, const CodeOptions& options) {
  using V = typename C::scalar_type;
  using Access = RecordAccess;
  using Of = ObserverOfController<C>;
  using Bare = typename WithoutAdapter<C>::type;
  using Maker = DesignRecorder<Bare, typename WithoutAdapter<typename Of::type>::type>;
  using Number = typename Maker::Number;
  using Numbers = typename Maker::Numbers;

  if (const auto rules = checked_options<V>(options); !rules) return rules.error();
  const Bare bare = without_adapter(controller);
  Maker maker(bare, options);
  RecordedDesign& design = maker.design;
  design.is_controller = true;
  design.loop = Access::rules(Access::loop(bare));
  design.error_based = Of::error_based;
  design.softens = Access::softens(bare);
  design.compensates = !requires { controller.gains(); };
  design.lower = static_cast<double>(controller.limiter().lower());
  design.upper = static_cast<double>(controller.limiter().upper());
  take_adapters(design, controller.observer());
  design.law = Access::law_numbers(Access::core(bare.observer()));

  const bool wraps = design.wrap.period > 0;
  std::vector<std::string> of_rest{"y", "u"};
  if (wraps) of_rest.push_back("angle");
  const bool around_angle = design.known.around_angle;
  maker.add("rest_at", of_rest, false, [around_angle](auto& c, const Numbers& in) {
    Access::rest(Access::at_rest(c.observer()), in, around_angle);
    return Numbers{};
  });
  using BareObserver = typename WithoutAdapter<typename Of::type>::type;
  if constexpr (Access::blanks<BareObserver>) {
    std::vector<std::string> of_law{"r"};
    for (int i = 0; i < BareObserver::size; ++i) of_law.push_back("e" + std::to_string(i));
    maker.add("law", of_law, true,
              [](auto& c, const Numbers& in) { return Numbers{Access::law_for(c, in)}; });
  } else {
    maker.add("law", {"r"}, true,
              [](auto& c, const Numbers& in) { return Numbers{Access::law(c, in[0])}; });
  }
  maker.add("limit", {"u"}, true, [](auto& c, const Numbers& in) {
    return Numbers{Access::limited(Access::loop(c), in[0])};
  });
  maker.add("applied", {"u"}, false, [](auto& c, const Numbers& in) {
    Access::loop(c).applied(in[0]);
    return Numbers{};
  });
  if (design.softens) {
    maker.add("harden", {}, false, [](auto& c, const Numbers&) {
      Access::harden(c);
      return Numbers{};
    });
  }
  const auto name_of = [](const auto& c, const Number* at) -> std::string {
    // The limiter keeps the bounds of the next output behind the last.
    constexpr const char* names[] = {"u_last", "u_low", "u_high"};
    const auto place = at - &c.output();
    return 0 <= place && place < 3 ? names[place] : at == &c.requested() ? "u_asked" : "";
  };
  const auto of = [](auto& c) -> auto& { return c.observer(); };
  if (auto ok = maker.record(of, name_of); !ok) return ok.error();
  if (design.error_based) design.input_gain = -design.input_gain;
  C played = controller;
  design.samples = self_test_samples<V>(options.self_test_samples,
                                        [&](V y, V r) { return played.update(y, r); });
  return design;
}

/// The design of an observer.
template <WritableObserver Observer>
Expected<RecordedDesign, Error<typename Observer::scalar_type>> recorded_design(
    const Observer& observer, const CodeOptions& options) {
  using V = typename Observer::scalar_type;
  using Bare = typename WithoutAdapter<Observer>::type;
  using Maker = DesignRecorder<Bare, Bare>;

  if (const auto rules = checked_options<V>(options); !rules) return rules.error();
  const Bare bare = without_adapter(observer);
  Maker maker(bare, options);
  take_adapters(maker.design, observer);
  maker.design.law = RecordAccess::law_numbers(RecordAccess::core(bare));
  const auto of = [](auto& o) -> auto& { return o; };
  const auto no_name = [](const auto&, const auto*) { return std::string(); };
  if (auto ok = maker.record(of, no_name); !ok) return ok.error();
  Observer played = observer;
  maker.design.samples = self_test_samples<V>(options.self_test_samples, [&](V y, V u) {
    (void)played.update(y, u);
    return played.total_disturbance();
  });
  return maker.design;
}

/// The design of a controller in two phases.
template <WritablePredictive C>
Expected<RecordedDesign, Error<typename C::scalar_type>> recorded_design(
    const C& controller, const CodeOptions& options) {
  using V = typename C::scalar_type;
  using Observer = typename PredictiveOf<C>::type;
  using Maker = DesignRecorder<C, Observer>;
  using Number = typename Maker::Number;
  using Numbers = typename Maker::Numbers;

  Rules<V> rules = checked_options<V>(options);
  rules.require(!options.settings_in_struct, "settings_in_struct", V(1),
                "is not written for PredictiveAdrc");
  if (!rules) return rules.error();
  Maker maker(controller, options);
  RecordedDesign& design = maker.design;
  design.predictive = true;
  design.hold = RecordAccess::hold_left(controller);
  design.lower = static_cast<double>(RecordAccess::limiter(controller).lower());
  design.upper = static_cast<double>(RecordAccess::limiter(controller).upper());
  const auto of = [](auto& c) -> auto& { return RecordAccess::observer_of(c); };
  maker.add("rest_at", {"y", "u"}, false, [of](auto& c, const Numbers& in) {
    auto& o = of(c);
    (void)o.reset(o.equilibrium(in[0], in[1]));
    return Numbers{};
  });
  RecordAccess::add_phases<Number, Observer::size>(
      [&](const char* name, std::vector<std::string> arguments, bool has_output, auto call) {
        maker.add(name, std::move(arguments), has_output,
                  [call](auto& c, const Numbers& in) { return call(c, in); });
      });
  const auto name_of = [](const auto& c, const Number* at) -> std::string {
    return at == &c.output() ? "u_last" : "";
  };
  if (auto ok = maker.record(of, name_of); !ok) return ok.error();
  C played = controller;
  design.samples = self_test_samples<V>(options.self_test_samples,
                                        [&](V y, V r) { return played.update(y, r); });
  return design;
}

template <class Object>
concept Writable =
    WritableController<Object> || WritableObserver<Object> || WritablePredictive<Object>;

}  // namespace detail
}  // namespace esokit
