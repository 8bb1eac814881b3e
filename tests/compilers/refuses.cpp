// Bad numbers are refused by what any compiler makes of the check, also at -O3 -ffast-math, and
// results have text: a plain program, as GoogleTest is not there for every standard library.
// Returns 0 when it passes.
#include <cstdio>
#include <esokit/analysis/health_text.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <sstream>

#include "support/numbers.hpp"

namespace {

using namespace esokit;
int failures = 0;

void expect(bool holds, const char* what) {
  if (!holds) std::printf("failed: %s\n", what);
  failures += holds ? 0 : 1;
}

template <class Observer>
void rejects(const char* name, const typename Observer::Config& config) {
  using S = typename Observer::scalar_type;
  auto observer = Observer::make(config).value();
  for (const S bad : {esokit_test::hidden_nan<S>(), esokit_test::hidden_infinity<S>(),
                      -esokit_test::hidden_infinity<S>()}) {
    observer.reset(S(1));
    expect(has(observer.update(bad, S(0)), StepStatus::measurement_rejected), name);
    expect(has(observer.update(S(1), bad), StepStatus::input_rejected), name);
    const auto estimate = observer.estimate();
    for (const S& x : estimate) expect(x >= S(-10) && x <= S(10), name);
    auto wrong = config;
    wrong.sample_time = bad;
    expect(!Observer::make(wrong), name);
  }
}

template <class S>
void rejects_all() {
  rejects<LinearEso<2, S>>(
      "LinearEso", {.observer_bandwidth = S(50), .input_gain = S(1), .sample_time = S(0.001)});
  rejects<CascadeEso<2, 2, S>>("CascadeEso", {.observer_bandwidth = S(50),
                                              .bandwidth_factor = S(2),
                                              .input_gain = S(1),
                                              .sample_time = S(0.001)});
  auto loop =
      Adrc<LinearEso<1, S>>::make(
          {.observer = {.observer_bandwidth = S(50), .input_gain = S(1), .sample_time = S(0.001)},
           .controller_bandwidth = S(10),
           .limits = {.lower = S(-5), .upper = S(5)}})
          .value();
  loop.update(S(0), S(1));
  const S u = loop.update(esokit_test::hidden_nan<S>(), S(1));
  expect(u >= -5 && u <= 5, "Adrc");
  expect(has(loop.status(), StepStatus::measurement_rejected), "Adrc");
}

void rejects_a_lane() {
  Packed<LinearEso<2, float>> observer(
      LinearEso<2, float>::make(
          {.observer_bandwidth = 50.0F, .input_gain = 1.0F, .sample_time = 0.001F})
          .value());
  Pack<float> y(1.0F);
  y[0] = esokit_test::hidden_nan<float>();
  const auto status = observer.update(y, Pack<float>(0.0F));
  expect(has(status[0], StepStatus::measurement_rejected), "the bad lane of a pack");
  expect(status[1] == StepStatus::ok, "the good lane of a pack");
}

void writes_text() {
  std::ostringstream out;
  out << StepStatus::ok << LoopMode::safe << LoopFault::wrong_sign;
  write_header<1>(out);
  write_row(out, Telemetry<1, float>{});
  expect(out.str().starts_with("oksafe"), "results have text");
}

}  // namespace

int main() {
  rejects_all<float>();
  rejects_all<double>();
  rejects_all<long double>();
  rejects_a_lane();
  writes_text();
  return failures;
}
