/// @file
/// The worst margins of a controller over a set of plants.
#pragma once

#include <cstddef>
#include <esokit/analysis/delay_margin.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <utility>
#include <vector>

namespace esokit {

/// A worst value and the parameters of the plant for which it was found.
template <std::size_t Count>
struct Worst {
  double value = 0.0;                 ///< unit of the margin
  Array<double, Count> parameters{};  ///< parameters of the plant
};

/// The worst values over all plants, each with the plant at which it occurs. If the loop of any
/// plant is unstable, there are no margins: they then have the values of a loop at the stability
/// limit, for example modulus 0.
template <std::size_t Count>
struct WorstCase {
  Worst<Count> stability_abscissa;  ///< the largest; if negative, every loop was stable
  Worst<Count> modulus;             ///< smallest abs(1 + L)
  Worst<Count> gain_increase;       ///< smallest factor > 1 on L that makes a loop oscillate
  Worst<Count> gain_decrease;       ///< largest factor below 1 that does so
  Worst<Count> phase;               ///< smallest phase shift, rad
  Worst<Count> delay;               ///< smallest additional delay, s

  /// True if every tested loop is stable.
  [[nodiscard]] bool stable() const noexcept { return stability_abscissa.value < 0.0; }
};

namespace detail {

/// The values of one plant that are compared, larger being worse: abscissa, and margins with a
/// suitable sign.
using Badness = std::array<double, 6>;

/// Computes the values of one loop. @param worst is written
Check<double> judge(const LoopResult& loop, Badness& worst);

/// The worst of each kind so far, and its parameters.
struct Found {
  Badness value{};
  std::array<std::vector<double>, 6> at{};
};

/// The plants to be studied: `look(study, parameters, worst)`, see `judge`.
struct PlantStudy {
  const void* study;
  Check<double> (*look)(const void*, const std::vector<double>&, Badness&);
};

/// Evaluates every point of a grid over the ranges, then searches from the worst of each kind in
/// steps that are halved.
Check<double> find_worst(const PlantStudy& plants, const std::vector<Interval<>>& ranges,
                         int points, int halvings, Found& found);

}  // namespace detail

/// The effort of the search.
struct WorstCaseSearch {
  int points = 5;    ///< points per parameter, ends included; points^parameters loops
  int halvings = 6;  ///< halvings of the step in the search from the worst points; may be 0
};

/// The worst margins over a box of plant parameters: at every point of a grid, and by a search from
/// the worst points in steps that are halved. This is not a proof: between the points the margins
/// may be worse.
/// @param plant_of function from an Array<double, Count> of parameters to a LinearPlant, or to an
/// Expected of one @param ranges of the parameters
/// @return error for an empty range, or the error of the first plant that does not form a loop
template <class PlantOf, std::size_t Count, class Controller>
Expected<WorstCase<Count>, Error<double>> worst_case(PlantOf&& plant_of,
                                                     const std::array<Interval<>, Count>& ranges,
                                                     const Controller& controller,
                                                     const WorstCaseSearch& search = {}) {
  Rules<double> rules;
  rules
      .demand(2 <= search.points && search.points <= 1000, "points", search.points,
              "must be 2 .. 1000")
      .demand(0 <= search.halvings && search.halvings <= 100, "halvings", search.halvings,
              "must be 0 .. 100");
  for (std::size_t i = 0; i < Count; ++i) {
    const auto index = static_cast<int>(i);
    rules.finite("ranges", ranges[i].lower, index)
        .finite("ranges", ranges[i].upper, index)
        .demand(!(ranges[i].lower > ranges[i].upper), "ranges", ranges[i].lower,
                "must not be above upper", index);
  }
  if (!rules) return rules.error();
  const auto look = [&](const std::vector<double>& at, detail::Badness& worst) -> Check<double> {
    Array<double, Count> parameters{};
    for (std::size_t i = 0; i < Count; ++i) parameters[i] = at[i];
    const auto plant = plant_of(std::as_const(parameters));
    if constexpr (requires { plant.error(); }) {
      if (!plant) {
        const auto& error = plant.error();
        return Error<double>{error.field, static_cast<double>(error.value), error.rule,
                             error.index};
      }
      return detail::judge(closed_loop(*plant, controller), worst);
    } else {
      return detail::judge(closed_loop(plant, controller), worst);
    }
  };
  using Look = decltype(look);
  const detail::PlantStudy plants{
      &look, [](const void* study, const std::vector<double>& at, detail::Badness& worst) {
        return (*static_cast<const Look*>(study))(at, worst);
      }};
  detail::Found found;
  if (auto ok = detail::find_worst(plants, {ranges.begin(), ranges.end()}, search.points,
                                   search.halvings, found);
      !ok) {
    return ok.error();
  }
  const auto take = [&](std::size_t kind, double sign) {
    Worst<Count> worst{sign * found.value[kind], {}};
    for (std::size_t i = 0; i < Count; ++i) worst.parameters[i] = found.at[kind][i];
    return worst;
  };
  return WorstCase<Count>{take(0, 1.0), take(1, -1.0), take(2, -1.0),
                          take(3, 1.0), take(4, -1.0), take(5, -1.0)};
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/worst_case.ipp>
#endif
