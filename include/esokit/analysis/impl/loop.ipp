#pragma once

#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/analysis/dynamic_matrix.hpp>
#include <esokit/analysis/frequency_response.hpp>
#include <esokit/analysis/library_systems.hpp>
#include <esokit/analysis/linear_controller.hpp>
#include <esokit/analysis/loop.hpp>
#include <esokit/analysis/poles.hpp>
#include <esokit/model/linear_plant.hpp>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION HeldFor held_for(const DynamicMatrix<double>& a, const DynamicMatrix<double>& b,
                                 double t) {
  const int n = a.rows();
  DynamicMatrix<double> stacked(n + b.cols(), n + b.cols());  // ((a, b), (0, 0))
  add(stacked, 0, 0, a, t);
  add(stacked, 0, n, b, t);
  DynamicMatrix<double> work(n + b.cols(), 2 * (n + b.cols()));
  exp_minus_identity(stacked.data(), work.data(), n + b.cols());
  HeldFor held{DynamicMatrix<double>(n, n), DynamicMatrix<double>(n, b.cols())};
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) held.increment(i, j) = stacked(i, j);
    for (int j = 0; j < b.cols(); ++j) held.input(i, j) = stacked(i, n + j);
  }
  return held;
}

ESOKIT_FUNCTION int SampledPlant::remembered(int input) const {
  for (int i = 0; i < a.rows(); ++i) {
    if (before(i, input) != 0.0) return whole[static_cast<std::size_t>(input)] + 1;
  }
  return whole[static_cast<std::size_t>(input)];
}

/// Computes column `input` of a sampled plant for the dead time of this input.
inline void set_input(SampledPlant& sampled, const DensePlant& plant, int input, double dead_time) {
  const double T = sampled.sample_time;
  const int n = plant.a.rows();
  DynamicMatrix<double> b(n, 1);
  for (int i = 0; i < n; ++i) b(i, 0) = plant.b(i, input);
  double whole = std::floor(dead_time / T);
  double rest = dead_time - whole * T;
  // A whole number of samples within the rounding of T.
  const double rounding = 1e-12 * (dead_time + T);
  if (rest > T - rounding) whole += 1.0;
  if (rest > T - rounding || rest < rounding) rest = 0.0;
  sampled.whole[static_cast<std::size_t>(input)] = static_cast<int>(whole);
  const HeldFor late = held_for(plant.a, b, T - rest);
  const HeldFor early = held_for(plant.a, b, rest);
  // Advances to the end of the sample by exp(A (T - rest)).
  auto old = product(late.increment, early.input);
  add(old, 0, 0, early.input);
  for (int i = 0; i < n; ++i) {
    sampled.now(i, input) = late.input(i, 0);
    sampled.before(i, input) = old(i, 0);
  }
}

ESOKIT_FUNCTION SampledPlant sampled_plant(const DensePlant& plant, double sample_time) {
  SampledPlant sampled{plant.a,    plant.b, DynamicMatrix<double>(plant.b.rows(), plant.b.cols()),
                       plant.e,    plant.c, std::vector<int>(plant.dead_time.size()),
                       sample_time};
  if (sample_time > 0.0) {
    const HeldFor held = held_for(plant.a, plant.e, sample_time);
    sampled.a = held.increment;
    sampled.e = held.input;
    for (int j = 0; j < plant.b.cols(); ++j) {
      set_input(sampled, plant, j, plant.dead_time[static_cast<std::size_t>(j)]);
    }
  }
  // Scales the states to similar size, without rounding.
  const int n = plant.a.rows();
  const int q = plant.b.cols();
  DynamicMatrix<double> inputs(n, 2 * q + plant.e.cols());
  add(inputs, 0, 0, sampled.now);
  add(inputs, 0, q, sampled.before);
  add(inputs, 0, 2 * q, sampled.e);
  balance(sampled.a.view(), inputs.view(), sampled.c.view());
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < q; ++j) {
      sampled.now(i, j) = inputs(i, j);
      sampled.before(i, j) = inputs(i, q + j);
    }
    for (int j = 0; j < plant.e.cols(); ++j) sampled.e(i, j) = inputs(i, 2 * q + j);
  }
  return sampled;
}

/// The same with past inputs as states.
inline DynamicSystem with_memory(const SampledPlant& plant) {
  const int n = plant.a.rows();
  const int q = plant.now.cols();
  int states = n;
  for (int j = 0; j < q; ++j) states += plant.remembered(j);
  DynamicSystem all{DynamicMatrix<double>(states, states),
                    DynamicMatrix<double>(states, q),
                    DynamicMatrix<double>(plant.c.rows(), states),
                    {},
                    plant.sample_time};
  add(all.a, 0, 0, plant.a);
  add(all.c, 0, 0, plant.c);
  int first = n;
  for (int j = 0; j < q; ++j) {
    const int count = plant.remembered(j);
    const int whole = plant.whole[static_cast<std::size_t>(j)];
    for (int k = 0; k < count; ++k) {
      all.a(first + k, first + k) = -1.0;
      if (k > 0) all.a(first + k, first + k - 1) = 1.0;
    }
    if (count > 0) all.b(first, j) = 1.0;
    // u[k - i] is state first + i - 1.
    for (int i = 0; i < n; ++i) {
      if (whole == 0) {
        all.b(i, j) += plant.now(i, j);
      } else {
        all.a(i, first + whole - 1) += plant.now(i, j);
      }
      if (count > whole) all.a(i, first + whole) += plant.before(i, j);
    }
    first += count;
  }
  return all;
}

ESOKIT_FUNCTION ComplexMatrix response(const SampledPlant& plant, std::complex<double> value,
                                       bool disturbance) {
  const int n = plant.a.rows();
  if (disturbance) {
    ComplexMatrix e(n, plant.e.cols());
    for (int j = 0; j < e.cols(); ++j) {
      for (int i = 0; i < n; ++i) e(i, j) = plant.e(i, j);
    }
    return seen(plant.c, resolvent(plant.a, value, std::move(e)));
  }
  const int q = plant.now.cols();
  ComplexMatrix b(n, q);
  for (int j = 0; j < q; ++j) {
    const bool remembers = plant.remembered(j) > 0;
    const std::complex<double> back = remembers ? 1.0 / (1.0 + value) : 0.0;
    const std::complex<double> whole =
        remembers ? std::pow(back, plant.whole[static_cast<std::size_t>(j)]) : 1.0;
    for (int i = 0; i < n; ++i) {
      b(i, j) = plant.now(i, j);
      if (remembers) b(i, j) = whole * (b(i, j) + back * plant.before(i, j));
    }
  }
  return seen(plant.c, resolvent(plant.a, value, std::move(b)));
}

ESOKIT_FUNCTION ComplexMatrix response(const LinearController& controller,
                                       std::complex<double> value) {
  ComplexMatrix b(controller.states(), controller.channels());
  for (int j = 0; j < b.cols(); ++j) {
    for (int i = 0; i < b.rows(); ++i) b(i, j) = controller.from_y(i, j);
  }
  ComplexMatrix u = seen(controller.to_u, resolvent(controller.a, value, std::move(b)));
  for (int j = 0; j < u.cols(); ++j) {
    for (int i = 0; i < u.rows(); ++i) u(i, j) += controller.y_to_u(i, j);
  }
  return u;
}

ESOKIT_FUNCTION void balance(LinearController& c) {
  const int n = c.states();
  const int q = c.channels();
  DynamicMatrix<double> b(n, 2 * q);
  add(b, 0, 0, c.from_y);
  add(b, 0, q, c.from_r);
  DynamicMatrix<double> outputs(q + c.estimates(), n);
  add(outputs, 0, 0, c.to_u);
  add(outputs, q, 0, c.to_estimate);
  balance(c.a.view(), b.view(), outputs.view());
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < q; ++j) {
      c.from_y(i, j) = b(i, j);
      c.from_r(i, j) = b(i, q + j);
      c.to_u(j, i) = outputs(j, i);
    }
    for (int j = 0; j < c.estimates(); ++j) c.to_estimate(j, i) = outputs(q + j, i);
  }
}

ESOKIT_FUNCTION DynamicSystem closed_system(const SampledPlant& sampled,
                                            const LinearController& controller, int open) {
  const DynamicSystem plant = with_memory(sampled);
  const LinearController& c = controller;
  const int n = plant.a.rows();
  const int m = c.states();
  const int q = c.channels();
  const int disturbances = sampled.e.cols();
  DynamicMatrix<double> b = plant.b;
  if (open >= 0) {
    for (int i = 0; i < n; ++i) b(i, open) = 0.0;
  }
  DynamicSystem closed{
      DynamicMatrix<double>(n + m, n + m), DynamicMatrix<double>(n + m, 2 * q + disturbances),
      DynamicMatrix<double>(2 * q + c.estimates(), n + m),
      DynamicMatrix<double>(2 * q + c.estimates(), 2 * q + disturbances), plant.sample_time};
  const auto through = product(b, c.y_to_u);
  add(closed.a, 0, 0, plant.a);
  add(closed.a, 0, 0, product(through, plant.c));
  add(closed.a, 0, n, product(b, c.to_u));
  add(closed.a, n, 0, product(c.from_y, plant.c));
  add(closed.a, n, n, c.a);
  add(closed.b, 0, 0, product(b, c.r_to_u));
  add(closed.b, 0, q, through);
  add(closed.b, 0, 2 * q, sampled.e);
  add(closed.b, n, 0, c.from_r);
  add(closed.b, n, q, c.from_y);
  add(closed.c, 0, 0, plant.c);
  add(closed.c, q, 0, product(c.y_to_u, plant.c));
  add(closed.c, q, n, c.to_u);
  add(closed.c, 2 * q, 0, product(c.y_to_estimate, plant.c));
  add(closed.c, 2 * q, n, c.to_estimate);
  add(closed.d, q, 0, c.r_to_u);
  add(closed.d, q, q, c.y_to_u);
  add(closed.d, 2 * q, 0, c.r_to_estimate);
  add(closed.d, 2 * q, q, c.y_to_estimate);
  balance(closed.a.view(), closed.b.view(), closed.c.view());
  return closed;
}

/// (I + factor g) in place of g; g is square.
inline ComplexMatrix identity_plus(const ComplexMatrix& g, double factor = 1.0) {
  ComplexMatrix out(g.rows(), g.rows());
  for (int j = 0; j < g.rows(); ++j) {
    for (int i = 0; i < g.rows(); ++i) out(i, j) = factor * g(i, j);
    out(j, j) += 1.0;
  }
  return out;
}

ESOKIT_FUNCTION std::complex<double> loop_gain_of_channel(const ComplexMatrix& plant,
                                                          const ComplexMatrix& controller,
                                                          int channel) {
  ComplexMatrix l = product(controller, plant);
  const int q = l.rows();
  for (int j = 0; j < q; ++j) {
    for (int i = 0; i < q; ++i) l(i, j) = -l(i, j);
  }
  if (q == 1) return l(0, 0);
  // l_ii - l_io (I + l_oo)^-1 l_oi, o: the others
  const auto other = [&](int i) { return i < channel ? i : i + 1; };
  ComplexMatrix others(q - 1, q - 1);
  ComplexMatrix into(q - 1, 1);
  for (int i = 0; i < q - 1; ++i) {
    for (int j = 0; j < q - 1; ++j) others(i, j) = l(other(i), other(j));
    others(i, i) += 1.0;
    into(i, 0) = l(other(i), channel);
  }
  solve_in_place(others.view(), into.view());
  std::complex<double> gain = l(channel, channel);
  for (int i = 0; i < q - 1; ++i) gain -= l(channel, other(i)) * into(i, 0);
  return gain;
}

/// Largest singular value.
inline double largest_singular_value(const ComplexMatrix& matrix) {
  const int n = matrix.cols();
  if (n == 1 && matrix.rows() == 1) return (std::abs)(matrix(0, 0));
  ComplexMatrix square(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < matrix.rows(); ++k) {
        square(i, j) += std::conj(matrix(k, i)) * matrix(k, j);
      }
    }
  }
  std::vector<std::complex<double>> values(static_cast<std::size_t>(n));
  if (!eigenvalues(square.view(), values.data())) return std::numeric_limits<double>::quiet_NaN();
  double largest = 0.0;
  for (const auto& value : values) largest = (std::max)(largest, value.real());
  return std::sqrt(largest);
}

}  // namespace detail

ESOKIT_FUNCTION Expected<Loop, Error<double>> Loop::make(detail::DensePlant plant,
                                                         LinearController controller) {
  const double T = controller.sample_time;
  const int q = controller.channels();
  Rules<double> rules;
  rules.not_negative("controller.sample_time", T)
      .demand(plant.b.cols() == q,
              {"plant.inputs", static_cast<double>(plant.b.cols()),
               "must be the channels of the controller, that is", -1, static_cast<double>(q), true})
      .demand(plant.c.rows() == q, {"plant.outputs", static_cast<double>(plant.c.rows()),
                                    "must be the channels of the controller, that is", -1,
                                    static_cast<double>(q), true});
  for (const auto* matrix : {&plant.a, &plant.b, &plant.c, &plant.e}) {
    rules.finite("plant", detail::sum_of_magnitudes(*matrix));
  }
  for (const auto* matrix :
       {&controller.a, &controller.from_y, &controller.from_r, &controller.from_u, &controller.to_u,
        &controller.y_to_u, &controller.r_to_u, &controller.to_estimate, &controller.y_to_estimate,
        &controller.r_to_estimate}) {
    rules.finite("controller", detail::sum_of_magnitudes(*matrix));
  }
  for (const double dead_time : plant.dead_time) {
    rules.not_negative("plant.dead_time", dead_time)
        .demand(T > 0.0 || !(dead_time > 0.0), "plant.dead_time", dead_time,
                "must be zero with a continuous controller")
        .demand(!(T > 0.0) || dead_time <= detail::most_whole_samples * T, "plant.dead_time",
                dead_time, "must not be above 1000 samples");
  }
  if (!rules) return rules.error();
  Loop loop;
  loop.continuous_ = std::move(plant);
  loop.input_gain_ = controller.input_gain;
  loop.controller_ = detail::closed_upon_itself(controller);
  detail::balance(loop.controller_);
  loop.plant_ = detail::sampled_plant(loop.continuous_, T);
  loop.system_ = detail::closed_system(loop.plant_, loop.controller_);
  const DynamicSystem& closed = loop.system_;
  for (const auto* matrix : {&closed.a, &closed.b, &closed.c, &closed.d}) {
    rules.finite("system", detail::sum_of_magnitudes(*matrix));
  }
  if (!rules) return rules.error();
  loop.poles_ = detail::poles_of(closed.a);
  loop.abscissa_ = detail::worst_pole(loop.poles_.data(), loop.poles_.size(), T > 0.0);
  if (!is_finite(loop.abscissa_)) {
    return Error<double>{"plant.b", loop.continuous_.b(0, 0),
                         "gives a closed loop whose poles the scalar cannot hold"};
  }
  return loop;
}

ESOKIT_FUNCTION Expected<Loop::ComplexNumber, Error<double>> Loop::loop_gain(double frequency,
                                                                             int channel) const {
  return at(frequency, channel, channel, [&](ComplexNumber value) {
    return detail::loop_gain_of_channel(detail::response(plant_, value),
                                        detail::response(controller_, value), channel);
  });
}

ESOKIT_FUNCTION Expected<Loop::ComplexNumber, Error<double>> Loop::sensitivity(double frequency,
                                                                               int channel) const {
  return of_gain(frequency, channel, [](ComplexNumber l) { return 1.0 / (1.0 + l); });
}

ESOKIT_FUNCTION Expected<Loop::ComplexNumber, Error<double>> Loop::complementary_sensitivity(
    double frequency, int channel) const {
  return of_gain(frequency, channel, [](ComplexNumber l) { return l / (1.0 + l); });
}

ESOKIT_FUNCTION Expected<Loop::ComplexNumber, Error<double>> Loop::noise_to_control(
    double frequency, int control, int measurement) const {
  return at(frequency, control, measurement, [&](ComplexNumber value) {
    // u = C (v + P u)
    auto c = detail::response(controller_, value);
    auto inner = detail::identity_plus(detail::product(c, detail::response(plant_, value)), -1.0);
    detail::solve_in_place(inner.view(), c.view());
    return ComplexNumber(c(control, measurement));
  });
}

ESOKIT_FUNCTION Expected<Loop::ComplexNumber, Error<double>> Loop::disturbance_to_output(
    double frequency, int output, int disturbance) const {
  return at(frequency, output, disturbance, [&](ComplexNumber value) {
    auto y = detail::response(plant_, value, true);
    auto inner = output_return(value);
    detail::solve_in_place(inner.view(), y.view());
    return ComplexNumber(y(output, disturbance));
  });
}

ESOKIT_FUNCTION Expected<double, Error<double>> Loop::largest_sensitivity(double frequency) const {
  double largest = 0.0;
  const auto found = at(frequency, 0, 0, [&](ComplexNumber value) {
    largest = sensitivity_at(value);
    return ComplexNumber(largest);
  });
  if (!found) return found.error();
  return largest;
}

ESOKIT_FUNCTION double Loop::sensitivity_at(ComplexNumber value) const {
  auto inner = output_return(value);
  auto identity = detail::ComplexMatrix(channels(), channels());
  for (int i = 0; i < channels(); ++i) identity(i, i) = 1.0;
  detail::solve_in_place(inner.view(), identity.view());
  return detail::largest_singular_value(identity);
}

ESOKIT_FUNCTION Check<double> Loop::check_channel(const char* field, int channel) const {
  return Rules<double>{}.demand(
      0 <= channel && channel < channels(),
      {field, static_cast<double>(channel), "must be 0 .. channels - 1, that is at most", -1,
       static_cast<double>(channels() - 1), true});
}

ESOKIT_FUNCTION detail::ComplexMatrix Loop::output_return(ComplexNumber value) const {
  return detail::identity_plus(
      detail::product(detail::response(plant_, value), detail::response(controller_, value)), -1.0);
}

template <class Function>
Expected<Loop::ComplexNumber, Error<double>> Loop::at(double frequency, int row, int column,
                                                      Function&& function) const {
  Rules<double> rules;
  rules.positive("frequency", frequency)
      .all_of(detail::check_frequency(frequency, sample_time()))
      .all_of(check_channel("channel", row))
      .all_of(check_channel("channel", column));
  if (!rules) return rules.error();
  const ComplexNumber value = function(detail::frequency_operator(frequency, sample_time()));
  if (!is_finite(value.real()) || !is_finite(value.imag())) {
    return Error<double>{"frequency", frequency, "is a pole of the closed loop"};
  }
  return value;
}

template <class Function>
Expected<Loop::ComplexNumber, Error<double>> Loop::of_gain(double frequency, int channel,
                                                           Function&& function) const {
  const auto l = loop_gain(frequency, channel);
  if (!l) return l.error();
  const ComplexNumber value = function(*l);
  if (!is_finite(value.real()) || !is_finite(value.imag())) {
    return Error<double>{"frequency", frequency, "is a pole of the closed loop"};
  }
  return value;
}

}  // namespace esokit
