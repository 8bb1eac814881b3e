// The definitions of what only a workstation runs, compiled once: by the CMake target
// esokit::compiled, or by a line of your own, with ESOKIT_COMPILED in all that uses them.
#if !defined(ESOKIT_COMPILED)
#define ESOKIT_COMPILED
#endif

#include <esokit/identify/impl/fit.ipp>
#include <esokit/identify/impl/gain_evidence.ipp>
#include <esokit/identify/impl/identified.ipp>
#include <esokit/identify/impl/identify.ipp>
#include <esokit/identify/impl/innovations_filter.ipp>
#include <esokit/identify/impl/input_checks.ipp>
#include <esokit/identify/impl/intervals.ipp>
#include <esokit/identify/impl/log.ipp>
#include <esokit/identify/impl/measured_columns.ipp>
#include <esokit/identify/impl/order_fits.ipp>
#include <esokit/identify/impl/plateau.ipp>
#include <esokit/identify/impl/second_opinion.ipp>
#include <esokit/identify/impl/sinusoids.ipp>
#include <esokit/identify/impl/spectrum.ipp>
#include <esokit/identify/impl/timed_column.ipp>
