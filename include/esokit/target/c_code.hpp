/// @file
/// to_c: a finished controller or observer as C99, written from its recorded calls.
#pragma once

#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <esokit/target/detail/runtime_text.hpp>
#include <esokit/target/detail/writable.hpp>
#include <string>
#include <vector>

namespace esokit {

/// The two files, `name.h` and `name.c`.
struct CCode {
  std::string header{};  ///< text of `name.h`
  std::string source{};  ///< text of `name.c`

  /// With CodeOptions::settings_in_struct: text of the struct for a file of its own, where it is
  /// not that of `name.c` but of another design, for `name_adopt`.
  std::string settings{};
};

namespace detail {

/// All of it, empty if there is none.
template <class Code>
std::string text_of(const Code& made) {
  return made ? made->header + made->source + made->settings : std::string();
}

/// The C of what has nothing to record: its files of target/runtime.
/// @param fill gives their text the features, constants and lines
template <class S, class Fill>
Expected<CCode, Error<S>> code_of(const CodeOptions& options, const char* header,
                                  const std::vector<const char*>& sources, const Fill& fill) {
  const auto ok = checked_names<S>(options, [&](const CodeOptions& as) {
    return text_of(code_of<S>(as, header, sources, fill));
  });
  if (!ok) return ok.error();
  RuntimeText text(options.name, sizeof(S) == sizeof(float));
  text.lines("DESIGN_ABOUT", options.comment.empty() ? "" : " * " + options.comment + "\n");
  fill(text);
  std::vector<const char*> files{runtime::head};
  files.insert(files.end(), sources.begin(), sources.end());
  return CCode{text.header(header), text.source(files), {}};
}

/// The texts; settings bear a mark of what else is in them.
CCode c_code(const RecordedDesign& design);

}  // namespace detail

/// The controller or observer as C99, two files without a library.
///
/// They have a state struct, init, update, estimates in physical units, and a self-test that
/// compares with the C++, also through gaps, restarts, safe mode, bad numbers and reports (compiled
/// if `NAME_SELF_TEST` is defined). A controller also has start, an observer reset, predict and
/// correct. What is done at a sample is recorded from its own calls, so
/// there is no second implementation. Settings are constants. With `settings_in_struct`, gains and
/// limits are a struct that `name_adopt` changes while it runs, as `adopt` does. Bad and missing
/// samples, gaps, restarts, the start hold and safe mode are those of the object, too.
///
/// Compiled without contraction (-std=c99 in GCC) it equals the C++ bit for bit, as far as tested:
/// after any bad sample, gap, report or start. Where the design computes a power or an exponential
/// at each sample (NonlinearEso), nothing is promised through those of another library. A gap of
/// each length has its gains in a table of one row more than the `max_gap` of the config: choose it
/// as short as the machine allows. Where gaps beyond `max_gap()` are bridged, `update` of a valid
/// sample also reads whether corrections are due.
///
/// Written are, and others do not compile:
/// - LinearEso, also with a set of poles, HalfGainEso, ReducedOrderEso, CascadeEso, PlantEso,
///   AdjustableBandwidthEso, NonlinearEso, AlgebraicEso; ModelEso, not with `follows_speed`;
///   ExtendedStateFilter, recursive and frozen, without a nominal model;
/// - these in DelayedInput, OutlierGate and WrappedOutput;
/// - these but AlgebraicEso in KnownModel, if its function is generic;
/// - these in MappedInput (the curve is no setting);
/// - these in Measured, not around WrappedOutput or another Measured, and not in Guarded;
/// - LinearEso and CascadeEso in Guarded (a changing b0 unless the law softens);
/// - Adrc of both forms, also in Resting, and DisturbanceCompensator around all of these;
/// - PredictiveAdrc around one without an adapter whose gain is known before the measurement (not
///   AdjustableBandwidthEso or NonlinearEso), so EPADRC around ExtendedStateFilter, too.
///
/// The function of a KnownModel is recorded like all else, with its own numbers as constants: it is
/// `template <class E> auto operator()(const E& x) const noexcept`, or a template of the scalar
/// with `with_scalar`. It adds, multiplies and compares numbers of the observer's scalar (and
/// integers), and calls abs, sqrt, pow, exp, expm1, sin, cos, tan, atan and tanh as by `using
/// std::sin;`. A branch on a value does not compile: `select(condition, a, b)` chooses.
///
/// Not VariableTime: a step of another length designs the observer anew. Write the observer of a
/// fixed T. After a pause of k T call k - 1 times `name_applied(&o, u)`, with the u that was held,
/// and `name_update_without_measurement`; then `name_applied(&o, u)` and `name_update`. The
/// estimate is that of `elapsed`, and so is u. But each call counts as a command, which a limit of
/// rate goes on from and a rest holds, and as a missing sample.
///
/// SmoothProfile, ApproachProfile and FollowProfile, TimeProportioned, HealthMonitor:
/// target/profile_code.hpp, target/time_proportioned_code.hpp and target/health_code.hpp.
/// @param object as `make` returned it, or running, after a valid sample: `init` begins in its
///        state, a `start` or report since included. A gap that runs, safe mode and a sample
///        without a measurement that is due are not kept
/// @return error for a name that is no identifier, a comment that would end the one it stands in, a
///         number of samples of the self-test out of range, or a gain law of your own whose gain
///         after a gap depends on the innovation
template <detail::Writable Object>
Expected<CCode, Error<typename Object::scalar_type>> to_c(const Object& object,
                                                          const CodeOptions& options = {}) {
  const auto design = detail::recorded_design(object, options);
  if (!design) return design.error();
  const auto new_names = detail::new_names<typename Object::scalar_type>(
      options, [&](const CodeOptions& as) { return detail::text_of(to_c(object, as)); });
  if (!new_names) return new_names.error();
  return detail::c_code(*design);
}

/// What cannot be written yet, by name.
template <class Other>
void to_c(const Other&, const CodeOptions& = {}) {
  static_assert(!detail::TakesAnyTime<Other>,
                "esokit: to_c does not write VariableTime, whose steps of another length design "
                "the observer anew: write it of a fixed T, and after a pause of k T call "
                "update_without_measurement k - 1 times before update, and applied(u) before each");
  static_assert(detail::knows_in_general<Other>,
                "esokit: to_c records the function of a KnownModel: it has to be generic, template "
                "<class E> auto operator()(const E& x) const noexcept, in numbers of the "
                "observer's scalar");
  static_assert(
      !detail::knows_in_general<Other> || detail::Writable<Other>,
      "esokit: to_c writes LinearEso, HalfGainEso, ReducedOrderEso, CascadeEso, "
      "AdjustableBandwidthEso, NonlinearEso, ModelEso, PlantEso, AlgebraicEso and "
      "ExtendedStateFilter, these in DelayedInput, OutlierGate, WrappedOutput, Measured and "
      "MappedInput, in "
      "KnownModel (not AlgebraicEso), on the chain with one extended state in Guarded, and "
      "Adrc (also in Resting) and DisturbanceCompensator around them, and PredictiveAdrc around "
      "one without an adapter whose gain does not depend on the innovation; no other gains, "
      "adapters or controllers yet");
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/c_code.ipp>
#endif
