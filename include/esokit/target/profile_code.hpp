/// @file
/// to_c of a SmoothProfile: the reference of a move as C99.
#pragma once

#include <cctype>
#include <cmath>
#include <cstddef>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/c_text.hpp>
#include <esokit/target/list_writer.hpp>
#include <esokit/target/recorded_design.hpp>
#include <esokit/target/structured_text.hpp>
#include <string>
#include <vector>

namespace esokit {

namespace detail {

inline constexpr const char* c_profile_header = R"(#ifndef $NAME_H
#define $NAME_H
/* Written by esokit from a finished profile; do not edit.
$COMMENT * A reference from rest to rest with all derivatives up to the one of order $ORDER, T = $TIME s.
 *
 * Compile with -std=c99 or -ffp-contract=off: then it equals the C++ bit for bit, with the same
 * $roots. */

$include <stdbool.h>
$include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define $NAME_ORDER $ORDER

typedef struct {
  $real start;
  $real target;
  int32_t sample;
  int32_t samples; /* of the move */
} $name_state;

/* At rest at `value`; false, and nothing changes, if it is not finite. */
bool $name_reset($name_state *o, $real value);
/* One sample on the way to a target; one that changes during a move is taken up at its end. False if
 * it is not finite or too far: a move that runs goes on, another one does not begin. */
bool $name_update($name_state *o, $real target);
/* Whether a move runs. */
bool $name_moves(const $name_state *o);
/* The reference and its derivatives, now. */
void $name_motion(const $name_state *o, $real motion[$COUNT]);

#ifdef $NAME_SELF_TEST
/* 0, or the number of the first sample that differs from that of the design by more than
 * `tolerance`. */
int $name_self_test($real tolerance);
#endif

#ifdef __cplusplus
}
#endif
#endif
)";

/// The counterpart of SmoothProfile and smooth_step.
inline constexpr const char* c_profile_source =
    R"(/* From 0 to 1 while x does; of the second half by symmetry. */
static void smooth_step($real x, $real all[$COUNT])
{
  static const $real polynomials[$COUNT][$TERMS] = { /* s, s', .. */
$POLYNOMIALS  };
  const $real inside = (x > $ZERO) ? ((x < $ONE) ? x : $ONE) : $ZERO;
  const bool second = inside > $HALF;
  $real at = inside;
  unsigned i;
  if (second) {
    at = $ONE - inside;
  }
  for (i = 0u; i < $COUNTu; ++i) {
    $real sum = $ZERO;
    unsigned k;
    for (k = $TERMSu; k > 0u; --k) {
      sum = (sum * at) + polynomials[i][k - 1u];
    }
    if (second && ((i % 2u) == 0u)) {
      sum = -sum;
    }
    all[i] = sum;
  }
  if (second) {
    all[0] = $ONE + all[0];
  }
}

/* Of a move from where the last one ends. */
static $real duration(const $name_state *o, $real target)
{
  const $real way = $fabs(target - o->target);
  $real time = $ZERO;
  $real least;
  if (!(way > $ZERO)) {
    return time;
  }
  time = $SHORTEST;
$LIMITS  return time;
}

static bool plan($name_state *o, $real target)
{
  const $real samples = (duration(o, target) / $TIME) * $LONGER;
  const bool stays = !(samples > $ZERO) && !(target < o->target) && !(target > o->target);
  if (!is_finite(samples) || !(samples < $MOST)) {
    return false;
  }
  o->start = o->target;
  o->target = target;
  o->sample = 0;
  o->samples = stays ? 0 : (int32_t)$ceil(samples);
  if (!stays && (o->samples == 0)) {
    o->samples = 1;
  }
  return true;
}

bool $name_reset($name_state *o, $real value)
{
  const bool good = is_finite(value);
  if (good) {
    o->start = value;
    o->target = value;
    o->sample = 0;
    o->samples = 0;
  }
  return good;
}

bool $name_moves(const $name_state *o)
{
  return o->sample < o->samples;
}

bool $name_update($name_state *o, $real target)
{
  bool good = is_finite(target);
  if (good && !$name_moves(o)) {
    good = plan(o, target);
  }
  if ($name_moves(o)) {
    o->sample = o->sample + 1;
  }
  return good;
}

void $name_motion(const $name_state *o, $real motion[$COUNT])
{
  const $real way = o->target - o->start;
  const $real count = ($real)o->samples;
  $real step[$COUNT];
  $real scale = way;
  $real x;
  unsigned i;
  motion[0] = o->target;
  for (i = 1u; i < $COUNTu; ++i) {
    motion[i] = $ZERO;
  }
  if (!$name_moves(o)) {
    return;
  }
  x = ($real)o->sample / count;
  smooth_step($ONE - x, step);
  motion[0] = o->target - (way * step[0]); /* from the nearer end: exact there */
  if (!(x > $HALF)) {
    smooth_step(x, step);
    motion[0] = o->start + (way * step[0]);
  }
  smooth_step(x, step);
  for (i = 1u; i < $COUNTu; ++i) {
    scale = scale / (count * $TIME);
    motion[i] = scale * step[i];
  }
}

#ifdef $NAME_SELF_TEST
int $name_self_test($real tolerance)
{
  static const $real samples[$SAMPLES][$COLUMNS] = { /* target, motion */
$VECTORS  };
  $name_state o;
  unsigned i;
  unsigned k;
  (void)$name_reset(&o, $ZERO);
  for (i = 0u; i < $SAMPLESu; ++i) {
    $real motion[$COUNT];
    (void)$name_update(&o, samples[i][0]);
    $name_motion(&o, motion);
    for (k = 0u; k < $COUNTu; ++k) {
      if (!($fabs(motion[k] - samples[i][k + 1u]) <= tolerance)) {
        return (int)i + 1;
      }
    }
  }
  return 0;
}
#endif
)";

}  // namespace detail

/// A profile as C99: `name_reset`, then `name_update` once a sample and `name_motion` for (r, r',
/// .., r^(n)). There is nothing to record, as it branches everywhere: its text is written, and
/// tested to equal the C++ bit for bit where the roots (sqrt, cbrt) of the two libraries do.
/// @param profile at rest at zero, as `make` returned it
/// @return error for the options, as for a controller
template <int Order, PlainScalar S>
Expected<CCode, Error<S>> to_c(const SmoothProfile<Order, S>& profile,
                               const CodeOptions& options = {}) {
  if (const auto rules = detail::checked_options<S>(options); !rules) return rules.error();
  const detail::ListWriter writer(detail::c_language, sizeof(S) == sizeof(float));
  const auto number = [&](S x) { return writer.number(static_cast<double>(x)); };
  const std::string root_names[] = {"", "sqrt", "cbrt", "sqrt"};
  const auto rooted = [&](const std::string& x, int degree) {
    const std::string suffix = writer.single() ? "f(" : "(";
    if (degree == 1) return x;
    const std::string once = root_names[degree - 1] + suffix + x + ")";
    return degree == 4 ? "sqrt" + suffix + once + ")" : once;
  };
  const auto numbers = detail::RecordAccess::profile(profile);
  std::string limits;
  for (int i = 1; i <= Order; ++i) {
    const auto row = static_cast<std::size_t>(i - 1);
    if (!(numbers.limits[row] > S(0))) continue;
    limits += "  least = (" + rooted("way", i) + " / " + number(numbers.roots_of_limits[row]) +
              ") * " + number(numbers.roots_of_peaks[row]) +
              ";\n  if (!(time >= least)) {\n    time = least;\n  }\n";
  }
  // The polynomial and its derivatives, as smooth_step has them.
  constexpr int degree = 2 * Order + 1;
  std::array<S, static_cast<std::size_t>(degree) + 1> c{};
  for (int k = 0; k <= Order; ++k) {
    c[static_cast<std::size_t>(Order + 1 + k)] = static_cast<S>(
        (k % 2 == 0 ? 1 : -1) * binomial(Order + k, k) * binomial(degree, Order - k));
  }
  std::string polynomials;
  for (int i = 0; i <= Order; ++i) {
    std::string row;
    for (const S& one : c) row += (row.empty() ? "    {" : ", ") + number(one);
    polynomials += row + "},\n";
    for (std::size_t k = 0; k + 1 < c.size(); ++k) c[k] = static_cast<S>(k + 1) * c[k + 1];
    c.back() = S(0);
  }
  SmoothProfile<Order, S> played = profile;
  std::string vectors;
  for (int k = 0; k < options.self_test_samples; ++k) {
    const S target = static_cast<S>((k / 40) % 2 == 0 ? 1.0 : -0.5);
    (void)played.update(target);
    const auto motion = played.motion();
    vectors += "    {" + number(target);
    for (int i = 0; i <= Order; ++i) vectors += ", " + number(motion(i));
    vectors += "},\n";
  }
  const std::string count = std::to_string(Order + 1);
  detail::Words words{{"$include", "#include"},
                      {"$POLYNOMIALS", polynomials},
                      {"$LIMITS", limits},
                      {"$TERMS", std::to_string(degree + 1)},
                      {"$SHORTEST", number(numbers.shortest_time)},
                      {"$TIME", number(numbers.sample_time)},
                      {"$LONGER", number(numbers.longer)},
                      {"$MOST", number(static_cast<S>(1 << 30))},
                      {"$VECTORS", vectors},
                      {"$SAMPLES", std::to_string(options.self_test_samples)},
                      {"$COLUMNS", std::to_string(Order + 2)},
                      {"$COUNT", count},
                      {"$ORDER", std::to_string(Order)},
                      {"$ceil", writer.single() ? "ceilf" : "ceil"},
                      {"$roots", Order > 2 ? "sqrt and cbrt" : "sqrt"},
                      {"$HALF", number(static_cast<S>(0.5))}};
  const detail::Words common = detail::c_common_words(writer, options);
  words.insert(words.end(), common.begin(), common.end());
  return CCode{
      detail::filled(detail::c_profile_header, words),
      detail::filled(std::string(detail::c_source_head) + detail::c_profile_source, words)};
}

/// A profile as a function block in Structured Text, a call of which is a sample: its C,
/// translated. The cube root that a limited third derivative needs is EXPT: such a move may take a
/// sample more or less. @param profile as for to_c @return the text, or an error as for to_c
template <int Order, PlainScalar S>
Expected<std::string, Error<S>> to_structured_text(const SmoothProfile<Order, S>& profile,
                                                   const CodeOptions& options = {}) {
  const auto code = to_c(profile, options);
  if (!code) return code.error();
  detail::StBlock block(*code, options, sizeof(S) == sizeof(float), "_init");
  block.input("target : $real", "of the next move, or where it rests");
  block.input("resets : BOOL", "TRUE: is at rest at target");
  block.output("good : BOOL", "FALSE: target is not finite or too far");
  block.output("moves : BOOL");
  block.own("motion : $name_numbers_" + std::to_string(Order + 1));
  block.body =
      "IF resets THEN\n  good := $name_reset(o := o, value := target);\nELSE\n"
      "  good := $name_update(o := o, target := target);\nEND_IF;\n"
      "moves := $name_moves(o := o);\ndone := $name_motion(o := o, motion := motion);\n";
  for (int i = 0; i <= Order; ++i) {
    const std::string r = i == 0 ? "r" : "r" + std::to_string(i);
    block.output(r + " : $real", i == 0 ? "the reference" : "its derivative");
    block.body += r + " := motion[" + std::to_string(i) + "];\n";
  }
  const detail::StructuredText all = block.text(
      "(* Written by esokit from a finished profile; do not edit.\n$COMMENT   FUNCTION_BLOCK $name "
      "is at the end: call it once in each T = " +
      detail::ListWriter(detail::c_language, false)
          .number(static_cast<double>(detail::RecordAccess::profile(profile).sample_time)) +
      " s. *)\n\n");
  return all.template expected<S>(all.text);
}

}  // namespace esokit
