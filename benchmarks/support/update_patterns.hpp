/// @file
/// The three situations in which an observer's update is measured.
#pragma once

#include <benchmark/benchmark.h>

#include <array>
#include <cstddef>
#include <string>

namespace esokit::benchmarks {

inline constexpr std::size_t bank_size = 16;

/// Inputs that the compiler knows nothing about.
template <class S>
struct Signals {
  std::array<S, bank_size> y;
  std::array<S, bank_size> u;
  Signals() {
    for (std::size_t i = 0; i < bank_size; ++i) {
      y[i] = static_cast<S>(0.3) + static_cast<S>(0.01) * static_cast<S>(i);
      u[i] = static_cast<S>(0.1);
    }
    benchmark::DoNotOptimize(y);
    benchmark::DoNotOptimize(u);
  }
};

/// 16 observers one after the other: throughput.
template <class S, class Observer>
void bank(benchmark::State& state, const Observer& observer, const std::string& label) {
  std::array<Observer, bank_size> observers = [&]<std::size_t... I>(std::index_sequence<I...>) {
    return std::array<Observer, bank_size>{((void)I, observer)...};
  }
  (std::make_index_sequence<bank_size>{});
  const Signals<S> signals;
  while (state.KeepRunningBatch(bank_size)) {
    for (std::size_t i = 0; i < bank_size; ++i) {
      (void)observers[i].update(signals.y[i], signals.u[i]);
    }
    benchmark::DoNotOptimize(observers.data());
    benchmark::ClobberMemory();
  }
  state.SetLabel(label);
}

/// A call that the compiler cannot see into, as in a controller task.
template <class S, class Observer>
[[gnu::noinline]] void call(Observer& observer, S y, S u) {
  (void)observer.update(y, u);
}

template <class S, class Observer>
void out_of_line(benchmark::State& state, const Observer& observer, const std::string& label) {
  std::array<Observer, bank_size> observers = [&]<std::size_t... I>(std::index_sequence<I...>) {
    return std::array<Observer, bank_size>{((void)I, observer)...};
  }
  (std::make_index_sequence<bank_size>{});
  const Signals<S> signals;
  while (state.KeepRunningBatch(bank_size)) {
    for (std::size_t i = 0; i < bank_size; ++i) {
      call<S>(observers[i], signals.y[i], signals.u[i]);
    }
    benchmark::ClobberMemory();
  }
  state.SetLabel(label);
}

/// One observer, inlined, each update on the state that the last one left in memory.
template <class S, class Observer>
void latency(benchmark::State& state, const Observer& observer, const std::string& label) {
  Observer own = observer;
  const Signals<S> signals;
  while (state.KeepRunningBatch(bank_size)) {
    for (std::size_t i = 0; i < bank_size; ++i) {
      (void)own.update(signals.y[i], signals.u[i]);
      benchmark::DoNotOptimize(&own);
      benchmark::ClobberMemory();
    }
  }
  state.SetLabel(label);
}

/// Registers the three under `bank/NAME`, `call/NAME`, `latency/NAME`. `limits` is a list of
/// "BASELINE LIMIT" for all three, see benchmarks/run.sh; "" for none.
struct Limits {
  std::string bank;
  std::string out_of_line;
  std::string latency;
};

template <class S, class Observer>
void add(const std::string& name, const Observer& observer, const Limits& limits = {}) {
  benchmark::RegisterBenchmark(("bank/" + name).c_str(), [=](benchmark::State& state) {
    bank<S>(state, observer, limits.bank);
  });
  benchmark::RegisterBenchmark(("call/" + name).c_str(), [=](benchmark::State& state) {
    out_of_line<S>(state, observer, limits.out_of_line);
  });
  benchmark::RegisterBenchmark(("latency/" + name).c_str(), [=](benchmark::State& state) {
    latency<S>(state, observer, limits.latency);
  });
}

}  // namespace esokit::benchmarks
