/// @file
/// to_c of a SmoothProfile, an ApproachProfile and a FollowProfile: a reference as C99.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/control/approach_profile.hpp>
#include <esokit/control/follow_profile.hpp>
#include <esokit/control/smooth_profile.hpp>
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
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

namespace runtime {
inline constexpr const char* profile_header =
#include <esokit/target/runtime/profile.h>
    ;
inline constexpr const char* profile =
#include <esokit/target/runtime/profile.c>
    ;
inline constexpr const char* sum =
#include <esokit/target/runtime/sum.c>
    ;
inline constexpr const char* approach_header =
#include <esokit/target/runtime/approach.h>
    ;
inline constexpr const char* approach =
#include <esokit/target/runtime/approach.c>
    ;
inline constexpr const char* follow_header =
#include <esokit/target/runtime/follow.h>
    ;
inline constexpr const char* follow =
#include <esokit/target/runtime/follow.c>
    ;
}  // namespace runtime

/// `body` gives the motion of a block to its outputs. @param order of the highest derivative
inline void put_motion(StBlock& block, int order) {
  block.own("motion : $name_numbers_" + std::to_string(order + 1));
  block.body += "done := $name_motion(o := o, motion := motion);\n";
  for (int i = 0; i <= order; ++i) {
    const std::string r = i == 0 ? "r" : "r" + std::to_string(i);
    block.output(r + " : $real", i == 0 ? "the reference" : "its derivative");
    block.body += r + " := motion[" + std::to_string(i) + "];\n";
  }
}

/// What the self-test of a profile does at a sample.
struct ProfileCall {
  double target;
  bool is_infinite = false;
  bool resets = false;
};

/// Moves to and fro, and between them what is refused, a rest, and a move of no length.
inline ProfileCall profile_call(int sample, double largest) {
  switch (sample) {
    case 50:
      return {.target = 4, .is_infinite = true};
    case 60:
      return {.target = 0, .resets = true};
    case 61:
      return {.target = 0};
    case 62:
      return {.target = largest};
    case 63:
      return {.target = 4, .is_infinite = true, .resets = true};
    case 64:
      return {.target = 8 / largest};
    default:
      return {.target = (sample / 40) % 2 == 0 ? 1.0 : -0.5};
  }
}

}  // namespace detail

/// A profile as C99: `name_reset`, then `name_update` once a sample and `name_motion` for (r, r',
/// .., r^(n)). There is nothing to record, as it branches everywhere: its text is written, and
/// tested to equal the C++ bit for bit where the roots (sqrt, cbrt) of the two libraries do.
/// @param profile at rest at zero, as `make` returned it
/// @return error for the options, as for a controller
template <int Order, PlainScalar S>
Expected<CCode, Error<S>> to_c(const SmoothProfile<Order, S>& profile,
                               const CodeOptions& options = {}) {
  const auto fill = [&](detail::RuntimeText& text) {
    const auto numbers = detail::RecordAccess::profile(profile);
    for (int i = 1; i <= Order; ++i) {
      const auto row = static_cast<std::size_t>(i - 1);
      const std::string of = std::to_string(i);
      text.feature("ESOKIT_LIMITED_" + of, numbers.limits[row] > S(0));
      text.number("ROOT_OF_LIMIT_" + of, numbers.roots_of_limits[row]);
      text.number("ROOT_OF_PEAK_" + of, numbers.roots_of_peaks[row]);
    }
    // The polynomial and its derivatives, as smooth_step has them.
    constexpr int degree = 2 * Order + 1;
    std::array<S, static_cast<std::size_t>(degree) + 1> c{};
    for (int k = 0; k <= Order; ++k) {
      c[static_cast<std::size_t>(Order + 1 + k)] = static_cast<S>(
          (k % 2 == 0 ? 1 : -1) * binomial(Order + k, k) * binomial(degree, Order - k));
    }
    std::vector<decltype(c)> polynomials;
    for (int i = 0; i <= Order; ++i) {
      polynomials.push_back(c);
      for (std::size_t k = 0; k + 1 < c.size(); ++k) c[k] = static_cast<S>(k + 1) * c[k + 1];
      c.back() = S(0);
    }
    constexpr S largest = (std::numeric_limits<S>::max)();
    SmoothProfile<Order, S> played = profile;
    std::vector<std::vector<S>> vectors;
    for (int k = 0; k < options.self_test_samples; ++k) {
      const auto call = detail::profile_call(k, static_cast<double>(largest));
      const S target = static_cast<S>(call.target);
      const S given = call.is_infinite ? target * largest : target;
      if (call.resets) {
        (void)played.reset(given);
      } else {
        (void)played.update(given);
      }
      const auto motion = played.motion();
      std::vector<S> sample{target,
                            static_cast<S>((call.is_infinite ? 1 : 0) + (call.resets ? 2 : 0))};
      for (int i = 0; i <= Order; ++i) sample.push_back(motion(i));
      vectors.push_back(sample);
    }
    text.counts({{"COUNT", polynomials.size()},
                 {"TERMS", c.size()},
                 {"COLUMNS", polynomials.size() + 2},
                 {"SAMPLES", vectors.size()}});
    text.constant("ORDER", std::to_string(Order));
    text.number("SAMPLE_TIME", numbers.sample_time);
    text.number("SHORTEST_TIME", numbers.shortest_time);
    text.number("LONGER", numbers.longer);
    text.number("LARGEST", largest);
    text.number("MOST_SAMPLES", static_cast<S>(1 << 30));
    text.replace("DESIGN_ROOTS", Order > 2 ? "sqrt and cbrt" : "sqrt");
    text.lines("DESIGN_POLYNOMIALS", text.writer().rows(polynomials));
    text.lines("DESIGN_VECTORS", text.writer().rows(vectors));
  };
  return detail::code_of<S>(options, detail::runtime::profile_header, {detail::runtime::profile},
                            fill);
}

/// A profile as a function block in Structured Text, a call of which is a sample: its C,
/// translated. The cube root that a limited third derivative needs is EXPT: such a move may take a
/// sample more or less. @param profile as for to_c @return the text, or an error as for to_c
template <int Order, PlainScalar S>
Expected<std::string, Error<S>> to_structured_text(const SmoothProfile<Order, S>& profile,
                                                   const CodeOptions& options = {}) {
  const auto add = [](detail::StBlock& block) {
    block.input("target : $real", "of the next move, or where it rests");
    block.input("resets : BOOL", "TRUE: is at rest at target");
    block.output("good : BOOL", "FALSE: target is not finite or too far");
    block.output("moves : BOOL");
    block.body =
        "IF resets THEN\n  good := $name_reset(o := o, value := target);\nELSE\n"
        "  good := $name_update(o := o, target := target);\nEND_IF;\n"
        "moves := $name_moves(o := o);\n";
    detail::put_motion(block, Order);
  };
  return detail::block_of<S>(
      options, [&](const CodeOptions& as) { return to_c(profile, as); }, "_init", "profile",
      detail::once_in_each(detail::RecordAccess::profile(profile).sample_time), add);
}

namespace detail {

/// What the self-test of an ApproachProfile calls, as in runtime/approach.c.
enum class ApproachCall : unsigned char {
  updates,
  updates_to_infinity,
  starts,
  starts_at_infinity,
  starts_by_infinity,  ///< u is
  starts_high,         ///< under the upper limit
  starts_low
};

inline ApproachCall approach_call(int k) {
  constexpr std::array<std::pair<int, ApproachCall>, 6> all{
      {{39, ApproachCall::starts_low},  // before the target is on the other side
       {79, ApproachCall::starts_high},
       {56, ApproachCall::starts_at_infinity},
       {58, ApproachCall::starts_by_infinity},
       {60, ApproachCall::updates_to_infinity},
       {64, ApproachCall::starts}}};
  for (const auto& [at, call] : all) {
    if (at == k) return call;
  }
  return ApproachCall::updates;
}

}  // namespace detail

/// A profile towards any target as C99: `name_start` at rest at y under u, then `name_update` once
/// a sample. `name_motion` gives (r, r') or (r, r', r''), and `name_feed` the u to add to that of
/// the law. It equals the C++ bit for bit.
/// @param profile whose settings count, not where it is @return error for the options, as for a
///        controller
template <int Order, int Capacity, PlainScalar S>
Expected<CCode, Error<S>> to_c(const ApproachProfile<Order, Capacity, S>& profile,
                               const CodeOptions& options = {}) {
  const auto fill = [&](detail::RuntimeText& text) {
    const auto numbers = detail::RecordAccess::approach(profile);
    const auto& config = numbers.config;
    ApproachProfile<Order, Capacity, S> played = profile;
    (void)played.start(S(0), S(0));
    constexpr std::size_t count = static_cast<std::size_t>(Order) + 1;
    constexpr S largest = (std::numeric_limits<S>::max)();
    std::vector<std::array<S, count + 3>> vectors;
    for (int k = 0; k < options.self_test_samples; ++k) {
      const S way = detail::clipped(
          S(S((k / 40) % 2 == 0 ? 20 : -10) * config.sample_time * numbers.half_speed));
      const auto call = detail::approach_call(k);
      const S u = call == detail::ApproachCall::starts_high  ? detail::clipped(config.limits.upper)
                  : call == detail::ApproachCall::starts_low ? detail::clipped(config.limits.lower)
                                                             : S(0);
      const S beyond = S(S(4) * largest);
      if (call == detail::ApproachCall::updates) {
        (void)played.update(way);
      } else if (call == detail::ApproachCall::updates_to_infinity) {
        (void)played.update(beyond);
      } else {
        (void)played.start(call == detail::ApproachCall::starts_at_infinity ? beyond : way,
                           call == detail::ApproachCall::starts_by_infinity ? beyond : u);
      }
      std::array<S, count + 3> sample{way, static_cast<S>(static_cast<int>(call)), played.feed()};
      for (int i = 0; i <= Order; ++i) sample[static_cast<std::size_t>(i + 3)] = played.motion()(i);
      vectors.push_back(sample);
    }
    text.number("LARGEST", largest);
    text.number("MOST_HELD", detail::clipped(config.limits.upper));
    text.number("LEAST_HELD", detail::clipped(config.limits.lower));
    text.features({{"ESOKIT_LAGS", Order == 2},
                   {"ESOKIT_DELAYED", numbers.delay > 0},
                   {"ESOKIT_NEGATIVE", config.input_gain < S(0)}});
    const auto delay = static_cast<std::size_t>(numbers.delay);
    text.counts(
        {{"COUNT", count}, {"DELAY", delay}, {"PLACES", delay * count}, {"COLUMNS", count + 3}});
    text.constant("SAMPLES", std::to_string(vectors.size()));
    text.constant("ORDER", std::to_string(Order));
    text.number("SAMPLE_TIME", config.sample_time);
    text.number("POLE", config.pole);
    text.number("LAG", config.lag);
    text.number("INPUT_GAIN", config.input_gain);
    text.number("UPPER", config.limits.upper);
    text.number("LOWER", config.limits.lower);
    text.number("MOST", S(S(9) / S(10)));
    text.number("LEAST", S(numbers.half_speed / S(10)));
    text.number("BY_BANDWIDTH", S(-numbers.share));
    text.number("DECAY", numbers.decay);
    text.number("DIGITS", S(S(8) * detail::rounding<S>()));
    text.lines("DESIGN_VECTORS", text.writer().rows(vectors));
  };
  return detail::code_of<S>(options, detail::runtime::approach_header,
                            {detail::runtime::sum, detail::runtime::approach}, fill);
}

/// The same as a function block in Structured Text, a call of which is a sample: its C, translated.
/// @param profile as for to_c @return the text, or an error as for to_c
template <int Order, int Capacity, PlainScalar S>
Expected<std::string, Error<S>> to_structured_text(
    const ApproachProfile<Order, Capacity, S>& profile, const CodeOptions& options = {}) {
  const auto add = [](detail::StBlock& block) {
    block.input("target : $real", "where to go; it may change at any time");
    block.input("y : $real", "if starts");
    block.input("u_held : $real", "if starts");
    block.input("starts : BOOL", "TRUE: the machine rests at y under u_held, before the sample");
    block.output("started : BOOL", "FALSE: not finite or too large, nothing changed");
    block.output("good : BOOL", "FALSE: target is not finite or too large, the last one counts");
    block.output("feed : $real", "to be added to u of the law");
    block.body =
        "started := FALSE;\nIF starts THEN\n  started := $name_start(o := o, y := y, u := "
        "u_held);\n"
        "END_IF;\ngood := $name_update(o := o, target := target);\nfeed := $name_feed(o := o);\n";
    detail::put_motion(block, Order);
  };
  return detail::block_of<S>(
      options, [&](const CodeOptions& as) { return to_c(profile, as); }, "_init", "profile",
      detail::once_in_each(detail::RecordAccess::approach(profile).config.sample_time), add);
}

namespace detail {

/// A sample of the self-test of a FollowProfile: what is done (0 a target, 2 a start, one more: of
/// numbers that are infinite, 4 waits), with which numbers, and the motion then.
/// @param fastest, highest derivatives of its targets
template <int Order, class S>
std::vector<S> follow_sample(FollowProfile<Order, S>& played, int k, S way, S fastest, S highest) {
  using Motion = typename FollowProfile<Order, S>::Motion;
  const bool forth = (k / 30) % 2 == 0, turns = (k / 15) % 2 == 1;
  const int at = k % 30;
  const int call = at == 18 || at == 20 || at == 22 ? 1 : at > 24 && at < 28 ? 4 : 0;
  const int starts = k == 63 ? 3 : k == 65 ? 2 : 0;
  Motion given = Motion::Zero();
  given(0) = clipped(S(S(forth ? 16 : -8) * way));
  if (turns) given(1) = clipped(S(S(forth ? -1 : 2) * fastest));
  if (Order == 2 && (k / 10) % 2 == 1) given(Order) = highest;
  if (call == 1 || starts == 3) {
    given = Motion::Zero();
    given((k / 2) % (Order + 1)) = S(4);
  }
  const S by = call == 1 || starts == 3 ? (std::numeric_limits<S>::max)() : S(1);
  Motion scaled = given;
  for (int i = 0; i <= Order; ++i) scaled(i) = given(i) * by;
  if (starts > 0) {
    (void)played.start(scaled(0), scaled(1));
  } else if (call == 4) {
    played.wait();
  } else {
    (void)played.update(scaled);
  }
  std::vector<S> sample{S(starts > 0 ? starts : call)};
  for (int i = 0; i <= Order; ++i) sample.push_back(given(i));
  for (int i = 0; i <= Order; ++i) sample.push_back(played.motion()(i));
  return sample;
}

}  // namespace detail

/// A profile that follows a target as C99: `name_start` at y with a speed, then `name_update` once
/// a sample, with the target and its derivatives, or `name_wait`. `name_motion` gives (r, r') or
/// (r, r', r''). It equals the C++ bit for bit. There is no retune.
/// @param profile whose settings count, not where it is @return error for the options, as for a
///        controller
template <int Order, PlainScalar S>
Expected<CCode, Error<S>> to_c(const FollowProfile<Order, S>& profile,
                               const CodeOptions& options = {}) {
  const auto fill = [&](detail::RuntimeText& text) {
    const auto numbers = detail::RecordAccess::follow(profile);
    const S fastest = numbers.config.limits[0];
    const S highest = numbers.config.limits[Order - 1];
    const S h = numbers.width;
    const S unit = highest * h * (Order == 1 ? S(1) : h);
    auto played = FollowProfile<Order, S>::make(numbers.config).value();
    std::vector<std::vector<S>> vectors;
    for (int k = 0; k < options.self_test_samples; ++k) {
      vectors.push_back(detail::follow_sample(played, k, unit, S(highest * h), highest));
    }
    constexpr std::size_t count = static_cast<std::size_t>(Order) + 1;
    text.features({{"ESOKIT_SECOND", Order == 2}, {"ESOKIT_LIMITED", fastest > S(0)}});
    text.counts({{"COUNT", count}, {"COLUMNS", 2 * count + 1}, {"SAMPLES", vectors.size()}});
    constexpr S largest = (std::numeric_limits<S>::max)();
    text.constant("ORDER", std::to_string(Order));
    text.number("SAMPLE_TIME", numbers.config.sample_time);
    text.number("HALF_A_SAMPLE", S(numbers.config.sample_time / S(2)));
    text.number("WIDTH", h);
    text.number("FASTEST", fastest);
    text.number("HIGHEST", highest);
    text.number("UNIT", unit);
    text.number("LARGEST", largest);
    text.number("LONGEST", S(largest / S(16)));
    text.number("DIGITS", S(S(8) * detail::rounding<S>()));
    text.number("ROUNDING", S(S(8) * detail::rounding<S>() * fastest));
    text.lines("DESIGN_VECTORS", text.writer().rows(vectors));
  };
  return detail::code_of<S>(options, detail::runtime::follow_header,
                            {detail::runtime::sum, detail::runtime::follow}, fill);
}

/// The same as a function block in Structured Text, a call of which is a sample: its C, translated.
/// @param profile as for to_c @return the text, or an error as for to_c
template <int Order, PlainScalar S>
Expected<std::string, Error<S>> to_structured_text(const FollowProfile<Order, S>& profile,
                                                   const CodeOptions& options = {}) {
  const auto add = [](detail::StBlock& block) {
    block.input("target : $real", "where to be now, and its derivatives, or zeros");
    for (int i = 1; i <= Order; ++i) block.input("target" + std::to_string(i) + " : $real");
    block.input("y : $real", "if starts");
    if (Order == 2) block.input("speed : $real", "if starts");
    block.input("starts : BOOL", "TRUE: it is at y with this speed, before the sample");
    block.input("waits : BOOL", "TRUE: the axis cannot go on, r comes to rest");
    block.output("started : BOOL", "FALSE: not finite or too large, nothing changed");
    block.output("good : BOOL", "FALSE: target is not finite or too large, the last one goes on");
    block.own("wanted : $name_numbers_" + std::to_string(Order + 1));
    block.body =
        std::string(
            "started := FALSE;\nIF starts THEN\n  started := $name_start(o := o, y := y, ") +
        (Order == 2 ? "speed := speed" : "speed := 0.0") + ");\nEND_IF;\nwanted[0] := target;\n";
    for (int i = 1; i <= Order; ++i) {
      const std::string row = std::to_string(i);
      block.body += "wanted[" + row + "] := target" + row + ";\n";
    }
    block.body +=
        "IF waits THEN\n  good := TRUE;\n  done := $name_wait(o := o);\nELSE\n"
        "  good := $name_update(o := o, target := wanted);\nEND_IF;\n";
    detail::put_motion(block, Order);
  };
  return detail::block_of<S>(
      options, [&](const CodeOptions& as) { return to_c(profile, as); }, "_init", "profile",
      detail::once_in_each(detail::RecordAccess::follow(profile).config.sample_time), add);
}

}  // namespace esokit
