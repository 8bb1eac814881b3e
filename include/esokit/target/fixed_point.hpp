/// @file
/// to_fixed_c: a finished controller or observer as C99 in integers, with proven bounds.
#pragma once

#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <esokit/core/expected.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/fixed_design.hpp>
#include <esokit/target/fixed_text.hpp>
#include <string>
#include <vector>

namespace esokit {

/// A design in fixed point: the files, and how far they are from the design.
struct FixedCode {
  CCode code{};                         ///< `name.h` and `name.c`
  std::vector<FixedBound> estimates{};  ///< of each, in its unit
  FixedBound input{};                   ///< of u before its limits, in counts; of a controller
  WrittenSystem written{};              ///< what the bounds are from
  FixedLayout layout{};                 ///< what other settings have to fit into
};

namespace detail {

/// Plays the lists of a design for its self-test.
class FixedPlayer {
 public:
  explicit FixedPlayer(const FixedDesign& design)
      : held(design.start_held()),
        design_(&design),
        words_(design.states(), 0),
        rests_(design.states(), 0),
        last_(held << design.law_scale),
        hold_left_(design.design().loop.hold_left) {}

  /// @param y in counts, of a counter its change
  void observe(std::int64_t y, std::int64_t u) {
    std::vector<std::int64_t> results;
    (void)design_->update.run(words_, rests_, {y, u}, results);
    for (std::size_t i = 0; i < words_.size(); ++i) {
      words_[i] = results[static_cast<std::size_t>(design_->next[i])];
      const int rest = design_->next_rest[i];
      if (rest >= 0) rests_[i] = results[static_cast<std::size_t>(rest)];
    }
  }
  std::int64_t control(std::int64_t r) {
    const std::int64_t one = std::int64_t(1) << design_->law_scale;
    const auto low = static_cast<std::int64_t>(design_->lower) * one;
    const auto high = static_cast<std::int64_t>(design_->upper) * one;
    std::int64_t u = design_->hold_counts() * one;
    if (hold_left_ > 0) {
      --hold_left_;
    } else {
      std::vector<std::int64_t> results;
      (void)design_->law.run(words_, rests_, {r}, results);
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
  [[nodiscard]] std::int64_t next_word(std::size_t i) const { return words_[i]; }
  std::int64_t held;

 private:
  const FixedDesign* design_;
  std::vector<std::int64_t> words_;
  std::vector<std::int64_t> rests_;
  std::int64_t last_;
  unsigned hold_left_;
};

/// The text of a design.
class FixedText {
 public:
  explicit FixedText(const FixedDesign& design) : d_(design), design_(design.design()) {}

  [[nodiscard]] CCode code() {
    const bool controls = design_.is_controller;
    std::string lists = observe();
    if (controls) lists += law();
    if (opens_) {  // What is the same for all settings has a mark.
      words("");
      mark = mark_of(lists);
    }
    words(design_.options.settings_name);
    const auto text = [&](const char* from) { return filled(from, words_); };
    const std::string set = opens_ ? text(fixed_settings) : "";
    return {text(fixed_header_head) + (opens_ ? text(fixed_header_settings) : "") +
                text(controls ? fixed_header_controller : fixed_header_observer) +
                (opens_ ? text(fixed_header_adopt) : "") + text(fixed_header_tail),
            text(fixed_source_head) + set + lists + text(fixed_source_gap) +
                text(controls ? fixed_source_controller : fixed_source_observer) +
                (opens_ ? text(fixed_source_adopt) : "") + text(fixed_source_self_test),
            opens_ ? "#include \"" + design_.options.name + ".h\"\n\n" + set : ""};
  }
  /// Of the text but for settings and samples.
  [[nodiscard]] std::uint32_t mark_of(const std::string& lists) const {
    std::uint32_t found = 2166136261u;  // FNV-1a
    const char* end = design_.is_controller ? fixed_source_controller : fixed_source_observer;
    for (const char c : filled("$name $TIME $UNIT_Y $UNIT_U $UNITS$LIMITS$MEMBERS", words_) +
                            lists + filled(fixed_source_gap, words_) + filled(end, words_)) {
      found = (found ^ static_cast<unsigned char>(c)) * 16777619u;
    }
    return found;
  }
  std::uint32_t mark = 0;  ///< of what is the same for all settings

  /// Estimates of several states need equal coefficients.
  [[nodiscard]] bool can_estimate(std::size_t row) const {
    double c = 0;
    for (const double x : d_.written.estimates[row]) {
      if (!(std::fabs(x) > 0)) continue;
      if (std::fabs(c) > 0 && std::fabs(x - c) > 1e-12 * std::fabs(c)) return false;
      c = x;
    }
    return true;
  }
  /// Its coefficient and scale: of one state its own, of several one bit coarser than the coarsest.
  [[nodiscard]] std::pair<double, int> unit_of(std::size_t row) const {
    double c = 0;
    int scale = 1000;
    int count = 0;
    for (std::size_t i = 0; i < d_.states(); ++i) {
      if (!(std::fabs(d_.written.estimates[row][i]) > 0)) continue;
      c = d_.written.estimates[row][i];
      scale = (std::min)(scale, d_.written.scale[i]);
      ++count;
    }
    while (count > 1) {
      --scale;
      count = (count + 1) / 2;
    }
    return {c, scale};
  }
  [[nodiscard]] int states_of(std::size_t row) const {
    int count = 0;
    for (const double x : d_.written.estimates[row]) count += std::fabs(x) > 0 ? 1 : 0;
    return count;
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
    std::vector<int> uses(list.lines.size(), 0);
    for (std::size_t i = list.lines.size(); i-- > 0;) {
      const IntegerLine& one = list.lines[i];
      if (!need[i] || one.operation <= IntegerOperation::argument) continue;
      for (const int part : {one.a, one.b}) {
        if (part < 0) continue;
        need[static_cast<std::size_t>(part)] = true;
        ++uses[static_cast<std::size_t>(part)];
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
        int exponent = 0;
        (void)std::frexp(c, &exponent);
        const int power = std::fabs(c) > 0 ? std::clamp(28 - exponent, 0, 62) : 0;
        m += (j > 0 ? ", " : "") +
             text_of(static_cast<std::int64_t>(std::nearbyint(std::ldexp(c, power))));
        powers += (j > 0 ? ", " : "") + std::to_string(power) + "u";
      }
      m += "},\n";
      powers += "},\n";
    }
  }

  void words(const std::string& settings_name) {
    const std::size_t n = d_.states();
    const FixedPointOptions& options = d_.options();
    const bool wraps = d_.wraps();
    const double of_u = options.u.unit / options.y.unit;
    const std::string& name = design_.options.name;
    const std::string upper = begin_of_constants(name);

    std::string bounds;
    std::string units;
    std::string estimates;
    for (std::size_t row = 0; row < d_.estimates.size(); ++row) {
      const std::string number = std::to_string(row);
      const auto [c, scale] = unit_of(row);
      const FixedBound& bound = d_.estimates[row];
      bounds += " *   estimate " + number + ": " + text_of(bound.deviation) +
                " (half a count of y: " + text_of(bound.half_count) +
                "), and by the rounding of the gains " + text_of(bound.by_gains) + "\n";
      units +=
          "#define $NAME_ESTIMATE_" + number + "_UNIT (" + text_of(std::ldexp(c, -scale)) + ")\n";
      std::string sum;
      for (std::size_t i = 0; i < n; ++i) {
        if (!(std::fabs(d_.written.estimates[row][i]) > 0)) continue;
        const int down = d_.written.scale[i] - scale;
        const std::string x = "o->x[" + std::to_string(i) + "]";
        sum += (sum.empty() ? "" : " + ") +
               (down > 0 ? "(" + x + " >> " + std::to_string(down) + ")" : x);
      }
      estimates += "  case " + number + "u:\n    value = " + sum + ";\n    break;\n";
    }
    if (design_.is_controller) {
      bounds += " *   u before its limits: " + text_of(d_.input.deviation) +
                " counts (half a count of y: " + text_of(d_.input.half_count) +
                "), and by the rounding of the gains " + text_of(d_.input.by_gains) + "\n";
    }

    std::string members = "  int32_t x[" + std::to_string(n) + "]; /* in counts of y and 2^-";
    for (std::size_t i = 0; i < n; ++i)
      members += (i > 0 ? ", 2^-" : "") + std::to_string(d_.written.scale[i]);
    members += " */\n";
    std::string forget;
    for (std::size_t i = 0; i < n; ++i) {
      if (d_.next_rest[i] < 0) continue;
      const std::string rest = "rest" + std::to_string(i);
      members +=
          "  int32_t " + rest + "; /* of x[" + std::to_string(i) + "], below its last bit */\n";
      forget += "  o->" + rest + " = 0;\n";
    }
    if (wraps) members += "  uint16_t y_last; /* the counter */\n";

    if (opens_) members += "  const " + name + "_settings *settings;\n";
    std::string reach;
    std::string box;
    for (std::size_t i = 0; i < n; ++i) {
      reach += (i > 0 ? ", " : "") +
               text_of(static_cast<std::int64_t>(std::ldexp(d_.reach[i], d_.written.scale[i])));
      box += (i > 0 ? ", " : "") +
             text_of(static_cast<std::int64_t>(std::ldexp(d_.box[i], d_.written.scale[i])));
    }
    std::string predict_m;
    std::string predict_p;
    matrix(d_.rows_of("predict_step", {FixedDesign::column}), of_u, predict_m, predict_p, "    ");
    std::string correct_m;
    std::string correct_p;
    for (int row = 0; row < d_.table_rows(); ++row) {
      const auto rows = d_.correction_rows(row + 1);
      correct_m += "    {\n";
      correct_p += "    {\n";
      matrix(rows, 1, correct_m, correct_p, "      ");
      correct_m += "    },\n";
      correct_p += "    },\n";
    }
    std::string rest_at;
    std::vector<LinearForm> at(n, LinearForm(n + 2, 0.0));
    if (design_.is_controller)
      at = d_.rows_of("rest_at", {FixedDesign::column, FixedDesign::column});
    else {
      const auto rows = d_.rows_of("restart_at", {FixedDesign::column});
      for (std::size_t i = 0; i < n; ++i) at[i][n] = rows[i][n];
    }
    for (std::size_t i = 0; i < n; ++i) {
      std::string sum;
      const double scale = std::ldexp(1.0, d_.written.scale[i]);
      for (int input = 0; input < 2; ++input) {
        if (input == 0 && wraps) continue;
        const double c =
            at[i][n + static_cast<std::size_t>(input)] * (input == 0 ? 1.0 : of_u) * scale;
        if (!(std::fabs(c) > 0)) continue;
        int exponent = 0;
        (void)std::frexp(c, &exponent);
        const int power = std::clamp(28 - exponent, 0, 62);
        sum += (sum.empty() ? "" : " + ") + std::string("((") + (input == 0 ? "y" : "u") +
               " * ((int64_t)" +
               text_of(static_cast<std::int64_t>(std::nearbyint(std::ldexp(c, power)))) + ")) >> " +
               std::to_string(power) + ")";
      }
      const std::string number = std::to_string(i);
      rest_at += "  o->x[" + number + "] = " +
                 (sum.empty() ? std::string("0")
                              : "within(" + sum + ", " +
                                    (opens_ ? "o->settings->box[" + number + "]"
                                            : text_of(static_cast<std::int64_t>(
                                                  std::ldexp(d_.box[i], d_.written.scale[i])))) +
                                    ", &status)") +
                 ";\n";
    }

    const std::string y_most = std::to_string(options.y.most);
    const std::string y_twice = std::to_string(2 * options.y.most);
    const std::string half = std::to_string(wraps ? 1 << (options.y.counter_bits - 1) : 0);
    const std::string mask = std::to_string(wraps ? (1 << options.y.counter_bits) - 1 : 0);
    // The change of a counter, and of a reference from it.
    const auto change = [&](const std::string& of, const std::string& kind,
                            const std::string& now) {
      return "  const uint32_t " + of + "_bits = (((uint32_t)" + now + " - o->y_last) & " + mask +
             "u) ^ " + half + "u;\n  " + kind + of + " = (int32_t)" + of + "_bits - " + half +
             ";\n";
    };
    const std::string of_y =
        wraps ? change("y", "const int32_t ", "given") : "  const int32_t y = given;\n";
    const std::string in_range = "((uint32_t)y + " + y_most + "u) <= " + y_twice + "u";

    std::string vectors;
    FixedPlayer player(d_);
    std::uint32_t seed = 1;
    std::int64_t counter = 0;
    const auto drawn = [&](std::int64_t most) {
      seed = seed * 1664525u + 1013904223u;
      return static_cast<std::int64_t>(seed >> 8) % (2 * most + 1) - most;
    };
    const int samples = design_.options.self_test_samples;
    for (int k = 0; k < samples; ++k) {
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
        result = player.next_word(n - 1);
      }
      vectors += "    {" + text_of(wraps ? counter : y) + ", " + text_of(second) + ", " +
                 text_of(result) + "},\n";
    }

    const LoopRules& loop = design_.loop;
    const std::int64_t one = std::int64_t(1) << d_.law_scale;
    const auto fine = [&](double physical) {
      return text_of(static_cast<std::int64_t>(std::nearbyint(physical / options.u.unit)) * one);
    };
    std::string rate;
    const std::string lower = text_of(static_cast<std::int64_t>(d_.lower) * one);
    const std::string highest = text_of(static_cast<std::int64_t>(d_.upper) * one);
    std::string limits;
    std::string limit_values;
    if (design_.is_controller) {
      limits = "  int32_t lower; /* of u, in 2^-$LAW_SCALE counts */\n  int32_t upper;\n";
      limit_values = "  " + lower + ",\n  " + highest + ",\n";
    }
    if (d_.rate > 0) {
      std::string step =
          text_of(static_cast<std::int64_t>(std::floor(std::ldexp(d_.rate, d_.law_scale))));
      limits += "  int32_t rate; /* a sample */\n";
      limit_values += "  " + step + ",\n";
      if (opens_) step = "o->settings->rate";
      rate = "  if (u > (o->u_last + " + step + ")) {\n    u = o->u_last + " + step + ";\n  }\n" +
             "  if (u < (o->u_last - " + step + ")) {\n    u = o->u_last - " + step + ";\n  }\n";
    }
    const std::string flagged =
        ";\n    o->status = (uint8_t)(o->status | $NAME_REFERENCE_REJECTED);\n  }\n";
    const std::string clamp_r = wraps ? ""
                                      : "  if (r > " + y_most + ") {\n    r = " + y_most + flagged +
                                            "  if (r < -" + y_most + ") {\n    r = -" + y_most +
                                            flagged;
    std::string gain;
    for (const std::int32_t one_gain : gains_) {
      gain += (gain.empty() ? "" : ", ") + std::to_string(one_gain);
    }
    const auto table = [](const std::string& what) {
      return "  static const int32_t most[$N] = {" + what + "};\n";
    };
    const std::string type = wraps ? "uint16_t" : "int32_t";
    const auto& comment = design_.options.comment;
    words_ = {{"$include", "#include"},
              {"$REACH_TABLE", opens_ ? "" : table("$REACH")},
              {"$CORRECT_TABLES",
               opens_ ? ""
                      : "  static const int32_t m[$ROWS][$N][$N1] = { /* after 1, 2, .. samples "
                        "*/\n$CORRECT_M  };\n  static const uint8_t powers[$ROWS][$N][$N1] = "
                        "{\n$CORRECT_P  };\n" +
                            table("$BOX")},
              {"$GAINS_OF", opens_ ? "o->settings->correct[elapsed - 1u], "
                                     "o->settings->powers[elapsed - 1u]"
                                   : "m[elapsed - 1u], powers[elapsed - 1u]"},
              {"$REACH_OF", opens_ ? "o->settings->reach" : "most"},
              {"$BOX_OF", opens_ ? "o->settings->box" : "most"},
              {"$LOWER_OF", opens_ ? "o->settings->lower" : lower},
              {"$UPPER_OF", opens_ ? "o->settings->upper" : highest},
              {"$LIMITS", limits},
              {"$LIMIT_VALUES", limit_values},
              {"$GAINS", std::to_string(gains_.size())},
              {"$GAIN", gain},
              {"$MEMBERS", members},
              {"$TIME", text_of(design_.sample_time)},
              {"$UNIT_Y", text_of(options.y.unit)},
              {"$UNIT_U", text_of(options.u.unit)},
              {"$BOUNDS", bounds},
              {"$UNITS", units},
              {"$LAW_SCALE", std::to_string(d_.law_scale)},
              {"$AT_REST", wraps ? "the counter 0" : "y = 0"},
              {"$Y_TYPE", type},
              {"$LAST", std::to_string(design_.size - 1)},
              {"$OF_R",
               wraps ? change("r", "const int32_t ", "reference") : "  int32_t r = reference;\n"},
              {"$RELATIVE", wraps ? " less the last counter" : ""},
              {"$FORGET", forget},
              {"$REST_AT", rest_at},
              {"$PREDICT_M", predict_m},
              {"$PREDICT_P", predict_p},
              {"$CORRECT_M", correct_m},
              {"$CORRECT_P", correct_p},
              {"$REACH", reach},
              {"$BOX", box},
              {"$ROWS", std::to_string(d_.table_rows())},
              {"$U_MOST", std::to_string(options.u.most)},
              {"$U_TWICE", std::to_string(2 * options.u.most)},
              {"$OF_Y_SLOWLY", of_y},
              {"$OF_Y_RESET", wraps ? "" : of_y},
              {"$OF_Y", of_y},
              {"$IF_Y", wraps ? "" : "if (" + in_range + ") "},
              {"$REFUSE_Y", wraps ? ""
                                  : "  if (((uint32_t)y + " + y_most + "u) > " + y_twice +
                                        "u) {\n    return $NAME_MEASUREMENT_REJECTED;\n  }\n"},
              {"$Y_IN_GAP_RANGE", wraps ? "((uint32_t)y + ((uint32_t)elapsed * " + y_most +
                                              "u)) <= ((uint32_t)elapsed * " + y_twice + "u)"
                                        : in_range},
              {"$Y_OUT", "(((uint32_t)y + " + y_most + "u) > " + y_twice + "u)"},
              {"$Y_ABSOLUTE", wraps ? "0" : "y"},
              {"$NEW_Y", wraps ? "    o->y_last = given;\n" : ""},
              {"$ESTIMATES", estimates},
              {"$INIT", std::string(opens_ ? "  o->settings = &$name_$SET;\n" : "") +
                            (wraps ? "  o->y_last = 0u;\n" : "")},
              {"$RATE_LIMIT", rate},
              {"$HALF", text_of(one / 2)},
              {"$ONE", text_of(one)},
              {"$CLAMP_R", clamp_r},
              {"$MISSING_LIMIT", std::to_string(loop.missing_limit)},
              {"$LEAVE_SAFE", loop.stays_safe ? ""
                                              : "  if ((o->mode == $NAME_SAFE) && (o->gap < 1u)) "
                                                "{\n    o->mode = $NAME_RUNNING;\n  }\n"},
              {"$SAFE_INPUT", loop.holds_safe ? "o->u_last" : fine(loop.safe_input)},
              {"$HOLD_INPUT", text_of(d_.hold_counts() * one)},
              {"$START_FINE", text_of(d_.start_held() * one)},
              {"$START_HELD", text_of(d_.start_held())},
              {"$HOLD_LEFT", std::to_string(loop.hold_left)},
              {"$MODE", loop.hold_left > 0 ? "$NAME_START_HOLD" : "$NAME_RUNNING"},
              {"$VECTORS", vectors},
              {"$SAMPLES", std::to_string(samples)},
              {"$COLUMNS", design_.is_controller ? "y, r, u" : "y, u, the last word of the state"},
              {"$RESULT", design_.is_controller
                              ? "const int32_t result = $name_update(&o, (" + type +
                                    ")samples[i][0], (" + type + ")samples[i][1]);"
                              : "const int32_t result =\n        ($name_update(&o, (" + type +
                                    ")samples[i][0], samples[i][1]) == 0u) ? o.x[" +
                                    std::to_string(n - 1) + "] : (samples[i][2] - 1);"},
              {"$N1", std::to_string(n + 1)},
              {"$NAME", upper},
              {"$N", std::to_string(n)},
              {"$SET", settings_name},
              {"$MARK", std::to_string(mark)},
              {"$name", name},
              {"$COMMENT", comment.empty() ? "" : " * " + comment + "\n"}};
  }

  const FixedDesign& d_;
  const RecordedDesign& design_;
  bool opens_ = !design_.settings.empty();
  std::vector<std::int32_t> gains_;  ///< that may be changed while it runs
  Words words_;
};

}  // namespace detail

/// The controller or observer as C99 in 32-bit integers, two files without a library, for cores
/// without floating point. Functions and modes are those of `to_c`; y, u and the reference are
/// counts.
///
/// Each state has a scale of its own, chosen so that nothing can overflow while y and u are within
/// their declared ranges; a y outside is no measurement. What a shift leaves over is kept where the
/// bound needs it, so that a slow observer at a high rate does not stall. Where samples are missing
/// the states move in 64 bits and are held within their ranges, with a flag; after more than
/// `max_gap` samples the next good one restarts.
///
/// The bounds are worst cases over all sequences of y and u within their ranges with a measurement
/// at each sample: sums of the impulse responses from each rounding that is written to each
/// estimate. After a gap they hold again as the state that it left decays.
///
/// Written are observers whose update is linear (LinearEso, also with a set of poles, HalfGainEso,
/// CascadeEso; AlgebraicEso once it has settled and the frozen ExtendedStateFilter, which restart
/// after any gap with the gains of then) and Adrc around them up to order 2. A limit of rate may be
/// below one count a sample.
///
/// With CodeOptions::settings_in_struct, gains and limits are in a struct, and `name_adopt` takes
/// another one while it runs: CCode::settings of another design that was written with
/// FixedPointOptions::settings_for. The scales are those of the running code; gains that do not fit
/// into them, ranges that would overflow and bounds above what is allowed are refused here. A
/// switch holds each state within the range of the new settings, so no sequence of switches
/// overflows; the bounds hold again as what the old settings left decays.
///
/// Larger gains overflow the scales of a design, and so do the wider ranges of a slower one, in
/// which what u does lasts longer. So write each design alone first, then the running code with all
/// of them in FixedPointOptions::room_for, then each with `settings_for` that code:
///
///     const auto alone = to_fixed_c(slow, options);
///     options.room_for = {&*alone};
///     const auto running = to_fixed_c(fast, options);
///     options.settings_for = &*running;
///     const auto settings = to_fixed_c(slow, options);  // its code.settings
/// @param object as `make` returned it; the C begins at rest at zero
/// @return error, with what would do, for ranges that 32 bits cannot hold, a bound above what is
///         allowed, and designs that are not linear or have what is not written in fixed point
template <detail::Writable Object>
Expected<FixedCode, Error<typename Object::scalar_type>> to_fixed_c(
    const Object& object, const FixedPointOptions& options) {
  using V = typename Object::scalar_type;
  const auto recorded = detail::recorded_design(object, options.code);
  if (!recorded) return recorded.error();
  const bool given = options.settings_for != nullptr;
  detail::FixedDesign design(*recorded, options, given ? &options.settings_for->layout : nullptr);
  std::vector<FixedLayout> others;
  for (const FixedCode* other : options.room_for) {
    if (other != nullptr) others.push_back(other->layout);
  }
  if (!given) design.make_room(others);  // that code has it
  if (!design.make()) {
    const detail::FixedRefusal& no = design.refusal;
    return Error<V>{no.field, static_cast<V>(no.value), no.rule,
                    no.index, static_cast<V>(no.limit), no.has_limit};
  }
  detail::FixedText text(design);
  for (std::size_t row = 0; row < design.estimates.size(); ++row) {
    if (!text.can_estimate(row)) {
      return Error<V>{"observer", static_cast<V>(row), "has an estimate that is no sum of states"};
    }
    if (text.states_of(row) > 1) {  // what reading it shifts away
      const auto [c, scale] = text.unit_of(row);
      design.estimates[row].deviation += std::fabs(std::ldexp(c, -scale)) * text.states_of(row);
    }
  }
  const auto new_names = detail::new_names<V>(options.code, [&](const CodeOptions& as) {
    FixedPointOptions other = options;
    other.code = as;
    other.settings_for = nullptr;
    const auto code = to_fixed_c(object, other);
    return detail::text_of(code ? &code->code : nullptr);
  });
  if (!new_names) return new_names.error();
  FixedCode made{text.code(), design.estimates, design.input, design.written, design.layout};
  made.layout.mark = text.mark;
  if (given && text.mark != options.settings_for->layout.mark) {
    return Error<V>{"settings_for", static_cast<V>(text.mark),
                    "must be the code of a design with the same name, structure, sample time, b0, "
                    "ranges, max_gap and signs of its gains"};
  }
  return made;
}

/// What cannot be written yet, by name.
template <class Other>
void to_fixed_c(const Other& object, const FixedPointOptions&) {
  to_c(object);
}

}  // namespace esokit
