/// @file
/// LinearEso and CascadeEso beside hand-written code for the same maths and a dense Eigen observer.
#include <array>
#include <cmath>
#include <esokit/analysis/integrator_chain.hpp>
#include <esokit/control/adrc_law.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <string>

#include "../support/run.hpp"
#include "../support/update_patterns.hpp"

namespace esokit::benchmarks {
namespace {

/// What one finds in most programs: the continuous observer by forward Euler, no check of anything.
template <class S>
struct ForwardEuler2 {
  S x0{}, x1{}, x2{};
  S l0_time, l1_time, l2_time, input_gain, time;

  void update(S y, S u) noexcept {
    const S e = y - x0;
    const S n0 = x0 + time * x1 + l0_time * e;
    const S n1 = x1 + time * (x2 + input_gain * u) + l1_time * e;
    x2 = x2 + l2_time * e;
    x0 = n0;
    x1 = n1;
  }
};

/// What one writes by hand for n = 2 on the scaled chain: straight-line code, named members, with a
/// finite check (that of all estimates in physical units) or without.
template <class S, bool Checked = true>
struct HandWritten2 {
  S x0{}, x1{}, x2{};
  S k0, k1, k2, scaled_input_gain, rate, twice_rate;
  S innovation{}, applied_input{};

  bool update(S y, S u) noexcept {
    const S driven = x2 + scaled_input_gain * u;
    const S half_way = x1 + driven;
    const S p0 = x0 + half_way;
    const S p1 = half_way + driven;
    const S e = y - p0;
    const S n0 = p0 + k0 * e;
    const S n1 = p1 + k1 * e;
    const S n2 = x2 + k2 * e;
    if constexpr (Checked) {
      const S probe = (std::abs(n2) * twice_rate + std::abs(n1)) * rate + std::abs(n0);
      if (!is_finite(probe)) return false;
    }
    x0 = n0;
    x1 = n1;
    x2 = n2;
    innovation = e;
    applied_input = u;
    return true;
  }
};

/// The same in physical units, as in a textbook.
template <class S>
struct Textbook2 {
  S x0{}, x1{}, x2{};
  S k0, k1, k2, gamma0, gamma1, time, half_square_time;
  S innovation{}, applied_input{};

  bool update(S y, S u) noexcept {
    const S p0 = x0 + time * x1 + half_square_time * x2 + gamma0 * u;
    const S p1 = x1 + time * x2 + gamma1 * u;
    const S e = y - p0;
    const S n0 = p0 + k0 * e;
    const S n1 = p1 + k1 * e;
    const S n2 = x2 + k2 * e;
    if (!is_finite(n0 + n1 + n2)) return false;
    x0 = n0;
    x1 = n1;
    x2 = n2;
    innovation = e;
    applied_input = u;
    return true;
  }
};

/// A fixed-gain observer on dense Eigen matrices, any size.
template <class S, int Size>
struct DenseEigen {
  EigenMatrix<S, Size> state = EigenMatrix<S, Size>::Zero();
  EigenMatrix<S, Size, Size> transition;
  EigenMatrix<S, Size> input;
  EigenMatrix<S, Size> gain;
  S innovation{}, applied_input{};

  bool update(S y, S u) noexcept {
    const EigenMatrix<S, Size> predicted = transition * state + input * u;
    const S e = y - predicted(0);
    const EigenMatrix<S, Size> next = predicted + gain * e;
    if (!is_finite(next.sum())) return false;
    state = next;
    innovation = e;
    applied_input = u;
    return true;
  }
};

template <class S>
constexpr S bandwidth = S(60);
template <class S>
constexpr S input_gain = S(2);
template <class S>
constexpr S sample_time = static_cast<S>(1e-3);

template <class S, int Size>
ScaledGain<Size, S> design() {
  return current_gain<Size, S>(
      EqualSampledPoles<Size, S>::from_bandwidth(bandwidth<S>, sample_time<S>).weights());
}

template <class S, int Order>
DenseEigen<S, Order + 1> dense() {
  using Chain = IntegratorChain<Order, S>;
  DenseEigen<S, Order + 1> observer;
  observer.transition = Chain::transition_matrix(sample_time<S>);
  observer.input = Chain::sampled_input_matrix(sample_time<S>, input_gain<S>);
  observer.gain = physical_gain<Order + 1, S>(design<S, Order + 1>(), sample_time<S>);
  return observer;
}

template <class S, int Order>
LinearEso<Order, S> linear() {
  return LinearEso<Order, S>::make({.observer_bandwidth = bandwidth<S>,
                                    .input_gain = input_gain<S>,
                                    .sample_time = sample_time<S>})
      .value();
}

template <class S, int Levels>
CascadeEso<2, Levels, S> cascade() {
  return CascadeEso<2, Levels, S>::make({.observer_bandwidth = bandwidth<S>,
                                         .bandwidth_factor = S(2),
                                         .input_gain = input_gain<S>,
                                         .sample_time = sample_time<S>})
      .value();
}

std::string against(const std::string& pattern, const std::string& name, const std::string& limit) {
  return "vs " + pattern + "/" + name + limit;
}

template <class S>
void add_all(const std::string& scalar) {
  const auto gain = design<S, 3>();
  const S rate = S(1) / sample_time<S>;
  const S square = sample_time<S> * sample_time<S>;
  const auto by_hand = [&]<bool Checked>() {
    return HandWritten2<S, Checked>{.k0 = gain[0],
                                    .k1 = gain[1],
                                    .k2 = gain[2],
                                    .scaled_input_gain = input_gain<S> * square / S(2),
                                    .rate = rate,
                                    .twice_rate = S(2) * rate};
  };
  add<S>("forward_euler/2/" + scalar,
         ForwardEuler2<S>{.l0_time = S(3) * bandwidth<S> * sample_time<S>,
                          .l1_time = S(3) * bandwidth<S> * bandwidth<S> * sample_time<S>,
                          .l2_time = bandwidth<S> * bandwidth<S> * bandwidth<S> * sample_time<S>,
                          .input_gain = input_gain<S>,
                          .time = sample_time<S>});
  add<S>("hand_written_unchecked/2/" + scalar, by_hand.template operator()<false>());
  add<S>("hand_written/2/" + scalar, by_hand.template operator()<true>());
  add<S>("textbook/2/" + scalar, Textbook2<S>{.k0 = gain[0],
                                              .k1 = gain[1] * rate,
                                              .k2 = gain[2] * S(2) * rate * rate,
                                              .gamma0 = input_gain<S> * square / S(2),
                                              .gamma1 = input_gain<S> * sample_time<S>,
                                              .time = sample_time<S>,
                                              .half_square_time = square / S(2)});
  add<S>("dense_eigen/1/" + scalar, dense<S, 1>());
  add<S>("dense_eigen/2/" + scalar, dense<S, 2>());
  add<S>("dense_eigen/3/" + scalar, dense<S, 3>());
  add<S>("dense_eigen/4/" + scalar, dense<S, 4>());

  const auto beside_dense = [&](int order) {
    const std::string name = "dense_eigen/" + std::to_string(order) + "/" + scalar;
    return Limits{against("bank", name, ""), against("call", name, ""),
                  against("latency", name, "")};
  };
  add<S>("linear_eso/1/" + scalar, linear<S, 1>(), beside_dense(1));
  const auto hand = [&](const std::string& pattern, const std::string& limit,
                        const std::string& dense_limit) {
    return against(pattern, "hand_written/2/" + scalar, limit) + "; " +
           against(pattern, "hand_written_unchecked/2/" + scalar, "") + "; " +
           against(pattern, "forward_euler/2/" + scalar, "") + "; " +
           against(pattern, "textbook/2/" + scalar, "") + "; " +
           against(pattern, "dense_eigen/2/" + scalar, dense_limit);
  };
  add<S>("linear_eso/2/" + scalar, linear<S, 2>(),
         {hand("bank", " <= 1.10", " < 1"), hand("call", " <= 1.10", ""),
          hand("latency", " <= 1.15", "")});
  add<S>("linear_eso/3/" + scalar, linear<S, 3>(), beside_dense(3));
  add<S>("linear_eso/4/" + scalar, linear<S, 4>(), beside_dense(4));

  const auto linear_limits = [&](const std::string& limit) {
    const std::string name = "linear_eso/2/" + scalar;
    return Limits{against("bank", name, limit), against("call", name, limit),
                  against("latency", name, limit)};
  };
  add<S>("cascade_eso/2x2/" + scalar, cascade<S, 2>(), linear_limits(""));
  // Three levels are three observers and the sums that join them: 54 operations beside 18, and more
  // numbers than registers.
  add<S>("cascade_eso/2x3/" + scalar, cascade<S, 3>(), linear_limits(" <= 3.3"));
}

}  // namespace
}  // namespace esokit::benchmarks

int main(int argc, char** argv) {
  esokit::benchmarks::add_all<double>("double");
  esokit::benchmarks::add_all<float>("float");
  return esokit::benchmarks::run(argc, argv);
}
