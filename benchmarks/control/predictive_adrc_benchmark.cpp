/// @file
/// What stands between a measurement and the control: `control` of the two-phase controller beside
/// the one-phase form, which updates the observer and computes the law before u is known (the bare
/// observer, AdrcLaw and Limiter by hand; and Adrc, with all it does around them). `prepare` is the
/// rest, after u is out.
///
/// `bank`: 16 controllers one after the other, what the work costs. `latency`: from y to u, each y
/// known only when the u before it is.
#include <benchmark/benchmark.h>

#include <array>
#include <cstddef>
#include <esokit/control/adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <string>

#include "../support/run.hpp"
#include "../support/update_patterns.hpp"

namespace esokit::benchmarks {
namespace {

template <class S>
constexpr S sample_time = static_cast<S>(1e-3);

template <class S>
esokit::Limits<S> magnitudes() {
  return {.lower = S(-5), .upper = S(5)};
}

/// The one-phase form by hand, nothing around it.
template <class Observer>
struct OnePhase {
  using S = typename Observer::scalar_type;
  Observer observer;
  AdrcLaw<Observer::order, S> law;
  Limiter<S> limiter;

  ESOKIT_INLINE S control(S y) noexcept {
    (void)observer.update(y, limiter.last());
    return limiter(law.control(observer.estimate(), S(1)));
  }
};

template <class Observer>
struct CompleteOnePhase {
  using S = typename Observer::scalar_type;
  Adrc<Observer> controller;

  ESOKIT_INLINE S control(S y) noexcept { return controller.update(y, S(1)); }
};

/// The second phase alone.
template <class Observer>
struct Rest {
  using S = typename Observer::scalar_type;
  PredictiveAdrc<Observer> controller;

  ESOKIT_INLINE S control(S y) noexcept {
    (void)controller.control(y);
    (void)controller.prepare(S(1));
    return controller.output();
  }
};

template <class S, class Controller>
void bank_of_controls(benchmark::State& state, const Controller& controller,
                      const std::string& label) {
  std::array<Controller, bank_size> controllers = [&]<std::size_t... I>(std::index_sequence<I...>) {
    return std::array<Controller, bank_size>{((void)I, controller)...};
  }
  (std::make_index_sequence<bank_size>{});
  const Signals<S> signals;
  std::array<S, bank_size> out{};
  while (state.KeepRunningBatch(bank_size)) {
    for (std::size_t i = 0; i < bank_size; ++i) out[i] = controllers[i].control(signals.y[i]);
    benchmark::DoNotOptimize(out);
    benchmark::DoNotOptimize(controllers.data());
    benchmark::ClobberMemory();
  }
  state.SetLabel(label);
}

/// y carries a zero that is made of the last u, so it waits for it: 8 cycles more for all of them.
template <class S, class Controller>
void latency_of_controls(benchmark::State& state, const Controller& controller,
                         const std::string& label) {
  Controller own = controller;
  const Signals<S> signals;
  S u = S(0);
  S zero = S(0);
  benchmark::DoNotOptimize(zero);
  while (state.KeepRunningBatch(bank_size)) {
    for (std::size_t i = 0; i < bank_size; ++i) {
      u = own.control(signals.y[i] + zero * u);
      benchmark::DoNotOptimize(&own);
      benchmark::ClobberMemory();
    }
  }
  benchmark::DoNotOptimize(u);
  state.SetLabel(label);
}

template <class S, class Controller>
void add_control(const std::string& name, const Controller& controller,
                 const std::string& bank_label, const std::string& latency_label) {
  benchmark::RegisterBenchmark(("bank/" + name).c_str(), [=](benchmark::State& state) {
    bank_of_controls<S>(state, controller, bank_label);
  });
  benchmark::RegisterBenchmark(("latency/" + name).c_str(), [=](benchmark::State& state) {
    latency_of_controls<S>(state, controller, latency_label);
  });
}

template <class Observer>
void add_observer(const std::string& name, const typename Observer::Config& config,
                  const std::string& limit) {
  using S = typename Observer::scalar_type;
  const auto observer = Observer::make(config).value();
  const auto law = AdrcLaw<Observer::order, S>::make(
                       {.controller_bandwidth = S(40), .input_gain = config.input_gain})
                       .value();
  const auto limiter = Limiter<S>::make(magnitudes<S>(), sample_time<S>).value();
  auto two_phase =
      PredictiveAdrc<Observer>::make(
          {.observer = config, .controller_bandwidth = S(40), .limits = magnitudes<S>()})
          .value();
  two_phase.set_reference(S(1));
  const auto complete =
      Adrc<Observer>::make(
          {.observer = config, .controller_bandwidth = S(40), .limits = magnitudes<S>()})
          .value();
  const auto against = [&](const std::string& pattern, const std::string& bound) {
    return "vs " + pattern + "/one_phase/" + name + bound + "; vs " + pattern + "/adrc/" + name +
           bound;
  };
  add_control<S>("one_phase/" + name, OnePhase<Observer>{observer, law, limiter}, "", "");
  add_control<S>("adrc/" + name, CompleteOnePhase<Observer>{complete}, "", "");
  add_control<S>("two_phase/" + name, two_phase, against("bank", limit), against("latency", ""));
  add_control<S>("both_phases/" + name, Rest<Observer>{two_phase}, against("bank", ""),
                 against("latency", ""));
}

template <class S, int Order>
void add_linear(const std::string& scalar) {
  using Observer = LinearEso<Order, S>;
  add_observer<Observer>(
      "linear_" + std::to_string(Order) + "/" + scalar,
      {.observer_bandwidth = S(300), .input_gain = S(2), .sample_time = sample_time<S>},
      Order >= 2 ? " <= 0.36" : "");  // a third of Adrc, which has become faster itself
}

template <class S>
void add_all(const std::string& scalar) {
  add_linear<S, 1>(scalar);
  add_linear<S, 2>(scalar);
  add_linear<S, 3>(scalar);
  add_linear<S, 4>(scalar);
  using Cascade = CascadeEso<2, 2, S>;
  add_observer<Cascade>("cascade_2x2/" + scalar,
                        {.observer_bandwidth = S(150),
                         .bandwidth_factor = S(2),
                         .input_gain = S(2),
                         .sample_time = sample_time<S>},
                        " <= 0.334");
  using Filter = ExtendedStateFilter<2, S>;
  typename Filter::Config config{.input_gain = S(2),
                                 .sample_time = sample_time<S>,
                                 .measurement_variance = static_cast<S>(1e-6),
                                 .disturbance_bounds = {S(0), S(0), S(1)},
                                 .inflation = static_cast<S>(0.1)};
  add_observer<Filter>("esf_2/" + scalar, config, " <= 0.334");
}

}  // namespace
}  // namespace esokit::benchmarks

int main(int argc, char** argv) {
  esokit::benchmarks::add_all<double>("double");
  esokit::benchmarks::add_all<float>("float");
  return esokit::benchmarks::run(argc, argv);
}
