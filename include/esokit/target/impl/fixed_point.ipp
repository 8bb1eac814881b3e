#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <esokit/core/expected.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/detail/design_text.hpp>
#include <esokit/target/detail/fixed_design.hpp>
#include <esokit/target/detail/runtime_text.hpp>
#include <esokit/target/fixed_point.hpp>
#include <string>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION void FixedPlayer::observe(std::int64_t y, std::int64_t u) {
  std::vector<std::int64_t> results;
  design_->update.run(words_, rests_, {y, u}, results);
  for (std::size_t i = 0; i < words_.size(); ++i) {
    words_[i] = results[static_cast<std::size_t>(design_->next[i])];
    const int rest = design_->next_rest[i];
    if (rest >= 0) rests_[i] = results[static_cast<std::size_t>(rest)];
  }
}

ESOKIT_FUNCTION std::int64_t FixedPlayer::control(std::int64_t r) {
  const std::int64_t one = std::int64_t(1) << design_->law_scale;
  const auto low = static_cast<std::int64_t>(design_->lower) * one;
  const auto high = static_cast<std::int64_t>(design_->upper) * one;
  std::int64_t u = design_->hold_counts() * one;
  if (hold_left_ > 0) {
    --hold_left_;
  } else {
    std::vector<std::int64_t> results;
    design_->law.run(words_, rests_, {r}, results);
    u = results[static_cast<std::size_t>(design_->law_line)];
  }
  if (design_->rate > 0) {
    const auto step =
        static_cast<std::int64_t>(std::floor(std::ldexp(design_->rate, design_->law_scale)));
    u = std::clamp(u, last_ - step, last_ + step);
  }
  last_ = std::clamp(u, low, high);
  const std::int64_t up = last_ + one / 2;
  held = up >= 0 ? up / one : -((-up + one - 1) / one);
  return held;
}

namespace runtime {

inline constexpr const char* fixed_header =
#include <esokit/target/runtime/fixed.h>
    ;

}  // namespace runtime

/// The text of a design.
class FixedText {
 public:
  explicit FixedText(const FixedDesign& design)
      : d_(design), design_(design.design()), text_(design_.options.name, design_.single) {}

  [[nodiscard]] CCode code() {
    const std::string lists = observe();
    text_.lines("DESIGN_LISTS", design_.is_controller ? lists + law() : lists);
    set_features();
    set_constants();
    set_limits();
    set_words();
    set_members();
    set_rest();
    set_estimates();
    set_tables();
    set_about("", "");
    std::string set;
    if (opens_) {
      // What is the same for all settings has a mark: all but what comes now.
      mark = hash_of(text_.header(runtime::fixed_header) + text_.source({runtime::fixed}));
      text_.constant("DESIGN_MARK", std::to_string(mark) + "u");
      text_.replace("esokit_DESIGN_SET", name() + "_" + design_.options.settings_name);
      set = settings();
      text_.lines("DESIGN_SET_OF_SETTINGS", set);
    }
    set_about(design_.options.comment,
              structure_text(design_) + ", design " + design_hash(design_));
    set_bounds();
    set_samples();
    return {text_.header(runtime::fixed_header), text_.source({runtime::fixed}),
            opens_ ? "#include \"" + name() + ".h\"\n\n" + set : ""};
  }
  std::uint32_t mark = 0;  ///< of what is the same for all settings

  /// What an estimate is made of.
  struct Unit {
    double c = 0;        ///< the coefficient of its states
    int scale = 1000;    ///< of one state its own, of several one bit coarser than the coarsest
    int states = 0;      ///< how many
    bool is_sum = true;  ///< their coefficients are equal
  };
  [[nodiscard]] Unit unit_of(std::size_t row) const {
    Unit unit;
    for (std::size_t i = 0; i < d_.states(); ++i) {
      const double x = d_.written.estimates[row][i];
      if (!(std::fabs(x) > 0)) continue;
      if (unit.states > 0 && std::fabs(x - unit.c) > 1e-12 * std::fabs(unit.c)) unit.is_sum = false;
      unit.c = x;
      unit.scale = (std::min)(unit.scale, d_.written.scale[i]);
      ++unit.states;
    }
    for (int count = unit.states; count > 1; count = (count + 1) / 2) --unit.scale;
    return unit;
  }

 private:
  static std::string text_of(double x) {
    char digits[40];
    std::snprintf(digits, sizeof digits, "%.9g", x);
    return digits;
  }
  static std::string text_of(std::int64_t x) { return std::to_string(x); }

  /// The lines that are needed, as C. @param names of the arguments
  std::string lines(const IntegerList& list, const std::vector<int>& wanted,
                    const std::vector<std::string>& arguments, std::vector<std::string>& names,
                    std::vector<bool>& read) {
    std::vector<bool> need(list.lines.size(), false);
    for (const int i : wanted) {
      if (i >= 0) need[static_cast<std::size_t>(i)] = true;
    }
    for (std::size_t i = list.lines.size(); i-- > 0;) {
      const IntegerLine& one = list.lines[i];
      if (!need[i] || one.operation <= IntegerOperation::argument) continue;
      for (const int part : {one.a, one.b}) {
        if (part >= 0) need[static_cast<std::size_t>(part)] = true;
      }
    }
    std::string text;
    names.assign(list.lines.size(), "");
    int temporaries = 0;
    read.assign(arguments.size(), false);
    for (std::size_t i = 0; i < list.lines.size(); ++i) {
      const IntegerLine& one = list.lines[i];
      if (!need[i]) continue;
      const std::string number = std::to_string(one.a);
      std::string from;
      if (one.operation == IntegerOperation::argument) {
        names[i] = arguments[static_cast<std::size_t>(one.a)];
        read[static_cast<std::size_t>(one.a)] = true;
        continue;
      }
      if (one.operation == IntegerOperation::state) {
        names[i] = "x" + number;
        from = "o->x[" + number + "]";
      } else if (one.operation == IntegerOperation::remainder) {
        names[i] = "rest" + number;
        from = "o->rest" + number;
      } else {
        names[i] = "t" + std::to_string(++temporaries);
        std::string setting;
        if (one.setting >= 0) {
          setting = "o->settings->gain[" + std::to_string(gains_.size()) + "]";
          gains_.push_back(one.constant);
        }
        from = IntegerList::in_c(one, names, setting);
      }
      text += "  const int32_t " + names[i] + " = " + from + "; /* 2^-" +
              std::to_string(one.scale) + " */\n";
    }
    return text;
  }

  std::string observe() {
    std::vector<int> wanted = d_.next;
    wanted.insert(wanted.end(), d_.next_rest.begin(), d_.next_rest.end());
    std::vector<std::string> names;
    std::vector<bool> read;
    std::string text =
        "/* ---- Recorded from the design, in integers; behind each number the power of two by "
        "which it\n"
        " * is to be multiplied. None can overflow. */\n\nstatic void observe(" +
        design_.options.name + "_state *o, int32_t y, int32_t u)\n{\n" +
        lines(d_.update, wanted, {"y", "u"}, names, read);
    for (std::size_t i = 0; i < d_.states(); ++i) {
      const std::string number = std::to_string(i);
      text += "  o->x[" + number + "] = " + names[static_cast<std::size_t>(d_.next[i])] + ";\n";
      if (d_.next_rest[i] >= 0) {
        text +=
            "  o->rest" + number + " = " + names[static_cast<std::size_t>(d_.next_rest[i])] + ";\n";
      }
    }
    if (!read[1]) text += "  (void)u;\n";
    return text + "}\n\n";
  }

  std::string law() {
    std::vector<std::string> names;
    std::vector<bool> read;
    const std::string inside = lines(d_.law, {d_.law_line}, {"r"}, names, read);
    return "/* u before its limits, in 2^-" + std::to_string(d_.law_scale) +
           " counts. */\nstatic int32_t law(const " + design_.options.name +
           "_state *o, int32_t r)\n{\n" + inside + (read[0] ? "" : "  (void)r;\n") + "  return " +
           names[static_cast<std::size_t>(d_.law_line)] + ";\n}\n\n";
  }

  /// A number as 28 bits and the power of two by which these are too large.
  static std::pair<std::string, std::string> split(double c) {
    int exponent = 0;
    (void)std::frexp(c, &exponent);
    const int power = std::fabs(c) > 0 ? std::clamp(28 - exponent, 0, 62) : 0;
    return {text_of(static_cast<std::int64_t>(std::nearbyint(std::ldexp(c, power)))),
            std::to_string(power)};
  }
  /// Rows of numbers as mantissas and powers of two. @param columns the scales of what they
  /// multiply
  void matrix(const std::vector<LinearForm>& rows, double of_last, std::string& m,
              std::string& powers, const std::string& indent) const {
    const std::size_t n = d_.states();
    for (std::size_t i = 0; i < n; ++i) {
      m += indent + "{";
      powers += indent + "{";
      for (std::size_t j = 0; j <= n; ++j) {
        const int from = j < n ? d_.written.scale[j] : 0;
        const double c =
            std::ldexp(rows[i][j] * (j < n ? 1.0 : of_last), d_.written.scale[i] - from);
        const auto [mantissa, power] = split(c);
        m += (j > 0 ? ", " : "") + mantissa;
        powers += (j > 0 ? ", " : "") + power + "u";
      }
      m += "},\n";
      powers += "},\n";
    }
  }

  [[nodiscard]] const std::string& name() const { return design_.options.name; }
  /// A bound of a state, in its counts.
  [[nodiscard]] std::string scaled(const std::vector<double>& bounds, std::size_t i) const {
    return text_of(static_cast<std::int64_t>(std::ldexp(bounds[i], d_.written.scale[i])));
  }
  /// Of all.
  [[nodiscard]] std::string scaled(const std::vector<double>& bounds) const {
    return counted(bounds.size(), [&](std::size_t i) { return scaled(bounds, i); });
  }

  void set_features() {
    text_.feature("ESOKIT_CONTROLLER", design_.is_controller);
    text_.feature("ESOKIT_COUNTER", d_.wraps());
    text_.feature("ESOKIT_SETTINGS", opens_);
    text_.feature("ESOKIT_RATED", d_.rate > 0);
    text_.feature("ESOKIT_STAYS_SAFE", design_.loop.stays_safe);
    text_.feature("ESOKIT_SAFE_INPUT", !design_.loop.holds_safe);
  }
  void set_constants() {
    const FixedPointOptions& options = d_.options();
    const auto y = static_cast<std::size_t>(options.y.most);
    const auto u = static_cast<std::size_t>(options.u.most);
    text_.constant("Y_MOST", std::to_string(y));
    text_.count("Y_MOST_U", y);
    text_.constant("Y_BEYOND", std::to_string(y + 1));
    text_.count("Y_TWICE", 2 * y);
    text_.constant("U_MOST", std::to_string(u));
    text_.count("U_MOST_U", u);
    text_.count("U_TWICE", 2 * u);
    const std::size_t half = d_.wraps() ? std::size_t{1} << (options.y.counter_bits - 1) : 1;
    text_.constant("COUNTER_HALF", std::to_string(half));
    text_.count("COUNTER_HALF_U", half);
    text_.count("COUNTER_MASK", 2 * half - 1);
    text_.count("STATES", d_.states());
    text_.count("COLUMNS", d_.states() + 1);
    const auto rows = static_cast<std::size_t>(d_.table_rows());
    text_.count("ROWS", rows);
    // Of 16 bits, as the count is.
    text_.count("GAP_MOST",
                (std::min)((std::max)(rows + 1, std::size_t{design_.loop.missing_limit}),
                           std::size_t{65535}));
    text_.count("GAINS", gains_.size());
    text_.constant("SAMPLES", std::to_string(design_.options.self_test_samples));
  }
  void set_limits() {
    const LoopRules& loop = design_.loop;
    const std::int64_t one = std::int64_t(1) << d_.law_scale;
    text_.constant("LAW_SCALE", std::to_string(d_.law_scale));
    text_.constant("ONE", text_of(one));
    text_.constant("HALF", text_of(one / 2));
    text_.constant("LOWER", fine(d_.lower));
    text_.constant("UPPER", fine(d_.upper));
    text_.constant("RATE", fine(d_.rate));
    text_.constant("SAFE_INPUT", fine(std::nearbyint(loop.safe_input / d_.options().u.unit)));
    text_.constant("HOLD_INPUT", text_of(d_.hold_counts() * one));
    text_.constant("START_FINE", text_of(d_.start_held() * one));
    text_.constant("START_HELD", text_of(d_.start_held()));
    text_.count("HOLD_SAMPLES", loop.hold_left);
    text_.count("MISSING_LIMIT", loop.missing_limit);
    text_.constant("FIRST_MODE", loop.hold_left > 0 ? "1u" : "0u");
  }
  /// Counts of u as they are kept.
  [[nodiscard]] std::string fine(double counts) const {
    return text_of(static_cast<std::int64_t>(std::floor(std::ldexp(counts, d_.law_scale))));
  }
  void set_words() {
    const bool wraps = d_.wraps();
    text_.replace("y_count", wraps ? "uint16_t" : "int32_t");
    text_.replace("DESIGN_ORIGIN", wraps ? "the counter 0" : "y = 0");
    text_.replace("DESIGN_Y", wraps ? "y less the last counter" : "y");
    text_.replace("DESIGN_LAST", std::to_string(design_.size - 1));
    text_.replace("DESIGN_COLUMNS",
                  design_.is_controller ? "y, r, u" : "y, u, the last word of the state");
  }
  void set_members() {
    const std::size_t n = d_.states();
    std::string members =
        "  int32_t x[" + std::to_string(n) + "]; /* in counts of y and 2^-" +
        filled(counted(n, [&](std::size_t i) { return std::to_string(d_.written.scale[i]); }),
               {{", ", ", 2^-"}}) +
        " */\n";
    std::string forget;
    for (std::size_t i = 0; i < n; ++i) {
      if (d_.next_rest[i] < 0) continue;
      const std::string number = std::to_string(i);
      members += "  int32_t rest" + number + "; /* of x[" + number + "], below its last bit */\n";
      forget += "  o->rest" + number + " = 0;\n";
    }
    if (d_.wraps()) members += "  uint16_t y_last; /* the counter */\n";
    if (opens_) members += "  const " + name() + "_settings *settings;\n";
    text_.lines("DESIGN_MEMBERS", members);
    text_.lines("DESIGN_FORGET", forget);
  }
  /// The states at rest at y under u.
  void set_rest() {
    const std::size_t n = d_.states();
    const bool wraps = d_.wraps();
    std::vector<LinearForm> at(n, LinearForm(n + 2, 0.0));
    if (design_.is_controller) {
      at = d_.rows_of("rest_at", {FixedDesign::column, FixedDesign::column});
    } else {
      const auto rows = d_.rows_of("restart_at", {FixedDesign::column});
      for (std::size_t i = 0; i < n; ++i) at[i][n] = rows[i][n];
    }
    std::string rest_at;
    for (std::size_t i = 0; i < n; ++i) {
      std::string sum;
      const double scale = std::ldexp(1.0, d_.written.scale[i]);
      for (int input = wraps ? 1 : 0; input < 2; ++input) {
        const double c =
            at[i][n + static_cast<std::size_t>(input)] * (input == 0 ? 1.0 : d_.of_u()) * scale;
        if (!(std::fabs(c) > 0)) continue;
        const auto [mantissa, power] = split(c);
        sum += (sum.empty() ? "" : " + ") + std::string("((") + (input == 0 ? "y" : "u") +
               " * ((int64_t)" + mantissa + ")) >> " + power + ")";
      }
      const std::string number = std::to_string(i);
      const std::string most = opens_ ? "o->settings->box[" + number + "]" : scaled(d_.box, i);
      rest_at += "  o->x[" + number +
                 "] = " + (sum.empty() ? "0" : "within(" + sum + ", " + most + ", &status)") +
                 ";\n";
    }
    text_.lines("DESIGN_REST_AT", rest_at);
  }
  void set_estimates() {
    std::string units;
    std::string estimates;
    const std::string upper = begin_of_constants(name());
    for (std::size_t row = 0; row < d_.estimates.size(); ++row) {
      const std::string number = std::to_string(row);
      const Unit unit = unit_of(row);
      units += "#define " + upper + "_ESTIMATE_" + number + "_UNIT (" +
               text_of(std::ldexp(unit.c, -unit.scale)) + ")\n";
      std::string sum;
      for (std::size_t i = 0; i < d_.states(); ++i) {
        if (!(std::fabs(d_.written.estimates[row][i]) > 0)) continue;
        const int down = d_.written.scale[i] - unit.scale;
        const std::string x = "o->x[" + std::to_string(i) + "]";
        sum += (sum.empty() ? "" : " + ") +
               (down > 0 ? "(" + x + " >> " + std::to_string(down) + ")" : x);
      }
      estimates += "  case " + number + "u:\n    value = " + sum + ";\n    break;\n";
    }
    text_.lines("DESIGN_UNITS", units);
    text_.lines("DESIGN_ESTIMATES", estimates);
  }
  void set_tables() {
    std::string m;
    std::string powers;
    matrix(d_.rows_of("predict_step", {FixedDesign::column}), d_.of_u(), m, powers, "    ");
    text_.lines("DESIGN_PREDICT_M", m);
    text_.lines("DESIGN_PREDICT_P", powers);
    for (int row = 0; row < d_.table_rows(); ++row) {
      correct_m_ += "    {\n";
      correct_p_ += "    {\n";
      matrix(d_.correction_rows(row + 1), 1, correct_m_, correct_p_, "      ");
      correct_m_ += "    },\n";
      correct_p_ += "    },\n";
    }
    text_.lines("DESIGN_CORRECT_M", correct_m_);
    text_.lines("DESIGN_CORRECT_P", correct_p_);
    text_.replace("DESIGN_REACH", scaled(d_.reach));
    text_.replace("DESIGN_BOX", scaled(d_.box));
  }
  [[nodiscard]] std::string settings() const {
    std::string set = "const " + name() + "_settings " + name() + "_" +
                      design_.options.settings_name + " = {\n  " + std::to_string(mark) +
                      "u,\n  {" +
                      listed(gains_, [](std::int32_t gain) { return std::to_string(gain); }) +
                      "},\n  {" + scaled(d_.reach) + "},\n  {" + scaled(d_.box) + "},\n";
    if (design_.is_controller) set += "  " + fine(d_.lower) + ",\n  " + fine(d_.upper) + ",\n";
    if (d_.rate > 0) set += "  " + fine(d_.rate) + ",\n";
    return set + "  {\n" + correct_m_ + "  },\n  {\n" + correct_p_ + "  }\n};\n\n";
  }
  void set_about(const std::string& comment, const std::string& identity) {
    const FixedPointOptions& options = d_.options();
    text_.lines("DESIGN_ABOUT", (comment.empty() ? "" : " * " + comment + "\n") +
                                    " * T = " + text_of(design_.sample_time) +
                                    " s; fixed point: a count of y is " + text_of(options.y.unit) +
                                    ", a count of u " + text_of(options.u.unit) + ".\n * " +
                                    identity + ".\n");
    text_.replace("DESIGN_TEXT", "\"" + identity + "\"");
  }
  void set_bounds() {
    const auto of = [](const FixedBound& bound, const char* unit) {
      return text_of(bound.deviation) + unit + " (half a count of y: " + text_of(bound.half_count) +
             "), and by the rounding of the gains " + text_of(bound.by_gains) + "\n";
    };
    std::string bounds;
    for (std::size_t row = 0; row < d_.estimates.size(); ++row) {
      bounds += " *   estimate " + std::to_string(row) + ": " + of(d_.estimates[row], "");
    }
    if (design_.is_controller) bounds += " *   u before its limits: " + of(d_.input, " counts");
    text_.lines("DESIGN_BOUNDS", bounds);
  }
  void set_samples() {
    const FixedPointOptions& options = d_.options();
    const bool wraps = d_.wraps();
    std::string vectors;
    FixedPlayer player(d_);
    std::uint32_t seed = 1;
    std::int64_t counter = 0;
    const auto drawn = [&](std::int64_t most) {
      seed = seed * 1664525u + 1013904223u;
      return static_cast<std::int64_t>(seed >> 8) % (2 * most + 1) - most;
    };
    for (int k = 0; k < design_.options.self_test_samples; ++k) {
      const std::int64_t y = drawn(options.y.most);
      counter = (counter + y) & ((std::int64_t(1) << 16) - 1);
      if (wraps) counter &= (std::int64_t(1) << options.y.counter_bits) - 1;
      std::int64_t second = drawn(options.u.most);
      std::int64_t result = 0;
      if (design_.is_controller) {
        second = drawn(options.y.most);
        player.observe(y, player.held);
        result = player.control(second);
        if (wraps) second = (counter + second) & ((std::int64_t(1) << options.y.counter_bits) - 1);
      } else {
        player.observe(y, second);
        result = player.next_word(d_.states() - 1);
      }
      vectors += "    {" + text_of(wraps ? counter : y) + ", " + text_of(second) + ", " +
                 text_of(result) + "},\n";
    }
    text_.lines("DESIGN_VECTORS", vectors);
  }

  const FixedDesign& d_;
  const RecordedDesign& design_;
  bool opens_ = !design_.settings.empty();
  std::vector<std::int32_t> gains_;  ///< that may be changed while it runs
  std::string correct_m_{};
  std::string correct_p_{};
  RuntimeText text_;
};

ESOKIT_FUNCTION Expected<FixedCode, Error<double>> fixed_code(const RecordedDesign& recorded,
                                                              const FixedPointOptions& options) {
  for (const auto& [field, is_set] :
       {std::pair{"moving_reference", recorded.options.moving_reference},
        std::pair{"saves_state", recorded.options.saves_state}}) {
    if (is_set) return Error<double>{field, 1, "is not written in fixed point"};
  }
  const bool given = options.settings_for != nullptr;
  FixedDesign design(recorded, options, given ? &options.settings_for->layout : nullptr);
  std::vector<FixedLayout> others;
  for (const FixedCode* other : options.room_for) {
    if (other != nullptr) others.push_back(other->layout);
  }
  if (!given) design.make_room(others);  // that code has it
  if (!design.make()) return design.refusal;
  FixedText text(design);
  for (std::size_t row = 0; row < design.estimates.size(); ++row) {
    const auto unit = text.unit_of(row);
    if (!unit.is_sum) {
      return Error<double>{"observer", static_cast<double>(row),
                           "has an estimate that is no sum of states"};
    }
    if (unit.states > 1) {  // what reading it shifts away
      design.estimates[row].deviation += std::fabs(std::ldexp(unit.c, -unit.scale)) * unit.states;
    }
  }
  FixedCode made{text.code(), design.estimates, design.input, design.written, design.layout};
  made.layout.mark = text.mark;
  return made;
}

}  // namespace detail
}  // namespace esokit
