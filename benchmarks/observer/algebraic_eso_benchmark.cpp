/// @file
/// AlgebraicEso beside LinearEso of the same size: while its schedule runs, and once it has
/// settled.
#include <cstdio>
#include <cstdlib>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <string>

#include "../support/run.hpp"
#include "../support/update_patterns.hpp"

namespace esokit::benchmarks {
namespace {

template <class S>
constexpr S bandwidth = S(60);
template <class S>
constexpr S input_gain = S(2);
template <class S>
constexpr S sample_time = static_cast<S>(1e-3);

template <class S, int Order>
LinearEso<Order, S> linear() {
  return LinearEso<Order, S>::make({.observer_bandwidth = bandwidth<S>,
                                    .input_gain = input_gain<S>,
                                    .sample_time = sample_time<S>})
      .value();
}

template <class S, int Order>
AlgebraicEso<Order, S> algebraic(S shift) {
  return AlgebraicEso<Order, S>::make({.observer_bandwidth = bandwidth<S>,
                                       .frequency_shift = shift,
                                       .input_gain = input_gain<S>,
                                       .sample_time = sample_time<S>})
      .value();
}

/// One whose schedule has run past the deadbeat samples and goes on for longer than any benchmark
/// lasts: qT = 1e-9, so that its place in the schedule is set anew as for any q > 0.
template <class S, int Order>
AlgebraicEso<Order, S> running() {
  auto observer = algebraic<S, Order>(static_cast<S>(1e-6));
  for (int k = 0; k < 100; ++k) (void)observer.update(S(0), S(0));
  return observer;
}

template <class S, int Order>
AlgebraicEso<Order, S> settled() {
  auto observer = algebraic<S, Order>(S(100));
  for (int k = 0; k < 100'000 && !observer.settled(); ++k) (void)observer.update(S(0), S(0));
  if (!observer.settled()) {
    std::fprintf(stderr, "the schedule has not settled\n");
    std::exit(1);
  }
  return observer;
}

template <class S, int Order>
void add_order(const std::string& scalar, const Limits& while_running, const Limits& once_settled) {
  const std::string size = "/" + std::to_string(Order) + "/" + scalar;
  const auto against_linear = [&](const Limits& limits) {
    return Limits{"vs bank/linear_eso" + size + limits.bank,
                  "vs call/linear_eso" + size + limits.out_of_line,
                  "vs latency/linear_eso" + size + limits.latency};
  };
  add<S>("linear_eso" + size, linear<S, Order>());
  add<S>("algebraic_eso_running" + size, running<S, Order>(), against_linear(while_running));
  add<S>("algebraic_eso_settled" + size, settled<S, Order>(), against_linear(once_settled));
}

template <class S>
void add_all(const std::string& scalar) {
  add_order<S, 1>(scalar, {}, {});
  add_order<S, 2>(scalar, {" <= 4", "", " <= 3"}, {" <= 1.15", " <= 1.15", " <= 1.15"});
  add_order<S, 4>(scalar, {}, {});
}

}  // namespace
}  // namespace esokit::benchmarks

int main(int argc, char** argv) {
  esokit::benchmarks::add_all<double>("double");
  esokit::benchmarks::add_all<float>("float");
  return esokit::benchmarks::run(argc, argv);
}
