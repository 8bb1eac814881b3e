/// @file
/// tuned_code: a tuned design as C99 and as Structured Text.
#pragma once

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

/// The controller of a design as C99 and Structured Text, beside `TunedDesign::code`: the same
/// gains up to rounding, see `with_controller`.
/// @tparam Order n of the model @tparam S float or double @param model as given to `tune`
/// @param design one of its designs @return the code, or an error as for with_controller and to_c
template <int Order, class S = double>
Expected<TunedCode, Error<double>> tuned_code(const TuneModel& model, const TunedDesign& design,
                                              const CodeOptions& options = {}) {
  Expected<TunedCode, Error<double>> code = TunedCode{};
  const auto made = with_controller<Order, S>(model, design, [&](const auto& controller) {
    const auto recorded = detail::recorded_design(controller, options);
    if (recorded) {
      code = TunedCode{detail::c_code(*recorded), detail::structured_text(*recorded).text};
    } else {
      code = detail::as_double(recorded.error());
    }
  });
  if (!made) return made.error();
  return code;
}

}  // namespace esokit
