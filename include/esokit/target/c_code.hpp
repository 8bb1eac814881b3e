/// @file
/// to_c: a finished controller or observer as C99, written from its recorded calls.
#pragma once

#include <cctype>
#include <cstddef>
#include <esokit/control/adrc.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/target/c_text.hpp>
#include <esokit/target/c_writer.hpp>
#include <esokit/target/recorder.hpp>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace esokit {

/// How the C is to be written.
struct CCodeOptions {
  std::string name = "controller";  ///< begins every name and the files: an identifier of C
  std::string comment{};            ///< at the head of the header: which machine, which design; no
                                    ///< marks of a comment of C
  int self_test_samples = 100;      ///< samples of the self-test, 1 .. 10000
};

/// The two files, `name.h` and `name.c`.
struct CCode {
  std::string header{};  ///< text of `name.h`
  std::string source{};  ///< text of `name.c`
};

namespace detail {

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
    return c.judged(reference);
  }
  /// The output of the loop for a u that is wanted.
  template <class Loop, class S>
  static S limited(Loop& loop, const S& wanted) noexcept {
    return loop.limited(wanted);
  }
  template <class C>
  static bool softens(const C& c) noexcept {
    return c.soft_.on();
  }
  /// The law as designed again.
  template <class C>
  static void harden(C& c) noexcept {
    c.soft_.reset();
  }

  /// The rules of the loop: plain numbers.
  struct Rules {
    unsigned hold_left;
    unsigned missing_limit;
    int divider;
    bool has_safe_input;
    bool stays_safe;
    double hold_input;
    double safe_input;
  };
  template <class Loop>
  static Rules rules(const Loop& loop) noexcept {
    return {loop.hold_left_,
            loop.missing_limit_,
            loop.divider_,
            loop.has_safe_input_,
            loop.stay_safe_,
            static_cast<double>(loop.hold_input_),
            static_cast<double>(loop.safe_input_)};
  }

  /// The gain laws of all levels.
  template <class O>
  static auto laws(O& o) noexcept -> decltype((o.laws_)) {
    return o.laws_;
  }
};

/// A law with constants that it keeps, and others after a gap.
template <class Law>
concept KeepsItsGain = gain_law_traits<Law>
.kind == GainKind::preset&& gain_law_traits<Law>.bridges_gaps && !gain_law_traits<Law>.advances &&
    !gain_law_traits<Law>.accepts &&
    std::is_lvalue_reference_v<decltype(std::declval<const Law&>().gain_before_measurement())>;

/// An observer with such laws.
template <class Observer>
concept GainIsKept = can_be_recorded<Observer> && requires(const Observer& o) {
  requires KeepsItsGain<std::remove_cvref_t<decltype(RecordAccess::laws(o)[0])>>;
};

/// The parts of a file that an observer and a controller have in common.
/// @tparam Subject the observer or controller @tparam Observer its observer
template <class Subject, class Observer>
class CBuilder {
 public:
  using V = typename Observer::scalar_type;
  using Number = typename Recorder<Subject>::Number;
  using Numbers = std::vector<Number>;
  static constexpr int size = Observer::size;
  static constexpr int gains = size * Observer::levels;

  CBuilder(const Subject& subject, const CCodeOptions& options)
      : writer(sizeof(V) == sizeof(float), options.name), options_(options), recorder_(subject) {}

  /// The rules for the options.
  [[nodiscard]] static Rules<V> checked(const CCodeOptions& options) {
    const auto letter = [](char c) {
      return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_';
    };
    bool is_name = !options.name.empty() && letter(options.name[0]);
    for (const char c : options.name) {
      is_name = is_name && (letter(c) || std::isdigit(static_cast<unsigned char>(c)) != 0);
    }
    Rules<V> rules;
    rules.require(is_name, "name", V(0), "must be an identifier of C")
        .require(1 <= options.self_test_samples && options.self_test_samples <= 10000,
                 "self_test_samples", static_cast<V>(options.self_test_samples),
                 "must be 1 .. 10000")
        .require(options.comment.find("*/") == std::string::npos &&
                     options.comment.find("/*") == std::string::npos,
                 "comment", V(0), "must not begin or end a comment of C");
    return rules;
  }

  void add(const std::string& name, std::vector<std::string> arguments, bool has_output,
           typename Recorder<Subject>::Call call) {
    recorder_.add(static_cast<int>(arguments.size()), std::move(call));
    functions_.push_back({name, std::move(arguments), has_output});
  }

  /// The calls of the observer. @param of the observer of a recorded subject
  template <class Of>
  void add_observer(const Of& of) {
    add("predict_step", {"u"}, false, [of](auto& c, const Numbers& in) {
      (void)of(c).predict(in[0]);
      return Numbers{};
    });
    std::vector<std::string> arguments{"y"};
    for (int i = 1; i <= gains; ++i) arguments.push_back("k" + std::to_string(i));
    add("correct_step", arguments, false, [of](auto& c, const Numbers& in) {
      // With gains that are arguments; the object is not constant, only their getter is.
      auto& laws = RecordAccess::laws(of(c));
      const auto nominal = laws;
      std::size_t next = 1;
      for (auto& law : laws) {
        using Gain = std::remove_cvref_t<decltype(law.gain_before_measurement())>;
        for (auto& k : const_cast<Gain&>(law.gain_before_measurement())) k = in[next++];
      }
      (void)of(c).correct(in[0]);
      laws = nominal;
      return Numbers{};
    });
    add("restart_at", {"y"}, false, [of](auto& c, const Numbers& in) {
      (void)of(c).reset(in[0]);
      return Numbers{};
    });
    unroll<size>([&](auto row) {
      add("estimate_" + std::to_string(int{row}), {}, true, [of](auto& c, const Numbers&) {
        return Numbers{of(c).template estimate<int{decltype(row)::value}>()};
      });
    });
  }

  /// Records all, names the numbers and writes what is common. @param name_of gives the name of a
  /// number from its place behind z_1 of the observer, or ""
  template <class Of, class NameOf>
  [[nodiscard]] Check<V> record(const Subject& subject, const Of& of, const NameOf& name_of) {
    const auto recorded = recorder_.record();
    if (!recorded) return recorded.error();
    auto object = Recorder<Subject>::as_recorded(subject);
    const auto numbers = numbers_of<Number>(object);
    const Number* first = &of(object).predicted_measurement();
    writer.live.assign(numbers.size(), false);
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const auto state = numbers[i] - first;
      std::string name = name_of(object, numbers[i]);
      if (numbers[i] == &of(object).applied_input()) name = "u_applied";
      if (numbers[i] == &of(object).innovation()) name = "innovation";
      if (0 <= state && state < gains) {
        name = "z" + std::to_string(state % size + 1);
        if (state >= size) name += "_level" + std::to_string(state / size + 1);
      }
      writer.live[i] = name[0] == 'z' || name == "u_applied" || name == "u_last";
      writer.members.push_back(name.empty() ? "x" + std::to_string(i) : name);
    }
    writer.find_live(*recorded);
    std::string members;
    std::string init;
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      if (!writer.live[i]) continue;
      members += "  " + writer.real() + " " + writer.members[i] + ";\n";
      init += "  o->" + writer.members[i] + " = " + writer.number(recorded->numbers[i]) + ";\n";
    }
    for (std::size_t i = 0; i < functions_.size(); ++i) {
      lists_ += writer.function(functions_[i], recorded->calls[i][0]);
    }
    common(of(subject), members, init);
    return {};
  }

  /// The two files. @param words more words, filled in first
  [[nodiscard]] CCode code(const char* header, const char* source, Words words) const {
    words.insert(words.end(), words_.begin(), words_.end());
    const auto text = [&](const char* from) { return filled(from, words); };
    return {text(c_header_head) + text(header) + text(c_header_tail),
            text(c_source_head) + lists_ + text(c_source_observer_part) + text(source) +
                text(c_source_self_test)};
  }

  CWriter writer;

 private:
  void common(const Observer& observer, const std::string& members, const std::string& init) {
    const int max_gap = observer.max_gap();
    std::string table;
    for (int elapsed = 1; elapsed <= max_gap + 1; ++elapsed) {
      std::string row;
      for (const auto& law : RecordAccess::laws(observer)) {
        const auto gain = elapsed == 1 ? law.gain_before_measurement()
                                       : law.gap_gain(V(0), static_cast<unsigned>(elapsed));
        for (const V k : gain) {
          row += (row.empty() ? "  {" : ", ") + writer.number(static_cast<double>(k));
        }
      }
      table += row + "},\n";
    }
    std::string call_gains;
    for (int i = 0; i < gains; ++i) call_gains += ", k[" + std::to_string(i) + "]";
    std::string rows;
    for (int row = 0; row < size; ++row) {
      const std::string number = std::to_string(row);
      rows += "  case " + number + "u:\n    (void)estimate_" + number + "(o, &u);\n    break;\n";
    }
    std::string upper = options_.name;
    for (char& c : upper) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    constexpr bool single = sizeof(V) == sizeof(float);
    words_ = {{"$include", "#include"},  // not written in the texts: scripts look for such lines
              {"$MEMBERS", members},
              {"$TIME", writer.number(static_cast<double>(observer.sample_time()))},
              {"$GAINS", call_gains},
              {"$GAIN", writer.number(static_cast<double>(observer.input_gain()))},
              {"$ROWS_OF_ESTIMATE", rows},
              {"$ROWS", std::to_string(max_gap + 1)},
              {"$LAST", std::to_string(size - 1)},
              {"$GAP_GAINS", table},
              {"$SIZE", std::to_string(gains)},
              {"$INIT", init},
              {"$SAMPLES", std::to_string(options_.self_test_samples)},
              {"$word", single ? "uint32_t" : "uint64_t"},
              {"$exponent", single ? "0x7f800000u" : "0x7ff0000000000000u"},
              {"$fabs", single ? "fabsf" : "fabs"},
              {"$real", writer.real()},
              {"$NAME", upper},
              {"$name", options_.name},
              // The last, so that no word in it is taken for a key.
              {"$COMMENT", options_.comment.empty() ? "" : " * " + options_.comment + "\n"}};
  }

  CCodeOptions options_;
  Recorder<Subject> recorder_;
  std::vector<CFunction> functions_{};
  std::string lists_{};
  Words words_{};
};

/// Samples for the self-test: what y is does not matter. @param step gives the result for y and r
template <class V, class Step>
std::string self_test_samples(const CWriter& writer, int count, Step&& step) {
  std::string text;
  for (int k = 0; k < count; ++k) {
    const V r = static_cast<V>((k / 10) % 2 == 0 ? 1.0 : -0.5);
    const V y = static_cast<V>(0.25 * ((k * 37) % 16) - 1.5);
    text += "    {" + writer.number(static_cast<double>(y)) + ", " +
            writer.number(static_cast<double>(r)) + ", " +
            writer.number(static_cast<double>(step(y, r))) + "},\n";
  }
  return text;
}

}  // namespace detail

/// The controller as C99, two files without a library: state struct, init, start, update, estimates
/// in physical units, and a self-test that compares with the C++ (compiled if `NAME_SELF_TEST` is
/// defined). What the controller does at a sample is recorded from its own calls, so there is no
/// second implementation; settings are constants. Bad and missing samples, gaps, restarts, the
/// start hold and safe mode are those of the controller, too.
///
/// Compiled without contraction (-std=c99 in GCC) it equals the C++ bit for bit, as far as tested:
/// after any bad sample, gap, report or start. A gap of each length has its gains in a table of
/// max_gap + 1 rows: choose `max_gap` as short as the machine allows.
///
/// The observer has constant gains: LinearEso, also with a set of poles, HalfGainEso,
/// ReducedOrderEso, CascadeEso. Others do not compile.
/// @param controller as `make` returned it: its state is that of `init`
/// @return error for a name that is no identifier, a comment that would end the one it stands in, a
///         number of samples of the self-test out of range, or a measurement_divider, which cannot
///         be written yet
template <LoopObserver Observer>
requires detail::GainIsKept<Observer> Expected<CCode, Error<typename Observer::scalar_type>> to_c(
    const Adrc<Observer>& controller, const CCodeOptions& options = {}) {
  using C = Adrc<Observer>;
  using V = typename C::scalar_type;
  using Access = detail::RecordAccess;
  using Builder = detail::CBuilder<C, Observer>;
  using Number = typename Builder::Number;
  using Numbers = typename Builder::Numbers;

  const auto loop = Access::rules(Access::loop(controller));
  auto rules = Builder::checked(options);
  rules.require(loop.divider == 1, "measurement_divider", static_cast<V>(loop.divider),
                "must be 1: regular gaps cannot be written yet");
  if (!rules) return rules.error();

  const auto of = [](auto& c) -> auto& { return c.observer(); };
  const bool softens = Access::softens(controller);
  Builder builder(controller, options);
  builder.add("observe", {"y"}, false, [](auto& c, const Numbers& in) {
    (void)c.observer().update(in[0], Number(c.output()));
    return Numbers{};
  });
  builder.add_observer(of);
  builder.add("rest_at", {"y"}, false, [](auto& c, const Numbers& in) {
    auto& o = c.observer();
    (void)o.reset(o.equilibrium(in[0], Number(o.applied_input())));
    return Numbers{};
  });
  builder.add("law", {"r"}, true,
              [](auto& c, const Numbers& in) { return Numbers{Access::law(c, in[0])}; });
  builder.add("limit", {"u"}, true, [](auto& c, const Numbers& in) {
    return Numbers{Access::limited(Access::loop(c), in[0])};
  });
  builder.add("applied", {"u"}, false, [](auto& c, const Numbers& in) {
    Access::loop(c).applied(in[0]);
    return Numbers{};
  });
  if (softens) {
    builder.add("harden", {}, false, [](auto& c, const Numbers&) {
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
  if (auto ok = builder.record(controller, of, name_of); !ok) return ok.error();

  const auto& writer = builder.writer;
  C played = controller;
  const auto& limiter = controller.limiter();
  return builder.code(
      detail::c_header_controller, detail::c_source_controller,
      {{"$LIMITS", ", u within " + writer.number(static_cast<double>(limiter.lower())) + " .. " +
                       writer.number(static_cast<double>(limiter.upper()))},
       {"$SAFE_INPUT", loop.has_safe_input ? writer.number(loop.safe_input) : "o->u_last"},
       {"$HOLD_INPUT", writer.number(loop.hold_input)},
       {"$HARDEN", softens ? "  (void)harden(o);\n" : ""},
       {"$MISSING_LIMIT", std::to_string(loop.missing_limit)},
       {"$LEAVE_SAFE", loop.stays_safe ? ""
                                       : " else if (o->mode == $NAME_SAFE && o->gap == 0u) {\n"
                                         "    o->mode = $NAME_RUNNING;\n  }"},
       {"$HOLD_LEFT", std::to_string(loop.hold_left)},
       {"$MODE", loop.hold_left > 0 ? "$NAME_START_HOLD" : "$NAME_RUNNING"},
       {"$COLUMNS", "y, r, u"},
       {"$RESULT", "const $real result = $name_update(&o, samples[i][0], samples[i][1]);"},
       {"$VECTORS", detail::self_test_samples<V>(writer, options.self_test_samples,
                                                 [&](V y, V r) { return played.update(y, r); })}});
}

/// The same for an observer alone: init, reset, update, its halves predict and correct, and the
/// estimates.
template <LoopObserver Observer>
requires detail::GainIsKept<Observer> Expected<CCode, Error<typename Observer::scalar_type>> to_c(
    const Observer& observer, const CCodeOptions& options = {}) {
  using V = typename Observer::scalar_type;
  using Builder = detail::CBuilder<Observer, Observer>;
  using Number = typename Builder::Number;
  using Numbers = typename Builder::Numbers;

  if (const auto rules = Builder::checked(options); !rules) return rules.error();
  const auto of = [](auto& o) -> auto& { return o; };
  Builder builder(observer, options);
  builder.add("observe", {"y", "u"}, false, [](auto& o, const Numbers& in) {
    (void)o.update(in[0], in[1]);
    return Numbers{};
  });
  builder.add_observer(of);
  const auto no_name = [](const auto&, const Number*) { return std::string(); };
  if (auto ok = builder.record(observer, of, no_name); !ok) return ok.error();
  Observer played = observer;
  return builder.code(
      detail::c_header_observer, detail::c_source_observer,
      {{"$LIMITS", ""},
       {"$COLUMNS", "y, u, the disturbance"},
       {"$RESULT",
        "const unsigned status = $name_update(&o, samples[i][0], samples[i][1]);\n"
        "    const $real result = status == 0u ? $name_estimate(&o, $ORDERu) : samples[i][2] - 1;"},
       {"$ORDER", std::to_string(Observer::order)},
       {"$VECTORS",
        detail::self_test_samples<V>(builder.writer, options.self_test_samples, [&](V y, V u) {
          (void)played.update(y, u);
          return played.total_disturbance();
        })}});
}

/// What cannot be written yet, by name.
template <class Other>
void to_c(const Other&, const CCodeOptions& = {}) {
  static_assert(detail::GainIsKept<Other>,
                "esokit: to_c writes LinearEso, HalfGainEso, ReducedOrderEso and CascadeEso of the "
                "chain, and an output-based Adrc around them; no other gains, models, adapters or "
                "controllers yet");
}

}  // namespace esokit
