/// @file
/// From a log to a model with error bars, or to an error that says what to record instead.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/identify/detail/b0_evidence.hpp>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/detail/order_selection.hpp>
#include <esokit/identify/detail/row_study.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/identified.hpp>
#include <esokit/identify/input_checks.hpp>
#include <esokit/identify/log.hpp>
#include <esokit/identify/measured_columns.hpp>
#include <esokit/identify/plateau.hpp>
#include <esokit/identify/second_opinion.hpp>
#include <esokit/identify/seen_curve.hpp>
#include <esokit/identify/sinusoids.hpp>

namespace esokit {

namespace detail {

/// Whether averaged rows are better. Averaging loses fast effects, in the end the motion itself: so
/// it must help much, b0 must agree with that of the plain rows, and a row must be short.
bool better(const Identified& averaged, const Identified& plain, const Identified& best,
            const IdentifyOptions& options);

}  // namespace detail

/// The model and everything known about its quality. Whether it can be trusted is decided by
/// `judge`. It fails only if something cannot be computed.
[[nodiscard]] Expected<Identified, Error<double>> study(const Log& log,
                                                        const IdentifyOptions& options = {});

/// Decides whether a study can be trusted; if not, returns the first reason and what to record
/// instead.
[[nodiscard]] Check<double> judge(const Identified& found, const Log& log,
                                  const IdentifyOptions& options = {});

/// `study` and `judge`: a model with error bars, or the reason why this log cannot give one.
[[nodiscard]] Expected<Identified, Error<double>> identify(const Log& log,
                                                           const IdentifyOptions& options = {});

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/identify.ipp>
#endif
