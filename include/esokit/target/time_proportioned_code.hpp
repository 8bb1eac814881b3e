/// @file
/// to_c of a TimeProportioned: a relay's output as C99.
#pragma once

#include <algorithm>
#include <array>
#include <esokit/control/time_proportioned.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/detail/list_writer.hpp>
#include <esokit/target/detail/record_access.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <esokit/target/detail/runtime_text.hpp>
#include <esokit/target/structured_text.hpp>
#include <limits>
#include <string>
#include <vector>

namespace esokit {

namespace detail {

namespace runtime {
inline constexpr const char* proportioned_header =
#include <esokit/target/runtime/proportioned.h>
    ;
inline constexpr const char* proportioned =
#include <esokit/target/runtime/proportioned.c>
    ;
}  // namespace runtime

}  // namespace detail

/// A time-proportioned output as C99: `name_reset`, then `name_update` once a sample; `name_begins`
/// and `name_applied` as those of the C++, which it equals bit for bit.
/// @param output as `make` returned it @return error for the options, as for a controller
template <PlainScalar S>
Expected<CCode, Error<S>> to_c(const TimeProportioned<S>& output, const CodeOptions& options = {}) {
  const auto fill = [&](detail::RuntimeText& text) {
    const auto numbers = detail::RecordAccess::proportioned(output);
    const S range = numbers.on - numbers.off;
    constexpr S largest = (std::numeric_limits<S>::max)();
    TimeProportioned<S> simulated = output;
    // Windows with each share of time, and near what is too short; then samples of them.
    constexpr std::array<double, 20> shares{0,    1,   0.03, 0.07, 0.93, 0.97, 1.1, 0.98, 0.96, 0.5,
                                            -0.1, 0.1, 0.2,  0.4,  0.25, 0.04, 0.6, 0.8,  0.9,  4};
    constexpr int infinite = 19;
    std::vector<std::array<S, 4>> vectors;
    for (int k = 0; k < options.self_test_samples; ++k) {
      const int at = k % static_cast<int>(shares.size());
      const S share = static_cast<S>(shares[static_cast<std::size_t>(at)]);
      const S u = detail::clipped(S(numbers.off + range * share));
      const S given = k == infinite ? S(S(4) * largest) : u;
      const int times = k <= infinite ? (std::min)(numbers.window, 100000) : 1;
      int on = 0;
      for (int left = times; left > 0; --left) on += simulated.update(given) ? 1 : 0;
      vectors.push_back({k == infinite ? S(4) : u, static_cast<S>(times),
                         static_cast<S>(simulated.begins() ? -on : on), simulated.applied()});
    }
    text.constant("INFINITE", std::to_string(infinite));
    text.number("LARGEST", largest);
    text.constant("SAMPLES", std::to_string(vectors.size()));
    text.constant("WINDOW", std::to_string(numbers.window));
    text.constant("SHORTEST", std::to_string(numbers.shortest));
    text.constant("LONGEST", std::to_string(numbers.longest));
    text.constant("LAST_SAMPLE", std::to_string(numbers.window - 1));
    text.constant("BEYOND_LONGEST", std::to_string(numbers.longest + numbers.window));
    text.number("OFF_VALUE", numbers.off);
    text.number("ON_VALUE", numbers.on);
    text.number("RANGE", range);
    text.number("LOW", range < S(0) ? numbers.on : numbers.off);
    text.number("HIGH", range < S(0) ? numbers.off : numbers.on);
    text.number("SAMPLE_TIME", numbers.sample_time);
    text.lines("DESIGN_VECTORS", text.writer().rows(vectors));
  };
  return detail::code_of<S>(options, detail::runtime::proportioned_header,
                            {detail::runtime::proportioned}, fill);
}

/// The same as a function block in Structured Text, a call of which is a sample: its C, translated.
/// @param output as for to_c @return the text, or an error as for to_c
template <PlainScalar S>
Expected<std::string, Error<S>> to_structured_text(const TimeProportioned<S>& output,
                                                   const CodeOptions& options = {}) {
  const auto add = [](detail::StBlock& block) {
    block.input("u : $real", "counts at the start of a window");
    block.output("is_on : BOOL");
    block.output("applied : $real", "the mean of this window");
    block.output("begins : BOOL", "TRUE: the next call begins a window");
    block.body =
        "is_on := $name_update(o := o, u := u);\napplied := $name_applied(o := o);\n"
        "begins := $name_begins(o := o);\n";
  };
  return detail::block_of<S>(
      options, [&](const CodeOptions& as) { return to_c(output, as); }, "_reset", "output",
      detail::once_in_each(detail::RecordAccess::proportioned(output).sample_time), add);
}

}  // namespace esokit
