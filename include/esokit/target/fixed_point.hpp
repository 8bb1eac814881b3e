/// @file
/// to_fixed_c: a finished controller or observer as C99 in integers, with proven bounds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/detail/fixed_design.hpp>
#include <esokit/target/detail/runtime_text.hpp>
#include <vector>

namespace esokit {

/// A design in fixed point: the files, and how far they are from the design.
struct FixedCode {
  CCode code{};                         ///< `name.h` and `name.c`
  std::vector<FixedBound> estimates{};  ///< of each, in its unit
  FixedBound input{};                   ///< of u before its limits, in counts; of a controller
  WrittenSystem written{};              ///< what the bounds are from
  FixedLayout layout{};                 ///< what other settings have to fit into
};

namespace detail {

/// Runs the lists of a design for its self-test.
class FixedPlayer {
 public:
  explicit FixedPlayer(const FixedDesign& design)
      : held(design.start_held()),
        design_(&design),
        words_(design.states(), 0),
        rests_(design.states(), 0),
        last_(held << design.law_scale),
        hold_left_(design.design().loop.hold_left) {}

  /// @param y in counts, of a counter its change
  void observe(std::int64_t y, std::int64_t u);
  std::int64_t control(std::int64_t r);
  [[nodiscard]] std::int64_t next_word(std::size_t i) const { return words_[i]; }
  std::int64_t held;

 private:
  const FixedDesign* design_;
  std::vector<std::int64_t> words_;
  std::vector<std::int64_t> rests_;
  std::int64_t last_;
  unsigned hold_left_;
};

namespace runtime {

inline constexpr const char* fixed =
#include <esokit/target/runtime/fixed.c>
    ;

}  // namespace runtime

/// The code of a design, but for the settings that another code has to fit.
Expected<FixedCode, Error<double>> fixed_code(const RecordedDesign& recorded,
                                              const FixedPointOptions& options);

}  // namespace detail

/// The controller or observer as C99 in 32-bit integers, two files without a library, for cores
/// without floating point. Functions and modes are those of `to_c`; y, u and the reference are
/// counts.
///
/// Each state has a scale of its own, chosen so that nothing can overflow while y and u are within
/// their declared ranges; a y outside is no measurement. What a shift leaves over is kept where the
/// bound needs it, so that a slow observer at a high rate does not stall. Where samples are missing
/// the states move in 64 bits and are held within their ranges, with a flag. After more than
/// `max_gap()` samples the next valid one restarts, also where the object bridges longer gaps.
///
/// The bounds are worst cases over all sequences of y and u within their ranges with a measurement
/// at each sample: sums of the impulse responses from each rounding that is written to each
/// estimate. After a gap they hold again as the state that it left decays.
///
/// Written are observers whose update is linear and Adrc around them up to order 2: LinearEso, also
/// with a set of poles, HalfGainEso and CascadeEso. Also AlgebraicEso once it has settled and the
/// frozen ExtendedStateFilter, which restart after any gap with the gains of then. A limit of rate
/// may be below one count a sample.
///
/// With CodeOptions::settings_in_struct, gains and limits are in a struct, and `name_adopt` takes
/// another one while it runs: CCode::settings of another design that was written with
/// FixedPointOptions::settings_for. The scales are those of the running code; gains that do not fit
/// into them, ranges that would overflow and bounds above what is allowed are refused here. A
/// switch holds each state within the range of the new settings, so no sequence of switches
/// overflows; the bounds hold again as what the old settings left decays.
///
/// Larger gains overflow the scales of a design, and so do the wider ranges of a slower one, in
/// which what u does lasts longer. So write each design alone first, then the running code with all
/// of them in FixedPointOptions::room_for, then each with `settings_for` that code:
///
///     const auto alone = to_fixed_c(slow, options);
///     options.room_for = {&*alone};
///     const auto running = to_fixed_c(fast, options);
///     options.settings_for = &*running;
///     const auto settings = to_fixed_c(slow, options);  // its code.settings
/// @param object as `make` returned it; the C begins at rest at zero
/// @return error, with what would do, for ranges that 32 bits cannot hold, a bound above what is
///         allowed, and designs that are not linear or have what is not written in fixed point
template <detail::Writable Object>
Expected<FixedCode, Error<typename Object::scalar_type>> to_fixed_c(
    const Object& object, const FixedPointOptions& options) {
  using V = typename Object::scalar_type;
  const auto recorded = detail::recorded_design(object, options.code);
  if (!recorded) return recorded.error();
  auto made = detail::fixed_code(*recorded, options);
  if (!made) {
    const auto& no = made.error();
    return Error<V>{no.field, static_cast<V>(no.value), no.rule,
                    no.index, static_cast<V>(no.limit), no.has_limit};
  }
  const auto new_names = detail::new_names<V>(options.code, [&](const CodeOptions& as) {
    FixedPointOptions other = options;
    other.code = as;
    other.settings_for = nullptr;
    const auto code = to_fixed_c(object, other);
    return detail::text_of(code ? &code->code : nullptr);
  });
  if (!new_names) return new_names.error();
  const std::uint32_t mark = made->layout.mark;
  if (options.settings_for != nullptr && mark != options.settings_for->layout.mark) {
    return Error<V>{"settings_for", static_cast<V>(mark),
                    "must be the code of a design with the same name, structure, sample time, b0, "
                    "ranges, max_gap and signs of its gains"};
  }
  return std::move(*made);
}

/// What cannot be written yet, by name.
template <class Other>
void to_fixed_c(const Other& object, const FixedPointOptions&) {
  to_c(object);
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/fixed_point.ipp>
#endif
