/// @file
/// RecordAccess: what is private in a controller and an observer, and is recorded apart.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <esokit/adapter/guarded.hpp>
#include <esokit/control/control_loop.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/gain/riccati_gain.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <esokit/model/sampled_model.hpp>
#include <esokit/target/detail/recorded_numbers.hpp>
#include <esokit/target/recorder.hpp>
#include <iterator>
#include <limits>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace esokit {
namespace detail {

/// Names with numbers from `first`: "k1 k2 k3".
inline std::string numbered(const char* name, int count, int first = 1) {
  std::string all;
  for (int i = first; i < first + count; ++i) {
    all += (i > first ? " " : "") + (name + std::to_string(i));
  }
  return all;
}

/// What is private in a controller and an observer, and is recorded apart.
struct RecordAccess {
  template <class C>
  static auto& loop(C& c) noexcept {
    return c.loop_;
  }
  /// Of a controller, in one phase or two.
  template <class C>
  static auto& limiter_of(C& c) noexcept {
    if constexpr (requires { c.loop_; }) {
      return c.loop_.limiter_;
    } else {
      return c.limiter_;
    }
  }
  /// u of the law for the present estimate, before the limits; as if no start hold were left.
  template <class C, class Given>
  static auto law(C& c, const Given& reference) noexcept {
    c.loop_.mode_ = LoopMode::running;
    const auto u = c.command(reference);
    if constexpr (requires { c.soft_; }) {
      if (!all(!c.soft_.on())) return c.eased(u, reference);
    }
    return u;
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
  /// Softens the law by the u that it asks for.
  template <class C, class S>
  static void soften(C& c, const S& u) noexcept {
    if constexpr (requires { c.soft_; }) c.judge(u);
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
            loop.set_.hold_safe,
            loop.set_.stay_safe,
            static_cast<double>(loop.set_.hold_input),
            static_cast<double>(loop.set_.safe_input),
            loop.elsewhere_,
            static_cast<double>(loop.output())};
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
      const auto& limiter = c.loop_.limiter_;
      const Number* state[] = {&limiter.held_, &limiter.waiting_, &limiter.commanded_};
      std::erase_if(found, [&state](const auto& one) {
        return std::find(std::begin(state), std::end(state), one.first) != std::end(state);
      });
      if constexpr (requires { c.law_; }) {
        take(c.law_, "law");
        take(c.weights_, "law");
      }
      if constexpr (requires { c.gain_; }) take(c.gain_, "law");
      find_settings(core(c.observer()), found);
    } else if constexpr (requires { c.numbers_.laws; }) {
      for (auto& law : c.numbers_.laws) take(law, "gain");
    }
  }

  /// @param others whether other settings may follow
  template <class C>
  static RestNumbers rest_of(const C& c, bool others) noexcept {
    using S = typename C::scalar_type;
    const bool may = c.error_ > S(0) || (others && c.controller().measurement_divider() == 1);
    return {may,       static_cast<double>(c.error_), c.samples_, static_cast<double>(c.r_),
            c.inside_, c.mode() == LoopMode::rest};
  }

  // ---- A controller in two phases.

  template <class Numbers, class C>
  static Numbers armed(const C& c) {
    (void)(all(is_finite(c.next_.blind)) && all(is_finite(c.next_.offset)) &&
           all(is_finite(c.next_.slope)));
    return {};
  }
  template <class Numbers, class C, class Gains>
  static Numbers arm(C& c, const Gains& gains) {
    using O = std::remove_cvref_t<decltype(c.observer_)>;
    c.look_ahead();
    if constexpr (O::levels > 1 || !observer_traits<O>.measures_first_row) {
      c.arm_by(preview(c.observer_, gains));
    } else {
      c.arm_by(gains[0]);
    }
    return armed<Numbers>(c);
  }
  /// The lists around which its text goes.
  /// @param waits whether the limiter's steps may wait @param moves whether the reference does
  template <class Number, class Observer, class Add>
  static void add_phases(bool waits, bool moves, const Add& add) {
    using Numbers = std::vector<Number>;
    add("control_by", "y", true, [](auto& c, const auto& in) {
      if constexpr (observer_traits<Observer>.gates_outliers) {  // asked before, by the text
        const Number u = c.wanted(in[0]);
        c.output_ = c.limiter_.clamp(select(c.usable(in[0], u), u, c.next_.blind));
        return Numbers{c.output_};
      } else {
        return Numbers{c.control(in[0])};
      }
    });
    add("control_blind", "", true,
        [](auto& c, const auto&) { return Numbers{c.control_without_measurement()}; });
    const std::string motion = moves ? "r " + numbered("r", Observer::order) : "r";
    add("refer", motion, false, [](auto& c, const auto& in) {
      for (Number& one : c.reference_) one = Number(0.0);
      for (std::size_t i = 0; i < in.size(); ++i) c.reference_[i] = in[i];
      return Numbers{};
    });
    add("take_output", "u", false, [](auto& c, const auto& in) {
      c.output_ = in[0];
      return Numbers{};
    });
    add("track", "", false, [](auto& c, const auto&) {
      c.limiter_.track(c.output_);
      return Numbers{};
    });
    if (waits) {
      add("settle", "", false, [](auto& c, const auto&) {
        c.limiter_.settle(c.output_);
        return Numbers{};
      });
    }
    add("revise", "u", false, [](auto& c, const auto& in) {
      (void)c.observer_.revise_input(in[0]);
      return Numbers{};
    });
    add_arms<Number, Observer>(add);
  }
  /// Those that prepare the next sample.
  template <class Number, class Observer, class Add>
  static void add_arms(const Add& add) {
    using Numbers = std::vector<Number>;
    constexpr RunningLaw runs = kind_of<LawOf<Observer>>;
    constexpr int size = Observer::size;
    add("arm_restart", "", false, [](auto& c, const auto&) {
      using O = std::remove_cvref_t<decltype(c.observer_)>;
      typename O::Preview next{};
      for (Number& one : next.offset) one = Number(0.0);
      next.slope = O::Numbers::by_rows(O::Numbers::standing(Number(1.0)));
      c.look_ahead();
      c.arm_by(next);
      return armed<Numbers>(c);
    });
    add("arm_at", "u", true, [](auto& c, const auto& in) {
      c.look_ahead();
      const Number feed = c.next_.feed;
      c.settle_for(in[0]);
      return Numbers{feed};
    });
    add("arm_blind", "", true, [](auto& c, const auto&) {
      c.look_ahead();
      const Number blind = c.next_.blind;
      c.settle_for_blind();
      return Numbers{blind};
    });
    using Gains = Array<ScaledGain<size, Number>, Observer::levels>;
    if constexpr (runs != RunningLaw::none) {
      add("arm_by", "", false, [](auto& c, const auto&) {
        return arm<Numbers>(c, Gains{c.observer_.gain_law().gain(Number(0.0))});
      });
    } else {
      add("arm_by", numbered("k", size * Observer::levels), false,
          [](auto& c, const auto& in) { return arm<Numbers>(c, gains_from<Observer>(in, 0)); });
    }
    if constexpr (runs == RunningLaw::schedule) {
      add("arm_long", "contraction samples", false, [](auto& c, const auto& in) {
        const EqualSampledPoles<size, Number> poles{in[0]};
        return arm<Numbers>(c, Gains{long_step_gain<size, Number>(poles, in[1])});
      });
      add("arm_blanked", "", true, [](auto& c, const auto&) {
        using C = std::remove_cvref_t<decltype(c)>;
        c.observer_.numbers_.laws[0].age_ = std::uint32_t{0};  // it publishes what it keeps
        typename C::Reference::All reference;
        int row = 0;
        for (const Number& one : c.reference_) reference(row++) = one;
        c.settle_for(c.set_.law.control(c.observer_.estimate(), reference));
        const Number blind = c.next_.blind;
        c.settle_for_blind();
        return Numbers{blind};
      });
    }
  }
  /// `preview` with gains from elsewhere, `gains[level][row]`.
  template <class O, class Gains>
  static typename O::Preview preview(const O& o, const Gains& gains) noexcept {
    using S = typename O::scalar_type;
    const auto gain_of = [&](auto level, const S&) -> const auto& {
      return gains[std::size_t{level}];
    };
    typename O::Numbers::Correction slope{};
    for (auto& state : slope.states) state.fill(S(0.0));
    typename O::Numbers::Correction offset{o.numbers_.kept.states};
    o.numbers_.correct_by(offset, S(0.0), gain_of);
    o.numbers_.correct_by(slope, S(1.0), gain_of);
    constexpr int last = O::levels - 1;
    return {O::Numbers::by_rows(O::Numbers::template up_to_level<last>(offset.states)),
            O::Numbers::by_rows(O::Numbers::template up_to_level<last>(slope.states))};
  }
  /// Of a controller in two phases.
  template <class C>
  static LoopRules rules_of_phases(const C& c) noexcept {
    LoopRules rules;
    rules.hold_left = c.hold_left_;
    rules.hold = c.set_.hold;
    rules.missing_limit = c.set_.missing_limit;
    rules.holds_safe = c.set_.hold_safe;
    rules.stays_safe = c.set_.stay_safe;
    rules.safe_input = static_cast<double>(c.set_.safe_input);
    rules.elsewhere = c.phase_ == decltype(c.phase_)::started;
    return rules;
  }
  /// Of a controller, in one phase or two.
  template <class C>
  static auto& observer_of(C& c) noexcept {
    if constexpr (requires { c.loop_; }) {
      return c.observer();
    } else {
      return c.observer_;
    }
  }
  /// Gains of each level, from `in[next]` on.
  template <class O, class Number>
  static auto gains_from(const std::vector<Number>& in, std::size_t next) {
    Array<ScaledGain<O::size, Number>, O::levels> gains{};
    for (auto& level : gains) {
      for (Number& k : level) k = in[next++];
    }
    return gains;
  }

  /// The gain laws of all levels.
  template <class O>
  static auto laws(O& o) noexcept -> decltype((o.numbers_.laws)) {
    return o.numbers_.laws;
  }
  /// A correction with gains from elsewhere, `gains[level][row]`.
  template <class O, class S, class Gains>
  static void correct(O& o, const S& y, const Gains& gains) noexcept {
    typename O::Numbers::Correction step{o.numbers_.kept.states};
    const bool fine = o.numbers_.correct_by(
        step, y, [&](auto level, const S&) -> const auto& { return gains[std::size_t{level}]; });
    if (fine && all(is_finite(o.numbers_.probe(step.states)))) o.numbers_.commit(step);
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
  using LawOf = std::remove_cvref_t<decltype(std::declval<O&>().numbers_.laws[0])>;

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
    if constexpr (kind_of<Law> == RunningLaw::schedule) o.numbers_.laws[0].settled_ = true;
    if constexpr (kind_of<Law> == RunningLaw::filter) o.numbers_.laws[0].since_ = std::int8_t{9};
    return any;
  }
  template <class O>
  static LawNumbers law_numbers(const O& o) noexcept {
    LawNumbers numbers;
    numbers.kind = kind_of<LawOf<O>>;
    const auto& law = o.numbers_.laws[0];
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
      add("schedule_restart", "", [](Law& law, const auto&) { law.restart(); });
      add("anchor_begin", "", [](Law& law, const auto&) {
        law.power_ = S(1.0);
        law.bracket_ = S(0.0);
      });
      add("anchor_take", "power contraction", [](Law& law, const auto& in) {
        Law::anchor_take(law.power_, law.bracket_, in[0], in[1]);
      });
      add("anchor_contraction", "power contraction",
          [](Law&, const auto& in) { return S(in[1] + in[0] * in[1]); });
      add("anchor_power", "power contraction",
          [](Law& law, const auto& in) { return law.squared(in[0], in[1]); });
      add("anchor_end", "count",
          [](Law& law, const auto& in) { law.bracket_ = law.bracket(in[0], law.bracket_); });
      add("schedule_next", "", [](Law& law, const auto&) {
        law.push();
        law.set_gain();
      });
      add("schedule_settle", "", [](Law& law, const auto&) {
        if (all(law.settled_below_ >= std::get<0>(law.ratios_u_))) law.stand();
      });
      add("present_poles", "",
          [](Law& law, const auto&) { return law.present_poles().contraction; });
      add("joined_poles", "a b", [](Law&, const auto& in) { return Poles::joined(in[0], in[1]); });
    } else if constexpr (kind_of<Law> == RunningLaw::filter) {
      add("filter_corrected", "", [](Law& law, const auto&) { law.recur_usually(true); });
      add("filter_missed", "", [](Law& law, const auto&) { law.recur_usually(false); });
      add("filter_at_ceiling", "", [](Law& law, const auto&) {
        if (all(!(law.now_.factor.variance(0) < law.ceiling()))) law.recur_at_ceiling();
      });
      add("filter_to_limit", "", [](Law& law, const auto&) {
        if (law.now_.factor.close_to(law.limit_.factor, S(1e-3))) law.now_ = law.limit_;
      });
    }
  }
  /// u of the law; for estimates that are given from in[next] on, where the observer does not
  /// always publish its own.
  template <class C, class Given, class Numbers>
  static auto law_for(C& c, const Given& reference, const Numbers& in, std::size_t next) noexcept {
    auto& o = c.observer();
    if constexpr (!blanks<std::remove_cvref_t<decltype(o)>>) {
      return law(c, reference);
    } else {
      o.numbers_.laws[0].age_ = std::uint32_t{0};  // it publishes what it keeps
      const auto kept = o.rest_.published;
      for (auto& given : o.rest_.published) given = in[next++];
      const auto u = law(c, reference);
      o.rest_.published = kept;
      return u;
    }
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
      wrap.seen = counted(o.seen_.count);
      wrap.seen_at = o.seen_.at;
      wrap.seen_steady = o.seen_.steady;
      wrap.seen_rejected = o.seen_.rejected;
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
            number(o.given_ratio_),
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
    return o.numbers_.model.predict(x, o.numbers_.model.drive(in[x.size()]))[0];
  }
  template <class O, class Numbers>
  static void stand_at(O& o, const Numbers& in) noexcept {
    auto still = o.numbers_.kept.states;
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
    auto scaled = o.numbers_.kept.states;
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
      return o.numbers_.model.constant_column();
    }
  }
  /// `shift_load` with it.
  template <class O, class Column, class S>
  static void load(O& o, const Column& column, const S& offset) noexcept {
    if constexpr (std::is_same_v<Column, Empty>) {
      (void)o.shift_load(offset);
    } else {
      auto next = o.numbers_.kept.states;
      const S scaled = o.numbers_.model.scaled_constant(offset);
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

  /// The constants of a monitor's C: what it computes from its settings alone, and of the
  /// controller that it watches.
  template <class M, class C>
  static auto health(const M& m, const C& c) {
    using S = typename M::scalar_type;
    struct {
      std::vector<std::pair<const char*, S>> constants;
      S weight;
      int divider;
      S range, middle;  ///< of u
      S step;           ///< omega_o T D
    } all{{}, m.weight_, m.divider_, m.range_, m.middle(c.limiter()), m.step_};
    const S b = c.observer().input_gain();
    const S range = absolute(b) * m.range_;
    const S noise = m.health_.innovation_of_noise;
    all.constants = {{"SAMPLE_TIME", c.observer().sample_time()},
                     {"WEIGHT", m.weight_},
                     {"RARE_WEIGHT", m.rare_weight()},
                     {"QUICK_WEIGHT", m.quick_weight()},
                     {"HAIR", static_cast<S>(1e-4) * m.range_},
                     {"LARGEST_SQUARE", m.largest_square()},
                     {"LARGEST", S(1000) * range},
                     {"POLE", m.pole_},
                     {"SLOW", m.slow_},
                     {"MIDDLE", b * all.middle},
                     {"FIRST_HELD", c.limiter().last()},
                     {"END_OF_RANGE", static_cast<S>(0.9) * range},
                     {"LEAST_AGAINST", m.larger(static_cast<S>(0.02) * range, S(3) * m.least_)},
                     {"RANGE", range},
                     {"LARGE_MOVE", m.large_move * range},
                     {"FALLEN", static_cast<S>(0.85)},
                     {"SAID", static_cast<S>(-0.3)},
                     {"TENTH", S(1) / S(10)},
                     {"LEAST_SHARE", static_cast<S>(0.02) * range},
                     {"LEAST_PHI", m.least_},
                     {"STEP", m.step_},
                     {"FORGET", m.forget_},
                     {"INPUT_GAIN", b},
                     {"SIGN_OF_GAIN", b < S(0) ? S(-1) : S(1)},
                     {"NOISE", noise},
                     {"THRICE_NOISE", S(3) * noise}};
    return all;
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

  /// The settings of an ApproachProfile, and what it computes from them.
  template <class P>
  static auto approach(const P& p) noexcept {
    using S = typename P::scalar_type;
    struct {
      typename P::Config config;
      S share, decay, half_speed;
      std::int32_t delay;
    } const numbers{p.config_, p.share_, p.decay_, p.half_speed_, p.delay_};
    return numbers;
  }

  /// The settings of a FollowProfile, and h.
  template <class P>
  static auto follow(const P& p) noexcept {
    struct {
      typename P::Config config;
      typename P::scalar_type width;
    } const numbers{p.config_, p.width()};
    return numbers;
  }

  /// The settings of a TimeProportioned.
  template <class P>
  static auto proportioned(const P& p) noexcept {
    struct {
      typename P::scalar_type off, on, sample_time;
      std::int32_t window, shortest, longest;
    } const numbers{p.off_, p.on_, p.sample_time_, p.window_, p.shortest_, p.longest_};
    return numbers;
  }

  /// The curve of a MappedInput. Without a point, it gets one in the middle of its line; nothing of
  /// one that leaves u as it is.
  template <class O>
  static MapNumbers map(const O& o) {
    const auto& map = o.map();
    MapNumbers numbers;
    if (map.is_straight()) return numbers;
    const auto add = [&](std::size_t line) {
      const auto& of = map.lines_[line];
      numbers.lines.push_back({static_cast<double>(of.offset), static_cast<double>(of.slope),
                               static_cast<double>(of.inverse)});
    };
    add(0);
    for (std::size_t i = 0; i < map.inputs_.size() && is_finite(map.inputs_[i]); ++i) {
      numbers.inputs.push_back(static_cast<double>(map.inputs_[i]));
      numbers.effects.push_back(static_cast<double>(map.effects_[i]));
      add(i + 1);
    }
    if (numbers.inputs.empty()) {
      numbers.inputs = numbers.effects = {0.0};
      add(0);
    }
    return numbers;
  }

  /// The inputs of a DelayedInput that are still needed, the newest last.
  template <class O>
  static std::vector<double> line(const O& o) {
    std::vector<double> inputs;
    const int length = static_cast<int>(o.rest_.inputs.size());
    for (int age = o.rest_.delay; age >= 0; --age) {
      const int at = (o.rest_.newest - age + length) % length;
      inputs.push_back(static_cast<double>(o.rest_.inputs[static_cast<std::size_t>(at)]));
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

}  // namespace detail
}  // namespace esokit
