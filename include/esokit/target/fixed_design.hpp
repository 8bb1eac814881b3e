/// @file
/// FixedDesign: a recorded design in integers, with scales that cannot overflow and the bounds of
/// what rounding does.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/target/fixed_bounds.hpp>
#include <esokit/target/integer_list.hpp>
#include <esokit/target/recorded_design.hpp>
#include <limits>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace esokit {

/// A signal that comes or goes in counts.
struct CountedSignal {
  double unit = 0;        ///< what a count is, in the unit of the design
  std::int32_t most = 0;  ///< counts are within -most .. most, 1 .. 2^24; of a counter that wraps,
                          ///< by how many counts it changes at most from one sample to the next
  int counter_bits = 0;   ///< of y only: it is a counter of so many bits that wraps, 2 .. 16; 0: it
                          ///< does not
};

struct FixedCode;

/// How a design is to be written in fixed point.
struct FixedPointOptions {
  CountedSignal y{};         ///< the measurement
  CountedSignal u{};         ///< what the actuator held
  int innovation_bits = 32;  ///< 16 (fewer instructions) or 32

  /// For each estimate what rounding may do at most, in its unit; not given or zero: what half a
  /// count of y does.
  std::vector<double> most_deviation{};
  double most_input_deviation = 0;  ///< the same of u, in counts; 0: a count, or what half a
                                    ///< count of y does
  CodeOptions code{};               ///< name and comment, and whether settings are in a struct
  const FixedCode* settings_for = nullptr;  ///< with CodeOptions::settings_in_struct: the design is
                                            ///< for `name_adopt` of this code, with its scales
};

/// What rounding can do to an estimate or to u.
struct FixedBound {
  double deviation = 0;   ///< from the same design with the written gains in exact numbers, at most
  double by_gains = 0;    ///< by the rounding of the gains themselves, at most
  double half_count = 0;  ///< what half a count of y does, to compare
};

/// The written design in exact numbers: x(k+1) = A x(k) + by y(k) + bu u(k), in counts of y.
struct WrittenSystem {
  std::vector<double> a{};                       ///< by rows
  std::vector<double> by{};                      ///< of a counter that wraps: of its change
  std::vector<double> bu{};                      ///< for u in counts
  std::vector<std::vector<double>> estimates{};  ///< for each estimate its row of x, in its unit
  std::vector<double> law{};     ///< u in counts: for each state, then for the reference
  std::vector<int> scale{};      ///< state i is kept in 2^-scale counts
  std::vector<int> left_over{};  ///< and so many bits below
  std::vector<double> most{};    ///< the largest that y and u can make of state i, in counts
};

/// What settings that are changed while it runs leave as it is.
struct FixedLayout {
  std::vector<int> scale{};                    ///< of the states
  std::vector<bool> keeps{};                   ///< which of them keep what is left over
  bool rounds = false;                         ///< shifts round
  std::map<int, int> coarser{};                ///< scales of what is computed, by its owner
  std::map<int, int> narrow{};                 ///< scales of what has 16 bits, by its owner
  std::map<int, int> left_over{};              ///< scales of what is left over, by its owner
  std::array<std::vector<int>, 2> products{};  ///< scales of the products, of update and law
  int law_scale = 0;                           ///< u is kept in 2^-law_scale counts
  std::uint32_t mark = 0;                      ///< of the text
};

namespace detail {

/// A recorded call as numbers: what is linear in states and arguments, for each instruction.
class LinearCall {
 public:
  /// @param state_of for each number of the object which state it is, or -1
  /// @param given arguments that are numbers; NaN: the argument is a column
  /// @param settings which numbers may be changed while it runs, or empty
  LinearCall(const RecordedCall& call, const std::vector<int>& state_of,
             const std::vector<double>& values, std::size_t states,
             const std::vector<double>& given, const std::vector<bool>& settings = {})
      : constant_(states + given.size()) {
    for (const Instruction& one : call.list.instructions) {
      LinearForm form(constant_ + 1, 0.0);
      bool fine = true;
      const auto part = [&](int i) -> const LinearForm& { return of[static_cast<std::size_t>(i)]; };
      const auto number = [&](int i) { return part(i)[constant_]; };
      const auto constant = [&](int i) { return i < 0 || is_constant(i); };
      const auto good = [&](int i) { return i < 0 || linear[static_cast<std::size_t>(i)]; };
      const bool linear_parts =
          one.operation == Operation::argument || (good(one.a) && good(one.b) && good(one.c));
      const auto mix = [&](double by_a, double by_b) {
        for (std::size_t i = 0; i <= constant_; ++i) {
          form[i] = by_a * part(one.a)[i] + by_b * part(one.b)[i];
        }
      };
      if (one.operation == Operation::constant) {
        form[constant_] = one.value;
      } else if (one.operation == Operation::argument) {
        const auto from = static_cast<std::size_t>(one.a);
        if (from >= values.size()) {
          const std::size_t argument = from - values.size();
          if (std::isnan(given[argument]))
            form[states + argument] = 1;
          else
            form[constant_] = given[argument];
        } else if (state_of[from] >= 0) {
          form[static_cast<std::size_t>(state_of[from])] = 1;
        } else {
          form[constant_] = values[from];
        }
      } else if (!linear_parts) {
        fine = false;
      } else {
        const bool all = constant(one.a) && constant(one.b) && constant(one.c);
        switch (one.operation) {
          case Operation::add:
            mix(1, 1);
            break;
          case Operation::subtract:
            mix(1, -1);
            break;
          case Operation::negate:
            for (std::size_t i = 0; i <= constant_; ++i) form[i] = -part(one.a)[i];
            break;
          case Operation::multiply:
            fine = constant(one.a) || constant(one.b);
            if (!fine) break;
            {
              const int by = constant(one.a) ? one.a : one.b;
              const int what = constant(one.a) ? one.b : one.a;
              for (std::size_t i = 0; i <= constant_; ++i) form[i] = number(by) * part(what)[i];
            }
            break;
          case Operation::divide:
            fine = constant(one.b);
            for (std::size_t i = 0; fine && i <= constant_; ++i) {
              form[i] = part(one.a)[i] / number(one.b);
            }
            break;
          case Operation::less:
            form[constant_] = number(one.a) < number(one.b);
            fine = all;
            break;
          case Operation::greater:
            form[constant_] = number(one.a) > number(one.b);
            fine = all;
            break;
          case Operation::at_most:
            form[constant_] = number(one.a) <= number(one.b);
            fine = all;
            break;
          case Operation::at_least:
            form[constant_] = number(one.a) >= number(one.b);
            fine = all;
            break;
          case Operation::finite:
            form[constant_] = 1;
            fine = all;
            break;
          case Operation::choose:
            fine = constant(one.a);
            if (fine) form = part(number(one.a) > 0.5 ? one.b : one.c);
            break;
          default:
            fine = false;
        }
      }
      bool changes = false;
      if (one.operation == Operation::argument) {
        changes = static_cast<std::size_t>(one.a) < settings.size() &&
                  settings[static_cast<std::size_t>(one.a)];
      } else if (one.operation != Operation::constant) {
        for (const int i : {one.a, one.b, one.c}) {
          changes = changes || (i >= 0 && varies[static_cast<std::size_t>(i)]);
        }
      }
      of.push_back(form);
      linear.push_back(fine);
      varies.push_back(changes);
    }
  }

  std::vector<LinearForm> of{};  ///< states, arguments, the constant
  std::vector<bool> linear{};
  std::vector<bool> varies{};  ///< with the settings

  [[nodiscard]] bool is_constant(int i) const {
    const LinearForm& form = of[static_cast<std::size_t>(i)];
    for (std::size_t k = 0; k < constant_; ++k) {
      if (std::fabs(form[k]) > 0) return false;
    }
    return linear[static_cast<std::size_t>(i)];
  }
  [[nodiscard]] double number(int i) const { return of[static_cast<std::size_t>(i)][constant_]; }
  /// Linear, without a constant.
  [[nodiscard]] bool is_linear(int i) const {
    return linear[static_cast<std::size_t>(i)] && !(std::fabs(number(i)) > 0);
  }

 private:
  std::size_t constant_;
};

/// What is refused.
struct FixedRefusal {
  const char* field = nullptr;
  double value = 0;
  const char* rule = "";
  int index = -1;
  double limit = 0;
  bool has_limit = false;
};

/// A recorded design in integers.
class FixedDesign {
 public:
  using Value = IntegerValue;

  FixedDesign(const RecordedDesign& design, const FixedPointOptions& options)
      : design_(&design), options_(options), wraps_(options.y.counter_bits > 0) {}

  /// @param given scales and order that settings of this design are to fit into
  FixedDesign(const RecordedDesign& design, const FixedPointOptions& options,
              const FixedLayout* given)
      : FixedDesign(design, options) {
    given_ = given;
    if (given == nullptr) return;
    layout = *given;
    rounds_ = given->rounds;
    coarser_ = given->coarser;
    narrow_scale_ = given->narrow;
    left_over_scale_ = given->left_over;
  }
  FixedLayout layout{};

  FixedRefusal refusal{};

  IntegerList update{0};
  std::vector<int> next{};       ///< the line of the next word of each state
  std::vector<int> next_rest{};  ///< and of what is left over, or -1
  IntegerList law{0};
  int law_line = -1;
  int law_scale = 0;
  std::vector<FixedBound> estimates{};
  FixedBound input{};
  WrittenSystem written{};
  std::vector<double> box{};           ///< where a state is left after a gap, in counts of y
  std::vector<double> reach{};         ///< where it can be at all
  std::vector<std::size_t> numbers{};  ///< the number of the object of each state
  std::vector<std::size_t> first_of_level{};
  double lower = 0;  ///< of u, in counts
  double upper = 0;
  double rate = 0;  ///< counts a sample; 0: any

  [[nodiscard]] bool wraps() const { return wraps_; }
  [[nodiscard]] std::size_t states() const { return numbers.size(); }
  [[nodiscard]] const RecordedDesign& design() const { return *design_; }
  [[nodiscard]] const FixedPointOptions& options() const { return options_; }
  [[nodiscard]] double reference_most() const {
    return wraps_ ? std::ldexp(1.0, options_.y.counter_bits - 1) : options_.y.most;
  }
  /// So many samples after the last measurement the next can still be used: one, if the design has
  /// no table of gains, because they would go on.
  [[nodiscard]] int table_rows() const {
    int rows = std::max(1, static_cast<int>(design_->gap_gains.size()));
    if (wraps_) {
      const int half = (1 << (options_.y.counter_bits - 1)) - 1;
      rows = std::min(rows, half / options_.y.most);
    }
    return rows;
  }
  /// The correction so many samples after the last, in counts: states, y.
  [[nodiscard]] std::vector<LinearForm> correction_rows(int elapsed) const {
    std::vector<LinearForm> rows;
    if (design_->gap_gains.empty()) {  // of one level: x + k (y - x_1)
      for (std::size_t i = 0; i < states(); ++i) {
        rows.push_back(unit(i, states() + 1));
        rows[i][states()] = plain_by_[i];
        rows[i][0] -= plain_by_[i];
      }
    } else {
      std::vector<double> given{column};
      for (const double k : design_->gap_gains[static_cast<std::size_t>(elapsed - 1)]) {
        given.push_back(k);
      }
      rows = rows_of("correct_by", given);
    }
    for (const std::size_t i : first_of_level) rows[i][states()] -= 1;
    return rows;
  }
  /// A call as it moves the states, in counts: a row for each state, its columns states, arguments.
  [[nodiscard]] std::vector<LinearForm> rows_of(const char* name,
                                                const std::vector<double>& given) const {
    const RecordedCall& call = called(name);
    const LinearCall forms = linear(call, given);
    std::vector<LinearForm> rows;
    for (std::size_t i = 0; i < states(); ++i) {
      LinearForm row(states() + given.size(), 0.0);
      const int at = call.next[numbers[i]];
      if (at < 0)
        row[i] = 1;
      else
        row = forms.of[static_cast<std::size_t>(at)];
      row.resize(states() + given.size());
      rows.push_back(row);
    }
    return rows;
  }
  static constexpr double column = std::numeric_limits<double>::quiet_NaN();

  /// Chooses scales, builds the lists, computes the bounds; false if refused.
  bool make() {
    if (!checks() || !takes_design()) return false;
    std::vector<bool> keeps(states(), false);
    if (given_ != nullptr) {
      if (given_->keeps.size() != states() || (given_->law_scale > 0) != design_->is_controller) {
        return refuse("settings_for", static_cast<double>(states()),
                      "must be the code of such an object");
      }
      keeps = given_->keeps;
    }
    for (;;) {
      if (!builds(keeps)) return false;
      bounds();
      const int worst = exceeded();
      if (worst < 0) break;
      if (given_ != nullptr) {
        refuse_bound(worst);
        return false;
      }
      if (!rounds_) {
        rounds_ = true;
        continue;
      }
      // Keeps what the row with the largest share leaves over.
      double largest = 0;
      std::size_t row = states();
      for (std::size_t i = 0; i < states(); ++i) {
        if (!keeps[i] && share_[i] > largest) {
          largest = share_[i];
          row = i;
        }
      }
      if (row == states()) {
        refuse_bound(worst);
        return false;
      }
      keeps[row] = true;
    }
    for (std::size_t i = 0; i < estimates.size(); ++i) {
      estimates[i].by_gains = change(exact_estimates_[i], exact_estimates_[i], 0);
    }
    if (design_->is_controller && !law_fits()) return false;
    layout.scale = written.scale;
    layout.keeps = keeps;
    layout.rounds = rounds_;
    layout.coarser = coarser_;
    layout.narrow = narrow_scale_;
    layout.left_over = left_over_scale_;
    layout.law_scale = law_scale;
    return true;
  }

 private:
  static constexpr double fits = 2147400000.0;
  static constexpr std::int32_t most_gain = 32767;  ///< with 16 bits of anything in 32 bits
  static constexpr std::int32_t least_gain = 4096;
  static constexpr int fine_parts = 1000000;  ///< added to the owner of a sum

  [[nodiscard]] bool refuse(const char* field, double value, const char* rule, int index = -1) {
    if (refusal.field == nullptr) refusal = {field, value, rule, index};
    return false;
  }

  [[nodiscard]] const RecordedCall& called(const char* name) const {
    for (std::size_t i = 0; i < design_->names.size(); ++i) {
      if (design_->names[i].name == name) return design_->calls[i];
    }
    return design_->calls[0];
  }
  [[nodiscard]] LinearCall linear(const RecordedCall& call,
                                  const std::vector<double>& given) const {
    return {call, state_of_, design_->numbers, states(), given, design_->settings};
  }

  bool checks() {
    const auto& y = options_.y;
    const auto& u = options_.u;
    if (!(y.unit > 0) || std::isinf(y.unit))
      return refuse("y.unit", y.unit, "must be finite and positive");
    if (!(u.unit > 0) || std::isinf(u.unit))
      return refuse("u.unit", u.unit, "must be finite and positive");
    if (y.most < 1 || y.most > (1 << 24)) return refuse("y.most", y.most, "must be 1 .. 2^24");
    if (u.most < 1 || u.most > (1 << 24)) return refuse("u.most", u.most, "must be 1 .. 2^24");
    if (u.counter_bits != 0)
      return refuse("u.counter_bits", u.counter_bits, "must be 0: u is no counter");
    if (wraps_ && (y.counter_bits < 2 || y.counter_bits > 16)) {
      return refuse("y.counter_bits", y.counter_bits, "must be 2 .. 16, or 0");
    }
    if (wraps_ && y.most >= (1 << (y.counter_bits - 1))) {
      return refuse("y.most", y.most,
                    "must be less than half the range of the counter: of a "
                    "faster one nobody can say in which direction it went");
    }
    if (options_.innovation_bits != 16 && options_.innovation_bits != 32) {
      return refuse("innovation_bits", options_.innovation_bits, "must be 16 or 32");
    }
    if (!design_->line.empty()) {
      return refuse(
          "observer", static_cast<double>(design_->line.size() - 1),
          "is in DelayedInput, which is not written in fixed point: keep the u of earlier "
          "samples yourself");
    }
    if (design_->gate.threshold > 0) {
      return refuse("observer", design_->gate.threshold,
                    "is in OutlierGate, which is not written in fixed point");
    }
    if (design_->predictive) {
      return refuse("controller", 0, "is PredictiveAdrc, which is not written in fixed point");
    }
    if (design_->wrap.period > 0) {
      return refuse("observer", design_->wrap.period,
                    "is in WrappedOutput: in fixed point take the observer without it, and "
                    "y.counter_bits");
    }
    if (design_->guard.on) {
      return refuse("observer", design_->guard.trust,
                    "is in Guarded, which is not written in fixed point");
    }
    if (design_->measured.on) {
      return refuse("observer", design_->measured.paths[0].gain,
                    "is in Measured, which is not written in fixed point");
    }
    if (design_->known.on) {
      return refuse("observer", 0, "is in KnownModel, which is not written in fixed point");
    }
    if (design_->law.kind != RunningLaw::none && !design_->law.settled) {
      return refuse("observer", static_cast<double>(design_->law.age),
                    "has gains that go on: let it settle first (AlgebraicEso), freeze the filter "
                    "(RiccatiMode::frozen), or take a LinearEso");
    }
    if (design_->law.watches) {
      return refuse("outlier_threshold", 1, "is not written in fixed point");
    }
    if (options_.settings_for != nullptr && design_->settings.empty()) {
      return refuse("settings_in_struct", 0, "must be true for settings_for, here and there");
    }
    if (design_->loop.divider > 1) {
      return refuse("measurement_divider", design_->loop.divider, "must be 1 in fixed point");
    }
    if (design_->error_based || design_->softens || design_->compensates) {
      return refuse("controller", 0,
                    "is error-based, softens or compensates: only Adrc from y up to order 2 is "
                    "written in fixed point");
    }
    return true;
  }

  /// The linear part.
  bool takes_design() {
    state_of_.assign(design_->members.size(), -1);
    for (std::size_t i = 0; i < design_->members.size(); ++i) {
      if (design_->members[i][0] != 'z') continue;
      state_of_[i] = static_cast<int>(numbers.size());
      numbers.push_back(i);
    }
    const std::size_t n = states();
    const RecordedCall& call = called("observe");
    const LinearCall forms = linear(call, {column, column});
    const double of_u = options_.u.unit / options_.y.unit;
    exact_a_.clear();
    exact_by_.clear();
    exact_bu_.clear();
    for (std::size_t i = 0; i < n; ++i) {
      const int at = call.next[numbers[i]];
      if (at < 0 || !forms.is_linear(at)) {
        return refuse("observer", static_cast<double>(i),
                      "is not linear in its states, y and u: its gains depend on the innovation");
      }
      const LinearForm& form = forms.of[static_cast<std::size_t>(at)];
      for (std::size_t j = 0; j < n; ++j) exact_a_.push_back(form[j]);
      exact_by_.push_back(form[n]);
      exact_bu_.push_back(form[n + 1] * of_u);
    }
    plain_by_ = exact_by_;
    if (wraps_) {
      for (std::size_t i = 0; i < n; ++i) {
        if (design_->members[numbers[i]].compare(0, 2, "z1") == 0) {
          exact_by_[i] -= 1;
          first_of_level.push_back(i);
        }
      }
    }
    exact_estimates_.clear();
    for (int row = 0; row < design_->size; ++row) {
      const RecordedCall& estimate = called(("estimate_" + std::to_string(row)).c_str());
      const LinearCall of(linear(estimate, {}));
      const int at = estimate.outputs[0];
      if (!of.is_linear(at)) return refuse("observer", row, "has an estimate that is not linear");
      LinearForm c = of.of[static_cast<std::size_t>(at)];
      c.resize(n);
      for (double& x : c) x *= options_.y.unit;
      exact_estimates_.push_back(c);
    }
    weights_ = weights();
    worst_ = plain_ = WorstCase(static_cast<int>(n), exact_a_, weights_);
    if (!worst_.stable()) return refuse("observer", 0, "does not decay within 4 million samples");
    forced_.clear();
    for (std::size_t i = 0; i < n; ++i) {
      const auto sums = worst_.sums(unit(i, n), {exact_by_, exact_bu_});
      forced_.push_back(sums[0].most(-options_.y.most, options_.y.most) +
                        sums[1].most(-options_.u.most, options_.u.most));
    }
    return !design_->is_controller || takes_limits();
  }

  /// Sizes of the states by which the norm is taken: what y does to them in 20,000 samples.
  [[nodiscard]] std::vector<double> weights() const {
    const std::size_t n = states();
    std::vector<double> sizes(n, 1e-30);
    std::vector<double> x = plain_by_;
    for (int k = 0; k < 20000; ++k) {
      std::vector<double> to(n, 0.0);
      for (std::size_t i = 0; i < n; ++i) {
        for (std::size_t j = 0; j < n; ++j) to[i] += exact_a_[i * n + j] * x[j];
        sizes[i] += std::fabs(x[i]);
      }
      x = to;
    }
    return sizes;
  }

  static LinearForm unit(std::size_t i, std::size_t n) {
    LinearForm form(n, 0.0);
    form[i] = 1;
    return form;
  }

  bool takes_limits() {
    lower = design_->lower / options_.u.unit;
    upper = design_->upper / options_.u.unit;
    const double most = options_.u.most;
    if (!(lower >= -most) || !(upper <= most)) {
      return refuse("u.most", most, "must hold the limits of the controller in counts");
    }
    for (const double count : {lower, upper}) {
      if (std::fabs(count - std::nearbyint(count)) > 1e-6) {
        return refuse("u.unit", count, "must make the limits of the controller whole counts");
      }
    }
    lower = std::nearbyint(lower);
    upper = std::nearbyint(upper);
    const RecordedCall& limit = called("limit");
    std::vector<double> values = design_->numbers;
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (design_->members[i] == "u_low") values[i] = design_->lower;
      if (design_->members[i] == "u_high") values[i] = design_->upper;
    }
    const LinearCall at_lower(limit, std::vector<int>(values.size(), -1), values, 0,
                              {design_->lower});
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (design_->members[i] != "u_high" || limit.next[i] < 0) continue;
      const double high = at_lower.number(limit.next[i]);
      if (high < design_->upper) rate = (high - design_->lower) / options_.u.unit;
    }
    const LinearCall forms = linear(called("law"), {column});
    if (!forms.is_linear(called("law").outputs[0])) {
      return refuse("controller", 0, "has a law that is not linear");
    }
    exact_law_ = forms.of[static_cast<std::size_t>(called("law").outputs[0])];
    exact_law_.resize(states() + 1);
    for (double& x : exact_law_) x *= options_.y.unit / options_.u.unit;
    return true;
  }

  // ---- Building.

  struct Term {
    double coefficient;
    int node;
    bool varies = false;  ///< with the settings
  };

  /// A power of two times a small odd number.
  static bool is_short(double c, int& odd, int& exponent) {
    double mantissa = std::frexp(std::fabs(c), &exponent);
    for (int bits = 0; bits < 3; ++bits) {
      mantissa *= 2;
      --exponent;
      if (std::fabs(mantissa - std::nearbyint(mantissa)) <= 0) {
        odd = static_cast<int>(std::nearbyint(mantissa));
        return true;
      }
    }
    return false;
  }

  static bool is_short(const Term& one, int& odd, int& exponent) {
    return !one.varies && is_short(one.coefficient, odd, exponent);
  }

  /// Builds one recorded call.
  struct Builder {
    FixedDesign* of;
    const RecordedCall* call;
    LinearCall forms;
    IntegerList* list;
    int owners;                                     ///< the first owner number of kept results
    double factor;                                  ///< of the result
    bool narrows;                                   ///< what is multiplied, to 16 bits
    std::vector<std::pair<double, double>> inputs;  ///< a factor and the most of each argument
    std::vector<bool> kept{};
    std::map<int, Value> values{};
    std::vector<Value> words{};
    std::vector<Value> rests{};
    std::vector<int> narrow{};  ///< lines of 16 bits
    std::size_t products = 0;

    [[nodiscard]] const Instruction& at(int i) const {
      return call->list.instructions[static_cast<std::size_t>(i)];
    }
    [[nodiscard]] bool is_sum(int i) const {
      const Operation operation = at(i).operation;
      return operation == Operation::add || operation == Operation::subtract;
    }
    /// Whether a number is short whatever the settings are.
    [[nodiscard]] bool stays_short(int i) const {
      int odd = 0;
      int exponent = 0;
      return !forms.varies[static_cast<std::size_t>(i)] && is_short(forms.number(i), odd, exponent);
    }
    void collect(int i, double by, bool inside, std::vector<Term>& terms, int open,
                 bool varies = false) const {
      const Instruction& one = at(i);
      if (forms.is_constant(i)) return;
      if (one.operation == Operation::argument ||
          (inside && kept[static_cast<std::size_t>(i)] && i != open)) {
        for (Term& term : terms) {
          if (term.node == i) {
            term.coefficient += by;
            term.varies = term.varies || varies;
            return;
          }
        }
        terms.push_back({by, i, varies});
      } else if (one.operation == Operation::multiply) {
        const bool first = forms.is_constant(one.a);
        collect(first ? one.b : one.a, by * forms.number(first ? one.a : one.b), true, terms, open,
                varies || forms.varies[static_cast<std::size_t>(first ? one.a : one.b)]);
      } else if (one.operation == Operation::divide) {
        collect(one.a, by / forms.number(one.b), true, terms, open,
                varies || forms.varies[static_cast<std::size_t>(one.b)]);
      } else {
        collect(one.a, one.operation == Operation::negate ? -by : by, true, terms, open, varies);
        if (is_sum(i)) {
          collect(one.b, one.operation == Operation::subtract ? -by : by, true, terms, open,
                  varies);
        }
      }
    }
    /// What has a name: sums used more than once, and what is multiplied.
    void find_kept(const std::vector<int>& wanted) {
      const std::size_t count = call->list.instructions.size();
      std::vector<int> uses(count, 0);
      std::vector<bool> need(count, false);
      kept.assign(count, false);
      for (const int i : wanted) {
        need[static_cast<std::size_t>(i)] = true;
        ++uses[static_cast<std::size_t>(i)];
      }
      for (std::size_t i = count; i-- > 0;) {
        const Instruction& one = call->list.instructions[i];
        if (!need[i] || one.operation == Operation::argument) continue;
        for (const int part : {one.a, one.b}) {
          if (part < 0 || forms.is_constant(part)) continue;
          need[static_cast<std::size_t>(part)] = true;
          ++uses[static_cast<std::size_t>(part)];
          if (one.operation == Operation::multiply &&
              !stays_short(forms.is_constant(one.a) ? one.a : one.b)) {
            uses[static_cast<std::size_t>(part)] += 2;
          }
          // What is multiplied by a short number is used once more.
          if (one.operation == Operation::multiply && uses[i] > 1) {
            ++uses[static_cast<std::size_t>(part)];
          }
        }
      }
      for (std::size_t i = 0; i < count; ++i) {
        kept[i] = need[i] && uses[i] > 1 && is_sum(static_cast<int>(i));
      }
    }

    /// Factor and most of an argument of the call; null for all else.
    [[nodiscard]] const std::pair<double, double>* input_of(int node) const {
      if (at(node).operation != Operation::argument) return nullptr;
      if (of->state_of_argument(at(node).a) >= 0) return nullptr;
      return &inputs[static_cast<std::size_t>(at(node).a) - of->design_->members.size()];
    }
    [[nodiscard]] bool is_narrow(const Value& v) const {
      return std::find(narrow.begin(), narrow.end(), v.line) != narrow.end();
    }

    /// c v near a scale, as a product with a gain of 12 to 15 bits.
    Value product(double c, const Value& v, double most, int scale, bool full, bool varies,
                  bool& negative) {
      negative = c < 0;
      const bool high = !is_narrow(v) && !(most > 0);
      const int offset = high ? 16 - v.scale : -v.scale;
      const double largest = most > 0 ? std::floor(1073741824.0 / most) : most_gain;
      const double least = most > 0 ? largest / 8 : double{least_gain};
      const auto gain = [&](int s) { return std::fabs(c) * std::ldexp(1.0, s + offset); };
      auto& scales = of->layout.products[list == &of->law ? 1 : 0];
      const bool known = of->given_ != nullptr && products < scales.size();
      int s = known ? scales[products] : scale;
      while (!known && gain(s) > largest) --s;
      if (gain(s) > largest) of->gain_too_large_ = gain(s) / largest;
      if (known || !(gain(s) > 0)) {
        // As it is.
      } else if (full || gain(s) < (most > 0 ? double{least_gain} : least)) {
        while (gain(s + 1) <= largest && (full || gain(s) < largest / 4)) ++s;
      }
      if (!known) scales.push_back(s);
      list->setting = varies ? static_cast<int>(products) : -1;
      ++products;
      const auto rounded = static_cast<std::int32_t>(std::lround(std::min(gain(s), largest)));
      const Value result =
          high ? list->times_high(v, rounded, s, of->rounds_) : list->times(v, rounded, s);
      list->setting = -1;
      return result;
    }

    /// A term at its own scale, or near `scale`; three times a number is not finer than needed.
    Value term(const Term& one, int scale, bool full, bool& negative) {
      const auto* given = input_of(one.node);
      const double c = one.coefficient * (given == nullptr ? 1.0 : given->first);
      const Value v = value(one.node);
      int odd = 0;
      int exponent = 0;
      if (!one.varies && is_short(c, odd, exponent)) {
        negative = c < 0;
        Value shifted = v;
        shifted.scale -= exponent;
        for (double& x : shifted.form) x = std::ldexp(x, exponent);
        if (odd == 1) return shifted;
        const Value near = list->to_scale(shifted, std::min(shifted.scale, scale + 2), of->rounds_);
        return list->times(near, odd, near.scale);
      }
      return product(c, v, given == nullptr ? 0 : given->second, scale, full, one.varies, negative);
    }

    /// The sum of terms at a scale.
    Value sum(const std::vector<Term>& terms, int scale, bool full) {
      std::vector<std::pair<Value, bool>> fine;
      std::vector<std::pair<Value, bool>> rest;
      for (const Term& one : terms) {
        bool negative = false;
        const Value v = term(one, scale, full, negative);
        (v.scale > scale ? fine : rest).emplace_back(v, negative);
      }
      // Positive terms first; whether the result is the negative of the sum.
      const auto add = [&](std::vector<std::pair<Value, bool>>& parts, int to) {
        std::stable_sort(parts.begin(), parts.end(),
                         [](const auto& x, const auto& y) { return !x.second && y.second; });
        const bool negative = parts[0].second;
        Value total = list->to_scale(parts[0].first, to, of->rounds_);
        for (std::size_t i = 1; i < parts.size(); ++i) {
          total = list->sum(total, list->to_scale(parts[i].first, to, of->rounds_),
                            parts[i].second != negative);
        }
        return std::pair<Value, bool>(total, negative);
      };
      if (!fine.empty()) {
        const int owner = list->owner;
        int common = fine[0].first.scale;
        for (const auto& part : fine) common = std::min(common, part.first.scale);
        list->owner = owner + fine_parts;
        common = std::max(scale, common - of->coarser_[list->owner]);
        const auto [total, negative] = add(fine, common);
        list->owner = owner;
        rest.emplace_back(list->to_scale(total, scale, of->rounds_), negative);
      }
      const auto [total, negative] = add(rest, scale);
      return negative ? list->times(total, -1, scale) : total;
    }

    /// The coarsest scale among what is not an input and not multiplied; what may be finer else.
    [[nodiscard]] int natural(const std::vector<Term>& terms, bool finest) {
      int found = 1000;
      for (const Term& one : terms) {
        int odd = 0;
        int exponent = 0;
        if (input_of(one.node) != nullptr) continue;
        if (!is_short(one, odd, exponent)) continue;
        const int s = value(one.node).scale - exponent;
        if (found == 1000 || (finest ? s > found : s < found)) found = s;
      }
      return found;
    }

    /// The state whose scale is that of the sum: if the sum does not fit, it is that of the state
    /// that has to be coarser, so that nothing is shifted.
    [[nodiscard]] int root(const std::vector<Term>& terms) {
      const int scale = natural(terms, false);
      for (const Term& one : terms) {
        int odd = 0;
        int exponent = 0;
        if (input_of(one.node) != nullptr || !is_short(one, odd, exponent)) continue;
        if (value(one.node).scale - exponent != scale) continue;
        if (at(one.node).operation == Operation::argument) {
          return of->state_of_argument(at(one.node).a);
        }
        return of->root_of_[owners + one.node];
      }
      return -1;
    }

    Value value(int node) {
      const auto known = values.find(node);
      if (known != values.end()) return known->second;
      const Instruction& one = at(node);
      Value result;
      if (one.operation == Operation::argument) {
        const int state = of->state_of_argument(one.a);
        if (state >= 0) {
          result = words[static_cast<std::size_t>(state)];
        } else {
          const auto number = static_cast<std::size_t>(one.a) - of->design_->members.size();
          result = list->argument(static_cast<int>(number), of->states() + number);
        }
      } else {
        std::vector<Term> terms;
        collect(node, 1, false, terms, -1);
        const int owner = owners + node;
        for (const Term& part : terms) (void)value(part.node);
        list->owner = owner;
        int scale = natural(terms, false);
        if (scale == 1000) scale = 14;
        scale -= of->coarser_[owner];
        of->root_of_[owner] = root(terms);
        result = sum(terms, scale, false);
        if (narrows && is_multiplied(node)) {
          // Its scale: owner of the narrow one.
          const int to =
              std::min(result.scale, of->narrow_scale_.count(owner) > 0 ? of->narrow_scale_[owner]
                                                                        : result.scale);
          result = list->to_scale(result, to, of->rounds_);
          narrow.push_back(result.line);
          of->narrow_lines_.emplace_back(list, result.line, owner);
        }
      }
      values[node] = result;
      return result;
    }
    /// The innovation: what is multiplied by gains that are not short.
    [[nodiscard]] bool is_multiplied(int node) const {
      for (const Instruction& one : call->list.instructions) {
        if (one.operation != Operation::multiply || (one.a != node && one.b != node)) continue;
        const int other = one.a == node ? one.b : one.a;
        if (forms.is_constant(other) && !stays_short(other)) return true;
      }
      return false;
    }
  };

  [[nodiscard]] int state_of_argument(int argument) const {
    const auto from = static_cast<std::size_t>(argument);
    return from < state_of_.size() ? state_of_[from] : -1;
  }
  bool builds(const std::vector<bool>& keeps) {
    for (int round = 0; round < 400; ++round) {
      again_ = false;
      build(keeps);
      if (again_) continue;
      if (gain_too_large_ > 0) return refuse_settings(gain_too_large_);
      if (!finds_system()) return refuse("observer", 0, "does not decay with gains of 15 bits");
      const auto [owner, bits] = overflowing(update, false);
      if (bits == 0) return true;
      if (given_ != nullptr) return refuse_settings(std::ldexp(1.0, bits));
      const auto root = root_of_.find(owner);
      coarser_[root != root_of_.end() && root->second >= 0 ? root->second : owner] += bits;
    }
    return refuse("y.most", options_.y.most,
                  "is too large a range for 32 bits: choose larger counts "
                  "or a smaller range");
  }

  bool refuse_settings(double times) {
    return refuse("settings_for", times,
                  "times what the scales of that code hold comes of these gains: write that code "
                  "from this design, and the other as its settings");
  }

  void build(const std::vector<bool>& keeps) {
    const std::size_t n = states();
    update = IntegerList(n + 2);
    narrow_lines_.clear();
    gain_too_large_ = 0;
    if (given_ == nullptr) layout.products[0].clear();
    const RecordedCall& call = called("observe");
    const std::vector<double> given{column, column};
    of_u_ = options_.u.unit / options_.y.unit;
    Builder builder{this,
                    &call,
                    linear(call, given),
                    &update,
                    static_cast<int>(2 * n),
                    1,
                    options_.innovation_bits == 16,
                    {{1.0, options_.y.most}, {of_u_, options_.u.most}}};
    std::vector<int> wanted;
    for (std::size_t i = 0; i < n; ++i) wanted.push_back(call.next[numbers[i]]);
    builder.find_kept(wanted);
    written.scale.assign(n, 0);
    written.left_over.assign(n, 0);
    for (std::size_t i = 0; i < n; ++i) {
      update.owner = static_cast<int>(i);
      int s = static_cast<int>(std::floor(std::log2(fits / forced_[i])));
      written.scale[i] = given_ != nullptr ? given_->scale[i] : s - coarser_[static_cast<int>(i)];
      if (!keeps[i])
        builder.words.push_back(update.state(static_cast<int>(i), written.scale[i], 0, nullptr));
      else
        builder.words.push_back({});
      builder.rests.push_back({});
    }
    // Rows that keep what is left over: how many bits.
    for (std::size_t i = 0; i < n; ++i) {
      if (!keeps[i]) continue;
      const int own = static_cast<int>(i);
      const int acc =
          left_over_scale_.count(own) > 0 ? left_over_scale_[own] : written.scale[i] + 16;
      written.left_over[i] =
          std::clamp(acc - coarser_[static_cast<int>(n) + own] - written.scale[i], 1, 30);
      builder.words[i] =
          update.state(own, written.scale[i], written.left_over[i], &builder.rests[i]);
    }
    next.assign(n, -1);
    next_rest.assign(n, -1);
    next_form_.assign(n, {});
    // Results that are the next of a state and used by others come when they are needed.
    for (std::size_t i = 0; i < n; ++i) {
      const int node = call.next[numbers[i]];
      build_row(builder, i, node, keeps[i]);
    }
  }

  void build_row(Builder& b, std::size_t i, int node, bool keeps) {
    const std::size_t n = states();
    std::vector<Term> terms;
    b.collect(node, 1, false, terms, -1);
    // Without what is left over, what contains the state itself has its scale.
    const auto self = [&](const Term& t) {
      return b.at(t.node).operation == Operation::argument &&
             state_of_argument(b.at(t.node).a) == static_cast<int>(i);
    };
    const int s = written.scale[i];
    if (keeps) {
      for (int round = 0; round < 4; ++round) {
        std::vector<Term> open;
        for (const Term& t : terms) {
          std::vector<Term> inner;
          bool has_self = false;
          if (b.at(t.node).operation != Operation::argument && !t.varies &&
              !(std::fabs(t.coefficient - 1) > 0)) {
            b.collect(t.node, 1, false, inner, -1);
            has_self = contains(b, inner, i, 3);
          }
          if (!has_self) inner = {t};
          for (const Term& part : inner) {
            bool found = false;
            for (Term& o : open) {
              if (o.node == part.node) {
                o.coefficient += part.coefficient;
                o.varies = o.varies || part.varies;
                found = true;
              }
            }
            if (!found) open.push_back(part);
          }
        }
        terms = open;
      }
      std::vector<Term> others;
      for (const Term& t : terms) {
        if (!self(t)) others.push_back(t);
      }
      for (const Term& t : others) (void)b.value(t.node);
      update.owner = static_cast<int>(n + i);
      const int acc_scale = s + written.left_over[i];
      if (left_over_scale_.count(static_cast<int>(i)) == 0) {
        // First the natural scale: of what comes finer, and of full gains.
        const int fine = b.natural(others, true);
        bool negative = false;
        int product = 1000;
        for (const Term& t : others) {
          int odd = 0;
          int exponent = 0;
          if (is_short(t, odd, exponent)) continue;
          if (b.input_of(t.node) != nullptr) continue;
          product = std::min(product, b.term(t, s, true, negative).scale);
        }
        int scale = fine == 1000 ? product : std::min(fine, product);
        if (scale == 1000) scale = s + 16;
        left_over_scale_[static_cast<int>(i)] = scale > s ? scale : s + 1;
        again_ = true;
      }
      Value acc = b.sum(others, acc_scale, false);
      acc = update.sum(acc, b.rests[i], false);
      const Value up = update.to_scale(acc, s, false);
      update.owner = static_cast<int>(i);
      Value to = update.sum(b.words[i], up, false);
      next_rest[i] = update.low_bits(acc, written.left_over[i]).line;
      LinearForm form = b.words[i].form;
      form.resize(std::max(form.size(), acc.form.size()), 0.0);
      for (std::size_t k = 0; k < acc.form.size(); ++k) form[k] += acc.form[k];
      b.values[node] = to;
      finish_row(i, to, form);
    } else {
      for (const Term& t : terms) (void)b.value(t.node);
      update.owner = static_cast<int>(i);
      const Value to = b.sum(terms, s, false);
      b.values[node] = to;
      finish_row(i, to, to.form);
    }
  }

  void finish_row(std::size_t i, Value to, LinearForm form) {
    const std::size_t n = states();
    if (wraps_ &&
        std::find(first_of_level.begin(), first_of_level.end(), i) != first_of_level.end()) {
      const Value y = update.to_scale(update.argument(0, n), to.scale, false);
      to = update.sum(to, y, true);
      form[n] -= 1;
    }
    next[i] = to.line;
    next_form_[i] = form;
  }

  [[nodiscard]] bool contains(const Builder& b, const std::vector<Term>& terms, std::size_t state,
                              int depth) const {
    for (const Term& t : terms) {
      if (b.at(t.node).operation == Operation::argument) {
        if (state_of_argument(b.at(t.node).a) == static_cast<int>(state)) return true;
      } else if (depth > 0) {
        std::vector<Term> inner;
        b.collect(t.node, 1, false, inner, -1);
        if (contains(b, inner, state, depth - 1)) return true;
      }
    }
    return false;
  }

  // ---- Judging.

  /// The system of the lists; false if it does not decay.
  bool finds_system() {
    const std::size_t n = states();
    written.a.clear();
    written.by.clear();
    written.bu.clear();
    by_rounding_.assign(update.roundings.size(), LinearForm(n, 0.0));
    for (std::size_t i = 0; i < n; ++i) {
      LinearForm& form = next_form_[i];
      form.resize(n + 2 + update.roundings.size(), 0.0);
      for (std::size_t j = 0; j < n; ++j) written.a.push_back(form[j]);
      written.by.push_back(form[n]);
      written.bu.push_back(form[n + 1]);
      for (std::size_t e = 0; e < update.roundings.size(); ++e)
        by_rounding_[e][i] = form[n + 2 + e];
    }
    worst_ = WorstCase(static_cast<int>(n), written.a, weights_);
    if (!worst_.stable()) return false;
    box.clear();
    for (std::size_t i = 0; i < n; ++i) {
      box.push_back(most_at(unit(i, n), nullptr) + std::ldexp(2.0, -written.scale[i]));
    }
    written.most = box;
    reach.clear();
    for (std::size_t i = 0; i < n; ++i) {
      double free = 0;
      reach.push_back(most_at(unit(i, n), &free) + free + std::ldexp(2.0, -written.scale[i]));
    }
    // In a gap the prediction runs away from the last count.
    if (!first_of_level.empty()) {
      const auto rows = rows_of("predict_step", {column});
      for (const std::size_t i : first_of_level) {
        double change = std::fabs(rows[i][n]) * of_u_ * options_.u.most;
        for (std::size_t j = 0; j < n; ++j) change += j == i ? 0 : std::fabs(rows[i][j]) * reach[j];
        reach[i] += change * static_cast<double>(table_rows());
      }
    }
    return true;
  }

  /// The most that a form can be: of inputs and roundings of all times. @param free adds the most
  /// from states anywhere in the box
  [[nodiscard]] double most_at(const LinearForm& form, double* free) const {
    const std::size_t n = states();
    std::vector<LinearForm> inputs{written.by, written.bu};
    inputs.insert(inputs.end(), by_rounding_.begin(), by_rounding_.end());
    LinearForm c(form.begin(), form.begin() + static_cast<std::ptrdiff_t>(n));
    const auto sums = worst_.sums(c, inputs, box, free);
    double total = 0;
    const auto direct = [&](std::size_t at) { return at < form.size() ? form[at] : 0.0; };
    for (std::size_t j = 0; j < inputs.size(); ++j) {
      const double low = j == 0   ? -options_.y.most
                         : j == 1 ? -options_.u.most
                                  : update.roundings[j - 2].low;
      const double high = j == 0   ? options_.y.most
                          : j == 1 ? options_.u.most
                                   : update.roundings[j - 2].high;
      total += sums[j].most(low, high);
      const double d = direct(n + j);
      total += std::max(std::fabs(d * low), std::fabs(d * high));
    }
    return total;
  }

  /// The owner of a line that might not fit, and how many bits its scale has to be coarser; none if
  /// all fit. @param in_box the states are anywhere in their reach, else where the inputs bring
  /// them
  std::pair<int, int> overflowing(const IntegerList& list, bool in_box) {
    const std::size_t n = states();
    for (std::size_t i = 0; i < list.lines.size(); ++i) {
      const IntegerLine& one = list.lines[i];
      double most = 0;
      if (one.operation == IntegerOperation::low_bits ||
          one.operation == IntegerOperation::remainder) {
        continue;
      }
      if (in_box) {
        for (std::size_t j = 0; j < one.form.size(); ++j) {
          const double by = std::fabs(one.form[j]);
          if (j < n)
            most += by * reach[j];
          else if (j == n)
            most += by * reference_most();
          else
            most += by * std::max(-list.roundings[j - n - 1].low, list.roundings[j - n - 1].high);
        }
      } else if (one.operation == IntegerOperation::state) {
        most = reach[static_cast<std::size_t>(one.a)];
      } else {
        double free = 0;
        most = most_at(one.form, &free);
        most += free;
      }
      most = std::ldexp(most, one.scale) + 2;
      for (const IntegerLine& user : list.lines) {
        if (user.operation == IntegerOperation::round_down && user.a == static_cast<int>(i)) {
          most += std::ldexp(0.5, user.constant);
          break;
        }
      }
      for (const auto& [of, line, owner] : narrow_lines_) {
        if (of == &list && line == static_cast<int>(i) && !(most <= 32767)) {
          const int bits = static_cast<int>(std::ceil(std::log2(most / 32767)));
          narrow_scale_[owner] = one.scale - bits;
          return {owner_of_narrow_, bits};
        }
      }
      if (!(most <= fits)) {
        return {one.owner, static_cast<int>(std::ceil(std::log2(most / fits)))};
      }
    }
    return {0, 0};
  }

  void bounds() {
    const std::size_t n = states();
    estimates.clear();
    written.estimates = exact_estimates_;
    share_.assign(n, 0.0);
    for (const LinearForm& c : exact_estimates_) estimates.push_back(bound(c, 0, true));
  }

  /// Of an estimate, with what the reading of words adds.
  FixedBound bound(const LinearForm& c, double direct, bool reads) {
    const std::size_t n = states();
    FixedBound found;
    found.deviation = direct;
    const auto sums = worst_.sums(c, by_rounding_);
    std::vector<double> shares(n, 0.0);
    for (std::size_t e = 0; e < sums.size(); ++e) {
      const double part = sums[e].most(update.roundings[e].low, update.roundings[e].high);
      found.deviation += part;
      // The row that it enters most.
      std::size_t row = 0;
      double largest = 0;
      for (std::size_t i = 0; i < n; ++i) {
        const double enters = std::fabs(by_rounding_[e][i]) / forced_[i];
        if (enters > largest) {
          largest = enters;
          row = i;
        }
      }
      shares[row] += part;
    }
    for (std::size_t i = 0; i < n; ++i) {
      share_[i] = std::max(share_[i], found.deviation > 0 ? shares[i] / found.deviation : 0.0);
      if (reads && written.left_over[i] > 0)
        found.deviation += std::fabs(c[i]) * std::ldexp(1.0, -written.scale[i]);
    }
    found.half_count = plain_.sums(c, {plain_by_})[0].most(-0.5, 0.5);
    return found;
  }

  /// What another system with other rows does at most.
  [[nodiscard]] double change(const LinearForm& exact, const LinearForm& now, double direct) const {
    const std::size_t n = states();
    std::vector<double> a(4 * n * n, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        a[i * 2 * n + j] = exact_a_[i * n + j];
        a[(i + n) * 2 * n + n + j] = written.a[i * n + j];
      }
    }
    std::vector<double> sizes = weights_;
    sizes.insert(sizes.end(), sizes.begin(), sizes.end());
    const auto joined = [](LinearForm first, const LinearForm& second, double by) {
      for (const double x : second) first.push_back(by * x);
      return first;
    };
    const WorstCase both(static_cast<int>(2 * n), a, sizes);
    const auto sums = both.sums(joined(exact, now, -1), {joined(exact_by_, written.by, 1),
                                                         joined(exact_bu_, written.bu, 1)});
    return sums[0].most(-options_.y.most, options_.y.most) +
           sums[1].most(-options_.u.most, options_.u.most) + direct;
  }

  /// The first estimate above what is allowed, or -1.
  [[nodiscard]] int exceeded() const {
    for (std::size_t i = 0; i < estimates.size(); ++i) {
      if (!(estimates[i].deviation <= allowed(i))) return static_cast<int>(i);
    }
    return -1;
  }
  [[nodiscard]] double allowed(std::size_t i) const {
    const bool given = i < options_.most_deviation.size() && options_.most_deviation[i] > 0;
    return given ? options_.most_deviation[i] : estimates[i].half_count;
  }

  void refuse_bound(int i) {
    const auto at = static_cast<std::size_t>(i);
    refusal = {
        "most_deviation",
        estimates[at].deviation,
        options_.innovation_bits == 16
            ? "is what rounding does to this estimate at most: 32 bits of innovation_bits, a "
              "smaller y.most, or a longer sample time would do; allowed is"
            : "is what rounding does to this estimate at most: a smaller y.most or a longer "
              "sample time would do; allowed is",
        i,
        allowed(at),
        true};
  }

  // ---- The law.

  bool law_fits() {
    const std::size_t n = states();
    const RecordedCall& call = called("law");
    double range = 0;
    for (std::size_t i = 0; i < n; ++i) range += std::fabs(exact_law_[i]) * reach[i];
    range += std::fabs(exact_law_[n]) * reference_most() + options_.u.most;
    law_scale = std::min(16, static_cast<int>(std::floor(std::log2(fits / 2 / range))));
    if (given_ != nullptr) {
      if (law_scale < given_->law_scale) {
        return refuse_settings(std::ldexp(1.0, given_->law_scale - law_scale));
      }
      law_scale = given_->law_scale;
    }
    for (int round = 0; round < 100; ++round) {
      if (law_scale < 2) {
        return refuse(
            "controller", range,
            "can ask for so many counts of u that 32 bits do not hold "
            "them beside a quarter of a count: lower the controller's bandwidth or y.most");
      }
      law = IntegerList(n + 1);
      if (given_ == nullptr) layout.products[1].clear();
      Builder builder{this,
                      &call,
                      linear(call, {column}),
                      &law,
                      100000,
                      options_.y.unit / options_.u.unit,
                      false,
                      {{1.0, reference_most()}}};
      const int output = call.outputs[0];
      builder.find_kept({output});
      builder.kept[static_cast<std::size_t>(output)] = false;
      for (std::size_t i = 0; i < n; ++i) {
        Value rest;
        builder.words.push_back(
            law.state(static_cast<int>(i), written.scale[i], written.left_over[i], &rest));
      }
      std::vector<Term> terms;
      builder.collect(output, builder.factor, false, terms, -1);
      law.owner = 0;
      // What is multiplied keeps its own owner.
      for (const Term& t : terms) (void)builder.value(t.node);
      law.owner = 0;
      const Value u = builder.sum(terms, law_scale, false);
      law_line = u.line;
      const auto [owner, more] = overflowing(law, true);
      if (gain_too_large_ > 0) return refuse_settings(gain_too_large_);
      if (given_ != nullptr && more > 0) return refuse_settings(std::ldexp(1.0, more));
      if (more == 0) {
        judge_law(u.form);
        return judges_input();
      }
      if (owner == 0)
        law_scale -= more;
      else
        coarser_[owner] += more;
    }
    return refuse("controller", range, "does not fit into 32 bits");
  }

  void judge_law(LinearForm form) {
    const std::size_t n = states();
    written.law.assign(form.begin(), form.begin() + static_cast<std::ptrdiff_t>(n) + 1);
    double direct = 0.5;  // to whole counts
    for (std::size_t e = 0; e + n + 1 < form.size(); ++e) {
      direct += std::fabs(form[n + 1 + e]) * std::max(-law.roundings[e].low, law.roundings[e].high);
    }
    LinearForm c(written.law.begin(), written.law.begin() + static_cast<std::ptrdiff_t>(n));
    LinearForm exact(exact_law_.begin(), exact_law_.begin() + static_cast<std::ptrdiff_t>(n));
    input = bound(c, direct, false);  // the list of the law has what reading adds
    input.by_gains = change(exact, c, std::fabs(exact_law_[n] - written.law[n]) * reference_most());
  }

  bool judges_input() {
    const double most = options_.most_input_deviation > 0 ? options_.most_input_deviation
                                                          : std::max(input.half_count, 1.0);
    if (rate > 0 && std::ldexp(rate, law_scale) < 64) {
      refusal = {
          "limits.rate",
          rate,
          "is fewer counts of u a sample than are kept to a hundredth: choose a longer sample "
          "time or smaller counts of u; the least is",
          -1,
          std::ldexp(64.0, -law_scale),
          true};
      return false;
    }
    if (input.deviation <= most) return true;
    refusal = {"most_input_deviation",
               input.deviation,
               "is what rounding does to u at most, in counts: 32 bits of innovation_bits, larger "
               "counts of u or a smaller y.most would do; allowed is",
               -1,
               most,
               true};
    return false;
  }

  const RecordedDesign* design_;
  const FixedLayout* given_ = nullptr;
  double gain_too_large_ = 0;  ///< times what its scale holds
  FixedPointOptions options_;
  bool wraps_;
  std::vector<int> state_of_;
  std::vector<double> exact_a_;
  std::vector<double> exact_by_;
  std::vector<double> exact_bu_;
  std::vector<double> plain_by_;  ///< for y itself, also of a counter that wraps
  std::vector<LinearForm> exact_estimates_;
  LinearForm exact_law_;
  std::vector<double> forced_;
  WorstCase worst_;
  std::map<int, int> coarser_;
  std::map<int, int> root_of_;
  std::map<int, int> narrow_scale_;
  std::map<int, int> left_over_scale_;
  std::vector<std::tuple<const IntegerList*, int, int>> narrow_lines_;
  std::vector<LinearForm> next_form_;
  std::vector<LinearForm> by_rounding_;
  std::vector<double> share_;
  std::vector<double> weights_;
  WorstCase plain_;  ///< of the design itself
  bool again_ = false;
  bool rounds_ = false;  ///< shifts round: a number more to add
  double of_u_ = 1;
  static constexpr int owner_of_narrow_ = 900000;
};

}  // namespace detail
}  // namespace esokit
