#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/linear_controller.hpp>
#include <esokit/analysis/poles.hpp>
#include <esokit/tune/loop_cost.hpp>
#include <esokit/tune/specification.hpp>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION FastResponse::FastResponse(const LinearController& c)
    : n_(c.states()), h_(c.a), b_(c.from_y), c_(c.to_u), d_(c.y_to_u(0, 0)) {
  // By elimination with pivoting, which is cheapest (Wilkinson's elmhes).
  for (int m = 1; m + 1 < n_; ++m) {
    int pivot = m;
    for (int i = m + 1; i < n_; ++i) {
      if ((std::abs)(h_(i, m - 1)) > (std::abs)(h_(pivot, m - 1))) pivot = i;
    }
    if (h_(pivot, m - 1) == 0.0) continue;
    if (pivot != m) {
      for (int j = 0; j < n_; ++j) std::swap(h_(m, j), h_(pivot, j));
      for (int i = 0; i < n_; ++i) std::swap(h_(i, m), h_(i, pivot));
      std::swap(b_(m, 0), b_(pivot, 0));
      std::swap(c_(0, m), c_(0, pivot));
    }
    for (int i = m + 1; i < n_; ++i) {
      const double factor = h_(i, m - 1) / h_(m, m - 1);
      if (factor == 0.0) continue;
      for (int j = m - 1; j < n_; ++j) h_(i, j) -= factor * h_(m, j);
      b_(i, 0) -= factor * b_(m, 0);
      for (int k = 0; k < n_; ++k) h_(k, m) += factor * h_(k, i);
      c_(0, m) += factor * c_(0, i);
    }
  }
  work_.resize(static_cast<std::size_t>(n_ * n_ + n_));
}

ESOKIT_FUNCTION FastResponse::Answer FastResponse::at(std::complex<double> value) {
  using ComplexNumber = std::complex<double>;
  ComplexNumber* const m = work_.data();
  ComplexNumber* const x = m + n_ * n_;
  const auto entry = [&](int i, int j) -> ComplexNumber& { return m[i * n_ + j]; };
  for (int i = 0; i < n_; ++i) {
    for (int j = (std::max)(i - 1, 0); j < n_; ++j) entry(i, j) = -h_(i, j);
    entry(i, i) += value;
    x[i] = b_(i, 0);
  }
  ComplexNumber turn = 1.0;
  for (int k = 0; k < n_; ++k) {
    if (k + 1 < n_) {
      if (std::norm(entry(k + 1, k)) > std::norm(entry(k, k))) {
        for (int j = k; j < n_; ++j) std::swap(entry(k, j), entry(k + 1, j));
        std::swap(x[k], x[k + 1]);
        turn = -turn;
      }
      const ComplexNumber factor = divided(entry(k + 1, k), entry(k, k));
      for (int j = k + 1; j < n_; ++j) entry(k + 1, j) -= times(factor, entry(k, j));
      x[k + 1] -= times(factor, x[k]);
    }
    const double size = std::sqrt(std::norm(entry(k, k)));
    turn = times(turn, entry(k, k) / size);
  }
  ComplexNumber gain = d_;
  for (int k = n_ - 1; k >= 0; --k) {
    ComplexNumber sum = x[k];
    for (int j = k + 1; j < n_; ++j) sum -= times(entry(k, j), x[j]);
    x[k] = divided(sum, entry(k, k));
    gain += c_(0, k) * x[k];
  }
  return {gain, turn};
}

ESOKIT_FUNCTION Aliases aliases(const TuneModel& model, double gain, double w, double range) {
  using ComplexNumber = std::complex<double>;
  const double T = model.sample_time;
  const ComplexNumber held = 1.0 - std::polar(1.0, -w * T);
  constexpr int most = 10;
  ComplexNumber parts[2 * most + 1];
  Aliases found;
  for (int k = -most; k <= most; ++k) {
    const ComplexNumber s(0.0, w + 2.0 * std::numbers::pi * k / T);
    ComplexNumber part =
        gain * model.input_gain.value * held /
        (s * T * (s + model.pole) * (1.0 + model.lag * s) * (1.0 + model.sensor * s));
    for (int i = 1; i < model.order; ++i) part /= s;
    part *= std::exp(-s * model.dead_time);
    parts[k + most] = part;
    if (k != 0) found.rest += (std::abs)(part);
  }
  found.base = parts[most];
  found.size = (std::abs)(found.base);
  if (range >= 0.5 * T) return found;
  // A cell is short enough for a straight line: at most 0.2 rad of the frequency itself, which is
  // half a percent of its size. Where the others count, it is a sixteenth of a turn of the nearest
  // two.
  found.cells =
      found.rest < 0.02 * found.size ? 1 + static_cast<int>(10.0 * w * range) : Aliases::most_cells;
  for (int cell = 0; cell <= found.cells; ++cell) {
    const double late = (2.0 * cell / found.cells - 1.0) * range;
    for (int k = -most; k <= most; ++k) {
      found.sums[cell] +=
          parts[k + most] * std::polar(1.0, -(w + 2.0 * std::numbers::pi * k / T) * late);
    }
  }
  return found;
}

}  // namespace detail

ESOKIT_FUNCTION LoopCost::LoopCost(const TuneModel& model, const TuneRules& rules, double slowest,
                                   double points)
    : T_(model.sample_time), b0_(model.input_gain.value), factor_(rules.gain_factor) {
  std::vector<detail::SampledPlant> others;
  const auto variants = detail::plant_variants(model);
  const double share = model.input_gain.half_width / (std::abs)(model.input_gain.value);
  spread_[0] = {1.0 - share, 1.0 + share};
  for (std::size_t v = 0; v < (std::min)(variants.size(), most_variants); ++v) {
    // From this end of the interval of b0 to the other one.
    spread_[v + 1] = {(1.0 - share) / variants[v].gain, (1.0 + share) / variants[v].gain};
  }
  for (const auto& variant : variants) {
    others.push_back(
        detail::sampled_plant(detail::dense_plant(variant.model, variant.gain), model.sample_time));
  }
  variants_ = (std::min)(others.size(), most_variants);
  const detail::SampledPlant plant =
      detail::sampled_plant(detail::dense_plant(model), model.sample_time);
  const auto poles = detail::poles_of(plant.a);
  plant_states_ = plant.a.rows();
  // By how much latencies may differ from the middle one, which is less than the largest by that.
  range_ = 0.5 * (model.latency_half_width +
                  (std::min)(model.latency_half_width, model.lag + model.dead_time));
  const auto middle = [&](TuneModel other, double late) {
    other.dead_time += late - range_;
    return other;
  };
  const auto add = [&](double w, double density, double load) {
    // z - 1 as 2 j sin(wT/2) e^(j wT/2), which does not cancel for small angles.
    const double half = 0.5 * w * T_;
    const ComplexNumber value = ComplexNumber(0.0, 2.0 * std::sin(half)) * std::polar(1.0, half);
    Point p;
    p.frequency = w;
    p.value = value;
    p.plant = detail::response(plant, value)(0, 0);
    p.load = detail::response(plant, value, true)(0, 0);
    p.aliases[0] = detail::aliases(middle(model, model.latency_half_width), 1.0, w, range_);
    p.turned = std::polar(1.0, (std::min)(w * range_, std::numbers::pi));
    for (std::size_t v = 0; v < variants_; ++v) {
      p.ratio[v] = detail::response(others[v], value)(0, 0) / p.plant;
      p.aliases[v + 1] =
          detail::aliases(middle(variants[v].model, 0.0), variants[v].gain, w, range_);
    }
    p.turn = 1.0;
    for (const ComplexNumber& pole : poles) {
      const ComplexNumber factor = value - pole;
      p.turn *= factor / std::sqrt(std::norm(factor));
    }
    p.noise_power = density * model.noise * model.noise;
    p.load_power = density * model.disturbance * T_ / std::norm(value) + load;
    points_.push_back(p);
  };
  // Over v, log x = v + e^(v - last) - e^(first - v), x = W T / 2. It is even between first and
  // last; steps grow beyond, to z + 1 = 2e-6.
  const double first = std::log(0.15 * slowest * T_), last = std::log(10.0);
  const double from = first - 1.0, to = last + 2.25;
  const int steps = static_cast<int>(std::ceil(points * (to - from) / std::log(10.0)));
  const double h = (to - from) / steps;
  for (int i = 0; i <= steps; ++i) {
    const double v = from + h * i;
    const double after = std::exp(v - last), before = std::exp(first - v);
    const double x = std::exp(v + after - before);
    const double step = h * (1.0 + after + before);
    // Beyond the ends the densities are constant.
    const double ends = i == 0 || i == steps ? 0.5 * step + 1.0 : step;
    add(2.0 / T_ * std::atan(x), ends * 2.0 * x / (1.0 + x * x) / std::numbers::pi, 0.0);
  }
  add(std::numbers::pi / T_, 0.0, 0.0);
  walked_ = points_.size();
  for (const KnownSinusoid& sinusoid : model.sinusoids) {
    add(sinusoid.frequency, 0.0, 0.5 * sinusoid.amplitude * sinusoid.amplitude);
  }
}

ESOKIT_FUNCTION LoopNumbers LoopCost::operator()(const LinearController& controller) const {
  detail::FastResponse response(controller);
  LoopNumbers numbers;
  numbers.modulus = numbers.delay = numbers.tolerance = numbers.phase =
      std::numeric_limits<double>::infinity();
  double output = 0.0, control = 0.0, noise = 0.0;
  ComplexNumber before[3];
  double turned[3] = {};
  Trail trails[most_variants + 1];
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const Point& p = points_[i];
    const auto c = response.at(p.value);
    const ComplexNumber loop = -p.plant * c.gain;
    const ComplexNumber sensitivity = 1.0 / (1.0 + loop);
    const ComplexNumber cs = c.gain * sensitivity;
    const double caused = std::norm(cs) * p.noise_power;
    noise += caused;
    output += std::norm(loop * sensitivity) * p.noise_power +
              std::norm(p.load * sensitivity) * p.load_power;
    control += caused + std::norm(1.0 / b0_ + cs * p.load) * p.load_power;
    if (i >= walked_) continue;
    const ComplexNumber turn = p.turn * c.turn;
    // Also with b0 wrong by the factor at the ends of its interval.
    const ComplexNumber scales[] = {loop, factor_ * (variants_ > 0 ? p.ratio[0] : 1.0) * loop,
                                    1.0 / factor_ * (variants_ > 1 ? p.ratio[1] : 1.0) * loop};
    for (std::size_t g = 0; g < 3; ++g) {
      const ComplexNumber now = turn * (1.0 + scales[g]);
      turned[g] += i == 0 ? std::arg(now) : std::arg(now * std::conj(before[g]));
      before[g] = now;
    }
    if (i > 0 && std::signbit(loop.imag()) != std::signbit(trails[0].loop.imag())) {
      const ComplexNumber last = trails[0].loop;
      const double share = last.imag() / (last.imag() - loop.imag());
      const double real = last.real() + share * (loop.real() - last.real());
      // If both are large, a pole at frequency zero has turned L: this is no crossing.
      if (real < 0.0 && is_finite(real)) {
        numbers.tolerance = (std::min)(numbers.tolerance, (std::max)(-real, -1.0 / real));
      }
    }
    const double size = std::sqrt(std::norm(c.gain));
    for (std::size_t v = 0; v <= variants_; ++v) {
      margins(numbers, trails[v], v == 0 ? loop : p.ratio[v - 1] * loop, p.aliases[v], spread_[v],
              c.gain, size, i);
    }
  }
  const double whole = std::numbers::pi * (plant_states_ + controller.states());
  bool stable[3];
  for (std::size_t g = 0; g < 3; ++g) stable[g] = (std::abs)(turned[g] - whole) < 1.0;
  numbers.stable = stable[0] && is_finite(output) && is_finite(control);
  numbers.tolerant = stable[1] && stable[2];
  for (const Trail& trail : trails) {
    numbers.modulus = (std::min)(numbers.modulus, std::sqrt(trail.least));
  }
  numbers.output = std::sqrt(output);
  numbers.control = std::sqrt(control);
  numbers.control_noise = std::sqrt(noise);
  return numbers;
}

ESOKIT_FUNCTION double LoopCost::nearest(ComplexNumber from, ComplexNumber to) {
  const ComplexNumber step = to - from;
  const double along = -(from.real() * step.real() + from.imag() * step.imag());
  const double length = std::norm(step);
  if (along <= 0.0) return std::norm(from);
  if (along >= length) return std::norm(to);
  return (std::max)(std::norm(from) - along * along / length, 0.0);
}

ESOKIT_FUNCTION void LoopCost::margins(LoopNumbers& numbers, Trail& trail, ComplexNumber loop,
                                       const detail::Aliases& aliases, const Spread& spread,
                                       ComplexNumber gain, double size, std::size_t i) const {
  const Point& p = points_[i];
  const double base = size * aliases.size, rest = size * aliases.rest;
  double now = std::norm(1.0 + loop);
  // Where L is large nothing is near to -1, and that is half of all frequencies.
  if (range_ > 0.0 ? spread.low * (base - rest) < 5.0 : now < 16.0) {
    // As near to -1 as a gain of its interval brings it.
    if (spread.low < spread.high) {
      now = (std::min)(now, nearest(1.0 + spread.low * loop, 1.0 + spread.high * loop));
    }
    // As near to -1 as a latency of the range brings it.
    if (range_ > 0.0 && aliases.cells > 0) {
      ComplexNumber from = 1.0 - gain * aliases.sums[0];
      for (int cell = 1; cell <= aliases.cells; ++cell) {
        const ComplexNumber to = 1.0 - gain * aliases.sums[cell];
        now = (std::min)(now, nearest(from, to));
        from = to;
      }
      // At the latencies at both ends, every gain.
      for (const int cell : {0, aliases.cells}) {
        const ComplexNumber l = -gain * aliases.sums[cell];
        now = (std::min)(now, nearest(1.0 + spread.low * l, 1.0 + spread.high * l));
      }
    } else if (range_ > 0.0) {
      const ComplexNumber middle = aliases.base * gain;
      const double nearest =
          middle.real() >= base * p.turned.real()
              ? base
              : middle.real() * p.turned.real() + (std::abs)(middle.imag()) * p.turned.imag();
      const double distance = (std::max)(std::sqrt(1.0 + base * base - 2.0 * nearest) - rest, 0.0);
      now = (std::min)(now, distance * distance);
    }
    double least = now;
    // A parabola through three points of which the middle one is smallest.
    if (i >= 2 && trail.square[1] <= trail.square[0] && trail.square[1] <= now) {
      const double bend = trail.square[0] - 2.0 * trail.square[1] + now;
      const double slope = 0.5 * (now - trail.square[0]);
      least = bend > 0.0 ? (std::max)(trail.square[1] - 0.5 * slope * slope / bend, 0.0)
                         : trail.square[1];
    }
    trail.least = (std::min)(trail.least, least);
  }
  // The largest latency is the middle one and the range.
  const auto delay = [&](ComplexNumber there, double w) {
    numbers.delay = (std::min)(numbers.delay, detail::lag_to_minus_one(there) / w - range_);
    numbers.phase = (std::min)(numbers.phase, (std::abs)(std::arg(-there)) - w * range_);
  };
  const ComplexNumber largest = -(1.0 + aliases.rest / aliases.size) * aliases.base * gain;
  const double b = std::norm(largest);
  // With another gain of the interval it is here that abs(L) is one.
  if (i < walked_ && spread.low * spread.low * b < 1.0 && 1.0 < spread.high * spread.high * b) {
    delay(largest, p.frequency);
  }
  if (i > 0) {
    const double a = std::norm(trail.largest);
    if ((a < 1.0) != (b < 1.0)) {
      const double share = std::log(a) / std::log(a / b);
      const double w =
          std::pow(points_[i - 1].frequency, 1.0 - share) * std::pow(p.frequency, share);
      delay(trail.largest * std::polar(1.0, share * std::arg(largest * std::conj(trail.largest))),
            w);
    }
  }
  if (i + 1 == walked_ && b >= 1.0) delay(largest, p.frequency);
  trail.square[0] = trail.square[1];
  trail.square[1] = now;
  trail.loop = loop;
  trail.largest = largest;
}

ESOKIT_FUNCTION void exact_deviations(const TuneModel& model, const Loop& loop,
                                      LoopNumbers& numbers) {
  const DynamicSystem& closed = loop.system();
  const int n = closed.a.rows();
  DynamicSystem system{closed.a, closed.b, DynamicMatrix<double>(2, n),
                       DynamicMatrix<double>(2, closed.b.cols()), closed.sample_time};
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < n; ++j) system.c(i, j) = closed.c(i, j);
    for (int j = 0; j < closed.b.cols(); ++j) system.d(i, j) = closed.d(i, j);
  }
  const double b0 = model.input_gain.value;
  double output = 0.0, control = 0.0;
  for (const KnownSinusoid& sinusoid : model.sinusoids) {
    const auto g = detail::evaluate(
        system, detail::frequency_operator(sinusoid.frequency, system.sample_time));
    const double half = 0.5 * sinusoid.amplitude * sinusoid.amplitude;
    output += half * std::norm(g(0, 2));
    control += half * std::norm(1.0 / b0 + g(1, 2));
  }
  // A state stands at s1 d for a constant d; its distance from there is driven by -s1 times the
  // increments of d.
  DynamicMatrix<double> left = system.a, stand(n, 1);
  for (int i = 0; i < n; ++i) stand(i, 0) = -system.b(i, 2);
  detail::solve_in_place(left.view(), stand.view());
  for (int i = 0; i < n; ++i) system.b(i, 2) = -stand(i, 0);
  DynamicMatrix<double> input(system.b.cols(), system.b.cols());
  input(1, 1) = model.noise * model.noise;
  const auto noise = output_covariance(system, input);
  input(1, 1) = 0.0;
  input(2, 2) = model.disturbance * model.sample_time;
  const auto walk = output_covariance(system, input);
  if (noise) numbers.control_noise = std::sqrt((*noise)(1, 1));
  if (!noise || !walk) return;
  numbers.output = std::sqrt((*noise)(0, 0) + (*walk)(0, 0) + output);
  numbers.control = std::sqrt((*noise)(1, 1) + (*walk)(1, 1) + control);
}

ESOKIT_FUNCTION double pole_damping(const Loop& loop, double known) {
  std::vector<std::complex<double>> poles;
  for (const auto& pole : loop.poles())
    poles.emplace_back(1.0 + pole.real(), (std::abs)(pole.imag()));
  if (known > 0.0) {
    const auto at = std::polar(1.0, known * loop.sample_time());
    std::sort(poles.begin(), poles.end(),
              [&](const auto& a, const auto& b) { return std::norm(a - at) > std::norm(b - at); });
    poles.resize(poles.size() - std::min<std::size_t>(poles.size(), 2));
  }
  double least = 1.0;
  for (const auto& pole : poles) {
    if (std::norm(pole) < 1e-12) continue;
    const auto s = std::log(pole);
    least = (std::min)(least, -s.real() / (std::abs)(s));
  }
  return least;
}

}  // namespace esokit
