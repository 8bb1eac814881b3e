/// @file
/// The settings of an Experiment, their rules, its phases, and why it may end early.
#pragma once

#include <cmath>
#include <concepts>
#include <esokit/control/limiter.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/text.hpp>
#include <esokit/core/expected.hpp>
#include <optional>

namespace esokit {

/// How u moves the machine.
enum class Excitation : unsigned char {
  relay,  ///< u0 + A until y has risen by the hysteresis, u0 - A until it has fallen by it, and so
          ///< on
  steps   ///< u0 + A and u0 - A alternately for `half_period` each, the first one half as long
};

/// How an experiment gets from a cold machine to where it measures.
template <PlainScalar S = double>
struct ExperimentApproach {
  S input{};   ///< u that drives y from rest to `output`, such as full power
  S output{};  ///< y around which the relay then acts
};

/// Config of Experiment.
template <PlainScalar S = double>
struct ExperimentConfig {
  [[no_unique_address]] ByName<ExperimentConfig> by_name{};  ///< nothing to set, see ByName
  S sample_time{};                                           ///< T, s
  Excitation excitation = Excitation::relay;  ///< relay: needs no knowledge of the machine
  S input{};        ///< u0, unit of u: holds the machine where it starts; 0 of a cold heater
  S amplitude{};    ///< A, unit of u; negative if a larger u lowers y. With an approach A is the
                    ///< most: less if the u that holds y is nearer to a limit
  S hysteresis{};   ///< relay: unit of y, a few times the noise; leave out with steps. After an
                    ///< approach at least what y moves within the latency
  S lead{};         ///< relay, order 2: s, about five times lag plus dead time; else leave out
  S half_period{};  ///< steps: s, at least 8 samples; leave out with a relay
  S rest{};         ///< s, time with u0 at the start, in which y0 is measured; 0: y0 is the first y
  /// First drive y to another place; a relay of order 1 only. Then `response`, `response_time` and
  /// the limit of y on that side have to be given.
  std::optional<ExperimentApproach<S>> approach{};  ///< left out: y already is where it is wanted
  S response{};  ///< unit of y, several times noise and resolution of the sensor: while u drives
                 ///< y away from where u0 holds it, y has to move by so much, the right way, ..
  S response_time{};  ///< .. in each so many seconds, about three latencies and the time of such a
                      ///< move; 0: is not watched. After an approach longer by the ratio of what u
                      ///< was moved by then and is now
  S fastest{};  ///< largest abs(dy/dt), unit of y per s, as the mean over the time in which y so
                ///< moves by `response`; beyond it the experiment is aborted. 0: no limit
  S travel{};   ///< largest abs(y - y0), with an approach abs(y - output) from the first
                ///< settling cycle on; beyond it the experiment is aborted
  S lowest_output = Limits<S>{}.lower;   ///< least y; below it the experiment is aborted
  S highest_output = Limits<S>{}.upper;  ///< largest y
  std::optional<S> safe_input{};         ///< u after an abort; left out: u0
  S time_limit{};                        ///< longest total duration, s
  S hand_over{};       ///< s: relay or steps continue for this time after the last measured cycle
  int cycles = 8;      ///< number of measured cycles, after two to settle; even, 6 .. 200
  Limits<S> limits{};  ///< of the actuator; u0 - A and u0 + A must be within
};

/// The phase of an experiment.
enum class ExperimentPhase : unsigned char {
  rest,       ///< u0; y0 is measured
  approach,   ///< the approach's u, until y will reach its `output`
  centring,   ///< relay between u0 and the approach's u: one cycle shows which u holds `output`
  settling,   ///< the first two cycles
  measuring,  ///< the cycles from which the result is computed
  hand_over,  ///< the result is ready; u continues, so that the controller's observer can converge
  done,       ///< u0
  aborted     ///< the safe u; see `reason`
};

/// Has text.
template <>
inline constexpr bool has_text<ExperimentPhase> = true;

/// Writes the name of the phase.
template <class Stream, std::same_as<ExperimentPhase> Value>
requires detail::WritesText<Stream> Stream& operator<<(Stream& out, Value phase) {
  constexpr const char* names[] = {"rest",      "approach",  "centring", "settling",
                                   "measuring", "hand_over", "done",     "aborted"};
  out << names[static_cast<int>(phase)];
  return out;
}

/// Why an experiment was aborted.
enum class AbortReason : unsigned char {
  none,          ///< not aborted
  travel,        ///< y moved further than `travel`
  time_limit,    ///< it took too long: the relay does not switch, or switches slowly
  bad_sample,    ///< y or the reported u was not finite
  stopped,       ///< by `stop`
  no_response,   ///< y stands still although u moves it: sensor loose, actuator off, wrong channel,
                 ///< or an actuator too weak to get there
  wrong_sign,    ///< the first move of u, or a load meanwhile, drove y the wrong way
  load_changed,  ///< u drives y no longer where it drove it before: a load larger than A, or an
                 ///< actuator that failed
  too_noisy,     ///< noise at rest above half the hysteresis or a quarter of `response`
  resolution,    ///< the sensor's smallest step is above half the hysteresis or of `response`
  output_limit,  ///< y beyond `lowest_output` or `highest_output`, or the relay would lead there
  input_limit,   ///< the u that holds y leaves less than a tenth of A to a limit of the actuator
  too_fast       ///< y moved faster than `fastest`
};

/// Has text.
template <>
inline constexpr bool has_text<AbortReason> = true;

/// Writes the reason.
template <class Stream, std::same_as<AbortReason> Value>
requires detail::WritesText<Stream> Stream& operator<<(Stream& out, Value reason) {
  constexpr const char* names[] = {"none",      "travel",      "time_limit",   "bad_sample",
                                   "stopped",   "no_response", "wrong_sign",   "load_changed",
                                   "too_noisy", "resolution",  "output_limit", "input_limit",
                                   "too_fast"};
  out << names[static_cast<int>(reason)];
  return out;
}

/// A row of the log: y, and the u that was held from there to the next row.
template <PlainScalar S>
struct ExperimentRow {
  S time{};  ///< s since the first sample
  S u{};     ///< held from here on
  S y{};     ///< measured
};

namespace detail {

/// The levels of u: within the limits, and with an approach on the side that it needs.
template <int Order, PlainScalar S>
void check_levels(Rules<S>& rules, const ExperimentConfig<S>& config) {
  const auto within = [&](const char* field, const S& value, const S& level, const char* above,
                          const char* below) {
    rules
        .demand(at_most(level, config.limits.upper, config.input),
                {field, value, above, -1, config.limits.upper, true})
        .demand(at_most(config.limits.lower, level, config.input),
                {field, value, below, -1, config.limits.lower, true});
  };
  if (config.safe_input) {
    within("safe_input", *config.safe_input, *config.safe_input, "is above limits.upper, which is",
           "is below limits.lower, which is");
  }
  if (!config.approach) {
    const S size = absolute(config.amplitude);
    constexpr const char* above = "with input goes above limits.upper, which is";
    constexpr const char* below = "with input goes below limits.lower, which is";
    within("amplitude", config.amplitude, config.input + size, above, below);
    within("amplitude", config.amplitude, config.input - size, above, below);
    return;
  }
  const ExperimentApproach<S>& approach = *config.approach;
  within("input", config.input, config.input, "is above limits.upper, which is",
         "is below limits.lower, which is");
  within("approach.input", approach.input, approach.input, "is above limits.upper, which is",
         "is below limits.lower, which is");
  const bool rises = (approach.input > config.input) == (config.amplitude > S(0));
  rules
      .demand(Order == 1 && config.excitation == Excitation::relay, "approach.input",
              approach.input, "must be left out: an approach needs a relay of order 1")
      .demand(absolute(approach.input - config.input) > S(0), "approach.input", approach.input,
              "must not be input")
      .positive("response_time", config.response_time)
      .finite("approach.output", approach.output)
      .demand(rises ? config.highest_output < Limits<S>{}.upper
                    : config.lowest_output > Limits<S>{}.lower,
              rises ? "highest_output" : "lowest_output",
              rises ? config.highest_output : config.lowest_output,
              "must be given with an approach")
      .demand(
          below(config.lowest_output, S(approach.output - config.hysteresis), approach.output) &&
              below(S(approach.output + config.hysteresis), config.highest_output, approach.output),
          "approach.output", approach.output,
          "must be between lowest_output and highest_output by more than the hysteresis");
}

/// Refuses bad settings. @return the limiter of u
template <int Order, PlainScalar S>
Expected<Limiter<S>, Error<S>> checked_experiment(const ExperimentConfig<S>& config) {
  const bool relay = config.excitation == Excitation::relay;
  const S T = config.sample_time;
  const int cycles = config.cycles;
  Rules<S> rules;
  rules.positive("sample_time", T)
      .finite("input", config.input)
      .nonzero("amplitude", config.amplitude)
      .not_negative("rest", config.rest)
      .positive("travel", config.travel)
      .not_negative("response_time", config.response_time)
      .not_negative("fastest", config.fastest)
      .finite("lowest_output", config.lowest_output)
      .finite("highest_output", config.highest_output)
      .demand(config.lowest_output < config.highest_output,
              {"lowest_output", config.lowest_output, "must be below highest_output", -1,
               config.highest_output, true})
      .positive("time_limit", config.time_limit)
      .not_negative("hand_over", config.hand_over)
      .demand(6 <= cycles && cycles <= 200 && cycles % 2 == 0, "cycles", static_cast<S>(cycles),
              "must be even, 6 .. 200");
  if (relay) {
    rules.positive("hysteresis", config.hysteresis)
        .demand(!(config.hysteresis >= config.travel),
                {"hysteresis", config.hysteresis, "must be below travel", -1, config.travel, true})
        .left_out("half_period", config.half_period, "must be left out with a relay");
  } else {
    rules.left_out("hysteresis", config.hysteresis, "must be left out with steps")
        .positive("half_period", config.half_period);
  }
  if (relay && Order == 2) {
    rules.positive("lead", config.lead);
  } else {
    rules.left_out("lead", config.lead, "must be left out: it is for a relay of order 2");
  }
  if (config.response_time > S(0)) {
    rules.positive("response", config.response);
  } else {
    rules.left_out("response", config.response, "must be left out without response_time")
        .left_out("fastest", config.fastest, "must be left out without response");
  }
  if (!rules) return rules.error();
  const auto limiter = Limiter<S>::make(config.limits, T);
  if (!limiter) return limiter.error();
  const S samples = config.time_limit / T;
  check_levels<Order>(rules, config);
  rules
      .demand(below(samples, S(1 << 24)), "time_limit", config.time_limit,
              "must be below 2^24 samples")
      .demand(config.rest < config.time_limit,
              {"rest", config.rest, "must be below time_limit", -1, config.time_limit, true})
      .demand(
          config.hand_over < config.time_limit,
          {"hand_over", config.hand_over, "must be below time_limit", -1, config.time_limit, true});
  if (!rules) return rules.error();
  if (!relay) {
    rules
        .demand(config.half_period < config.time_limit,
                {"half_period", config.half_period, "must be below time_limit", -1,
                 config.time_limit, true})
        .demand(at_most(S(S(8) * T), config.half_period), "half_period", config.half_period,
                "must be at least 8 samples");
  }
  if (config.response_time > S(0)) {
    rules
        .demand(at_most(T, config.response_time), "response_time", config.response_time,
                "must be at least one sample")
        .demand(config.response_time < config.time_limit,
                {"response_time", config.response_time, "must be below time_limit", -1,
                 config.time_limit, true});
  }
  rules.demand(at_most(S(config.fastest * T), config.response),
               {"fastest", config.fastest, "must be at most response in a sample:", -1,
                config.response / T, true});
  const S power = Order == 1 ? T : S(T * T);
  rules.representable("sample_time", T, power, "has a power that the scalar cannot hold");
  if (!rules) return rules.error();
  return *limiter;
}

}  // namespace detail
}  // namespace esokit
