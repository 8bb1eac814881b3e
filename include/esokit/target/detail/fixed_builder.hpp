/// @file
/// FixedBuilder: the lines of a design in integers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/target/detail/fixed_bounds.hpp>
#include <esokit/target/detail/fixed_record.hpp>
#include <esokit/target/detail/integer_list.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <map>
#include <utility>
#include <vector>

namespace esokit::detail {

/// Chooses scales and builds the lists.
class FixedBuilder : public FixedRecord {
 public:
  using FixedRecord::FixedRecord;

 protected:
  // ---- Building.

  struct Term {
    double coefficient;
    int node;
    bool varies = false;  ///< with the settings
  };

  /// A power of two times a small odd number.
  struct Short {
    bool is = false;
    int odd = 0, exponent = 0;
  };
  static Short short_of(double c);
  static Short short_of(const Term& one) {
    return one.varies ? Short{} : short_of(one.coefficient);
  }

  /// Builds one recorded call.
  struct Builder {
    FixedBuilder* of;
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
    std::vector<int> narrow{};         ///< lines of 16 bits
    static constexpr int none = 1000;  ///< no scale
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
      return !forms.varies[static_cast<std::size_t>(i)] && short_of(forms.number(i)).is;
    }
    static void add(std::vector<Term>& terms, const Term& more) {
      for (Term& term : terms) {
        if (term.node != more.node) continue;
        term.coefficient += more.coefficient;
        term.varies = term.varies || more.varies;
        return;
      }
      terms.push_back(more);
    }
    /// The terms of a sum. @param inside it, what has a name is a term
    void collect(int i, double by, bool inside, std::vector<Term>& terms,
                 bool varies = false) const {
      const Instruction& one = at(i);
      if (forms.is_constant(i)) return;
      if (one.operation == Operation::argument || (inside && kept[static_cast<std::size_t>(i)])) {
        add(terms, {by, i, varies});
      } else if (one.operation == Operation::multiply) {
        const bool first = forms.is_constant(one.a);
        collect(first ? one.b : one.a, by * forms.number(first ? one.a : one.b), true, terms,
                varies || forms.varies[static_cast<std::size_t>(first ? one.a : one.b)]);
      } else if (one.operation == Operation::divide) {
        collect(one.a, by / forms.number(one.b), true, terms,
                varies || forms.varies[static_cast<std::size_t>(one.b)]);
      } else {
        collect(one.a, one.operation == Operation::negate ? -by : by, true, terms, varies);
        if (is_sum(i)) {
          collect(one.b, one.operation == Operation::subtract ? -by : by, true, terms, varies);
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
      const std::size_t which = list == &of->law ? 1 : 0;
      auto& scales = of->layout.products[which];
      const bool known = of->given_ != nullptr && products < scales.size();
      // Of all settings that are to fit.
      const auto& room = of->room_.gains[which];
      const double size = std::fmax(std::fabs(c), products < room.size() ? room[products] : 0.0);
      const auto all = [&](int s) { return size * std::ldexp(1.0, s + offset); };
      int s = known ? scales[products] : scale;
      while (!known && all(s) > largest) --s;
      if (gain(s) > largest) of->gain_too_large_ = gain(s) / largest;
      if (known || !(all(s) > 0)) {
        // As it is.
      } else if (full || all(s) < (most > 0 ? double{least_gain} : least)) {
        while (all(s + 1) <= largest && (full || all(s) < largest / 4)) ++s;
      }
      if (!known) {
        scales.push_back(s);
        of->layout.gains[which].push_back(std::fabs(c));
      }
      list->setting = varies ? static_cast<int>(products) : -1;
      ++products;
      const auto rounded = static_cast<std::int32_t>(std::lround((std::min)(gain(s), largest)));
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
      if (const Short by = short_of(c); !one.varies && by.is) {
        negative = c < 0;
        Value shifted = v;
        shifted.scale -= by.exponent;
        for (double& x : shifted.form) x = std::ldexp(x, by.exponent);
        if (by.odd == 1) return shifted;
        const Value fitting =
            list->to_scale(shifted, (std::min)(shifted.scale, scale + 2), of->rounds_);
        return list->times(fitting, by.odd, fitting.scale);
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
        for (const auto& part : fine) common = (std::min)(common, part.first.scale);
        list->owner = owner + fine_parts;
        common = (std::max)(scale, common - of->coarser_[list->owner]);
        const auto [total, negative] = add(fine, common);
        list->owner = owner;
        rest.emplace_back(list->to_scale(total, scale, of->rounds_), negative);
      }
      const auto [total, negative] = add(rest, scale);
      return negative ? list->times(total, -1, scale) : total;
    }

    /// The coarsest scale among what is not an input and not multiplied; what may be finer else.
    /// @param root if given, the state whose scale it is, or -1: if the sum does not fit, it has to
    ///        be coarser, so that nothing is shifted
    [[nodiscard]] int natural(const std::vector<Term>& terms, bool finest, int* root = nullptr) {
      int found = none;
      for (const Term& one : terms) {
        const Short by = short_of(one);
        if (!by.is || input_of(one.node) != nullptr) continue;
        const int s = value(one.node).scale - by.exponent;
        if (found != none && (finest ? s <= found : s >= found)) continue;
        found = s;
        if (root == nullptr) continue;
        const bool is_argument = at(one.node).operation == Operation::argument;
        *root =
            is_argument ? of->state_of_argument(at(one.node).a) : of->root_of_[owners + one.node];
      }
      return found;
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
        collect(node, 1, false, terms);
        const int owner = owners + node;
        for (const Term& part : terms) (void)value(part.node);
        list->owner = owner;
        int root = -1;
        const int scale = natural(terms, false, &root);
        of->root_of_[owner] = root;
        result = sum(terms, (scale == none ? 14 : scale) - of->coarser_[owner], false);
        if (narrows && is_multiplied(node)) {
          // Its scale: owner of the narrow one.
          const auto to = of->narrow_scale_.find(owner);
          if (to != of->narrow_scale_.end()) {
            result = list->to_scale(result, (std::min)(result.scale, to->second), of->rounds_);
          }
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

  [[nodiscard]] int state_of_argument(int argument) const;
  bool refuse_settings(double times);

  void build(const std::vector<bool>& keeps);

  void build_row(Builder& b, std::size_t i, int node, bool keeps);

  void finish_row(std::size_t i, Value to, LinearForm form);

  [[nodiscard]] bool contains(const Builder& b, const std::vector<Term>& terms, std::size_t state,
                              int depth) const;
};

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/fixed_builder.ipp>
#endif
