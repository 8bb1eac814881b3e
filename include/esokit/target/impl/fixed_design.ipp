#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/target/detail/fixed_bounds.hpp>
#include <esokit/target/detail/fixed_builder.hpp>
#include <esokit/target/detail/fixed_design.hpp>
#include <esokit/target/detail/integer_list.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <utility>
#include <vector>

namespace esokit::detail {

ESOKIT_FUNCTION bool FixedDesign::make() {
  if (!checks() || !takes_design()) return false;
  std::vector<bool> keeps(states(), false);
  const auto takes = [&](const FixedLayout& other) {
    keeps = other.keeps;
    return keeps.size() == states() && (other.law_scale > 0) == design_->is_controller;
  };
  if (given_ != nullptr && !takes(*given_)) {
    return refuse("settings_for", static_cast<double>(states()),
                  "must be the code of such an object");
  }
  if (!room_.scale.empty() && !takes(room_)) {
    return refuse("room_for", static_cast<double>(states()), "must be the codes of such objects");
  }
  for (;;) {
    if (!builds(keeps)) return false;
    bounds();
    const int worst = exceeded();
    if (worst < 0) break;
    if (given_ != nullptr) return refuse_bound(worst);
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
    if (row == states()) return refuse_bound(worst);
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

ESOKIT_FUNCTION bool FixedDesign::builds(const std::vector<bool>& keeps) {
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

ESOKIT_FUNCTION bool FixedDesign::finds_system() {
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
    for (std::size_t e = 0; e < update.roundings.size(); ++e) by_rounding_[e][i] = form[n + 2 + e];
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
      double change = std::fabs(rows[i][n]) * of_u() * options_.u.most;
      for (std::size_t j = 0; j < n; ++j) change += j == i ? 0 : std::fabs(rows[i][j]) * reach[j];
      reach[i] += change * static_cast<double>(table_rows());
    }
  }
  return true;
}

ESOKIT_FUNCTION double FixedDesign::most_at(const LinearForm& form, double* free) const {
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
    total += (std::max)(std::fabs(d * low), std::fabs(d * high));
  }
  return total;
}

ESOKIT_FUNCTION std::pair<int, int> FixedDesign::overflowing(const IntegerList& list, bool in_box) {
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
          most += by * (std::max)(-list.roundings[j - n - 1].low, list.roundings[j - n - 1].high);
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

ESOKIT_FUNCTION void FixedDesign::bounds() {
  const std::size_t n = states();
  estimates.clear();
  written.estimates = exact_estimates_;
  share_.assign(n, 0.0);
  for (const LinearForm& c : exact_estimates_) estimates.push_back(bound(c, 0, true));
}

ESOKIT_FUNCTION FixedBound FixedDesign::bound(const LinearForm& c, double direct, bool reads) {
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
    share_[i] = (std::max)(share_[i], found.deviation > 0 ? shares[i] / found.deviation : 0.0);
    if (reads && written.left_over[i] > 0)
      found.deviation += std::fabs(c[i]) * std::ldexp(1.0, -written.scale[i]);
  }
  found.half_count = plain_.sums(c, {plain_by_})[0].most(-0.5, 0.5);
  return found;
}

ESOKIT_FUNCTION double FixedDesign::change(const LinearForm& exact, const LinearForm& now,
                                           double direct) const {
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
  const auto sums = both.sums(joined(exact, now, -1),
                              {joined(exact_by_, written.by, 1), joined(exact_bu_, written.bu, 1)});
  return sums[0].most(-options_.y.most, options_.y.most) +
         sums[1].most(-options_.u.most, options_.u.most) + direct;
}

ESOKIT_FUNCTION int FixedDesign::exceeded() const {
  for (std::size_t i = 0; i < estimates.size(); ++i) {
    if (!(estimates[i].deviation <= allowed(i))) return static_cast<int>(i);
  }
  return -1;
}

ESOKIT_FUNCTION double FixedDesign::allowed(std::size_t i) const {
  const bool given = i < options_.most_deviation.size() && options_.most_deviation[i] > 0;
  return given ? options_.most_deviation[i] : estimates[i].half_count;
}

ESOKIT_FUNCTION bool FixedDesign::refuse_bound(int i) {
  const auto at = static_cast<std::size_t>(i);
  refusal = {"most_deviation",
             estimates[at].deviation,
             options_.innovation_bits == 16
                 ? "is what rounding does to this estimate at most: 32 bits of innovation_bits, a "
                   "smaller y.most, or a longer sample time would do; allowed is"
                 : "is what rounding does to this estimate at most: a smaller y.most or a longer "
                   "sample time would do; allowed is",
             i,
             allowed(at),
             true};
  return false;
}

ESOKIT_FUNCTION bool FixedDesign::law_fits() {
  const std::size_t n = states();
  const RecordedCall& call = called("law");
  double range = 0;
  for (std::size_t i = 0; i < n; ++i) range += std::fabs(exact_law_[i]) * reach[i];
  range += std::fabs(exact_law_[n]) * reference_most() + options_.u.most;
  law_scale = (std::min)(16, static_cast<int>(std::floor(std::log2(fits / 2 / range))));
  if (room_.law_scale > 0) law_scale = (std::min)(law_scale, room_.law_scale);
  if (given_ != nullptr) {
    if (law_scale < given_->law_scale) {
      return refuse_settings(std::ldexp(1.0, given_->law_scale - law_scale));
    }
    law_scale = given_->law_scale;
  }
  for (int round = 0; round < 100; ++round) {
    if (law_scale < 2) {
      return refuse("controller", range,
                    "can ask for so many counts of u that 32 bits do not hold "
                    "them beside a quarter of a count: lower the controller's bandwidth or y.most");
    }
    law = IntegerList(n + 1);
    if (given_ == nullptr) {
      layout.products[1].clear();
      layout.gains[1].clear();
    }
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
    builder.collect(output, builder.factor, false, terms);
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

ESOKIT_FUNCTION void FixedDesign::judge_law(LinearForm form) {
  const std::size_t n = states();
  written.law.assign(form.begin(), form.begin() + static_cast<std::ptrdiff_t>(n) + 1);
  double direct = 0.5;  // to whole counts
  for (std::size_t e = 0; e + n + 1 < form.size(); ++e) {
    direct += std::fabs(form[n + 1 + e]) * (std::max)(-law.roundings[e].low, law.roundings[e].high);
  }
  LinearForm c(written.law.begin(), written.law.begin() + static_cast<std::ptrdiff_t>(n));
  LinearForm exact(exact_law_.begin(), exact_law_.begin() + static_cast<std::ptrdiff_t>(n));
  input = bound(c, direct, false);  // the list of the law has what reading adds
  input.by_gains = change(exact, c, std::fabs(exact_law_[n] - written.law[n]) * reference_most());
}

ESOKIT_FUNCTION bool FixedDesign::judges_input() {
  const double most = options_.most_input_deviation > 0 ? options_.most_input_deviation
                                                        : (std::max)(input.half_count, 1.0);
  if (rate > 0 && !at_most(64.0, std::ldexp(rate, law_scale))) {
    refusal = {"limits.rate",
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

}  // namespace esokit::detail
