/// @file
/// tuned_c_code: a tuned design as C99.
#pragma once

#include <esokit/core/expected.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/tune/controller.hpp>

namespace esokit {

/// The controller of a design as C99, beside `TunedDesign::code`: the same gains up to rounding,
/// see `with_controller`.
/// @tparam Order n of the model @tparam S float or double @param model as given to `tune`
/// @param design one of its designs @return the C, or an error as for with_controller and to_c
template <int Order, class S = double>
Expected<CCode, Error<double>> tuned_c_code(const TuneModel& model, const TunedDesign& design,
                                            const CodeOptions& options = {}) {
  Expected<CCode, Error<double>> code = CCode{};
  const auto made = with_controller<Order, S>(model, design, [&](const auto& controller) {
    const auto written = to_c(controller, options);
    if (written) {
      code = *written;
    } else {
      const auto& error = written.error();
      code = Error<double>{error.field, static_cast<double>(error.value), error.rule};
    }
  });
  if (!made) return made.error();
  return code;
}

}  // namespace esokit
