/// @file
/// Banks of observers and controllers in packs, beside the same in scalars and beside raw SIMD with
/// the same checks (support/raw_simd.hpp); and what one bad lane a pack costs. Times are of a lane.
/// Packs are for AVX: run it with --flags "-O2 -march=x86-64-v3" too.
#include <cstddef>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <string>
#include <vector>

#include "../support/raw_simd.hpp"
#include "../support/run.hpp"

namespace esokit::benchmarks {
namespace {

template <class S>
LinearEso<2, S> linear() {
  return LinearEso<2, S>::make(
             {.observer_bandwidth = S(60), .input_gain = S(2), .sample_time = S(1e-3)})
      .value();
}

template <class S>
CascadeEso<2, 3, S> cascade() {
  return CascadeEso<2, 3, S>::make({.observer_bandwidth = S(60),
                                    .bandwidth_factor = S(2),
                                    .input_gain = S(2),
                                    .sample_time = S(1e-3)})
      .value();
}

template <class S>
ExtendedStateFilter<2, S> filter(RiccatiMode mode) {
  return ExtendedStateFilter<2, S>::make({.input_gain = S(2),
                                          .sample_time = S(1e-3),
                                          .measurement_variance = S(1e-4),
                                          .disturbance_bounds = {S(0), S(0), S(1)},
                                          .inflation = S(0.01),
                                          .mode = mode})
      .value();
}

template <class S>
DelayedInput<LinearEso<2, S>, 8> delayed() {
  return DelayedInput<LinearEso<2, S>, 8>::make(
             {.observer = {.observer_bandwidth = S(60), .input_gain = S(2), .sample_time = S(1e-3)},
              .delay = 3})
      .value();
}

template <class S>
Adrc<DelayedInput<LinearEso<2, S>, 8>> delayed_adrc() {
  return Adrc<DelayedInput<LinearEso<2, S>, 8>>::make(
             {.observer = {.observer = {.observer_bandwidth = S(60),
                                        .input_gain = S(2),
                                        .sample_time = S(1e-3)},
                           .delay = 3},
              .controller_bandwidth = S(5)})
      .value();
}

/// One by one.
template <class S>
Adrc<WrappedOutput<LinearEso<2, S>>> angle() {
  return Adrc<WrappedOutput<LinearEso<2, S>>>::make(
             {.observer = {.observer = {.observer_bandwidth = S(60),
                                        .input_gain = S(2),
                                        .sample_time = S(1e-3)},
                           .period = S(6.25)},
              .controller_bandwidth = S(5)})
      .value();
}

template <class S>
Adrc<LinearEso<2, S>> adrc(bool rate) {
  esokit::Limits<S> limits{.lower = S(-1e3), .upper = S(1e3)};
  if (rate) limits.rate = S(1e5);
  return Adrc<LinearEso<2, S>>::make(
             {.observer = {.observer_bandwidth = S(60), .input_gain = S(2), .sample_time = S(1e-3)},
              .controller_bandwidth = S(5),
              .limits = limits})
      .value();
}

/// `lanes` observers (a controller takes a reference in the place of u), one after the other.
template <class S>
struct LaneOfBank {
  using type = LaneScalar<S>;
  static constexpr int lanes = lane_count<S>;
};
template <class S>
requires std::same_as<S, RawRegister<float>> || std::same_as<S, RawRegister<double>>
struct LaneOfBank<S> {
  using type = std::remove_cvref_t<decltype(S{}[0])>;
  static constexpr int lanes = default_lanes<type>;
};

template <class S, class Observer>
void bank(benchmark::State& state, const Observer& observer, std::size_t lanes, bool one_bad,
          const std::string& label) {
  constexpr std::size_t width = LaneOfBank<S>::lanes;
  using One = typename LaneOfBank<S>::type;
  const auto all = [](double x) {
    if constexpr (std::constructible_from<S, double>) {
      return S(x);
    } else {
      return S{} + static_cast<One>(x);
    }
  };
  std::vector<Observer> observers(lanes / width, observer);
  std::vector<S> y(observers.size(), all(0.3));
  std::vector<S> u(observers.size(), all(0.1));
  if (one_bad) {
    // The first of as many lanes as a pack of doubles with AVX has.
    for (std::size_t i = 0; i < lanes; i += static_cast<std::size_t>(default_lanes<One>)) {
      if constexpr (width > 1) {
        y[i / width][static_cast<int>(i % width)] = std::numeric_limits<One>::quiet_NaN();
      } else {
        y[i] = std::numeric_limits<One>::quiet_NaN();
      }
    }
  }
  benchmark::DoNotOptimize(y.data());
  benchmark::DoNotOptimize(u.data());
  while (state.KeepRunningBatch(static_cast<benchmark::IterationCount>(lanes))) {
    for (std::size_t i = 0; i < observers.size(); ++i) (void)observers[i].update(y[i], u[i]);
    benchmark::DoNotOptimize(observers.data());
    benchmark::ClobberMemory();
  }
  state.SetLabel(label);
}

template <class S, class Observer>
void add(const std::string& name, const Observer& observer, std::size_t lanes, bool one_bad,
         const std::string& label) {
  benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) {
    bank<S>(state, observer, lanes, one_bad, label);
  });
}

template <class One>
void add_all(const std::string& scalar) {
  using P = Pack<One>;
  for (const std::size_t lanes : {std::size_t{64}, std::size_t{512}}) {
    const std::string bank = "bank" + std::to_string(lanes) + "/";
    const auto beside = [&](const std::string& what, const std::string& more) {
      return "vs " + bank + what + "/" + scalar + " <= 1.0" + more;
    };
    const auto few = [lanes](const char* at_64, const char* at_512) {
      return std::string(" <= ") + (lanes == 64 ? at_64 : at_512);
    };
    using Raw = RawRegister<One>;
    const std::string raw = bank + "raw/2/pack_of_" + scalar;
    add<Raw>(raw, raw_eso<One>(), lanes, false, "");
    add<One>(bank + "linear_eso/2/" + scalar, linear<One>(), lanes, false, "");
    add<P>(bank + "linear_eso/2/pack_of_" + scalar, Packed<LinearEso<2, One>>(linear<One>()), lanes,
           false, beside("linear_eso/2", "; vs " + raw + few("1.20", "1.30")));
    add<One>(bank + "cascade_eso/2x3/" + scalar, cascade<One>(), lanes, false, "");
    add<P>(bank + "cascade_eso/2x3/pack_of_" + scalar,
           Packed<CascadeEso<2, 3, One>>(cascade<One>()), lanes, false,
           beside("cascade_eso/2x3", ""));
    for (const bool rate : {false, true}) {
      const std::string name = rate ? "adrc_rate/2" : "adrc/2";
      add<One>(bank + name + "/" + scalar, adrc<One>(rate), lanes, false, "");
      const std::string raw_adrc_name = bank + "raw_" + name + "/pack_of_" + scalar;
      if (rate) {
        add<Raw>(raw_adrc_name, raw_adrc<One, true>(), lanes, false, "");
      } else {
        add<Raw>(raw_adrc_name, raw_adrc<One, false>(), lanes, false, "");
      }
      add<P>(bank + name + "/pack_of_" + scalar, Packed<Adrc<LinearEso<2, One>>>(adrc<One>(rate)),
             lanes, false,
             beside(name, "; vs " + raw_adrc_name + few("1.20", rate ? "1.30" : "1.35")));
    }
  }
  // One of each that works on all lanes in its own way, and what goes lane by lane.
  const auto both = [&](const std::string& name, const auto& plain, const std::string& limit) {
    const Packed<std::remove_cvref_t<decltype(plain)>> packed(plain);
    add<One>("bank64/" + name + "/" + scalar, plain, 64, false, "");
    add<P>("bank64/" + name + "/pack_of_" + scalar, packed, 64, false,
           "vs bank64/" + name + "/" + scalar + limit);
  };
  for (const bool frozen : {false, true}) {
    const auto mode = frozen ? RiccatiMode::frozen : RiccatiMode::recursive;
    both(frozen ? "frozen_filter/2" : "filter/2", filter<One>(mode), " <= 1.0");
  }
  // Beside the observer alone: one element of the line is read and one written, u is tested, and
  // whether the lanes agree on where.
  both("delayed_input/2", delayed<One>(),
       " <= 1.0; vs bank64/linear_eso/2/pack_of_" + scalar + " <= 1.7");
  both("adrc_of_delayed_input/2", delayed_adrc<One>(), " <= 1.0");
  both("adrc_of_angle/2", angle<One>(), "");
  const std::string bad = "one_bad_lane/";
  const auto bad_label = [&](const std::string& what) {
    return "vs " + bad + what + "/" + scalar + "; vs bank64/" + what + "/" + scalar;
  };
  add<One>(bad + "linear_eso/2/" + scalar, linear<One>(), 64, true, "");
  add<P>(bad + "linear_eso/2/pack_of_" + scalar, Packed<LinearEso<2, One>>(linear<One>()), 64, true,
         bad_label("linear_eso/2"));
  add<One>(bad + "adrc_rate/2/" + scalar, adrc<One>(true), 64, true, "");
  add<P>(bad + "adrc_rate/2/pack_of_" + scalar, Packed<Adrc<LinearEso<2, One>>>(adrc<One>(true)),
         64, true, bad_label("adrc_rate/2"));
}

}  // namespace
}  // namespace esokit::benchmarks

int main(int argc, char** argv) {
  esokit::benchmarks::add_all<double>("double");
  esokit::benchmarks::add_all<float>("float");
  return esokit::benchmarks::run(argc, argv);
}
