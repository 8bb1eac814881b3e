/// @file
/// to_c of a HealthMonitor: what it finds of a loop that runs as C99.
#pragma once

#include <concepts>
#include <esokit/control/health.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/observer/concepts.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/detail/health_test.hpp>
#include <esokit/target/detail/list_writer.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <esokit/target/detail/runtime_text.hpp>
#include <esokit/target/structured_text.hpp>
#include <initializer_list>
#include <string>
#include <type_traits>
#include <utility>

namespace esokit {

namespace detail {

namespace runtime {
inline constexpr const char* health_header =
#include <esokit/target/runtime/health.h>
    ;
inline constexpr const char* health =
#include <esokit/target/runtime/health.c>
    ;
}  // namespace runtime

/// A controller that can be watched in C: its observer is on the chain, without Guarded.
template <class C>
concept WatchedController = WritableController<C> && requires(const C& c) {
  requires model_traits<std::remove_cvref_t<decltype(c.observer().model())>>
  .is_chain;
  requires !observer_traits<std::remove_cvref_t<decltype(c.observer())>>.schedules_input_gain;
  requires !observer_traits<std::remove_cvref_t<decltype(c.observer())>>.maps_input;
};

}  // namespace detail

/// A monitor of a controller as C99: `name_look` after each update of the controller, whose own C
/// is written with CodeOptions::watched, and `name_diagnose`, the LoopFault of the default limits
/// as a number. As it branches everywhere, its text is written, not recorded, and tested to equal
/// the C++ bit for bit.
/// @param monitor cleared, as `make` returned it @param controller what it watches: on the chain of
///        integrators, without Guarded
/// @return error for the options, as for a controller
template <int Size, PlainScalar S, detail::WatchedController Controller>
requires std::same_as<S, typename Controller::scalar_type> Expected<CCode, Error<S>> to_c(
    const HealthMonitor<Size, S>& monitor, const Controller& controller,
    const CodeOptions& options = {.name = "health"}) {
  static_assert(std::remove_cvref_t<decltype(controller.observer())>::size == Size,
                "esokit: Size of the monitor must be the number of states of the observer");
  const auto fill = [&](detail::RuntimeText& text) {
    const auto settings = detail::RecordAccess::health(monitor, controller);
    for (const auto& [name, x] : settings.constants) text.number(name, x);
    // The limits of a diagnosis are double, whatever the monitor is.
    const detail::ListWriter in_double(detail::c_language, false);
    const HealthLimits limits;
    for (const auto& [name, x] : std::initializer_list<std::pair<const char*, double>>{
             {"FOR_EVIDENCE", limits.evidence},
             {"FOR_EVIDENCE_OF_SIGN", limits.evidence_of_sign},
             {"FOR_OPPOSED", limits.opposed},
             {"FOR_SIGN_RATIO", limits.sign_ratio},
             {"FOR_STEADY", limits.steady},
             {"FOR_STEADY_RATIO", limits.steady_ratio},
             {"RIGHT_SIGN", -limits.sign_ratio},
             {"FOR_STANDING", 0.99},
             {"FOR_WRONG_SIGN", limits.wrong_sign},
             {"FOR_TOO_SMALL", limits.too_small},
             {"FOR_RESPONSE", limits.response},
             {"FOR_TOO_LARGE", limits.too_large},
             {"NEGATIVE", 0},
             {"ONCE", 1},
             {"A_QUARTER", 4},
             {"OFTEN_LIMITED", 0.05},
             {"ONE_SIDE", 0.8}}) {
      text.constant(name, in_double.number(x));
    }
    const int late =
        detail::bounded_samples(S(static_cast<S>(Size * settings.divider) / settings.step));
    const auto rows = detail::watched_self_test<S>(
        monitor, controller, settings.range, settings.middle, settings.step, S(1) / settings.weight,
        settings.divider, late, options.self_test_samples);
    text.constant("LATE", std::to_string(late) + "u");
    text.constant("ROWS", std::to_string(rows.size()));
    text.counts({{"COLUMNS", rows.front().size()}, {"FOUND", rows.front().size() - 12}});
    text.lines("DESIGN_VECTORS", text.writer().rows(rows));
    text.replace("DESIGN_COLUMNS",
                 "of u: mean, move; disturbance, u beyond, u beyond by way, slope, innovation, "
                 "status, missed, stops, half, times; then what is found");
    text.count("SIZE", Size);
    text.count("DIVIDER", static_cast<std::size_t>(settings.divider));
    text.replace("DESIGN_MEMORY",
                 std::to_string(static_cast<long long>(S(1) / settings.weight + S(0.5))));
    text.replace("DESIGN_ROW", std::to_string(Controller::order));
  };
  return detail::code_of<S>(options, detail::runtime::health_header, {detail::runtime::health},
                            fill);
}

/// The same as a function block in Structured Text, to be called after that of the controller,
/// whose outputs it takes: its C, translated. @return the text, or an error as for to_c
template <int Size, PlainScalar S, detail::WatchedController Controller>
requires std::same_as<S, typename Controller::scalar_type> Expected<std::string, Error<S>>
to_structured_text(const HealthMonitor<Size, S>& monitor, const Controller& controller,
                   const CodeOptions& options = {.name = "health"}) {
  const auto add = [](detail::StBlock& block) {
    block.own("sample : $name_sample");
    block.own("flags : UDINT");
    block.body = "IF clears THEN\n  done := $name_clear(o := o);\nEND_IF;\n";
    const auto of_sample = [&](const char* name, const char* comment) {
      block.input(std::string(name) + " : $real", comment);
      block.body += std::string("sample.") + name + " := " + name + ";\n";
    };
    of_sample("innovation", "output of the controller's block, written with `watched`");
    of_sample("asked", "such an output");
    of_sample("held", "its u");
    of_sample("applied", "such an output");
    of_sample("measured", "y, as given to the controller's block");
    of_sample("estimate", "its e0");
    of_sample("disturbance", ("its e" + std::to_string(Controller::order)).c_str());
    block.input("missed : UINT", "such an output");
    block.input("its_status : UINT", "its status");
    block.input("mode : UINT", "its mode");
    block.input("clears : BOOL", "TRUE: forgets all before");
    block.body +=
        "sample.missed := UINT_TO_UDINT(missed);\nsample.status := UINT_TO_UDINT(its_status);\n"
        "sample.runs := mode = 0;\ndone := $name_look(o := o, sample := sample);\n"
        "flags := $name_diagnose(o := o);\nfault := UDINT_TO_UINT(flags);\n";
    block.output(
        "fault : UINT",
        "0: none, 1: the sign of b0 is wrong, 2: b0 is several times too small, 3: more than "
        "a tenth of y are rejected, 4: u is at a limit more than half of the time and y not on its "
        "way, 6: the "
        "innovation is three times that of the noise, 7: b0 is too large, or a load drives "
        "u, 8: the sensor stands still");
    for (const char* name : {"gain_ratio", "response", "saturated"}) {
      block.output(std::string(name) + " : $real", "see HealthMonitor");
      block.body += std::string(name) + " := o." + name + ";\n";
    }
  };
  return detail::block_of<S>(
      options, [&](const CodeOptions& as) { return to_c(monitor, controller, as); }, "_clear",
      "monitor", "after each call of the controller", add);
}

}  // namespace esokit
