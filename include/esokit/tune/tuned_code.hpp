/// @file
/// tuned_code: a tuned design as C99 and as Structured Text.
#pragma once

#include <esokit/adapter/mapped_input.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/structured_text.hpp>
#include <esokit/tune/tuned_controller.hpp>
#include <string>

namespace esokit {

/// A design in the languages of `target`, beside its C++.
struct TunedCode {
  CCode c{};                      ///< as from to_c
  std::string structured_text{};  ///< as from to_structured_text
};

namespace detail {

template <class C>
Expected<TunedCode, Error<double>> tuned_code_of(const C& controller, const CodeOptions& options) {
  const auto recorded = recorded_design(controller, options);
  if (!recorded) return as_double(recorded.error());
  return TunedCode{c_code(*recorded), structured_text(*recorded).text};
}

}  // namespace detail

/// The controller of a design as C99 and Structured Text, beside `TunedDesign::code`: the same
/// gains up to rounding, see `with_controller`.
/// @tparam Order n of the model @tparam S float or double @param model as given to `tune`
/// @param design one of its designs @return the code, or an error as for with_controller and to_c
template <int Order, class S = double>
Expected<TunedCode, Error<double>> tuned_code(const TuneModel& model, const TunedDesign& design,
                                              const CodeOptions& options = {}) {
  Expected<TunedCode, Error<double>> code = TunedCode{};
  const auto made = with_controller<Order, S>(model, design, [&](const auto& controller) {
    code = detail::tuned_code_of(controller, options);
  });
  if (!made) return made.error();
  return code;
}

/// The same for an actuator with a curve, around which the controller has a MappedInput.
/// @param model of the plant behind the actuator: its b0 and limits are of the effect of u
/// @param curve of the actuator; the limits of the code are those of u. Without a curve, `{}`, the
/// code has none
template <int Order, class S = double, int Points>
Expected<TunedCode, Error<double>> tuned_code(const TuneModel& model, const TunedDesign& design,
                                              const ActuatorCurve<double, Points>& curve,
                                              const CodeOptions& options = {}) {
  const auto map = ActuatorMap<double, Points>::make(curve);
  if (!map) return map.error();
  const auto input = [&](const S& effect) {
    return static_cast<S>(map->input(static_cast<double>(effect)));
  };
  ActuatorCurve<S, Points> in_scalar{.points = curve.points,
                                     .slope_below = static_cast<S>(curve.slope_below),
                                     .slope_above = static_cast<S>(curve.slope_above)};
  for (std::size_t i = 0; i < curve.input.size(); ++i) {
    in_scalar.input[i] = static_cast<S>(curve.input[i]);
    in_scalar.effect[i] = static_cast<S>(curve.effect[i]);
  }
  Expected<TunedCode, Error<double>> code = TunedCode{};
  const auto made = detail::with_config<Order, S>(
      model, design,
      [&](const auto& inside) -> Check<double> {
        using Inside = detail::ControllerOf<std::remove_cvref_t<decltype(inside)>>;
        using Mapped = MappedInput<typename detail::ObserverOfController<Inside>::type, Points>;
        AdrcConfig<Mapped> config;
        config.observer.observer = inside.observer;
        config.observer.curve = in_scalar;
        config.gains = inside.gains;
        config.limits = {input(inside.limits.lower), input(inside.limits.upper)};
        config.missing = inside.missing;
        if (inside.missing.input) config.missing.input = input(*inside.missing.input);
        config.soften = inside.soften;
        const auto controller = Adrc<Mapped>::make(config);
        if (!controller) return detail::as_double(controller.error());
        code = detail::tuned_code_of(*controller, options);
        return {};
      },
      {});
  if (!made) return made.error();
  return code;
}

}  // namespace esokit
