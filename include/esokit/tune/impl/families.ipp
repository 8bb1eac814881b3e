#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/analysis/library_systems.hpp>
#include <esokit/analysis/poles.hpp>
#include <esokit/gain/half_gain.hpp>
#include <esokit/gain/model_gain.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/model/augmented_model.hpp>
#include <esokit/tune/families.hpp>
#include <esokit/tune/lqg.hpp>
#include <esokit/tune/specification.hpp>
#include <optional>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION std::array<std::complex<double>, 2> pole_pair(double w, double zeta) {
  if (zeta < 1.0) {
    const std::complex<double> p(-zeta * w, w * std::sqrt(1.0 - zeta * zeta));
    return {p, std::conj(p)};
  }
  const double root = std::sqrt(zeta * zeta - 1.0);
  return {-w * (zeta + root), -w / (zeta + root)};
}

ESOKIT_FUNCTION std::vector<double> polynomial(const std::vector<std::complex<double>>& poles) {
  std::vector<std::complex<double>> c{1.0};
  for (const auto& p : poles) {
    c.push_back(c.back());
    for (std::size_t i = c.size() - 2; i > 0; --i) c[i] = c[i - 1] - p * c[i];
    c[0] *= -p;
  }
  std::vector<double> real;
  for (std::size_t i = 0; i + 1 < c.size(); ++i) real.push_back(c[i].real());
  return real;
}

/// Physical gains of a chain for sampled poles with these weights.
template <int Size>
void chain_gains(const PoleWeights<Size, double>& weights, double T, std::vector<double>& gains) {
  const auto scaled = current_gain<Size, double>(weights);
  double unit = 1.0;
  for (int r = 0; r < Size; ++r) {
    if (r > 0) unit *= r / T;
    gains.push_back(unit * scaled[static_cast<std::size_t>(r)]);
  }
}

ESOKIT_FUNCTION ObserverKind chain_kind(const TuneModel& model, TuneFamily family, int extension,
                                        int levels) {
  ObserverKind kind;
  const int n = model.order;
  const int size = n + extension;
  const double T = model.sample_time;
  kind.order = n;
  kind.size = size;
  kind.placed = size;
  kind.levels = levels;
  kind.input_gain = model.input_gain.value;
  kind.step = DynamicMatrix<double>(size, size);
  kind.gamma = DynamicMatrix<double>(size, 1);
  kind.disturbance = DynamicMatrix<double>(size, size);
  for (int i = n; i < size; ++i) kind.disturbance(i, i) = 1.0;
  for (int i = 0; i < size; ++i) {
    double power = 1.0;
    for (int j = i + 1; j < size; ++j) {
      power *= T / (j - i);
      kind.step(i, j) = power;
    }
    kind.state_of_row.push_back(i);
    if (i < n) kind.gamma(i, 0) = kind.step(i, n) * kind.input_gain;
  }
  const double noise = model.noise * model.noise;
  kind.gains = [=, step = kind.step](const TuneSettings& s, std::vector<double>& gains) {
    if (family == TuneFamily::filter) {
      auto phi = step;
      for (int i = 0; i < size; ++i) phi(i, i) += 1.0;
      DynamicMatrix<double> c(size, 1), q(size, size);
      c(0, 0) = 1.0;
      q(size - 1, size - 1) = s.disturbance_bound * s.disturbance_bound;
      const auto p = solve_riccati(transposed(phi), c, noise, q);
      for (int i = 0; i < size; ++i) gains.push_back(p(i, 0) / (p(0, 0) + noise));
      return true;
    }
    with_number<2, 5>(size, [&](auto number) {
      constexpr int N = number();
      double bandwidth = s.observer_bandwidth;
      for (int level = 0; level < levels; ++level) {
        if (family == TuneFamily::half_gain) {
          chain_gains<N>(HalfGainPoles::sample<N, double>(bandwidth, T).weights(), T, gains);
        } else if (family == TuneFamily::free_poles) {
          Array<std::complex<double>, N> poles{};
          std::copy(s.observer_poles.begin(), s.observer_poles.end(), poles.begin());
          chain_gains<N>(SampledPoleSet<N, double>::from_continuous(poles, T).weights(), T, gains);
        } else {
          chain_gains<N>(EqualSampledPoles<N, double>::from_bandwidth(bandwidth, T).weights(), T,
                         gains);
        }
        bandwidth *= s.bandwidth_factor;
      }
      return 0;
    });
    return true;
  };
  return kind;
}

template <ModelParts Parts>
typename AugmentedModel<Parts>::Settings model_settings(const TuneModel& model,
                                                        const TuneSettings& chosen) {
  typename AugmentedModel<Parts>::Settings settings{};
  if constexpr (Parts.actuator == 1) settings.actuator.time_constant = model.lag;
  if constexpr (Parts.sensor == 1) settings.sensor.time_constant = model.sensor;
  if constexpr (Parts.resonators == 1) {
    settings.resonators[0] = {model.sinusoids.front().frequency, 0.0, chosen.capture_bandwidth};
  }
  return settings;
}

/// Gains of a model's states for given poles of its corrected part, in physical units.
/// @param factors the PoleFactors for the number of poles of the part
template <class Model, class Factors>
bool model_gains(const Model& made, double bandwidth, const Factors& factors,
                 std::vector<double>& gains) {
  const double T = made.sample_time();
  typename Model::State ones;
  ones.fill(1.0);
  const auto units = made.physical(ones);
  return made.with_corrected_part(bandwidth, [&](const auto& part) {
    using Part = std::remove_cvref_t<decltype(part)>;
    constexpr int pairs = Part::own_pairs;
    constexpr int placed = Part::size - 2 * pairs;
    Array<Contraction<double>, pairs> own{};
    for (std::size_t i = 0; i < own.size(); ++i) {
      own[i] = contraction(part.pairs[i][0] * T, part.pairs[i][1] * T);
    }
    const auto of_part =
        placed_gain(part.step, part.output, part.degrees,
                    with_pairs(factors(std::integral_constant<int, placed>{}), own));
    gains.resize(Model::size);
    for (int row = 0; row < Model::size; ++row) {
      const int i = Model::state_of_row(row);
      double sum = 0.0;
      for (std::size_t j = 0; j < of_part.size(); ++j) {
        sum += part.whole(i, static_cast<int>(j)) * of_part[j];
      }
      if (!is_finite(sum)) return false;
      gains[static_cast<std::size_t>(i)] = units(row) * sum;
    }
    return true;
  });
}

/// An observer that knows parts of the plant; none if the model refuses the numbers.
template <ModelParts Parts>
std::optional<ObserverKind> known_kind(const TuneModel& model, TuneFamily family) {
  using Model = AugmentedModel<Parts>;
  const auto make = [model](const TuneSettings& settings) {
    return Model::make(model_settings<Parts>(model, settings), model.input_gain.value,
                       model.sample_time);
  };
  const auto first = make({});
  if (!first) return std::nullopt;
  ObserverKind kind;
  kind.order = Model::order;
  kind.size = Model::size;
  kind.placed = model.order + 1;
  kind.input_gain = first->input_gain();
  const auto matrices = model_matrices(*first);
  kind.step = dynamic_copy(matrices.step, Model::size, Model::size);
  kind.gamma = dynamic_copy(matrices.gamma, Model::size, 1);
  for (int r = 0; r < Model::size; ++r) kind.state_of_row.push_back(Model::state_of_row(r));
  kind.gains = [=, plain = *first](const TuneSettings& s, std::vector<double>& gains) {
    // The capture bandwidth is a setting of the model.
    const auto given = Parts.resonators > 0 ? make(s) : plain;
    if (!given) return false;
    const bool free = family == TuneFamily::free_poles;
    const double w = s.observer_bandwidth;
    const auto factors = [&](auto number) {
      constexpr int placed = number();
      if (free) {
        Array<std::complex<double>, placed> poles{};
        std::copy_n(s.observer_poles.begin(), placed, poles.begin());
        return pole_factors(PoleSet::sample<placed, double>(poles, model.sample_time));
      }
      return family == TuneFamily::half_gain
                 ? pole_factors(HalfGainPoles::sample<placed, double>(w, model.sample_time))
                 : pole_factors(EqualPoles::sample<placed, double>(w, model.sample_time));
    };
    // With free poles the bandwidth is zero, so that a sensor counts as faster and keeps its pole.
    return model_gains(*given, free ? 0.0 : w, factors, gains);
  };
  return kind;
}

ESOKIT_FUNCTION double observer_mean(TuneFamily family, const ObserverKind& kind,
                                     const TuneModel& model, const TuneSettings& s) {
  if (family == TuneFamily::free_poles) {
    double logarithm = 0.0;
    for (const auto& pole : s.observer_poles) logarithm += std::log((std::abs)(pole));
    return std::exp(logarithm / static_cast<double>(s.observer_poles.size()));
  }
  if (family == TuneFamily::filter) {
    return std::pow(s.disturbance_bound / (model.noise * model.sample_time), 1.0 / kind.size);
  }
  // Half gains halve the product of the poles, too.
  return s.observer_bandwidth *
         (family == TuneFamily::half_gain ? std::pow(0.5, 1.0 / kind.placed) : 1.0);
}

ESOKIT_FUNCTION double law_mean(const std::vector<double>& gains, int order) {
  const int n = static_cast<int>(gains.size());
  DynamicMatrix<double> companion(n, n);
  for (int i = 0; i < n; ++i) {
    if (i + 1 < n) companion(i, i + 1) = 1.0;
    companion(n - 1, i) = -gains[static_cast<std::size_t>(i)];
  }
  std::vector<double> size;
  for (const auto& pole : poles_of(companion)) size.push_back((std::abs)(pole));
  std::sort(size.begin(), size.end());
  double logarithm = 0.0;
  for (int i = 0; i < order; ++i) logarithm += std::log(size[static_cast<std::size_t>(i)]);
  return std::exp(logarithm / order);
}

ESOKIT_FUNCTION std::optional<LinearObserverForm> tuned_observer(const ObserverKind& kind, double T,
                                                                 const TuneSettings& settings) {
  std::vector<double> gains;
  if (!kind.gains(settings, gains)) return std::nullopt;
  const int states = kind.size * kind.levels;
  LinearObserverForm form;
  form.a = DynamicMatrix<double>(states, states);
  form.from_y = DynamicMatrix<double>(states, 1);
  form.from_u = DynamicMatrix<double>(states, 1);
  form.to_estimate = DynamicMatrix<double>(kind.size, states);
  form.y_to_estimate = DynamicMatrix<double>(kind.size, 1);
  form.sample_time = T;
  form.input_gain = kind.input_gain;
  DynamicMatrix<double> work(states, states + 2);
  put_together({kind.size, kind.levels},
               {{kind.step.data(), kind.size},
                {kind.gamma.data(), kind.size, 1},
                {kind.disturbance.data(), kind.size},
                gains.data(),
                kind.state_of_row.data()},
               work.view(), form.a.view(), form.from_y.view(), form.from_u.view(),
               form.to_estimate.view(), form.y_to_estimate.view());
  return form;
}

ESOKIT_FUNCTION std::optional<LinearController> tuned_controller(const ObserverKind& kind, double T,
                                                                 const TuneSettings& settings) {
  const auto form = tuned_observer(kind, T, settings);
  if (!form) return std::nullopt;
  return closed_upon_itself(
      feedback_of(*form, law_weights(settings.gains, kind.input_gain), false));
}

}  // namespace detail
}  // namespace esokit
