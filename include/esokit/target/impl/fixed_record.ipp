#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/target/detail/fixed_bounds.hpp>
#include <esokit/target/detail/fixed_record.hpp>
#include <esokit/target/detail/integer_list.hpp>
#include <esokit/target/detail/linear_call.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <vector>

namespace esokit::detail {

ESOKIT_FUNCTION FixedRecord::FixedRecord(const RecordedDesign& design,
                                         const FixedPointOptions& options, const FixedLayout* given)
    : design_(&design), given_(given), options_(options), wraps_(options.y.counter_bits > 0) {
  if (given == nullptr) return;
  layout = *given;
  rounds_ = given->rounds;
  coarser_ = given->coarser;
  narrow_scale_ = given->narrow;
  left_over_scale_ = given->left_over;
}

ESOKIT_FUNCTION void FixedRecord::make_room(const std::vector<FixedLayout>& others) {
  for (const FixedLayout& other : others) {
    const bool first = room_.scale.empty();
    const auto join = [first](auto& all, const auto& more, const auto& either) {
      if (first) all.assign(more.begin(), more.end());
      for (std::size_t i = 0; i < all.size() && i < more.size(); ++i) {
        all[i] = either(all[i], more[i]);
      }
    };
    const auto least = [](auto a, auto b) { return a < b ? a : b; };
    const auto most = [](auto a, auto b) { return a < b ? b : a; };
    join(room_.scale, other.scale, least);
    join(room_.keeps, other.keeps, [](bool a, bool b) { return a || b; });
    for (std::size_t k = 0; k < 2; ++k) join(room_.gains[k], other.gains[k], most);
    room_.law_scale = first ? other.law_scale : least(room_.law_scale, other.law_scale);
    rounds_ = rounds_ || other.rounds;
    // Of a state it is in its scale.
    for (const auto& [owner, bits] : other.coarser) {
      if (owner >= static_cast<int>(other.scale.size())) {
        coarser_[owner] = most(coarser_[owner], bits);
      }
    }
    for (const auto& [owner, scale] : other.narrow) {
      const auto there = narrow_scale_.find(owner);
      narrow_scale_[owner] = there == narrow_scale_.end() ? scale : least(there->second, scale);
    }
  }
}

ESOKIT_FUNCTION std::int64_t FixedRecord::start_held() const {
  const std::int64_t first = design_->loop.hold_left > 0 ? hold_counts() : 0;
  return std::clamp(first, static_cast<std::int64_t>(lower), static_cast<std::int64_t>(upper));
}

ESOKIT_FUNCTION int FixedRecord::table_rows() const {
  // Longer gaps restart: their bounds would be those of a state that ran away.
  int rows = design_->gap_gains.empty() ? 1 : design_->max_gap + 1;
  if (wraps_) {
    const int half = (1 << (options_.y.counter_bits - 1)) - 1;
    rows = (std::min)(rows, half / options_.y.most);
  }
  return rows;
}

ESOKIT_FUNCTION std::vector<LinearForm> FixedRecord::correction_rows(int elapsed) const {
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

ESOKIT_FUNCTION std::vector<LinearForm> FixedRecord::rows_of(
    const char* name, const std::vector<double>& given) const {
  const RecordedCall& call = called(name);
  const LinearCall forms = linear(call, given);
  std::vector<LinearForm> rows;
  for (std::size_t i = 0; i < states(); ++i) {
    LinearForm row(states() + given.size(), 0.0);
    const int at = call.next[numbers[i]];
    row[i] = 1;
    if (at >= 0) row = forms.of[static_cast<std::size_t>(at)];
    row.resize(states() + given.size());
    rows.push_back(row);
  }
  return rows;
}

ESOKIT_FUNCTION bool FixedRecord::refuse(const char* field, double value, const char* rule,
                                         int index) {
  refusal = {field, value, rule, index};
  return false;
}

ESOKIT_FUNCTION bool FixedRecord::checks() {
  const auto& y = options_.y;
  const auto& u = options_.u;
  const RecordedDesign& d = *design_;
  const int half = 1 << (std::clamp(y.counter_bits, 2, 16) - 1);
  const auto& w = d.measured.paths;
  const auto& lines = d.map.lines;
  const bool shares = options_.settings_for != nullptr || !options_.room_for.empty();
  Rules<double> rules;
  rules.positive("y.unit", y.unit)
      .positive("u.unit", u.unit)
      .demand(1 <= y.most && y.most <= (1 << 24), "y.most", y.most, "must be 1 .. 2^24")
      .demand(1 <= u.most && u.most <= (1 << 24), "u.most", u.most, "must be 1 .. 2^24")
      .demand(u.counter_bits == 0, "u.counter_bits", u.counter_bits, "must be 0: u is no counter")
      .demand(!wraps_ || (2 <= y.counter_bits && y.counter_bits <= 16), "y.counter_bits",
              y.counter_bits, "must be 2 .. 16, or 0")
      .demand(!wraps_ || y.most < half, "y.most", y.most,
              "must be less than half the range of the counter: of a "
              "faster one nobody can say in which direction it went")
      .demand(options_.innovation_bits == 16 || options_.innovation_bits == 32, "innovation_bits",
              options_.innovation_bits, "must be 16 or 32")
      .demand(d.line.empty(), "observer", static_cast<double>(d.line.size()) - 1,
              "is in DelayedInput, which is not written in fixed point: keep the u of earlier "
              "samples yourself")
      .demand(!(d.gate.threshold > 0), "observer", d.gate.threshold,
              "is in OutlierGate, which is not written in fixed point")
      .demand(!d.predictive, "controller", 0,
              "is PredictiveAdrc, which is not written in fixed point")
      .demand(!d.rest.on, "controller", d.rest.error,
              "is in Resting, which is not written in fixed point: keep u yourself while y "
              "is near the reference")
      .demand(!(d.wrap.period > 0), "observer", d.wrap.period,
              "is in WrappedOutput: in fixed point take the observer without it, and "
              "y.counter_bits")
      .demand(!d.guard.on, "observer", d.guard.trust,
              "is in Guarded, which is not written in fixed point")
      .demand(!d.measured.on, "observer", w.empty() ? 0 : w[0].gain,
              "is in Measured, which is not written in fixed point")
      .demand(lines.empty(), "observer", lines.empty() ? 0 : lines[0][1],
              "is in MappedInput, which is not written in fixed point: give u the table of "
              "its effect yourself")
      .demand(!d.known.on, "observer", 0, "is in KnownModel, which is not written in fixed point")
      .demand(d.law.kind == RunningLaw::none || d.law.settled, "observer", d.law.age,
              "has gains that go on: let it settle first (AlgebraicEso), freeze the filter "
              "(RiccatiMode::frozen), or take a LinearEso")
      .demand(!d.law.watches, "outlier_threshold", 1, "is not written in fixed point")
      .demand(!shares || !d.settings.empty(), "settings_in_struct", 0,
              "must be true for settings_for, here and there")
      .demand(d.loop.divider <= 1, "measurement_divider", d.loop.divider,
              "must be 1 in fixed point")
      .demand(!d.error_based && !d.softens && !d.compensates, "controller", 0,
              "is error-based, softens or compensates: only Adrc from y up to order 2 is "
              "written in fixed point");
  if (!rules) refusal = rules.error();
  return static_cast<bool>(rules);
}

ESOKIT_FUNCTION bool FixedRecord::takes_design() {
  numbers = design_->states();
  const std::size_t n = states();
  const RecordedCall& call = called("observe");
  const LinearCall forms = linear(call, {column, column});
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
    exact_bu_.push_back(form[n + 1] * of_u());
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
    const RecordedCall& estimate = called("estimate_" + std::to_string(row));
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

ESOKIT_FUNCTION std::vector<double> FixedRecord::weights() const {
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

ESOKIT_FUNCTION LinearForm FixedRecord::unit(std::size_t i, std::size_t n) {
  LinearForm form(n, 0.0);
  form[i] = 1;
  return form;
}

ESOKIT_FUNCTION bool FixedRecord::takes_limits() {
  lower = design_->lower / options_.u.unit;
  upper = design_->upper / options_.u.unit;
  const double digit =
      design_->single ? static_cast<double>(rounding<float>()) : rounding<double>();
  for (const double count : {lower, upper}) {
    if (std::fabs(count - std::nearbyint(count)) > 1e-6 + 4 * digit * std::fabs(count)) {
      return refuse("u.unit", count, "must make the limits of the controller whole counts");
    }
  }
  lower = std::nearbyint(lower);
  upper = std::nearbyint(upper);
  const double most = options_.u.most;
  if (!(lower >= -most) || !(upper <= most)) {
    return refuse("u.most", most, "must hold the limits of the controller in counts");
  }
  // A step as large as the range limits nothing.
  if (design_->rate < design_->upper - design_->lower) rate = design_->rate / options_.u.unit;
  const RecordedCall* call = design_->called("law");
  if (call == nullptr) {
    return refuse("controller", 0,
                  "takes estimates that are published apart (AlgebraicEso): only "
                  "its observer is written in fixed point");
  }
  const LinearCall forms = linear(*call, {column});
  if (!forms.is_linear(call->outputs[0])) {
    return refuse("controller", 0, "has a law that is not linear");
  }
  exact_law_ = forms.of[static_cast<std::size_t>(call->outputs[0])];
  exact_law_.resize(states() + 1);
  for (double& x : exact_law_) x *= options_.y.unit / options_.u.unit;
  return true;
}

}  // namespace esokit::detail
