#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/target/detail/fixed_bounds.hpp>
#include <esokit/target/detail/fixed_builder.hpp>
#include <esokit/target/detail/fixed_record.hpp>
#include <esokit/target/detail/integer_list.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <vector>

namespace esokit::detail {

ESOKIT_FUNCTION FixedBuilder::Short FixedBuilder::short_of(double c) {
  int exponent = 0;
  double mantissa = std::frexp(std::fabs(c), &exponent);
  for (int bits = 0; bits < 3; ++bits) {
    mantissa *= 2;
    --exponent;
    if (std::fabs(mantissa - std::nearbyint(mantissa)) <= 0) {
      return {true, static_cast<int>(std::nearbyint(mantissa)), exponent};
    }
  }
  return {};
}

ESOKIT_FUNCTION int FixedBuilder::state_of_argument(int argument) const {
  const auto at = std::find(numbers.begin(), numbers.end(), static_cast<std::size_t>(argument));
  return at == numbers.end() ? -1 : static_cast<int>(at - numbers.begin());
}

ESOKIT_FUNCTION bool FixedBuilder::refuse_settings(double times) {
  return refuse("settings_for", times,
                "times what the scales of that code hold comes of these gains: write that code "
                "with room_for, the code of this design alone");
}

ESOKIT_FUNCTION void FixedBuilder::build(const std::vector<bool>& keeps) {
  const std::size_t n = states();
  update = IntegerList(n + 2);
  narrow_lines_.clear();
  gain_too_large_ = 0;
  if (given_ == nullptr) {
    layout.products[0].clear();
    layout.gains[0].clear();
  }
  const RecordedCall& call = called("observe");
  const std::vector<double> given{column, column};
  Builder builder{this,
                  &call,
                  linear(call, given),
                  &update,
                  static_cast<int>(2 * n),
                  1,
                  options_.innovation_bits == 16,
                  {{1.0, options_.y.most}, {of_u(), options_.u.most}}};
  std::vector<int> wanted;
  for (std::size_t i = 0; i < n; ++i) wanted.push_back(call.next[numbers[i]]);
  builder.find_kept(wanted);
  written.scale.assign(n, 0);
  written.left_over.assign(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    update.owner = static_cast<int>(i);
    int s = static_cast<int>(std::floor(std::log2(fits / forced_[i])));
    s -= coarser_[static_cast<int>(i)];
    if (i < room_.scale.size()) s = (std::min)(s, room_.scale[i]);
    written.scale[i] = given_ != nullptr ? given_->scale[i] : s;
    builder.words.push_back(
        keeps[i] ? Value{} : update.state(static_cast<int>(i), written.scale[i], 0, nullptr));
    builder.rests.push_back({});
  }
  // Rows that keep what is left over: how many bits.
  for (std::size_t i = 0; i < n; ++i) {
    if (!keeps[i]) continue;
    const int own = static_cast<int>(i);
    const int acc = left_over_scale_.count(own) > 0 ? left_over_scale_[own] : written.scale[i] + 16;
    written.left_over[i] =
        std::clamp(acc - coarser_[static_cast<int>(n) + own] - written.scale[i], 1, 30);
    builder.words[i] = update.state(own, written.scale[i], written.left_over[i], &builder.rests[i]);
  }
  next.assign(n, -1);
  next_rest.assign(n, -1);
  next_form_.assign(n, {});
  // Results that are the next of a state and used by others come when they are needed.
  for (std::size_t i = 0; i < n; ++i) build_row(builder, i, call.next[numbers[i]], keeps[i]);
}

ESOKIT_FUNCTION void FixedBuilder::build_row(Builder& b, std::size_t i, int node, bool keeps) {
  const std::size_t n = states();
  std::vector<Term> terms;
  b.collect(node, 1, false, terms);
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
          b.collect(t.node, 1, false, inner);
          has_self = contains(b, inner, i, 3);
        }
        if (!has_self) inner = {t};
        for (const Term& part : inner) Builder::add(open, part);
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
      int product = Builder::none;
      for (const Term& t : others) {
        if (short_of(t).is || b.input_of(t.node) != nullptr) continue;
        product = (std::min)(product, b.term(t, s, true, negative).scale);
      }
      int scale = (std::min)(fine, product);
      if (scale == Builder::none) scale = s + 16;
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
    form.resize((std::max)(form.size(), acc.form.size()), 0.0);
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

ESOKIT_FUNCTION void FixedBuilder::finish_row(std::size_t i, Value to, LinearForm form) {
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

ESOKIT_FUNCTION bool FixedBuilder::contains(const Builder& b, const std::vector<Term>& terms,
                                            std::size_t state, int depth) const {
  for (const Term& t : terms) {
    if (b.at(t.node).operation == Operation::argument) {
      if (state_of_argument(b.at(t.node).a) == static_cast<int>(state)) return true;
    } else if (depth > 0) {
      std::vector<Term> inner;
      b.collect(t.node, 1, false, inner);
      if (contains(b, inner, state, depth - 1)) return true;
    }
  }
  return false;
}

}  // namespace esokit::detail
