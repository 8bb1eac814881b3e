#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <esokit/core/scalar.hpp>
#include <esokit/identify/detail/timed_column.hpp>
#include <esokit/identify/innovations_filter.hpp>
#include <esokit/identify/spectrum.hpp>
#include <esokit/math/detail/dense.hpp>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

/// Solves the normal equations in place of `right`, with columns scaled to one. A column of zeros
/// gets the solution zero.
inline void solve_normal(std::vector<double> matrix, std::vector<double>& right, int n) {
  std::vector<double> scale(static_cast<std::size_t>(n));
  const auto at = [n](int i, int j) { return static_cast<std::size_t>(j * n + i); };
  for (int i = 0; i < n; ++i) {
    const double diagonal = matrix[at(i, i)];
    scale[static_cast<std::size_t>(i)] = diagonal > 0.0 ? 1.0 / std::sqrt(diagonal) : 0.0;
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      matrix[at(i, j)] *= scale[static_cast<std::size_t>(i)] * scale[static_cast<std::size_t>(j)];
    }
    // Two columns that agree to ten digits share the effect, instead of a division by zero.
    matrix[at(j, j)] += scale[static_cast<std::size_t>(j)] > 0.0 ? 1e-10 : 1.0;
    right[static_cast<std::size_t>(j)] *= scale[static_cast<std::size_t>(j)];
  }
  solve_in_place<double>({matrix.data(), n}, {right.data(), n, 1});
  for (int i = 0; i < n; ++i)
    right[static_cast<std::size_t>(i)] *= scale[static_cast<std::size_t>(i)];
}

/// Sum of a[k] b[k], as four independent sums, so that additions do not wait for each other.
inline double dot(const double* a, const double* b, std::size_t count) noexcept {
  std::array<double, 4> sums{};
  std::size_t k = 0;
  for (; k + 4 <= count; k += 4) {
    for (std::size_t i = 0; i < 4; ++i) sums[i] += a[k + i] * b[k + i];
  }
  for (; k < count; ++k) sums[0] += a[k] * b[k];
  return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

/// The Kalman filter for one point: transition, input weights, and gains from a diffuse start.
template <int States>
struct InnovationsFilter {
  static constexpr int N = States;
  using Vector = std::array<double, static_cast<std::size_t>(N)>;

  std::array<Vector, static_cast<std::size_t>(N)> phi{};  // [row][column]
  Vector lag{}, previous{}, current{}, next{};            // from v and from u of three rows to x
  double lag_decay = 0.0, lag_previous = 0.0, lag_current = 0.0, lag_next = 0.0;
  Vector column{};  // from a column to x
  std::ptrdiff_t delay = 0;
  double w = 0.0, pole = 0.0, tau = 0.0;
  int order = 1;
  bool goes_on = false;  // the load, a random walk, from piece to piece
  std::shared_ptr<const GainTable> table{};

  /// @param cached gains of the last filters, reused if they are the same; receives the new ones
  static InnovationsFilter make(const FitData& data, const FitModel& model, const FitPoint& point,
                                GainTables& cached) {
    InnovationsFilter f;
    const double T = data.sample_time;
    const double w = point.bandwidth;
    const int n = model.order;
    // The states are y^(i) / w^i, so that the entries are of similar size.
    const double tau = (std::max)(point.lag(), 0.05 * T);
    f.w = w, f.pole = point.pole, f.tau = tau, f.order = n;
    f.goes_on = data.one_load && data.starts.size() > 1 && N == n + 1;
    double dead = (std::max)(point.latency - tau, 0.0);
    if (data.averaged > 1) dead += 0.5 * T / data.averaged;
    f.delay = static_cast<std::ptrdiff_t>(std::floor(dead / T));
    const double fraction = dead - static_cast<double>(f.delay) * T;
    constexpr int M = N + 3;  // x, v, u, slope of u
    using Square = std::array<double, static_cast<std::size_t>(M * M)>;
    const auto at = [](int i, int j) { return static_cast<std::size_t>(j * M + i); };
    const auto transition = [&](double h) {
      Square a{};
      for (int i = 0; i + 1 < N; ++i) a[at(i, i + 1)] = w * h;
      a[at(n - 1, n - 1)] = -point.pole * h;
      a[at(n - 1, N)] = h / std::pow(w, n - 1);
      a[at(N, N)] = -h / tau;
      a[at(N, N + 1)] = h / tau;
      a[at(N + 1, N + 2)] = h;
      std::array<double, static_cast<std::size_t>(2 * M * M)> work{};
      exp_minus_identity(a.data(), work.data(), M);
      for (int i = 0; i < M; ++i) a[at(i, i)] += 1.0;
      return a;
    };
    const Square first = transition(fraction);
    const Square second = transition(T - fraction);
    Square whole{};
    multiply(second.data(), first.data(), whole.data(), M);
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < N; ++j) {
        f.phi[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)] = whole[at(i, j)];
      }
    }
    // The input within one row: u of the row before until `fraction`, then that of the row itself.
    const bool straight = data.averaged > 1;
    std::array<double, static_cast<std::size_t>(M)> weight{};
    const auto weigh = [&](int which) {  // 0 previous, 1 current, 2 next
      double start1 = which == 0 ? 1.0 : 0.0, slope1 = 0.0;
      double start2 = which == 1 ? 1.0 : 0.0, slope2 = 0.0;
      if (straight) {
        if (which == 0) start1 = fraction / T, slope1 = -1.0 / T;
        if (which == 1) start1 = 1.0 - fraction / T, slope1 = 1.0 / T, slope2 = -1.0 / T;
        if (which == 2) slope2 = 1.0 / T;
      }
      for (int i = 0; i <= N; ++i) {
        double sum = second[at(i, N + 1)] * start2 + second[at(i, N + 2)] * slope2;
        for (int j = 0; j <= N; ++j) {
          sum += second[at(i, j)] * (first[at(j, N + 1)] * start1 + first[at(j, N + 2)] * slope1);
        }
        weight[static_cast<std::size_t>(i)] = sum;
      }
    };
    const auto take = [&](Vector& x, double& v) {
      for (int i = 0; i < N; ++i)
        x[static_cast<std::size_t>(i)] = weight[static_cast<std::size_t>(i)];
      v = weight[static_cast<std::size_t>(N)];
    };
    weigh(0);
    take(f.previous, f.lag_previous);
    weigh(1);
    take(f.current, f.lag_current);
    weigh(2);
    take(f.next, f.lag_next);
    for (int i = 0; i < N; ++i) f.lag[static_cast<std::size_t>(i)] = whole[at(i, N)];
    f.lag_decay = whole[at(N, N)];
    // A column enters where the disturbance does.
    for (int i = 0; i < n; ++i) {
      f.column[static_cast<std::size_t>(i)] =
          f.phi[static_cast<std::size_t>(i)][static_cast<std::size_t>(n)] / std::pow(w, n);
    }
    f.take_gains(w * w * T * T, data, cached);
    return f;
  }

  /// The gains from the cache, which receives them if it has none.
  void take_gains(double q, const FitData& data, GainTables& cached) {
    const auto known = std::find_if(cached.begin(), cached.end(), [&](const auto& one) {
      return one != nullptr && one->bandwidth == w && one->pole == pole;
    });
    // The one that was found, or else the oldest, becomes the first.
    std::rotate(cached.begin(), known == cached.end() ? known - 1 : known,
                (std::min)(known + 1, cached.end()));
    if (known == cached.end()) {
      auto fresh = std::make_shared<GainTable>();
      fresh->bandwidth = w;
      fresh->pole = pole;
      find_gains(q, data, *fresh);
      cached.front() = std::move(fresh);
    }
    table = cached.front();
  }

  using Variances = std::array<Vector, static_cast<std::size_t>(N)>;

  /// phi p phi'
  [[nodiscard]] Variances pushed(const Variances& p) const {
    Variances a{}, out{};
    for (std::size_t i = 0; i < a.size(); ++i) {
      for (std::size_t j = 0; j < a.size(); ++j) {
        double sum = 0.0;
        for (std::size_t l = i; l < a.size(); ++l) sum += phi[i][l] * p[l][j];
        a[i][j] = sum;
      }
    }
    for (std::size_t i = 0; i < a.size(); ++i) {
      for (std::size_t j = i; j < a.size(); ++j) {
        double sum = 0.0;
        for (std::size_t l = j; l < a.size(); ++l) sum += a[i][l] * phi[j][l];
        out[i][j] = out[j][i] = sum;
      }
    }
    return out;
  }

  /// Riccati recursion for noise of variance one; the last state is a random walk with variance q
  /// per row.
  void find_gains(double q, const FitData& data, GainTable& found) const {
    Variances p{};
    // Infinite at any w: the states are divided by w^i.
    const auto unknown = [q](std::size_t i) {
      return 1e8 / (std::min)(std::pow(q, static_cast<double>(i)), 1.0);
    };
    for (std::size_t i = 0; i < p.size(); ++i) p[i][i] = unknown(i);
    const std::vector<double> variances = recursion(q, data.y.size(), p, found.first.gains);
    // Without a measurement: p = phi p phi' + q.
    for (std::size_t rows = 0; rows < 6; ++rows) {
      std::vector<double>& now = found.waited.emplace_back();
      for (const Vector& line : p) now.insert(now.end(), line.begin(), line.end());
      p = pushed(p);
      p[p.size() - 1][p.size() - 1] += q;
    }
    found.steady_variance = variances.back();
    const auto weigh = [&](const std::vector<double>& of, std::size_t blind,
                           std::vector<double>& weights) {
      for (const double s : of) weights.push_back(std::sqrt(found.steady_variance / s));
      std::fill_n(weights.begin(), (std::min)(of.size(), blind), 0.0);
    };
    weigh(variances, static_cast<std::size_t>(N), found.first.weights);
    if (!goes_on) return;
    // Rows between two pieces, on average: the load went on there.
    double gap = 0.0;
    if (data.start_times.size() == data.starts.size()) {
      const double rows = (data.start_times.back() - data.start_times.front()) / data.sample_time;
      gap = (std::max)(rows - static_cast<double>(data.starts.back()), 0.0) /
            static_cast<double>(data.starts.size() - 1);
    }
    const double load = found.waited[0].back() + q * gap;
    p = {};
    for (std::size_t i = 0; i + 1 < p.size(); ++i) p[i][i] = unknown(i);
    p[p.size() - 1][p.size() - 1] = load;
    weigh(recursion(q, data.y.size(), p, found.next.gains), static_cast<std::size_t>(order),
          found.next.weights);
  }

  /// The gains from p on, until steady, when p is what is known before a measurement.
  /// @return the variances of the innovations
  std::vector<double> recursion(double q, std::size_t most, Variances& p,
                                std::vector<double>& gains) const {
    std::vector<double> variances;
    Vector before{};
    const double negligible = 1e-9 * std::sqrt(q);
    while (variances.size() < most) {
      const double s = p[0][0] + 1.0;
      Vector k{};
      for (std::size_t i = 0; i < k.size(); ++i) k[i] = p[i][0] / s;
      double change = 0.0;
      for (std::size_t i = 0; i < k.size(); ++i) {
        change = (std::max)(change, (std::abs)(k[i] - before[i]) / ((std::abs)(k[i]) + 1e-300));
      }
      before = k;
      gains.insert(gains.end(), k.begin(), k.end());
      variances.push_back(s);
      if (variances.size() > static_cast<std::size_t>(2 * N) && change < negligible) break;
      // p = phi (p - k k' s) phi' + q
      for (std::size_t i = 1; i < k.size(); ++i) {
        for (std::size_t j = 1; j < k.size(); ++j) p[i][j] -= k[i] * k[j] * s;
      }
      // p - p^2 / (p + 1), computed directly, would cancel.
      for (std::size_t i = 0; i < k.size(); ++i) p[0][i] = p[i][0] = k[i];
      p = pushed(p);
      p[k.size() - 1][k.size() - 1] += q;
    }
    return variances;
  }

  /// Power of the disturbance in y divided by that of the noise, at the frequency `part` times half
  /// the sample rate.
  [[nodiscard]] double disturbance_over_noise(double q, double part) const {
    const std::complex<double> z = std::polar(1.0, std::numbers::pi * part);
    std::array<std::complex<double>, static_cast<std::size_t>(N)> x{};
    for (std::size_t i = x.size(); i-- > 0;) {  // (z - phi) x = (0, .., 0, 1), phi is triangular
      std::complex<double> sum = i + 1 == x.size() ? 1.0 : 0.0;
      for (std::size_t j = i + 1; j < x.size(); ++j) sum += phi[i][j] * x[j];
      x[i] = sum / (z - phi[i][i]);
    }
    return q * std::norm(x[0]);
  }

  /// What a row measures, and what of it corrects the state.
  struct Sight {
    Vector seen{};      // y where it was measured: of the states,
    double push = 0.0;  // and of what acts on y^(n)
    Vector gain{};
    double weight = 0.0;
  };

  /// @param late how much later than its row it was measured, s: short, so two terms of the series
  /// are enough @param before number of measurements before it in the piece @param waited rows
  /// without one since then
  [[nodiscard]] Sight sight(const GainsFromStart& start, double late, std::size_t before,
                            std::size_t waited) const {
    Sight s;
    const double half = 0.5 * late * late;
    s.seen[0] = order == 1 ? 1.0 - pole * late + pole * pole * half : 1.0;
    s.seen[1] = w * late - (order <= 2 ? pole * w * half : 0.0);
    if constexpr (N > 2) s.seen[2] = w * w * half;
    s.push = order == 1 ? late - pole * half : order == 2 ? half : 0.0;
    if (before + 1 < start.weights.size()) {
      for (std::size_t i = 0; i < s.gain.size(); ++i) s.gain[i] = start.gains[before * N + i];
      s.weight = start.weights[before];
      return s;
    }
    const auto& p = table->waited[(std::min)(waited, table->waited.size() - 1)];
    double variance = 1.0;
    for (std::size_t i = 0; i < s.gain.size(); ++i) {
      for (std::size_t j = 0; j < s.gain.size(); ++j) s.gain[i] += p[i * N + j] * s.seen[j];
      variance += s.seen[i] * s.gain[i];
    }
    for (double& gain : s.gain) gain /= variance;
    s.weight = std::sqrt(table->steady_variance / variance);
    return s;
  }

  /// How row k of a piece corrects the state.
  struct Row {
    const double* gain;
    double weight;
    double value;       // y
    double late = 0.0;  // s after the row
    bool seen = true;
  };

  /// @param begin first row of the piece @param at of the last measurement that was not at its row
  /// @param measurements of the piece @param waited rows without one since
  [[nodiscard]] ESOKIT_INLINE Row row_of(const FitData& data, const GainsFromStart& start,
                                         std::ptrdiff_t begin, std::ptrdiff_t k, Sight& at,
                                         std::size_t& measurements, std::size_t& waited) const {
    const auto here = static_cast<std::size_t>(k);
    const std::size_t number =
        (std::min)(static_cast<std::size_t>(k - begin), start.weights.size() - 1);
    Row row{start.gains.data() + number * static_cast<std::size_t>(N), start.weights[number],
            data.y[here]};
    if (data.measured.empty()) return row;
    // The gains of a start are those of measurements at their rows: other speeds than those between
    // the rows would be wrong for long.
    if (k - begin < 2 * N) {
      ++measurements;
    } else if (data.has(here)) {
      row.late = data.offsets[here];
      at = sight(start, row.late, measurements++, std::exchange(waited, 0));
      row.gain = at.gain.data();
      row.weight = at.weight;
      row.value = data.measured[here];
    } else {
      row.seen = false;
      ++waited;
    }
    return row;
  }

  /// The mean of v from its row to a measurement `late` after it: v goes to where it would end.
  [[nodiscard]] double mean_lag(double late, double v_before, double v, double v_after) const {
    const double row_from = late > 0.0 ? v : v_before, row_to = late > 0.0 ? v_after : v;
    const double end = row_from + (row_to - row_from) / (1.0 - lag_decay);
    return end - (v - end) * std::expm1(-late / tau) * tau / late;
  }

  /// Computes innovations of y, u and the data's columns, each alone (one output for each), or of
  /// all of them together. `signal` is u or a replacement.
  ///
  /// The first rows of a piece, `lead` of them, only fill the lag and the dead time, because the
  /// input before is unknown.
  /// @tparam Runs number of innovations; `output(r)` and `input(r)` give the factors of y and
  /// `signal` in run r, `column_at(r, k)` its column
  template <int Runs, class Output, class Input, class Column>
  void run(const FitData& data, const std::vector<std::size_t>& lead,
           const std::vector<double>& signal, const Output& output, const Input& input,
           const Column& column_at,
           const std::array<double*, static_cast<std::size_t>(Runs)>& out) const {
    const bool regular = data.measured.empty();
    std::array<Vector, static_cast<std::size_t>(Runs)> x{};
    bool begun = false;
    for (std::size_t piece = 0; piece < data.starts.size(); ++piece) {
      const auto from = static_cast<std::ptrdiff_t>(data.starts[piece]);
      const auto to = static_cast<std::ptrdiff_t>(
          piece + 1 < data.starts.size() ? data.starts[piece + 1] : data.y.size());
      const auto u = [&](std::ptrdiff_t k) {
        return signal[static_cast<std::size_t>(std::clamp(k, from, to - 1))];
      };
      double v = u(from);
      double u_before = v, u_now = v;
      const std::ptrdiff_t begin = (std::min)(from + static_cast<std::ptrdiff_t>(lead[piece]), to);
      for (std::ptrdiff_t k = from; k < begin; ++k) {
        for (double* const to_run : out) to_run[k] = 0.0;
        const double u_next = u(k - delay + 1);
        v = lag_decay * v + lag_previous * u_before + lag_current * u_now + lag_next * u_next;
        u_before = u_now;
        u_now = u_next;
      }
      if (begin == to) continue;
      const GainsFromStart& start = begun && goes_on ? table->next : table->first;
      begun = true;
      std::array<double, static_cast<std::size_t>(Runs)> r_now{};
      for (std::size_t run = 0; run < x.size(); ++run) {
        const double load = goes_on ? x[run][N - 1] : 0.0;
        x[run] = {};
        x[run][N - 1] = load;
        x[run][0] = output(run) * data.y[static_cast<std::size_t>(begin)];
        r_now[run] = column_at(run, begin);
      }
      double v_before = v;
      std::size_t measurements = 0, waited = 0;  // of the piece, and rows without one since
      Sight at;
      at.seen[0] = 1.0;
      for (std::ptrdiff_t k = begin; k < to; ++k) {
        const Row row = row_of(data, start, begin, k, at, measurements, waited);
        const double u_next = u(k - delay + 1);
        const double v_after =
            lag_decay * v + lag_previous * u_before + lag_current * u_now + lag_next * u_next;
        const double v_late =
            order == 1 && row.late != 0.0 ? mean_lag(row.late, v_before, v, v_after) : v;
        const std::ptrdiff_t after = (std::min)(k + 1, to - 1);
        Vector pushed;
        for (std::size_t j = 0; j < pushed.size(); ++j) {
          pushed[j] = lag[j] * v + previous[j] * u_before + current[j] * u_now + next[j] * u_next;
        }
        for (std::size_t run = 0; run < x.size(); ++run) {
          Vector& state = x[run];
          const double b = input(run);
          double e = output(run) * row.value - state[0];
          if (!regular) {
            e += state[0] - at.push * (b * v_late + r_now[run]);
            for (std::size_t j = 0; j < state.size(); ++j) e -= at.seen[j] * state[j];
            if (!row.seen) e = 0.0;
          }
          out[run][k] = e * row.weight;
          for (std::size_t j = 0; j < state.size(); ++j) state[j] += row.gain[j] * e;
          const double r_next = column_at(run, after);
          const double r = 0.5 * (r_now[run] + r_next);
          r_now[run] = r_next;
          for (std::size_t j = 0; j < state.size(); ++j) {
            double sum = b * pushed[j] + column[j] * r;
            for (std::size_t l = j; l < state.size(); ++l) sum += phi[j][l] * state[l];
            state[j] = sum;
          }
        }
        v_before = v;
        v = v_after;
        u_before = u_now;
        u_now = u_next;
      }
    }
  }
};

}  // namespace detail
}  // namespace esokit
