/// @file
/// The self-test of written C: what is called at each sample, and what the design gives then.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/target/detail/recorded_numbers.hpp>
#include <limits>
#include <utility>
#include <vector>

namespace esokit::detail {

/// What the self-test calls, as in runtime/controller.c.
enum class TestCall : unsigned {
  update,   ///< with y, and r or u beside it
  misses,   ///< y times a sample without a measurement
  starts,   ///< under u
  reports,  ///< the u that acts
  resets,
  corrects,  ///< of an observer
  splits,    ///< the two phases, with a report between them
  loses,     ///< the same without a measurement
  measures,  ///< a disturbance w
  rests,     ///< y times a sample with y at r
  trusts,    ///< a guard, by y
  pins,      ///< it, at limit number y
  holds,     ///< under u
  gains,     ///< with b0 = y
  adopts,    ///< the settings it has, or foreign ones if y is 1
  keeps      ///< y samples after a save under u: it is loaded. 0: it is foreign
};

inline constexpr unsigned bad_y = 16;       ///< y is infinite
inline constexpr unsigned bad_beside = 32;  ///< what stands beside it is

inline constexpr int most_calls = 80;  ///< samples with those of all designs

inline constexpr unsigned of_row = 64;  ///< times the number of the estimate that is compared

/// One call of it, with numbers in place of what a loop has at that sample, where they are one.
struct PlannedCall {
  int sample;
  TestCall call;
  unsigned bad = 0;
  double y = std::numeric_limits<double>::quiet_NaN();
  double beside = std::numeric_limits<double>::quiet_NaN();  ///< r or u
};

/// What a call gives.
template <class V>
struct TestResult {
  V number;         ///< u, or an estimate
  unsigned status;  ///< that is returned, or of the sample
};

inline constexpr unsigned of_mode = 512;  ///< times the mode, in the status that is compared

/// What the calls of a self-test depend on.
struct TestNumbers {
  unsigned longest;   ///< gap that has a gain, samples
  unsigned rest;      ///< samples until it rests; 0: never
  unsigned limit;     ///< of missing measurements, samples
  double largest;     ///< number
  double huge;        ///< u, which a start still takes
  double step;        ///< of r
  double gain;        ///< b0
  double period;      ///< of an angle, or 0
  unsigned release;   ///< measurements after a pin, samples
  unsigned settling;  ///< and after a hold
  unsigned delay;     ///< of u, samples
};

/// The calls that are no plain update: gaps that are bridged, that restart and that end in safe
/// mode, bad numbers, starts and reports, each followed by plain updates.
inline PlannedCall planned(int sample, const TestNumbers& of) {
  const auto many = [](unsigned samples) {
    return static_cast<double>((std::min)((std::max)(samples, 1U), 1000U));
  };
  const std::array all{
      PlannedCall{.sample = 20, .call = TestCall::update, .beside = 20 * of.step},
      PlannedCall{.sample = 21, .call = TestCall::update, .beside = -20 * of.step},
      PlannedCall{22, TestCall::update, bad_y, 4},
      PlannedCall{24, TestCall::update, bad_y, 4},
      PlannedCall{25, TestCall::update, bad_y, 4},
      PlannedCall{.sample = 27, .call = TestCall::update, .bad = bad_beside, .beside = 4},
      PlannedCall{29, TestCall::misses, 0, 1},
      PlannedCall{31, TestCall::misses, 0, many(of.longest - 1)},
      PlannedCall{33, TestCall::misses, 0, many(of.longest + 1)},
      PlannedCall{34, TestCall::update, bad_y, 4},
      PlannedCall{36, TestCall::misses, 0, many(of.limit)},
      PlannedCall{39, TestCall::misses, 0, many(of.limit)},
      PlannedCall{.sample = 40, .call = TestCall::starts, .beside = 0},
      PlannedCall{43, TestCall::starts, bad_y, 4, 0},
      PlannedCall{.sample = 44, .call = TestCall::starts, .bad = bad_beside, .beside = 4},
      PlannedCall{.sample = 45, .call = TestCall::starts, .beside = of.largest},
      PlannedCall{.sample = 47, .call = TestCall::reports, .bad = bad_beside, .beside = 4},
      PlannedCall{49, TestCall::splits},
      PlannedCall{51, TestCall::loses},
      PlannedCall{53, TestCall::misses, 0, 1},
      PlannedCall{54, TestCall::corrects},
      PlannedCall{55, TestCall::measures, 0, 0.125},
      PlannedCall{57, TestCall::rests, 0, many(of.rest)},
      PlannedCall{58, TestCall::measures, bad_y, 4},
      PlannedCall{60, TestCall::resets},
      PlannedCall{62, TestCall::resets, bad_y, 4},
      PlannedCall{64, TestCall::update, 0, of.largest},
      // A state near the end of the numbers, from which even a small u leads beyond.
      PlannedCall{66, TestCall::starts, 0, of.largest, 0},
      PlannedCall{.sample = 67, .call = TestCall::reports, .beside = of.largest},
      PlannedCall{.sample = 70, .call = TestCall::reports, .beside = -of.huge},
      PlannedCall{71, TestCall::starts, 0, of.largest, -of.huge},
      PlannedCall{72, TestCall::reports, bad_y, 4, of.huge},
      PlannedCall{73, TestCall::update, bad_y, 4, of.huge},
      // The u that is kept leads beyond, too.
      PlannedCall{74, TestCall::resets, 0, of.largest, of.step},
      PlannedCall{.sample = 75, .call = TestCall::update, .beside = of.largest},
      PlannedCall{.sample = 76, .call = TestCall::starts, .beside = 0},
      // What is reported after a start is the u that a bad r leaves as it is.
      PlannedCall{.sample = 77, .call = TestCall::reports, .beside = of.step},
      PlannedCall{.sample = 78, .call = TestCall::update, .bad = bad_beside, .beside = 4},
  };
  const auto* const found =
      std::find_if(all.begin(), all.end(), [=](const auto& one) { return one.sample == sample; });
  const bool is_update = found == all.end() || (found->call == TestCall::rests && of.rest == 0);
  return is_update ? PlannedCall{sample, TestCall::update} : *found;
}

/// Trust, pins, holds and a changing b0, each on both sides, and what is beyond its limits.
inline std::vector<PlannedCall> calls_of_guard(const TestNumbers& of, bool changes_gain) {
  const auto rest = [&](unsigned samples) {
    return PlannedCall{0, TestCall::rests, 0, static_cast<double>((std::min)(samples + 1, 1000U))};
  };
  const PlannedCall update{0, TestCall::update};
  const PlannedCall hold{.sample = 0, .call = TestCall::holds, .beside = of.step};
  const auto pin = [](double where) { return PlannedCall{0, TestCall::pins, 0, where}; };
  const auto trust = [](double phi) { return PlannedCall{0, TestCall::trusts, 0, phi}; };
  const auto far = [](double y) { return PlannedCall{0, TestCall::update, 0, y}; };
  std::vector<PlannedCall> all{
      {.sample = 0, .call = TestCall::starts, .beside = 0},
      // The bound, and u at both limits.
      far(1e6),
      far(-1e6),
      {.sample = 0, .call = TestCall::starts, .beside = 0},
      {0, TestCall::trusts, bad_y, 4},
      trust(-1),
      update,
      trust(0.5),
      update,
      trust(2),
      pin(1),
      update,
      pin(2),
      update,
      pin(4),
      pin(3),
      update,
      pin(0),
      update,
      pin(0),
      rest(of.release),
      {.sample = 0, .call = TestCall::reports, .beside = of.step},
      update,
      pin(3),
      update,
      {.sample = 0, .call = TestCall::reports, .beside = -of.step},
      update,
      pin(3),
      pin(0),
      rest(of.release),
      hold,
      update,
      // The settling begins anew where it is disturbed.
      trust(0.5),
      update,
      trust(1),
      rest(of.settling),
      update,
      {0, TestCall::holds, bad_y, 4},
      {0, TestCall::holds, bad_y, 4},
      update,
      // u may be at its limit: the disturbance says what was kept.
      {.sample = 0, .call = TestCall::reports, .beside = 0},
      {.sample = 0, .call = TestCall::holds, .bad = bad_beside, .beside = 4},
      update,
      {0, TestCall::misses, 0, static_cast<double>((std::min)(of.longest + 1, 1000U))},
      hold,
      update};
  if (changes_gain) {
    for (const double b : {1.25 * of.gain, -of.gain, 0.0, 0.8 * of.gain, of.gain}) {
      all.insert(all.end(), {PlannedCall{0, TestCall::gains, 0, b}, update});
    }
    all.push_back({0, TestCall::gains, bad_y, 4});
  }
  return all;
}

/// A state that is taken up again, and what is refused.
inline std::vector<PlannedCall> calls_of_kept(const TestNumbers& of) {
  const PlannedCall update{0, TestCall::update};
  return {{.sample = 0, .call = TestCall::starts, .beside = 0},
          update,
          {0, TestCall::keeps, 0, 1, of.step},
          update,
          update,
          {0, TestCall::keeps, 0, static_cast<double>((std::min)(of.longest + 1, 1000U)), of.step},
          update,
          update,
          {0, TestCall::keeps, 0, 0, of.step},
          {0, TestCall::keeps, bad_y, 4, of.step},
          {0, TestCall::keeps, bad_beside, 1, 4},
          update};
}

/// Angles that move steadily, that jump, and that are missing now and then.
inline std::vector<PlannedCall> calls_of_angle(const TestNumbers& of) {
  const auto at = [&](double turns) {
    return PlannedCall{.sample = 0, .call = TestCall::update, .y = turns * of.period, .beside = 0};
  };
  const PlannedCall missed{.sample = 0, .call = TestCall::misses, .y = 1, .beside = 0};
  const PlannedCall at_rest{0, TestCall::rests, 0, 50, 0};
  std::vector<PlannedCall> all{{0, TestCall::starts, 0, 0, 0}, at_rest};
  // Faster than a gate lets in, across the end of a turn; then a jump, and back.
  for (int k = 1; k <= 12; ++k) all.push_back(at(0.03 * k * k / 12.0 + 0.06 * k));
  for (const double turns : {0.1, 0.55, 0.1, 0.55, 0.1, 0.1, 0.1}) all.push_back(at(turns));
  all.insert(all.end(), {missed, missed, at(0.1), at(0.12)});
  for (int k = 0; k < 9; ++k) all.insert(all.end(), {missed, at(0.14 + 0.02 * k)});
  all.insert(all.end(), {at(0.3), {0, TestCall::misses, 0, of.longest + 1.0, 0}, at(0.2), at(0.2)});
  return all;
}

/// A state near the end of the numbers, where a start does not lead, or u acts late.
inline std::vector<PlannedCall> calls_from_afar(const TestNumbers& of) {
  const auto misses = [](double samples) {
    return PlannedCall{0, TestCall::misses, 0, (std::min)(samples, 1000.0), 0};
  };
  const PlannedCall lost{0, TestCall::update, bad_y, 4, 0};
  const PlannedCall update{0, TestCall::update};
  std::vector<PlannedCall> all;
  for (const double u : {of.largest, -of.largest}) {
    all.insert(all.end(), {misses(of.longest + 1.0),
                           {0, TestCall::update, 0, -of.largest, 0},
                           {.sample = 0, .call = TestCall::reports, .beside = u},
                           misses(of.delay + 1.0),
                           update});
  }
  for (const double u : {of.huge, 2 * of.huge}) {
    all.insert(all.end(), {{0, TestCall::starts, 0, of.largest, -of.huge},
                           {.sample = 0, .call = TestCall::reports, .beside = u},
                           misses(of.delay + 1.0),
                           lost,
                           update});
  }
  all.push_back({.sample = 0, .call = TestCall::reports, .bad = bad_beside, .beside = 4});
  all.insert(all.end(), {{.sample = 0, .call = TestCall::starts, .beside = 0}, update});
  return all;
}

/// What a design has beside the calls of all.
inline std::vector<PlannedCall> further_calls(const RecordedDesign& design, const TestNumbers& of) {
  std::vector<PlannedCall> all;
  const auto add = [&](const std::vector<PlannedCall>& more) {
    all.insert(all.end(), more.begin(), more.end());
  };
  if (design.guard.on) add(calls_of_guard(of, !design.softens));
  if (design.wrap.period > 0) add(calls_of_angle(of));
  if (design.is_controller && (design.error_based || !design.line.empty())) {
    add(calls_from_afar(of));
  }
  if (design.options.settings_in_struct) {
    add({{.sample = 0, .call = TestCall::adopts, .y = 0},
         {0, TestCall::update},
         {0, TestCall::misses, 0, of.longest - 1.0},
         {0, TestCall::update},
         {.sample = 0, .call = TestCall::adopts, .y = 0},
         {0, TestCall::update},
         {.sample = 0, .call = TestCall::adopts, .y = 1},
         {0, TestCall::update}});
  }
  if (design.options.saves_state && !design.softens) add(calls_of_kept(of));
  return all;
}

/// The plant of the design, exact for a u that is held: y^(n) = b0 u.
class TestPlant {
 public:
  TestPlant(int order, double input_gain, double sample_time)
      : states_(static_cast<std::size_t>(order)), gain_(input_gain), step_(sample_time) {}
  [[nodiscard]] double output() const { return states_[0]; }
  void advance(double u) {
    if (!(std::abs(u) < 1e6)) return;
    for (std::size_t i = 0; i < states_.size(); ++i) {
      double power = 1;
      for (std::size_t k = i + 1; k <= states_.size(); ++k) {
        power *= step_ / static_cast<double>(k - i);
        states_[i] += power * (k < states_.size() ? states_[k] : gain_ * u);
      }
    }
  }
  void rest() { std::fill(states_.begin() + 1, states_.end(), 0.0); }

 private:
  std::vector<double> states_;
  double gain_, step_;
};

/// An estimate by its row.
template <class Observer>
auto estimate_of(const Observer& observer, int row) {
  typename Observer::scalar_type found(0);
  unroll<Observer::size>([&](auto at) {
    constexpr int place{decltype(at)::value};
    if (row == place) found = observer.template estimate<place>();
  });
  return found;
}

/// The samples of a self-test.
/// @tparam V their scalar @tparam inputs beside y: (u) or (r, r', ..)
/// @param law the gain of the law, u per r, or 0 @param calls gives a TestResult for a call, y,
/// what is beside it and a row @param output the u that moves the plant then
template <class V, int inputs, class Calls, class Output>
void take_self_test(RecordedDesign& design, double law, Calls&& calls, Output&& output) {
  constexpr V largest = (std::numeric_limits<V>::max)();
  const double room = (std::min)(std::abs(design.lower), std::abs(design.upper));
  const double size = law > 0 && room < 1e6 ? 0.3 * room / law : 1;
  const auto most = static_cast<double>(largest);
  const TestNumbers numbers{
      .longest = static_cast<unsigned>((std::max)(design.gap_gains.size(), std::size_t{1})),
      .rest = design.rest.error > 0 ? design.rest.samples + 3 : 0,
      .limit = design.loop.missing_limit,
      .largest = most,
      .huge = 0.25 * most / (std::max)(1.0, std::abs(design.input_gain)),
      .step = size,
      .gain = design.error_based ? -design.input_gain : design.input_gain,
      .period = design.wrap.period,
      .release = design.guard.release_samples,
      .settling = design.guard.settling_samples,
      .delay = static_cast<unsigned>(design.line.size())};
  const bool has_all = design.options.self_test_samples >= most_calls;
  const auto further = has_all ? further_calls(design, numbers) : std::vector<PlannedCall>{};
  const int calls_end = most_calls + static_cast<int>(further.size());
  const int samples = design.options.self_test_samples + static_cast<int>(further.size());
  // The text has no infinite numbers.
  const auto number = [most](double x) { return static_cast<V>(std::clamp(x, -most, most)); };
  TestPlant plant(design.order, design.input_gain, design.sample_time);
  for (int k = 0; k < samples; ++k) {
    const bool beside_all = most_calls <= k && k < calls_end;
    PlannedCall plan =
        beside_all ? further[static_cast<std::size_t>(k - most_calls)] : planned(k, numbers);
    // Each estimate once, with a report.
    int row = (k - 4) / 2;
    if (4 <= k && k < most_calls && k % 2 == 0 && row < (std::min)(design.size, 8)) {
      plan.call = TestCall::reports;
    } else {
      row = design.order;
    }
    if (std::isnan(plan.y)) plan.y = plant.output();
    V y = number(plan.y);
    Vector<V, inputs> beside;
    for (int i = 1; i < inputs; ++i) {
      const bool stands = plan.call == TestCall::rests;
      beside(i) = stands ? V(0) : number(size * (0.125 * ((k * 11 + i) % 9) - 0.5));
    }
    beside(0) = number(!std::isnan(plan.beside) ? plan.beside
                       : (k / 10) % 2 == 0      ? size
                                                : -0.5 * size);
    std::vector<double> sample{static_cast<double>(y)};
    for (const V& one : beside) sample.push_back(static_cast<double>(one));
    if ((plan.bad & bad_y) != 0) y = y * largest;
    if ((plan.bad & bad_beside) != 0) beside(0) = beside(0) * largest;
    const TestResult<V> result = calls(plan.call, y, beside, row);
    sample.push_back(static_cast<double>(result.number));
    design.samples.push_back(std::move(sample));
    if (k < calls_end) {
      design.test_calls.push_back(
          {static_cast<unsigned>(plan.call) + plan.bad + of_row * static_cast<unsigned>(row),
           result.status});
    }
    if (plan.call == TestCall::starts) plant.rest();
    plant.advance(static_cast<double>(output(beside)));
  }
}

}  // namespace esokit::detail
