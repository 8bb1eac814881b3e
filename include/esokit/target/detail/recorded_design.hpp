/// @file
/// recorded_design: all that a text of another language needs of a finished controller or
/// observer, recorded from its own calls.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/target/detail/record_access.hpp>
#include <esokit/target/detail/recorded_numbers.hpp>
#include <esokit/target/detail/self_test.hpp>
#include <esokit/target/detail/writable.hpp>
#include <esokit/target/detail/written_names.hpp>
#include <esokit/target/recorder.hpp>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

/// The rules for the options. @param takes_motion whether there is a law that takes r', ..
template <class V>
[[nodiscard]] Rules<V> checked_options(const CodeOptions& options, bool takes_motion = true) {
  Rules<V> rules;
  constexpr const char* identifier =
      "must be an identifier of C: this is the place of its first wrong character";
  const int in_name = wrong_place(options.name);
  const int in_settings = wrong_place(options.settings_name);
  rules.demand(in_name == 0, "name", static_cast<V>(in_name), identifier)
      .demand(has_small_letter(options.name), "name", V(0),
              "must have a small letter: in capitals it begins the constants of another name")
      .demand(!is_header_of_c(options.name), "name", V(0),
              "is that of a header of the C library: name.h would be taken for it")
      .demand(in_settings == 0, "settings_name", static_cast<V>(in_settings), identifier)
      .demand(1 <= options.self_test_samples && options.self_test_samples <= 10000,
              "self_test_samples", static_cast<V>(options.self_test_samples), "must be 1 .. 10000")
      .demand(!leaves_comment(options.comment), "comment", V(0),
              "must not begin or end a comment, nor a line of it with a backslash")
      .demand(
          takes_motion || !options.moving_reference, "moving_reference", V(1),
          "needs a law that takes r', ..: Adrc, not of the error-based form, or PredictiveAdrc");
  return rules;
}

/// The same for a text without recorded calls, and its names. @param write see new_names
template <class V, class Write>
[[nodiscard]] Check<V> checked_names(const CodeOptions& options, const Write& write) {
  if (const auto rules = checked_options<V>(options); !rules) return rules.error();
  return new_names<V>(options, write);
}

/// Notes a call. @param arguments their names, with blanks between @return how many there are
int note_call(RecordedDesign& design, std::string_view name, std::string_view arguments,
              bool has_output);

/// Names a number of the object that has perhaps a name. @param level of a state, or -1, in its
/// row @param published its place among those, or -1 @param setting begins the name of a setting
/// @return whether it is read from outside
bool name_number(RecordedDesign& design, std::string name, int level, int row, bool first,
                 int published, const char* setting);

/// Where the law of an angle subtracts an estimate from the reference, the difference becomes its
/// argument: the text takes off whole turns. A law on physical estimates gets a reference without
/// them. @return false where it does not
bool take_angle(RecordedDesign& design);

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

  /// A call without memory of its own: as a pointer it takes no code beside its own.
  using Plain = Numbers (*)(typename Recorder<Subject>::Recorded&, const Numbers&);
  void add(std::string_view name, std::string_view arguments, bool has_output, Plain call) {
    add_bound(name, arguments, has_output, call);
  }
  void add_bound(std::string_view name, std::string_view arguments, bool has_output,
                 typename Recorder<Subject>::Call call) {
    recorder_.add(note_call(design, name, arguments, has_output), std::move(call));
  }

  /// Records the calls of the observer, names the numbers. @param name_of gives the name of a
  /// number, or ""
  template <class NameOf>
  [[nodiscard]] Check<V> record(const NameOf& name_of) {
    // Without one nothing is rejected.
    design.wrap.gated = design.wrap.gated && (design.gate.threshold > 0 || design.law.watches);
    add_running_law();
    add_of_adapters();
    add_steps();
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
    auto& core = RecordAccess::core(observer_of(object));
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
      } else if (numbers[i] == &observer_of(object).applied_input()) {
        name = "u_given";  // without what is known
      }
      if (numbers[i] == &core.innovation()) name = "innovation";
      int level = -1;
      int row = 0;
      if (0 <= state && state < gains) {
        level = static_cast<int>(state) / size;
        while (Model::state_of_row(row) != state % size) ++row;
      }
      const char* setting = nullptr;
      for (const auto& [number, begins] : settings) {
        if (setting == nullptr && number == numbers[i]) setting = begins;
      }
      writer.live[i] = name_number(design, std::move(name), level, row, state == 0,
                                   RecordAccess::place_in_published(core, numbers[i]), setting);
    }
    writer.find_live(*recorded);
    design.live = writer.live;
    design.numbers = recorded->numbers;
    for (const auto& call : recorded->calls) design.calls.push_back(call[0]);
    if (auto ok = take_angle(); !ok) return ok;
    return take_gains(RecordAccess::core(observer_of(subject_)));
  }

 private:
  using Law = std::remove_cvref_t<decltype(RecordAccess::laws(std::declval<const Core&>())[0])>;
  static constexpr RunningLaw runs = RecordAccess::kind_of<Law>;

  /// The observer of a subject.
  template <class C>
  static auto& observer_of(C& c) {
    if constexpr (std::is_same_v<Subject, Observer>) {
      return c;
    } else {
      return RecordAccess::observer_of(c);
    }
  }
  /// The same for a call that does not move its law; and without what is known.
  template <class C>
  static auto& all_of(C& c) {
    return RecordAccess::at_rest(observer_of(c));
  }
  template <class C>
  static auto& of(C& c) {
    return RecordAccess::core(all_of(c));
  }

  void add_running_law() {
    if constexpr (RecordAccess::knows<Observer>) {
      add("drive", "u", true, [](auto& c, const Numbers& in) {
        return Numbers{RecordAccess::driven(all_of(c), in[0])};
      });
    }
    design.gain_is_kept = runs == RunningLaw::none && gain_law_traits<Law>.kind == GainKind::preset;
    if constexpr (runs != RunningLaw::none) {
      using Recorded = std::remove_cvref_t<decltype(RecordAccess::laws(RecordAccess::core(
          observer_of(std::declval<typename Recorder<Subject>::Recorded&>())))[0])>;
      RecordAccess::add_law<Recorded>(
          [&]<class Call>(std::string_view name, std::string_view arguments, const Call&) {
            constexpr bool has_output =
                !std::is_void_v<std::invoke_result_t<Call, Recorded&, const Numbers&>>;
            add(name, arguments, has_output, [](auto& c, const Numbers& in) {
              auto& law = RecordAccess::laws(RecordAccess::core(observer_of(c)))[0];
              if constexpr (has_output) {
                return Numbers{Call{}(law, in)};
              } else {
                Call{}(law, in);
                return Numbers{};
              }
            });
          });
    }
    if constexpr (runs == RunningLaw::schedule) {
      add("correct_long", "y contraction samples", false, [](auto& c, const Numbers& in) {
        const EqualSampledPoles<size, Number> poles{in[1]};
        RecordAccess::correct(
            of(c), in[0],
            Array<ScaledGain<size, Number>, 1>{long_step_gain<size, Number>(poles, in[2])});
        return Numbers{};
      });
    }
    if constexpr (runs == RunningLaw::filter) {
      if (design.law.watches) {
        add("is_inlier", "y", false, [](auto& c, const Numbers& in) {
          RecordAccess::judge(of(c), in[0]);
          return Numbers{};
        });
      }
    }
  }

  void add_of_adapters() {
    if constexpr (ShiftableOutput<Core>) {
      if (design.wrap.period > 0) {
        add("shift", "offset", false, [](auto& c, const Numbers& in) {
          (void)of(c).shift_output(in[0]);
          return Numbers{};
        });
      }
    }
    if constexpr (ShiftableLoad<Core>) {
      if (design.measured.on) {
        const auto column = RecordAccess::load_column(RecordAccess::core(observer_of(subject_)));
        add_bound("load", "offset", false, [column](auto& c, const Numbers& in) {
          RecordAccess::load(of(c), column, in[0]);
          return Numbers{};
        });
      }
    }
    if constexpr (model_traits<typename Core::PlantModel>.is_chain && size == Observer::order + 1) {
      if (design.guard.on) {
        add("predicted_y", numbered("x", size) + " u", true, [](auto& c, const Numbers& in) {
          return Numbers{RecordAccess::predicted_y(of(c), in)};
        });
        add("stand_at", "y " + numbered("d", Observer::levels), false,
            [](auto& c, const Numbers& in) {
              RecordAccess::stand_at(of(c), in);
              return Numbers{};
            });
        if (design.guard.by_input) {
          add("scale_found", "change", false, [](auto& c, const Numbers& in) {
            RecordAccess::scale_found(of(c), in[0]);
            return Numbers{};
          });
          add("scaled_bound", "bound", true, [](auto& c, const Numbers& in) {
            return Numbers{of(c).model().scaled_disturbance(in[0])};
          });
        }
      }
    }
  }

  void add_steps() {
    add("observe", "y u", false, [](auto& c, const Numbers& in) {
      (void)of(c).update(in[0], in[1]);
      return Numbers{};
    });
    add("predict_step", "u", false, [](auto& c, const Numbers& in) {
      (void)of(c).predict(in[0]);
      return Numbers{};
    });
    if constexpr (runs == RunningLaw::none) {
      add("correct_by", "y " + numbered("k", gains), false, [](auto& c, const Numbers& in) {
        RecordAccess::correct(of(c), in[0], RecordAccess::gains_from<Observer>(in, 1));
        return Numbers{};
      });
    }
    if (!design.gain_is_kept) {
      add("correct_step", "y", false, [](auto& c, const Numbers& in) {
        (void)of(c).correct(in[0]);
        return Numbers{};
      });
    }
    add("restart_at", "y", false, [](auto& c, const Numbers& in) {
      (void)of(c).reset(in[0]);
      return Numbers{};
    });
    unroll<size>([&](auto row) {
      add("estimate_" + std::to_string(int{row}), "", true, [](auto& c, const Numbers&) {
        return Numbers{RecordAccess::estimate<int{decltype(row)::value}>(all_of(c))};
      });
    });
  }

  /// `take_angle` where the law is of an angle.
  [[nodiscard]] Check<V> take_angle() {
    if (!(design.wrap.period > 0) || !design.is_controller || design.error_based ||
        design.compensates) {
      return {};
    }
    const bool elsewhere = RecordAccess::blanks<Core> || RecordAccess::knows<Observer> ||
                           design.options.moving_reference;
    if (elsewhere ? design.softens : !detail::take_angle(design)) {
      return Error<V>{"soften", V(1), "of an angle is not written for this observer"};
    }
    return {};
  }

  [[nodiscard]] Check<V> take_gains(const Core& observer) {
    design.size = size;
    design.max_gap = observer.max_gap();
    design.order = Observer::order;
    design.sample_time = static_cast<double>(observer.sample_time());
    design.input_gain = static_cast<double>(observer.input_gain());
    if constexpr (runs == RunningLaw::none) {
      return take_table(observer);
    }
    return {};
  }

  [[nodiscard]] Check<V> take_table(const Core& observer) {
    const auto& laws = RecordAccess::laws(observer);
    constexpr auto most = static_cast<unsigned>(most_bridged);
    design.recovers = observer.longest_gap() > observer.max_gap() ||
                      (design.options.settings_in_struct && recovery_after(laws, most) >= 0 &&
                       recovery_after(laws, most) < GapRecovery<double>::never);
    for (int elapsed = 1; elapsed <= observer.longest_gap() + 1; ++elapsed) {
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
      const int due = elapsed == 1 ? -1 : recovery_after(laws, static_cast<unsigned>(elapsed));
      design.recovery.push_back(due < GapRecovery<double>::never
                                    ? static_cast<std::uint16_t>(due + 1)
                                    : std::uint16_t{0});
    }
    return {};
  }

  Subject subject_;
  Recorder<Subject> recorder_;
};

/// How many disturbances are measured.
template <class O>
constexpr int measured_inputs() {
  if constexpr (requires { O::inputs; }) {
    return O::inputs;
  } else if constexpr (requires { typename O::Adapted; }) {
    return measured_inputs<typename O::Adapted>();
  } else {
    return 0;
  }
}

/// Gives measured disturbances, each the same. @return whether there are any
template <class O, class Object, class V>
bool give_measured(Object& object, V w) {
  constexpr int count = measured_inputs<O>();
  if constexpr (count == 1) {
    object.measured(w);
  } else if constexpr (count > 1) {
    Vector<V, count> all{};
    for (V& one : all) one = w;
    object.measured(all);
  }
  return count > 0;
}

/// Calls of what is beside the samples. @param object with its observer @param fresh as at first
/// @param has_settings in a struct @return the status as the C has it, or none if the call is none
/// of it
template <class Object, class Guard, class V>
std::optional<unsigned> called_beside(Object& object, Guard& guard, const Object& fresh,
                                      TestCall call, V y, V u, bool has_settings) {
  const auto of = [](auto good) { return good ? 0U : 1U; };
  if constexpr (requires { guard.set_pin(Pin::free); }) {
    if (call == TestCall::trusts) return static_cast<unsigned>(guard.set_trust(y));
    if (call == TestCall::pins && !(y <= V(3))) {
      return static_cast<unsigned>(StepStatus::input_rejected);
    }
    if (call == TestCall::pins) {
      guard.set_pin(static_cast<Pin>(static_cast<int>(y)));
      return 0U;
    }
    if constexpr (requires { object.set_input_gain(y); }) {
      if (call == TestCall::gains) return of(static_cast<bool>(object.set_input_gain(y)));
    }
  }
  if constexpr (requires { object.adopt(fresh); }) {
    if (call == TestCall::adopts) return of(!(y > V(0)) && object.adopt(fresh));
  }
  if (call != TestCall::keeps) return {};
  if (!(y >= V(1)) || !is_finite(y) || !is_finite(u)) return 1U;
  if constexpr (requires { object.adopt(fresh); }) {
    if (has_settings) (void)object.adopt(fresh);
  }
  const V none = (std::numeric_limits<V>::max)() * V(4);
  for (int left = static_cast<int>(y); left > 0; --left) {
    if constexpr (requires { object.track(none, none, u); }) {
      (void)object.track(none, V(0), u);
    } else if constexpr (requires { object.track(none, u); }) {
      (void)object.track(none, u);
    } else if constexpr (requires { object.predict(u); }) {
      (void)object.predict(u);
    }
  }
  return 0U;
}

/// r, or with its motion.
template <int inputs, class Beside>
auto reference(const Beside& beside) {
  if constexpr (inputs == 1) {
    return beside(0);
  } else {
    return beside;
  }
}

/// What a guard holds. @return u
template <class C, class V>
V held(C& controller, V y, V u) {
  if constexpr (requires { controller.hold(y, V(0), u); }) {
    return controller.hold(y, V(0), u);
  } else if constexpr (requires { controller.hold(y, u); }) {
    return controller.hold(y, u);
  } else {
    return u;
  }
}

/// The self-test of a controller in one phase.
template <int inputs, class C>
void take_samples(RecordedDesign& design, C played) {
  using V = typename C::scalar_type;
  const C fresh = played;
  const double law =
      design.law_gains.empty() ? 0 : std::abs(design.law_gains[0] / design.input_gain);
  take_self_test<V, inputs>(
      design, law,
      [&](TestCall call, V y, const auto& beside, int row) {
        using Of = typename ObserverOfController<C>::type;
        const auto with_mode = [&](V number, auto status) {
          const auto mode = static_cast<unsigned>(played.mode());
          return TestResult<V>{number, static_cast<unsigned>(status) + of_mode * mode};
        };
        const auto estimated = [&](auto status) {
          return with_mode(estimate_of(played.observer(), row), status);
        };
        if (const auto status = called_beside(played, played.observer(), fresh, call, y, beside(0),
                                              design.options.settings_in_struct)) {
          return estimated(*status);
        }
        if (call == TestCall::holds) {
          const V u = held(played, y, beside(0));
          return with_mode(u, played.status());
        }
        if (call == TestCall::starts) return estimated(played.start(y, beside(0)));
        if (call == TestCall::reports) return estimated(played.applied(beside(0)));
        if (call == TestCall::measures && give_measured<Of>(played, y)) return estimated(0U);
        const bool rests = call == TestCall::rests;
        if (!rests && call != TestCall::misses) {
          const V u = played.update(y, reference<inputs>(beside));
          return with_mode(u, played.status());
        }
        for (int left = static_cast<int>(y); left > 0; --left) {
          (void)(rests ? played.update(beside(0), reference<inputs>(beside))
                       : played.update_without_measurement(reference<inputs>(beside)));
        }
        return with_mode(played.output(), played.status());
      },
      [&](const auto&) { return played.output(); });
}

/// The self-test of a controller in two phases.
template <int inputs, class C>
void take_phases(RecordedDesign& design, C played) {
  using V = typename C::scalar_type;
  const double law = static_cast<double>(played.gains()[0]) / design.input_gain;
  take_self_test<V, inputs>(
      design, std::abs(law),
      [&](TestCall call, V y, const auto& beside, int row) {
        const auto with_mode = [&](V number, StepStatus status) {
          const auto mode = static_cast<unsigned>(played.mode());
          return TestResult<V>{number, static_cast<unsigned>(status) + of_mode * mode};
        };
        const auto estimated = [&](StepStatus status) {
          return with_mode(estimate_of(played.observer(), row), status);
        };
        if (call == TestCall::starts) return estimated(played.start(y, beside(0)));
        if (call == TestCall::reports) return estimated(played.applied(beside(0)));
        if (call == TestCall::resets) return estimated(played.reset(y));
        int left = call == TestCall::misses ? static_cast<int>(y) : 1;
        V u{};
        StepStatus status{};
        for (; left > 0; --left) {
          const bool lost = call == TestCall::misses || call == TestCall::loses;
          u = lost ? V(played.control_without_measurement()) : V(played.control(y));
          status = {};
          if (call == TestCall::splits || call == TestCall::loses) {
            status = played.applied(beside(0));
          }
          status = status | played.prepare(reference<inputs>(beside));
        }
        return with_mode(u, status);
      },
      [&](const auto&) { return played.output(); });
}

/// Records the calls of a controller without its adapters, of which the design knows already.
template <class Bare, class BareObserver>
[[nodiscard]] Check<typename Bare::scalar_type> record_controller(
    DesignRecorder<Bare, BareObserver>& maker) {
  using Access = RecordAccess;
  using Number = typename DesignRecorder<Bare, BareObserver>::Number;
  using Numbers = typename DesignRecorder<Bare, BareObserver>::Numbers;
  RecordedDesign& design = maker.design;
  const bool wraps = design.wrap.period > 0;
  const bool around_angle = design.known.around_angle;
  maker.add_bound("rest_at", wraps ? "y u angle" : "y u", false,
                  [around_angle](auto& c, const Numbers& in) {
                    Access::rest(Access::at_rest(c.observer()), in, around_angle);
                    return Numbers{};
                  });
  const bool blanks = Access::blanks<BareObserver>;
  const std::string law = blanks ? "law_for" : "law";
  const std::string estimates = blanks ? " " + numbered("e", BareObserver::size, 0) : "";
  if (!design.options.moving_reference) {
    maker.add(law, "r" + estimates, true,
              [](auto& c, const Numbers& in) { return Numbers{Access::law_for(c, in[0], in, 1)}; });
  } else if constexpr (requires { typename Bare::Reference; }) {
    maker.add(law, "r " + numbered("r", Bare::order) + estimates, true,
              [](auto& c, const Numbers& in) {
                typename std::remove_cvref_t<decltype(c)>::Reference::All motion;
                for (int i = 0; i <= Bare::order; ++i) motion(i) = in[static_cast<std::size_t>(i)];
                return Numbers{Access::law_for(c, motion, in, Bare::order + 1)};
              });
  }
  maker.add("limit", "u", true, [](auto& c, const Numbers& in) {
    return Numbers{Access::limited(Access::loop(c), in[0])};
  });
  maker.add("take_over", "u", false, [](auto& c, const Numbers& in) {
    Access::limiter_of(c).track(in[0]);
    return Numbers{};
  });
  maker.add("within", "u", true, [](auto& c, const Numbers& in) {
    return Numbers{Access::limiter_of(c).within(in[0])};
  });
  if (design.softens) {
    maker.add("harden", "", false, [](auto& c, const Numbers&) {
      Access::harden(c);
      return Numbers{};
    });
    maker.add("soften", "u", false, [](auto& c, const Numbers& in) {
      Access::soften(c, in[0]);
      return Numbers{};
    });
  }
  const auto name_of = [](const auto& c, const Number* at) -> std::string {
    // The limiter keeps the bounds of the next output behind the last.
    const Number* behind = &c.limiter().last();
    for (const char* name : {"u_last", "u_low", "u_high", "u_command"}) {
      if (at == behind++) return name;
    }
    return at == &c.requested() ? "u_asked" : at == &c.limiter().waiting() ? "u_waiting" : "";
  };
  return maker.record(name_of);
}

template <class C>
void take_limits(RecordedDesign& design, const C& controller) {
  const auto& limiter = RecordAccess::limiter_of(controller);
  design.lower = static_cast<double>(limiter.lower());
  design.upper = static_cast<double>(limiter.upper());
  if (is_finite(limiter.step())) design.rate = static_cast<double>(limiter.step());
  design.waits = limiter.waits();
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

  constexpr bool has_law = requires(const Bare& bare) { bare.gains(); };
  constexpr bool takes_motion = !Of::error_based && has_law;
  if (const auto rules = checked_options<V>(options, takes_motion); !rules) return rules.error();
  const Bare bare = without_adapter(controller);
  Maker maker(bare, options);
  RecordedDesign& design = maker.design;
  design.is_controller = true;
  design.loop = Access::rules(Access::loop(bare));
  design.error_based = Of::error_based;
  design.softens = Access::softens(bare);
  design.compensates = !has_law;
  if constexpr (IsResting<C>::value) {
    design.rest = Access::rest_of(controller, options.settings_in_struct);
  }
  take_limits(design, bare);
  take_adapters(design, controller.observer());
  design.law = Access::law_numbers(Access::core(bare.observer()));
  if constexpr (has_law) {
    for (const V& k : bare.gains()) design.law_gains.push_back(static_cast<double>(k));
  }

  if (auto ok = record_controller(maker); !ok) return ok.error();
  if (design.error_based) design.input_gain = -design.input_gain;
  if constexpr (takes_motion) {
    if (options.moving_reference) {
      take_samples<C::order + 1>(design, controller);
      return design;
    }
  }
  take_samples<1>(design, controller);
  return design;
}

/// The design of an observer.
template <WritableObserver Observer>
Expected<RecordedDesign, Error<typename Observer::scalar_type>> recorded_design(
    const Observer& observer, const CodeOptions& options) {
  using V = typename Observer::scalar_type;
  using Bare = typename WithoutAdapter<Observer>::type;
  using Maker = DesignRecorder<Bare, Bare>;

  if (const auto rules = checked_options<V>(options, false); !rules) return rules.error();
  const Bare bare = without_adapter(observer);
  Maker maker(bare, options);
  take_adapters(maker.design, observer);
  maker.design.law = RecordAccess::law_numbers(RecordAccess::core(bare));
  const auto unnamed = [](const auto&, const auto*) { return std::string(); };
  if (auto ok = maker.record(unnamed); !ok) return ok.error();
  Observer played = observer;
  take_self_test<V, 1>(
      maker.design, 0,
      [&](TestCall call, V y, const auto& u, int row) {
        StepStatus status{};
        if (const auto beside = called_beside(played, played, observer, call, y, u(0),
                                              maker.design.options.settings_in_struct)) {
          status = static_cast<StepStatus>(*beside);
        } else if (call == TestCall::holds) {
          if constexpr (requires { played.release(); }) {
            status = played.update(y, played.hold(u(0)));
            played.release();
          }
        } else if (call == TestCall::rests) {
          for (int left = static_cast<int>(y); left > 0; --left) status = played.update(u(0), u(0));
        } else if (call == TestCall::misses) {
          for (int left = static_cast<int>(y); left > 0; --left) status = played.predict(u(0));
        } else if (call == TestCall::starts || call == TestCall::resets) {
          status = played.reset(y);
        } else if (call == TestCall::corrects) {
          status = played.correct(y);
        } else if (call != TestCall::measures || !give_measured<Observer>(played, y)) {
          status = played.update(y, u(0));
        }
        return TestResult<V>{estimate_of(played, row), static_cast<unsigned>(status)};
      },
      [](const auto& u) { return u(0); });
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
  rules
      .demand(!options.settings_in_struct, "settings_in_struct", V(1),
              "is not written for PredictiveAdrc")
      .demand(!options.saves_state, "saves_state", V(1), "is not written for PredictiveAdrc");
  if (!rules) return rules.error();
  Maker maker(controller, options);
  RecordedDesign& design = maker.design;
  design.predictive = true;
  design.law = RecordAccess::law_numbers(controller.observer());
  design.loop = RecordAccess::rules_of_phases(controller);
  take_limits(design, controller);
  maker.add("rest_at", "y u", false, [](auto& c, const Numbers& in) {
    RecordAccess::rest(RecordAccess::at_rest(RecordAccess::observer_of(c)), in, false);
    return Numbers{};
  });
  RecordAccess::add_phases<Number, Observer>(
      design.waits, options.moving_reference,
      [&]<class Call>(std::string_view name, std::string_view arguments, bool has_output,
                      const Call&) {
        maker.add(name, arguments, has_output,
                  [](auto& c, const Numbers& in) { return Call{}(c, in); });
      });
  const auto name_of = [](const auto& c, const Number* at) -> std::string {
    return at == &c.output() ? "u_last" : "";
  };
  if (auto ok = maker.record(name_of); !ok) return ok.error();
  if (options.moving_reference) {
    take_phases<C::order + 1>(design, controller);
  } else {
    take_phases<1>(design, controller);
  }
  return design;
}

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/recorded_design.ipp>
#endif
