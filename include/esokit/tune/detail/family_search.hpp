/// @file
/// The search of one family for the settings with the least cost within the rules.
#pragma once

#include <algorithm>
#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/tune/controller_source.hpp>
#include <esokit/tune/detail/search.hpp>
#include <esokit/tune/families.hpp>
#include <esokit/tune/loop_cost.hpp>
#include <esokit/tune/lqg.hpp>
#include <esokit/tune/specification.hpp>
#include <esokit/tune/tuning.hpp>
#include <limits>
#include <map>
#include <vector>

namespace esokit {

namespace detail {

/// A family for a model, and how it is searched.
struct Contender {
  TunedDesign design{};
  ObserverKind kind{};
  int observer_numbers = 1;  ///< number of free parameters of the observer
  int law_numbers = 1;
};

/// The data of the problem that a search needs.
struct TuneSearch {
  TuneModel model;
  TuneRules rules;
  double rho;
  double fixed_bandwidth;      ///< omega_c if it is given, else 0
  double reference_bandwidth;  ///< of the law of the LQG controller
  double filter_bandwidth;     ///< of the filter of the LQG controller
  double possible_bandwidth;   ///< largest one that lag and dead time allow
  double most_noise;           ///< in u, 0 if something else is required
  const LoopCost* cost;
  bool damped = false;  ///< whether each evaluation looks at the poles of the loop

  /// Of a point that was evaluated: log J, what its rules lack, and log omega_c.
  struct Seen {
    double value = 0.0, lack = 0.0, speed = 0.0;
  };
  mutable std::map<std::vector<double>, Seen> seen{};  ///< of one contender

  /// J says nothing of the reference, and is often the same for a slow law and a fast observer: a
  /// law ten times as fast is worth 0.7 % of J.
  static constexpr double worth_of_speed = 0.003;

  [[nodiscard]] double slowest() const {
    return 0.05 * (std::min)({reference_bandwidth, filter_bandwidth, 0.3 * possible_bandwidth});
  }
  [[nodiscard]] double fastest() const;

  /// Settings from the logarithms over which the search runs.
  [[nodiscard]] TuneSettings settings(const Contender& c, const std::vector<double>& x) const;

  /// LQR gains of a chain of n integrators for var(y) + rho var(v).
  [[nodiscard]] std::vector<double> lqr(int n, double weight) const;

  /// The cost for the search, which requires slightly larger margins, because its frequency grid is
  /// coarse.
  [[nodiscard]] LoopCost coarse() const;

  /// What the rules are about: of each the number that a design has, over the one that is required;
  /// infinite if nothing is.
  struct Kept {
    double modulus, delay, gain, phase, noise, poles, damping, ratio;
  };
  [[nodiscard]] static double over(double has, double required) {
    return required > 0.0 ? has / required : std::numeric_limits<double>::infinity();
  }
  static constexpr double any = std::numeric_limits<double>::infinity();

  /// The damping of the poles of a loop, see TuneRules::pole_damping; negative if it is not stable.
  [[nodiscard]] double damping_of(const Loop& loop, bool knows_sinusoid) const {
    return pole_damping(loop, knows_sinusoid ? model.sinusoids.front().frequency : 0.0);
  }
  [[nodiscard]] double damping_of(const LinearController& controller, bool knows_sinusoid) const;

  /// Those that any controller has to keep. @param poles damping of the poles, if it is known
  [[nodiscard]] Kept kept(const LoopNumbers& numbers, double poles = any) const;
  [[nodiscard]] Kept kept(const Contender& c, const TuneSettings& s, const LoopNumbers& numbers,
                          double poles = any) const;
  /// How much is missing: the sum of shares, 0 if nothing is.
  [[nodiscard]] static double lack(const Kept& kept, double more = 1.0);

  /// log J plus a penalty on broken rules.
  [[nodiscard]] double value(const Contender& c, const std::vector<double>& x, double price) const;

  /// Whether a controller is not stable by itself, which poles of little damping can make of it;
  /// its integrator may stand.
  [[nodiscard]] static bool runs_away(const LinearController& controller);

  /// What a point lacks of the rules, by this cost. @param whole with the poles of the loop
  [[nodiscard]] double lacks(const Contender& c, const std::vector<double>& x, const LoopCost& by,
                             bool whole) const;

  /// Whether variable `index` of the search is a damping; the others are factors or bandwidths.
  [[nodiscard]] bool damping(const Contender& c, std::size_t index) const;
  [[nodiscard]] bool factor(const Contender& c, std::size_t i) const {
    return c.design.family == TuneFamily::cascade && i == 1;
  }
  [[nodiscard]] bool capture(const Contender& c, std::size_t i) const {
    return c.design.knows.sinusoid && c.observer_numbers == 2 && i == 1;
  }
  [[nodiscard]] double low(const Contender& c, std::size_t i) const;
  [[nodiscard]] double high(const Contender& c, std::size_t i) const;

  /// A start for the search for free poles: bandwidths `o` of the observer and `l` of the law, with
  /// the poles of half gains or all in one place.
  [[nodiscard]] std::vector<double> start(const Contender& c, double o, double l, bool half) const;

  /// The same free poles, divided otherwise between observer and law: all that there are.
  [[nodiscard]] std::vector<std::vector<double>> divisions(const Contender& c,
                                                           const std::vector<double>& x) const;

  /// The minimum of a family. @param starts start points in place of a scan
  [[nodiscard]] SearchPoint least(const Contender& c, bool margins,
                                  const std::vector<std::vector<double>>& starts) const;
};

/// The search of a problem whose rho is known.
TuneSearch search_for(const Tuning& tuning, bool given_law);

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/tune/impl/family_search.ipp>
#endif
