/// @file
/// The innovations fit: from a log to a chain of integrators with a lag and a dead time.
///
///     y^(n) + a y^(n-1) = b0 v(t - L) + sum_j theta_j r_j + d,   tau v' + v = u,   d^(m) = noise
///
/// For a given bandwidth w (ratio of disturbance to noise), tau, L and a, the innovations of the
/// Kalman filter of this model are linear in b0 and theta, which therefore have a closed form. w, L
/// + tau, the share of tau and a are found by the Levenberg-Marquardt method on the innovations. In
/// steady state the likelihood is largest where the mean square of the innovations is smallest (L.
/// Ljung, System Identification, 2nd ed., sec. 7.4). The filter starts from a diffuse state
/// (infinite covariance) at the first row and after each gap.
#pragma once

#include <array>
#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/identify/detail/timed_column.hpp>
#include <esokit/identify/innovations_filter.hpp>
#include <esokit/identify/spectrum.hpp>
#include <esokit/math/detail/dense.hpp>
#include <limits>
#include <span>
#include <vector>

namespace esokit {

/// The innovations of a log for one model structure, and the fit that minimises them.
///
/// It stores a reference to the data.
class InnovationsFit {
 public:
  /// For `data`, which must outlive this object.
  InnovationsFit(const FitData& data, const FitModel& model, const FitBounds& bounds);

  /// The fit with b0 and the numbers of the columns in closed form and all other parameters as
  /// given.
  [[nodiscard]] Fit at(const FitPoint& point);

  /// From now on u explains nothing: what is left without it, over the same rows. A u of zeros
  /// would leave out other rows at the start of a piece.
  void ignore_input();

  /// Minimises the innovations, from `start` on. @param with_bandwidth false: w is kept
  [[nodiscard]] Fit minimise(const FitPoint& start, bool with_bandwidth, int steps = 25);

  /// Derivatives of the innovations with respect to the free parameters, then the linear ones, then
  /// latency and squared lag of each timed column. Also which parameters are free: 0 log w, 1
  /// log(tau + L), 2 share squared, 3 a (tau + L).
  struct Sensitivities {
    std::vector<std::vector<double>> columns;  ///< one for each parameter, each as long as the log
    std::vector<int> free;                     ///< the parameters to which the first of them belong
  };

  /// The sensitivities at the fit that `at` or `minimise` returned last. Parameters at a bound are
  /// not free. @param with_times those of the timed columns, too, which a fit keeps
  [[nodiscard]] Sensitivities sensitivities(const Fit& fit, bool with_bandwidth,
                                            bool with_times = false);

  /// Derivatives of the innovations with respect to latency and squared lag of timed column `c`,
  /// whose number is `gain`.
  [[nodiscard]] std::array<std::vector<double>, 2> time_sensitivities(const FitPoint& at,
                                                                      std::size_t c, double gain);

  /// Innovations of y, then of u, the further inputs and the columns, each with the factor one, at
  /// the fit that `at` or `minimise` returned last.
  [[nodiscard]] const std::vector<std::vector<double>>& parts() const { return columns_; }

  /// Innovations of one more column with the factor one.
  [[nodiscard]] std::vector<double> column_innovations(const FitPoint& at,
                                                       const std::vector<double>& column) const;

  /// Innovations of the fit that `at` or `minimise` returned last; zero in the first rows of a
  /// piece, which are not used.
  [[nodiscard]] const std::vector<double>& residual() const { return residual_; }

  /// Whether the latency or the pole is at the upper bound of its range. A lag or a dead time of
  /// zero does not count: `split_errors` tells how large they may be.
  [[nodiscard]] bool at_bound(const FitPoint& p) const;

  /// The point, limited to the bounds.
  [[nodiscard]] FitPoint inside(FitPoint p) const;

  /// The measurement noise from the innovations of the fit that `at` or `minimise` returned last:
  /// the median over all stretches at frequencies where the disturbance has less than a tenth of
  /// the noise's power. 0 if these are too few. Effects that are not in the model are slower (a
  /// flexible mode) or occasional (stiction), so they do not affect this number, while they affect
  /// `Fit::noise`.
  [[nodiscard]] Estimate noise_floor(const Fit& fit) const;

  [[nodiscard]] const FitData& data() const { return data_; }        ///< as given
  [[nodiscard]] const FitModel& model() const { return model_; }     ///< as given
  [[nodiscard]] const FitBounds& bounds() const { return bounds_; }  ///< as given

  /// J'J and J'r over rows [from, to).
  static void normal_equations(std::span<const std::vector<double>> jacobian,
                               const std::vector<double>& residual, std::vector<double>& normal,
                               std::vector<double>& right, std::size_t from = 0,
                               std::size_t to = (std::numeric_limits<std::size_t>::max)());

 private:
  /// Rows at the start of a piece that only fill the lag and the dead time. They are those of the
  /// longest latency, unless much of the motion of u lies there, as in the record of a step. Then u
  /// is taken to have been at rest before. Else, if it is unknown, what the lag has left of the u
  /// before is fitted: a heater that is on when the log begins may have been off a moment ago.
  [[nodiscard]] std::size_t lead(std::size_t from, std::size_t to) const;
  [[nodiscard]] std::size_t longest_lead(std::size_t from, std::size_t to) const;

  /// Takes out of innovations, piece by piece, what an unknown lag at the start may explain.
  /// @return how much of `started_` that was, in each piece
  std::vector<double> without_start(std::vector<double>& innovations) const;

  static constexpr std::array<double, 4> longest_step = {1.0, 0.7, 0.4, 0.2};
  static constexpr std::array<double, 4> small_step = {1e-4, 1e-4, 1e-4, 1e-4};

  static std::array<double, 4> numbers(const FitPoint& p) {
    return {p.bandwidth, p.latency, p.lag_share, p.pole};
  }

  [[nodiscard]] FitPoint moved(FitPoint p, const std::array<double, 4>& move) const;

  /// The damped Gauss-Newton step from `p`, limited. A parameter that is at a bound and would leave
  /// its range stays, and the others move as if it were known: with steps that count on its move
  /// the fit would get worse. @returns whether anything moves, by a finite step
  bool step_within(const FitPoint& p, const std::vector<double>& normal, std::vector<double> right,
                   const std::vector<int>& free, double damping, std::array<double, 4>& move) const;

  template <class F>
  void with_filter(const FitPoint& point, const F& use) const;

  /// Adds the parts weighted by the linear numbers, from number `first` on.
  static void combine(std::vector<double>& sum, const std::vector<std::vector<double>>& parts,
                      const std::vector<double>& linear, std::size_t first);

  template <class Filter>
  void run_whole(const Filter& filter, const std::vector<double>& linear, double* out) const;

  template <class Filter>
  void solve_linear(const Filter& filter, Fit& fit);

  const FitData& data_;
  FitModel model_;
  FitBounds bounds_;
  std::vector<std::size_t> lead_{};             // unused rows at the start of each piece
  double input_ = 1.0;                          // of u: 0 if it is ignored
  std::size_t rows_ = 0;                        // number of innovations used
  std::vector<std::vector<double>> columns_{};  // of y, u, and the data's columns
  std::vector<double> residual_{};
  // The range of u in the first row of each piece of which u before is unknown: an input.
  std::vector<double> unknown_{};
  std::vector<double> started_{};  // its innovations
  std::vector<double> before_{};   // its number in each piece
  std::vector<std::vector<double>> kept_columns_{};
  std::vector<double> kept_residual_{}, kept_started_{}, kept_before_{};
  mutable std::vector<double> force_{}, combined_{};
  mutable detail::GainTables cached_{};
};

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/fit.ipp>
#endif
