#pragma once

#include <algorithm>
#include <cmath>
#include <esokit/identify/smooth.hpp>
#include <limits>

namespace esokit {

namespace detail {

/// A log at every sample: what was measured (NaN: nothing), and the u that acts from it to the
/// next.
struct SampledLog {
  std::vector<double> y, u;
  std::vector<std::size_t> rows;  ///< sample of each row of the log
  std::size_t measured = 0;
};

inline Expected<SampledLog, Error<double>> sampled_log(const Log& log, const SmoothModel& model) {
  const double T = model.sample_time;
  const std::size_t rows = log.y.size();
  const auto as_number = [](std::size_t count) { return static_cast<double>(count); };
  Rules<double> rules;
  rules.demand(rows > 0, "y", 0.0, "must have rows")
      .demand(log.u.size() == rows, {"u", as_number(log.u.size()), "must be as long as y, that is",
                                     -1, as_number(rows), true})
      .demand(log.time.empty() || log.time.size() == rows,
              {"time", as_number(log.time.size()), "must be empty or as long as y, that is", -1,
               as_number(rows), true})
      .demand(log.columns.empty(), "columns", as_number(log.columns.size()),
              "must be left out: add what is known to u, in its unit")
      .not_negative("sample_time", log.sample_time)
      .demand(
          !log.time.empty() || !(log.sample_time > 0.0) ||
              std::abs(log.sample_time - T) <= 0.01 * T,
          {"sample_time", log.sample_time, "must be that of the observer, which is", -1, T, true});
  if (!rules) return rules.error();
  rules.finite("u", log.u[0], 0);
  if (!log.time.empty()) rules.finite("time", log.time[0], 0);
  SampledLog all;
  std::vector<double> held;
  double u = 0.0;
  for (std::size_t k = 0; k < rows && rules; ++k) {
    double steps = 1.0;
    if (k > 0 && !log.time.empty()) {
      const double step = log.time[k] - log.time[k - 1];
      const int index = static_cast<int>(k);
      steps = std::round(step / T);
      rules.finite("time", log.time[k], index)
          .demand(step > 0.0, "time", log.time[k], "must rise", index)
          .demand(steps >= 1.0,
                  {"time", step, "has a step of less than half a sample, which is", index, T, true})
          .demand(as_number(held.size()) + steps <= 1e7, "time", step,
                  "must not have more than 1e7 samples from first to last row", index);
      if (!rules) break;
    }
    for (double i = 1.0; k > 0 && i < steps; i += 1.0) {
      all.y.push_back(std::numeric_limits<double>::quiet_NaN());
      held.push_back(u);
    }
    if (is_finite(log.u[k])) u = log.u[k];
    all.rows.push_back(all.y.size());
    all.y.push_back(log.y[k]);
    held.push_back(u);
    if (is_finite(log.y[k])) ++all.measured;
  }
  if (rules && !log.time.empty()) {
    // Each step may be anything near whole samples, all together may not.
    const double duration = log.time[rows - 1] - log.time[0];
    const double samples = as_number(held.size() - 1);
    rules.demand(std::abs(duration - samples * T) <= (1.0 + 0.01 * samples) * T,
                 {"time", duration / samples,
                  "has a mean step, in whole samples, other than the sample time of the observer",
                  -1, T, true});
  }
  const std::size_t states = model.units.size();
  rules.demand(all.measured > states,
               {"y", as_number(all.measured), "must be measured in more rows than", -1,
                as_number(states), true});
  if (!rules) return rules.error();
  const auto delay = static_cast<std::size_t>(model.delay);
  for (std::size_t k = 0; k < held.size(); ++k) all.u.push_back(held[k < delay ? 0 : k - delay]);
  return all;
}

/// What is known of x, as R x = z + noise of variance one; R is upper triangular. In units of the
/// noise on y. Bierman, Factorization Methods for Discrete Sequential Estimation, 1977.
class InformationArray {
 public:
  /// @param walk deviation of w
  InformationArray(const SmoothModel& model, double walk)
      : n_(model.phi.rows()), array_(n_ + 1, n_ + 2), back_(n_, n_), of_u_(n_, 1), of_w_(n_, 1) {
    DynamicMatrix<double> phi = model.phi;
    for (int i = 0; i < n_; ++i) back_(i, i) = 1.0;
    solve_in_place(phi.view(), back_.view());
    of_u_ = product(back_, model.gamma);
    of_w_ = product(back_, model.walk);
    for (int i = 0; i < n_; ++i) of_w_(i, 0) *= walk;
  }

  /// Row 0 is for w, then R in columns 1 .. n, z in the last.
  [[nodiscard]] double r(int i, int j) const { return array_(i + 1, j + 1); }
  [[nodiscard]] double z(int i) const { return array_(i + 1, n_ + 1); }
  /// Phi^-1, and Phi^-1 times Gamma and times the walk.
  [[nodiscard]] const DynamicMatrix<double>& back() const { return back_; }
  [[nodiscard]] double of_u(int i) const { return of_u_(i, 0); }
  [[nodiscard]] double of_w(int i) const { return of_w_(i, 0); }
  /// After `predict`: w = (z_w - R_wx x) / R_w + noise.
  [[nodiscard]] const DynamicMatrix<double>& array() const { return array_; }

  /// True if everything of x is known.
  [[nodiscard]] bool whole() const {
    for (int i = 0; i < n_; ++i) {
      if (!(std::abs(r(i, i)) > 0.0)) return false;
    }
    return true;
  }

  struct Innovation {
    double value;      ///< in its standard deviations
    double deviation;  ///< in that of the noise
  };

  /// Takes y = x_0 + noise in.
  Innovation measure(double y) {
    for (int j = 0; j <= n_ + 1; ++j) array_(0, j) = 0.0;
    array_(0, 1) = 1.0;
    array_(0, n_ + 1) = y;
    double deviation = 1.0;
    for (int j = 1; j <= n_; ++j) deviation *= rotate(j, 0, j);
    return {array_(0, n_ + 1), deviation};
  }

  /// One sample on. Leaves the row of w in row 0.
  void predict(double u) {
    DynamicMatrix<double>& a = array_;
    for (int i = 1; i <= n_; ++i) {
      double w = 0.0;
      for (int j = 0; j < n_; ++j) {
        double sum = 0.0;
        for (int k = i - 1; k < n_; ++k) sum += a(i, k + 1) * back_(k, j);
        row_[static_cast<std::size_t>(j)] = sum;
        w -= a(i, j + 1) * of_w_(j, 0);
        a(i, n_ + 1) += a(i, j + 1) * of_u_(j, 0) * u;
      }
      a(i, 0) = w;
      for (int j = 0; j < n_; ++j) a(i, j + 1) = row_[static_cast<std::size_t>(j)];
    }
    a(0, 0) = 1.0;
    for (int j = 1; j <= n_ + 1; ++j) a(0, j) = 0.0;
    for (int column = 0; column < n_; ++column) {
      for (int i = column + 1; i <= n_; ++i) rotate(column, i, column);
    }
  }

 private:
  /// Turns two rows so that the second is zero in a column; nothing but zeros is before it.
  /// @return by which factor the element of the first has grown
  double rotate(int first, int second, int column) {
    DynamicMatrix<double>& a = array_;
    const double y = a(second, column);
    if (!(std::abs(y) > 0.0)) return 1.0;
    const double x = a(first, column);
    const double size = std::sqrt(x * x + y * y);
    const double c = x / size;
    const double s = y / size;
    for (int j = column; j <= n_ + 1; ++j) {
      const double upper = a(first, j);
      const double lower = a(second, j);
      a(first, j) = c * upper + s * lower;
      a(second, j) = c * lower - s * upper;
    }
    a(second, column) = 0.0;
    return size / std::abs(x);
  }

  int n_;
  DynamicMatrix<double> array_, back_, of_u_, of_w_;
  std::vector<double> row_ = std::vector<double>(static_cast<std::size_t>(n_));
};

/// What the innovations say of the noise, with that on y as one: -2 log likelihood without
/// constants.
struct Likelihood {
  double rows = 0.0;
  double squares = 0.0;    ///< of the innovations, in their standard deviations
  double variances = 0.0;  ///< sum of the logarithms of their variances

  /// @param noise variance on y
  [[nodiscard]] double operator()(double noise) const {
    return variances + rows * std::log(noise) + squares / noise;
  }
};

/// @param walk deviation of w, in that of y
inline Likelihood likelihood(const SampledLog& log, const SmoothModel& model, double walk) {
  InformationArray known(model, walk);
  Likelihood found;
  // The middle of the measurements of a long log says as much. Not that of its samples: they may be
  // a pause between two recordings.
  constexpr std::size_t most = 20'000;
  std::size_t skip = log.measured > most ? (log.measured - most) / 2 : 0;
  std::size_t left = (std::min)(log.measured, most);
  std::size_t k = 0;
  for (; skip > 0; ++k) {
    if (is_finite(log.y[k])) --skip;
  }
  for (; left > 0; ++k) {
    if (is_finite(log.y[k])) {
      --left;
      const bool whole = known.whole();
      const auto innovation = known.measure(log.y[k]);
      if (whole) {
        found.rows += 1.0;
        found.squares += innovation.value * innovation.value;
        found.variances += 2.0 * std::log(innovation.deviation);
      }
    }
    known.predict(log.u[k]);
  }
  return found;
}

/// Variances of the noise on y and of w.
struct SmoothVariances {
  double measurement, walk;
};

/// The variances under which the log is most likely, by the bandwidth of FitPoint.
inline SmoothVariances likely_noise(const SampledLog& log, const SmoothModel& model,
                                    const SmoothNoise& noise) {
  const double T = model.sample_time;
  SmoothVariances best{};
  const auto at = [&](double log_of_bandwidth) {
    // q = w^(2 N) r T, and w walks by q T in a sample.
    const double ratio = std::exp(2.0 * model.integrations * log_of_bandwidth) * T * T;
    const Likelihood found = likelihood(log, model, std::sqrt(ratio));
    const double measurement = noise.measurement   ? *noise.measurement * *noise.measurement
                               : noise.disturbance ? *noise.disturbance * T / ratio
                                                   : found.squares / found.rows;
    best = {measurement, measurement * ratio};
    return found(measurement);
  };
  const double low = std::log(0.1 / (T * static_cast<double>(log.y.size())));
  const double high = std::log(2.0 / T);
  constexpr int steps = 16;
  double step = (high - low) / steps;
  double least = std::numeric_limits<double>::infinity();
  double place = high;
  const auto look = [&](double there) {
    const double value = at(there);
    if (!(value < least)) return;
    least = value;
    place = there;
  };
  for (int i = 0; i <= steps; ++i) look(low + i * step);
  while (step > 0.01) {
    step *= 0.5;
    const double middle = place;
    look(middle - step);
    look(middle + step);
  }
  at(place);
  return best;
}

/// What the way back needs of each sample: R_w, R_wx, z_w.
class WayBack {
 public:
  explicit WayBack(int states) : width_(static_cast<std::size_t>(states) + 2) {}
  void keep(const DynamicMatrix<double>& array) {
    for (int j = 0; j < static_cast<int>(width_); ++j) numbers_.push_back(array(0, j));
  }
  [[nodiscard]] const double* of(std::size_t k) const { return numbers_.data() + k * width_; }

 private:
  std::size_t width_;
  std::vector<double> numbers_;
};

/// One sample back, x = a x + what u and w do. @param row of `WayBack`
inline DynamicMatrix<double> way_back(const InformationArray& known, const double* row) {
  DynamicMatrix<double> a = known.back();
  for (int i = 0; i < a.rows(); ++i) {
    for (int j = 0; j < a.rows(); ++j) a(i, j) += known.of_w(i) * row[j + 1] / row[0];
  }
  return a;
}

/// x and its covariance, in units of the noise on y.
struct SmoothedState {
  std::vector<double> x;
  DynamicMatrix<double> p;

  /// Of all that is known. @param known with everything of x known
  explicit SmoothedState(const InformationArray& known, int n)
      : x(static_cast<std::size_t>(n)), p(n, n) {
    DynamicMatrix<double> inverse(n, n);  // R^-1
    for (int j = 0; j < n; ++j) {
      for (int i = j; i >= 0; --i) {
        double sum = i == j ? 1.0 : 0.0;
        for (int k = i + 1; k <= j; ++k) sum -= known.r(i, k) * inverse(k, j);
        inverse(i, j) = sum / known.r(i, i);
      }
    }
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < n; ++k) {
        x[static_cast<std::size_t>(i)] += inverse(i, k) * known.z(k);
        for (int j = 0; j < n; ++j) p(i, j) += inverse(i, k) * inverse(j, k);
      }
    }
  }

  /// Puts it into a row. @param noise deviation of that on y
  void write(const SmoothModel& model, double noise, std::size_t row, SmoothedLog& to) const {
    const int n = p.rows();
    double variance = 0.0;
    for (int i = 0; i < n; ++i) {
      const auto r = static_cast<std::size_t>(i);
      const int of = model.state_of_row[r];
      const double unit = model.units[static_cast<std::size_t>(of)];
      to.estimates[r][row] = unit * x[static_cast<std::size_t>(of)];
      to.deviations[r][row] = unit * noise * std::sqrt(p(of, of));
      to.disturbance[row] += model.load(0, i) * x[r];
      for (int j = 0; j < n; ++j) variance += model.load(0, i) * p(i, j) * model.load(0, j);
    }
    to.deviation[row] = noise * std::sqrt((std::max)(variance, 0.0));
  }

  /// One sample back: x = Phi^-1 (x - Gamma u - walk w) with w = (z_w - R_wx x) / R_w + noise /
  /// R_w.
  void back(const InformationArray& known, const double* row, double u) {
    const int n = p.rows();
    const double r_w = row[0];
    const double z_w = row[n + 1];
    const DynamicMatrix<double> a = way_back(known, row);
    std::vector<double> next(x.size());
    for (int i = 0; i < n; ++i) {
      double sum = -known.of_u(i) * u - known.of_w(i) * z_w / r_w;
      for (int j = 0; j < n; ++j) sum += a(i, j) * x[static_cast<std::size_t>(j)];
      next[static_cast<std::size_t>(i)] = sum;
    }
    const auto half = product(a, p);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        double sum = known.of_w(i) * known.of_w(j) / (r_w * r_w);
        for (int k = 0; k < n; ++k) sum += half(i, k) * a(j, k);
        p(i, j) = sum;
      }
    }
    x = next;
  }
};

/// True if u drives a state that fades and that no w drives: on the way back over so many samples
/// an error of u grows by more than 1e12. Those of integrators grow by a power of the samples, less
/// than twice by 1e6.
inline bool fades(const SmoothModel& model, bool walks, std::size_t samples) {
  const int n = model.phi.rows();
  InformationArray known(model, walks ? 1.0 : 0.0);
  DynamicMatrix<double> error(n, 1);
  for (int i = 0; i < n; ++i) error(i, 0) = known.of_u(i);
  const auto size = [&] {
    double sum = 0.0;
    for (int i = 0; i < n; ++i) sum += std::abs(error(i, 0));
    return sum;
  };
  double half = 0.0;
  std::vector<double> row(static_cast<std::size_t>(n) + 1);
  for (std::size_t k = 0; k < samples; ++k) {
    if (k == samples / 2) half = size();
    known.measure(0.0);
    known.predict(0.0);
    for (int j = 0; j <= n; ++j) row[static_cast<std::size_t>(j)] = known.array()(0, j);
    error = product(way_back(known, row.data()), error);
  }
  const double end = size();
  return !is_finite(end) || end > 1e6 * half;
}

ESOKIT_FUNCTION Expected<SmoothedLog, Error<double>> smooth(const Log& log,
                                                            const SmoothModel& model,
                                                            const SmoothNoise& noise) {
  Rules<double> rules;
  if (noise.measurement) {
    const double variance = *noise.measurement * *noise.measurement;
    rules.positive("measurement", *noise.measurement)
        .demand(normal(variance), "measurement", *noise.measurement,
                "must have a square that the scalar can hold");
  }
  if (noise.disturbance) rules.not_negative("disturbance", *noise.disturbance);
  if (!rules) return rules.error();
  const auto sampled = sampled_log(log, model);
  if (!sampled) return sampled.error();
  const double T = model.sample_time;
  const bool walks = !noise.disturbance || *noise.disturbance > 0.0;
  rules.demand(
      !fades(model, walks, sampled->y.size()), "y", static_cast<double>(sampled->y.size()),
      "has too many samples for a model with an actuator, or with poles and disturbance 0: "
      "leave it out, or filter u by it");
  if (!rules) return rules.error();
  SmoothVariances variances{};
  if (noise.measurement && noise.disturbance) {
    variances = {*noise.measurement * *noise.measurement, *noise.disturbance * T};
  } else if (!walks) {
    const Likelihood found = likelihood(*sampled, model, 0.0);
    variances = {found.squares / found.rows, 0.0};
  } else {
    variances = likely_noise(*sampled, model, noise);
  }
  constexpr const char* too_large = "gives estimates that the scalar cannot hold";
  rules
      .demand(is_finite(variances.measurement) || !(std::abs(variances.measurement) > 0.0), "y",
              variances.measurement, too_large)
      .demand(variances.measurement > 0.0, "y", variances.measurement,
              "must have noise: give its standard deviation")
      .finite("disturbance", variances.walk);
  if (!rules) return rules.error();
  const int n = model.phi.rows();
  InformationArray known(model, std::sqrt(variances.walk / variances.measurement));
  WayBack way(n);
  const std::size_t last = sampled->y.size() - 1;
  for (std::size_t k = 0; k <= last; ++k) {
    if (is_finite(sampled->y[k])) known.measure(sampled->y[k]);
    if (k == last) break;
    known.predict(sampled->u[k]);
    way.keep(known.array());
  }
  if (!known.whole()) {
    return Error<double>{"y", static_cast<double>(sampled->measured),
                         "does not show all states of the model"};
  }
  SmoothedLog found;
  found.noise = {std::sqrt(variances.measurement), variances.walk / T};
  found.bridged = sampled->y.size() - sampled->measured;
  std::size_t row = sampled->rows.size();
  found.estimates.assign(model.units.size(), std::vector<double>(row));
  found.deviations = found.estimates;
  found.disturbance = found.deviation = found.estimates[0];
  SmoothedState state(known, n);
  bool finite = true;
  for (std::size_t k = last + 1; row > 0;) {
    --k;
    if (k < last) state.back(known, way.of(k), sampled->u[k]);
    if (sampled->rows[row - 1] != k) continue;
    --row;
    state.write(model, *found.noise.measurement, row, found);
    for (const auto& list : found.deviations) finite = finite && is_finite(list[row]);
    for (const auto& list : found.estimates) finite = finite && is_finite(list[row]);
  }
  rules.demand(finite, "y", log.y[0], too_large);
  if (!rules) return rules.error();
  return found;
}

}  // namespace detail
}  // namespace esokit
