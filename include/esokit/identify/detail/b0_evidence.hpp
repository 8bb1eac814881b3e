/// @file
/// b0 by ranges of a scheduling column, and the interval that all evidence asks for.
#pragma once

#include <esokit/core/detail/compiled.hpp>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/detail/order_selection.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/identified.hpp>
#include <esokit/identify/plateau.hpp>
#include <esokit/identify/second_opinion.hpp>
#include <vector>

namespace esokit {

namespace detail {

/// Computes b0 at the plateau for ranges of a scheduling column, and as a straight line over the
/// column.
/// @param used the data with friction and sines
void find_schedule(const FitData& used, const std::vector<double>& along, const FitModel& model,
                   const IdentifyOptions& options, Identified& result);

/// Smallest share of u that does not follow from y.
constexpr double own_input_min = 1e-5;

/// Largest relative standard error of b0 at which u can be said to move y.
constexpr double excitation_max = 0.15;

/// Whether the innovations are as white as those of an exact model: of few rows the largest of
/// twenty correlations is larger.
double correlation_limit(const Identified& found, const IdentifyOptions& options);

bool white(const Identified& found, const IdentifyOptions& options);

/// Half a row, s: what takes less is not seen.
double half_row(const Identified& found);

/// Whether y moves before u. An optimum of the noise may look so: output error has to explain y
/// better with u so much earlier, too, or to be nearer to the b0 of the lead.
bool leads(const Identified& found);

/// Whether y moves before u, and b0 is more than a tenth off without it.
bool lead_harms(const Identified& found);

/// Whether output error tells b0: it is informative, and no lead harms. Where y follows
/// u within half a row, no machine was seen between them: then it has to explain nearly all of y.
bool informed(const Identified& found);

/// Half width that b0 of a plateau within two octaves of the lowest bandwidth needs. There every
/// fit is one of output error, so that neighbours agree tells nothing. b0 has to reach to the
/// interval of that of up to four octaves above, where the log is far more likely: by more than
/// e^10.
double reach_above(const Plateau& plateau, double bandwidth_min);

/// b0 with the interval that the other evidence asks for. Coloured innovations mean that the model
/// is not exact, so b0 is not known better than to a per cent. Where output error may be right
/// instead, the interval spans both. Friction that holds the machine takes b0 down, and that of the
/// motion is nearer to the truth: the interval reaches to the end of its own.
Estimate widened(const Identified& found, const IdentifyOptions& options);

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/b0_evidence.ipp>
#endif
