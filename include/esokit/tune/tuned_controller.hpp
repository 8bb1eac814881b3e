/// @file
/// The controller of a tuned design, ready to run.
#pragma once

#include <algorithm>
#include <complex>
#include <cstddef>
#include <esokit/control/adrc.hpp>
#include <esokit/gain/model_gain.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/tune/tune.hpp>
#include <numbers>
#include <type_traits>
#include <vector>

namespace esokit {

namespace detail {

template <class Config>
struct ControllerOfConfig;
template <class Observer>
struct ControllerOfConfig<AdrcConfig<Observer>> {
  using type = Adrc<Observer>;
};
template <class S>
Error<double> as_double(const Error<S>& error) {
  return {error.field, static_cast<double>(error.value), error.rule,
          error.index, static_cast<double>(error.limit), error.has_limit};
}

template <class Config>
using ControllerOf = typename ControllerOfConfig<Config>::type;

/// The observer poles that a design places, 1/s.
template <int Order>
std::vector<std::complex<double>> placed_poles(const TuneModel& model, const TunedDesign& d) {
  const int size = Order + d.extension;
  const double w = d.settings.observer_bandwidth;
  const double T = model.sample_time;
  if (d.family == TuneFamily::free_poles) return d.settings.observer_poles;
  std::vector<std::complex<double>> poles(static_cast<std::size_t>(size), -w);
  if (d.family == TuneFamily::half_gain) {
    // -w / 2 (1 + j cot(theta / 2)), see gain/half_gain.hpp
    for (int k = 0; k < size; ++k) {
      const bool real = 2 * k + 1 == size;
      const double half = 0.5 * std::numbers::pi * (2 * (std::min)(k, size - 1 - k) + 1) / size;
      const double imaginary = real ? 0.0 : 0.5 * w / std::tan(half);
      poles[static_cast<std::size_t>(k)] = {-0.5 * w, 2 * k < size ? -imaginary : imaginary};
    }
  } else if (d.family == TuneFamily::filter) {
    const auto kind = chain_kind(model, d.family, d.extension, 1);
    std::vector<double> gains;
    kind.gains(d.settings, gains);
    // (I - k C) Phi - I
    auto error = kind.step;
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size; ++j) {
        error(i, j) -=
            gains[static_cast<std::size_t>(i)] * (kind.step(0, j) + (j == 0 ? 1.0 : 0.0));
      }
    }
    poles = poles_of(error);
    std::sort(poles.begin(), poles.end(), [](const auto& a, const auto& b) {
      return (std::abs)(a.imag()) < (std::abs)(b.imag());
    });
    for (std::size_t i = 0; i < poles.size(); ++i) {
      // By rounding, computed conjugates may differ.
      const bool pair =
          i + 1 < poles.size() && (std::abs)(poles[i].imag()) > 1e-9 * (std::abs)(poles[i]);
      poles[i] = std::log(1.0 + (pair ? poles[i] : std::complex<double>(poles[i].real()))) / T;
      if (pair) {
        poles[i + 1] = std::conj(poles[i]);
        ++i;
      }
    }
  }
  return poles;
}

}  // namespace detail

namespace detail {

/// Calls `visit(config)` with the config of the Adrc of a design, see `with_controller`. It returns
/// a Check.
template <int Order, class S, class Visit>
Check<double> with_config(const TuneModel& model, const TunedDesign& design, const Visit& visit,
                          const MissingRule<double>& missing) {
  Rules<double> rules;
  rules.all_of(model.validate())
      .demand(model.order == Order,
              {"order", static_cast<double>(model.order), "is not the requested order, which is",
               -1, static_cast<double>(Order), true})
      .demand(!design.knows.sensor && !design.knows.sinusoid, "knows", 1.0,
              "includes more than the lag: use the code of the design")
      .demand(
          static_cast<int>(design.settings.gains.size()) == Order + (design.knows.lag ? 1 : 0) &&
              design.extension >= 1 && design.extension <= 2 && design.levels >= 1 &&
              design.levels <= 3 &&
              (design.family != TuneFamily::free_poles ||
               static_cast<int>(design.settings.observer_poles.size()) == Order + design.extension),
          "design", static_cast<double>(design.settings.gains.size()),
          "was not made by tune for a model of this order");
  if (!rules) return rules.error();
  const auto run = [&](auto config) -> Check<double> {
    config.observer.input_gain = static_cast<S>(model.input_gain.value);
    config.observer.sample_time = static_cast<S>(model.sample_time);
    config.observer.max_gap = model.predicted_samples();
    config.gains.emplace();
    std::transform(
        design.settings.gains.begin(),
        design.settings.gains.begin() + static_cast<std::ptrdiff_t>(config.gains->size()),
        config.gains->begin(), [](double gain) { return static_cast<S>(gain); });
    config.limits.lower = static_cast<S>(model.u_min);
    config.limits.upper = static_cast<S>(model.u_max);
    config.missing = {.most = missing.most, .stay = missing.stay, .hold = missing.hold};
    if (missing.input || !missing.hold) {
      config.missing.input = static_cast<S>(missing.input.value_or(model.safe_input()));
    }
    config.soften = design.settings.soften;
    return visit(config);
  };
  if (design.levels > 1) {
    return with_number<2, 3>(design.levels, [&](auto levels) {
      AdrcConfig<CascadeEso<Order, levels(), S>> config;
      config.observer.observer_bandwidth = static_cast<S>(design.settings.observer_bandwidth);
      config.observer.bandwidth_factor = static_cast<S>(design.settings.bandwidth_factor);
      return run(config);
    });
  }
  auto poles = placed_poles<Order>(model, design);
  const auto place = [&](auto& places) {
    for (std::size_t i = 0; i < places.size(); ++i) {
      places[i] = {static_cast<S>(poles[i].real()), static_cast<S>(poles[i].imag())};
    }
  };
  if (design.knows.lag) {
    AdrcConfig<ModelEso<ModelParts{.order = Order, .actuator = 1}, S, PoleSet>> config;
    config.observer.model.actuator.time_constant = static_cast<S>(model.lag);
    poles.insert(poles.begin(), -1.0 / model.lag);
    place(config.observer.poles);
    return run(config);
  }
  return with_number<1, 2>(design.extension, [&](auto extension) {
    AdrcConfig<LinearEso<Order, S, extension(), PoleSet>> config;
    place(config.observer.poles);
    return run(config);
  });
}

}  // namespace detail

/// Calls `visit(controller)` with the Adrc of a design for a plant of order `Order`, with the
/// actuator's limits, and returns its result.
///
/// So that fewer types are needed, every design with one level becomes a LinearEso with the poles
/// of the design (with m = 1 or 2, or with the lag in its model). Its gains equal those of the
/// design's `code` up to rounding. A cascade becomes a CascadeEso.
/// @param missing what to do when measurements are missing; if it does not say where u goes, that
/// is
///        `model.safe_input()`
/// @return error for a model of another order, for a design that knows more than the lag (use its
///         `code`), or from `make`
/// @tparam S scalar of the controller, double or float
template <int Order, class S = double, class Visit>
Check<double> with_controller(const TuneModel& model, const TunedDesign& design, const Visit& visit,
                              const MissingRule<double>& missing = {}) {
  return detail::with_config<Order, S>(
      model, design,
      [&](const auto& config) -> Check<double> {
        using Config = std::remove_cvref_t<decltype(config)>;
        const auto controller = detail::ControllerOf<Config>::make(config);
        if (!controller) return detail::as_double(controller.error());
        visit(*controller);
        return {};
      },
      missing);
}

}  // namespace esokit
