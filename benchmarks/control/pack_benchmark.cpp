/// @file
/// Banks of observers and controllers in packs, beside the same in scalars and beside pack code
/// written by hand with the same check; and what one bad lane a pack costs. Times are of a lane.
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

#include "../support/run.hpp"

namespace esokit::benchmarks {
namespace {

/// What one writes by hand for n = 2 on the scaled chain, for any scalar.
template <class S>
struct HandWritten2 {
  S x0{}, x1{}, x2{};
  S k0, k1, k2, scaled_input_gain, rate, twice_rate;
  S innovation{}, applied_input{};
  bool good = true;

  ESOKIT_INLINE void update(const S& y, const S& u) noexcept {
    const S driven = x2 + scaled_input_gain * u;
    const S half_way = x1 + driven;
    const S p0 = x0 + half_way;
    const S p1 = half_way + driven;
    const S e = y - p0;
    const S n0 = p0 + k0 * e;
    const S n1 = p1 + k1 * e;
    const S n2 = x2 + k2 * e;
    using detail::absolute;
    if (!all(is_finite(S((absolute(n2) * twice_rate + absolute(n1)) * rate + absolute(n0))))) {
      good = false;
      return;
    }
    x0 = n0;
    x1 = n1;
    x2 = n2;
    innovation = e;
    applied_input = u;
  }
};

template <class S>
HandWritten2<S> hand_written() {
  using One = LaneScalar<S>;
  const auto gain =
      current_gain<3, One>(EqualSampledPoles<3, One>::from_bandwidth(60, One(1e-3)).weights());
  return {.k0 = S(static_cast<double>(gain[0])),
          .k1 = S(static_cast<double>(gain[1])),
          .k2 = S(static_cast<double>(gain[2])),
          .scaled_input_gain = S(1e-6),
          .rate = S(1e3),
          .twice_rate = S(2e3)};
}

/// The loop around it with limits of u and of its rate.
template <class S>
struct HandWrittenAdrc2 {
  HandWritten2<S> observer;
  S w0, w1, w2, lower, upper, step, low, high;
  S requested{}, last{};

  ESOKIT_INLINE S update(const S& y, const S& r) noexcept {
    observer.update(y, last);
    S u = w0 * (r - observer.x0) - (w1 * observer.x1 + w2 * observer.x2);
    if (const auto good = is_finite(u); !all(good)) u = select(good, u, last);
    requested = u;
    u = select(u < low, low, u);
    u = select(high < u, high, u);
    last = u;
    const S below = u - step;
    const S above = u + step;
    low = select(below < lower, lower, below);
    low = select(upper < low, upper, low);
    high = select(upper < above, upper, above);
    high = select(high < lower, lower, high);
    return u;
  }
};

template <class S>
HandWrittenAdrc2<S> hand_written_adrc() {
  return {.observer = hand_written<S>(),
          .w0 = S(12.5),
          .w1 = S(5e3),
          .w2 = S(1e6),
          .lower = S(-1e3),
          .upper = S(1e3),
          .step = S(1e2),
          .low = S(-1e2),
          .high = S(1e2)};
}

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
Adrc<LinearEso<2, S>> adrc() {
  return Adrc<LinearEso<2, S>>::make(
             {.observer = {.observer_bandwidth = S(60), .input_gain = S(2), .sample_time = S(1e-3)},
              .controller_bandwidth = S(5),
              .limits = {S(-1e3), S(1e3), S(1e5)}})
      .value();
}

/// `lanes` observers (a controller takes a reference in the place of u), one after the other.
template <class S, class Observer>
void bank(benchmark::State& state, const Observer& observer, std::size_t lanes, bool one_bad,
          const std::string& label) {
  constexpr std::size_t width = lane_count<S>;
  using One = LaneScalar<S>;
  std::vector<Observer> observers(lanes / width, observer);
  std::vector<S> y(observers.size(), S(0.3));
  std::vector<S> u(observers.size(), S(0.1));
  if (one_bad) {
    // The first of as many lanes as a pack of doubles with AVX has.
    for (std::size_t i = 0; i < lanes; i += static_cast<std::size_t>(default_lanes<One>)) {
      if constexpr (PackScalar<S>) {
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
    const std::string hand = bank + "hand_written/2/pack_of_" + scalar;
    add<P>(hand, hand_written<P>(), lanes, false, "");
    add<One>(bank + "linear_eso/2/" + scalar, linear<One>(), lanes, false, "");
    add<P>(bank + "linear_eso/2/pack_of_" + scalar, Packed<LinearEso<2, One>>(linear<One>()), lanes,
           false, beside("linear_eso/2", "; vs " + hand + (lanes == 64 ? " <= 1.10" : " <= 1.25")));
    add<One>(bank + "cascade_eso/2x3/" + scalar, cascade<One>(), lanes, false, "");
    add<P>(bank + "cascade_eso/2x3/pack_of_" + scalar,
           Packed<CascadeEso<2, 3, One>>(cascade<One>()), lanes, false,
           beside("cascade_eso/2x3", ""));
    add<One>(bank + "adrc/2/" + scalar, adrc<One>(), lanes, false, "");
    const std::string adrc_by_hand = bank + "hand_written_adrc/2/pack_of_" + scalar;
    add<P>(adrc_by_hand, hand_written_adrc<P>(), lanes, false, "");
    add<P>(bank + "adrc/2/pack_of_" + scalar, Packed<Adrc<LinearEso<2, One>>>(adrc<One>()), lanes,
           false,
           beside("adrc/2", "; vs " + adrc_by_hand + (lanes == 64 ? " <= 1.15" : " <= 1.30")));
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
  add<One>(bad + "adrc/2/" + scalar, adrc<One>(), 64, true, "");
  add<P>(bad + "adrc/2/pack_of_" + scalar, Packed<Adrc<LinearEso<2, One>>>(adrc<One>()), 64, true,
         bad_label("adrc/2"));
}

}  // namespace
}  // namespace esokit::benchmarks

int main(int argc, char** argv) {
  esokit::benchmarks::add_all<double>("double");
  esokit::benchmarks::add_all<float>("float");
  return esokit::benchmarks::run(argc, argv);
}
