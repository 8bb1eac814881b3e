// The designs of `tune` against a second way to them that has no model: virtual reference feedback
// tuning (Campi, Lecchini and Savaresi, Automatica 38 (2002) 1337-1346).
//
// An observer with fixed poles Lambda is a filter of y and of the applied u, so the law on it is
//
//     u = k r - (Q(z) y + P(z) u) / Lambda(z),   k = Q(1) / Lambda(1),   P(1) = -Lambda(1)
//
// linear in the numerators (the last two for integral action). If the loop shall answer a reference
// by M, the log of a machine is that of this controller under the virtual reference y / M = r.
// Filtered by F = M (1 - M) that is a least-squares problem, without a model of the machine. Its
// instruments are the recorded reference, so that noise, friction and drift of the log do not bias
// it (two stages).
//
// M and Lambda are those of the best LinearEso that `tune` finds for the model that `identify`
// found: if model and design are right, both ways end at the same controller. Both are then put
// around the true plant.
//
// --count N, --seed S: logs, from that seed on (identify/random_plant.hpp).

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Dense>
#include <esokit/analysis/library_systems.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/tune/tuned_controller.hpp>

#include "common/compiled/study.hpp"
#include "common/compiled/tune.hpp"
#include "common/parallel.hpp"
#include "common/report.hpp"
#include "identify/random_plant.hpp"

using namespace esokit::examples;
using namespace identify_example;
using esokit::LinearController;

namespace {

using Signal = Eigen::VectorXd;
using Complex = std::complex<double>;

/// u = k r - (Q y + P u) / Lambda by powers of 1 / z; lambda[0] = 1, p[0] = 0.
struct Numerators {
  std::vector<double> lambda, q, p;

  [[nodiscard]] static double at_one(const std::vector<double>& of) {
    double sum = 0.0;
    for (const double value : of) sum += value;
    return sum;
  }
  [[nodiscard]] double k() const { return at_one(q) / at_one(lambda); }

  /// From y to u, negative, the controller's own u fed back.
  [[nodiscard]] Complex from_y(Complex z) const {
    const auto sum = [&](const std::vector<double>& of) {
      Complex all = 0.0;
      for (std::size_t i = of.size(); i-- > 0;) all = all / z + of[i];
      return all;
    };
    return sum(q) / (sum(lambda) + sum(p));
  }

  [[nodiscard]] LinearController form(double sample_time) const {
    const int n = static_cast<int>(lambda.size()) - 1;
    LinearController c(n, 1, 0, sample_time);
    for (int i = 0; i < n; ++i) {
      const auto next = static_cast<std::size_t>(i) + 1;
      c.a(i, 0) -= lambda[next];
      c.a(i, i) -= 1.0;
      if (i + 1 < n) c.a(i, i + 1) += 1.0;
      c.from_y(i, 0) = q[next] - lambda[next] * q[0];
      c.from_u(i, 0) = p[next];
    }
    c.to_u(0, 0) = -1.0;
    c.y_to_u(0, 0) = -q[0];
    c.r_to_u(0, 0) = k();
    return c;
  }
};

/// Those of a controller that knows the applied u.
Numerators numerators(const LinearController& c) {
  Numerators found;
  std::vector<Complex> lambda{1.0};
  for (const Complex& pole : esokit::detail::poles_of(c.a)) {
    lambda.push_back(0.0);
    for (std::size_t i = lambda.size(); i-- > 1;) lambda[i] -= (1.0 + pole) * lambda[i - 1];
  }
  for (const Complex& value : lambda) found.lambda.push_back(value.real());
  // The first samples of the responses, times Lambda.
  const auto times_lambda = [&](const auto& from, double direct) {
    const int n = c.states();
    std::vector<double> x(static_cast<std::size_t>(n), 0.0), h{-direct};
    for (int i = 0; i < n; ++i) x[static_cast<std::size_t>(i)] = from(i, 0);
    for (int k = 0; k < n; ++k) {
      double u = 0.0;
      auto next = x;
      for (int i = 0; i < n; ++i) {
        u += c.to_u(0, i) * x[static_cast<std::size_t>(i)];
        for (int j = 0; j < n; ++j)
          next[static_cast<std::size_t>(i)] += c.a(i, j) * x[static_cast<std::size_t>(j)];
      }
      h.push_back(-u);
      x = next;
    }
    std::vector<double> product(h.size(), 0.0);
    for (std::size_t i = 0; i < h.size(); ++i) {
      for (std::size_t j = 0; j <= i; ++j) product[i] += found.lambda[j] * h[i - j];
    }
    return product;
  };
  found.q = times_lambda(c.from_y, c.y_to_u(0, 0));
  found.p = times_lambda(c.from_u, 0.0);
  return found;
}

/// What M, from r to y of a loop, makes of a signal.
Signal answered(const esokit::DynamicSystem& loop, const Signal& signal) {
  const int n = loop.a.rows();
  Signal x = Signal::Zero(n), out(signal.size());
  Eigen::MatrixXd a(n, n);
  Eigen::VectorXd b(n), c(n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) a(i, j) = loop.a(i, j);
    b(i) = loop.b(i, 0);
    c(i) = loop.c(0, i);
  }
  for (Eigen::Index k = 0; k < signal.size(); ++k) {
    out(k) = c.dot(x) + loop.d(0, 0) * signal(k);
    x += a * x + b * signal(k);
  }
  return out;
}

Signal over(const std::vector<double>& lambda, Signal signal) {
  for (Eigen::Index k = 0; k < signal.size(); ++k) {
    for (std::size_t i = 1; i < lambda.size(); ++i) {
      if (const auto back = k - static_cast<Eigen::Index>(i); back >= 0)
        signal(k) -= lambda[i] * signal(back);
    }
  }
  return signal;
}

Signal later(const Signal& signal, std::size_t samples) {
  Signal late = Signal::Zero(signal.size());
  const auto by = static_cast<Eigen::Index>(samples);
  late.tail(signal.size() - by) = signal.head(signal.size() - by);
  return late;
}

/// The numerators of the log for this M. @param apart samples from instrument to instrument
Numerators virtual_reference(const RandomLog& log, const esokit::DynamicSystem& loop,
                             const std::vector<double>& lambda, std::size_t apart) {
  const auto rows = static_cast<Eigen::Index>(log.u.size());
  // The logs begin at rest.
  const auto taken = [&](const std::vector<double>& of) {
    return Signal(Eigen::Map<const Signal>(of.data(), rows));
  };
  const auto without = [&](const Signal& of) { return Signal(of - answered(loop, of)); };
  const Signal u = without(taken(log.u)), y = without(taken(log.y));
  const Signal mu = answered(loop, u), my = answered(loop, y);
  const Signal u_filtered = over(lambda, mu), y_filtered = over(lambda, my);
  const std::size_t n = lambda.size() - 1;
  const double sum = Numerators::at_one(lambda);
  // In powers of 1 - 1 / z, of which samples much shorter than the poles make numbers that differ.
  // Q = sum q_i (1 - 1/z)^i, i < N, P = (p_0 + p_1 (1 - 1/z) + ..) / z, k = q_0 / Lambda(1) and
  // p_0 = -Lambda(1). So
  //   mu - Lambda(1) u_0 = q_0 (y / Lambda(1) - y_0) - sum q_i y_i - sum p_i u_i.
  Eigen::MatrixXd regressors(rows, static_cast<Eigen::Index>(2 * n - 1));
  Signal yi = y_filtered, ui = later(u_filtered, 1);
  const Signal wanted = mu - sum * ui;
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    regressors.col(at) = i == 0 ? Signal(y / sum - yi) : Signal(-yi);
    if (i > 0) regressors.col(static_cast<Eigen::Index>(n) + at - 1) = -ui;
    yi -= later(yi, 1);
    ui -= later(ui, 1);
  }
  constexpr int lags = 10;
  const Signal reference = answered(loop, without(taken(log.reference)));
  Eigen::MatrixXd instruments(rows, lags);
  for (int i = 0; i < lags; ++i)
    instruments.col(i) = later(reference, static_cast<std::size_t>(i) * apart);
  const Eigen::MatrixXd seen =
      instruments * instruments.colPivHouseholderQr().solve(regressors).eval();
  // Columns of similar size.
  const Eigen::VectorXd size = seen.colwise().norm();
  const Eigen::VectorXd x =
      (seen * size.cwiseInverse().asDiagonal()).colPivHouseholderQr().solve(wanted);
  Numerators found{lambda, std::vector<double>(n + 1, 0.0), std::vector<double>(n + 1, 0.0)};
  std::vector<double> power{1.0};  // (1 - 1/z)^i
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<Eigen::Index>(i), of_p = static_cast<Eigen::Index>(n) + at - 1;
    const double q = x(at) / size(at), p = i == 0 ? -sum : x(of_p) / size(of_p);
    for (std::size_t j = 0; j < power.size(); ++j) {
      found.q[j] += q * power[j];
      found.p[j + 1] += p * power[j];
    }
    power.push_back(0.0);
    for (std::size_t j = power.size(); j-- > 1;) power[j] -= power[j - 1];
  }
  return found;
}

struct Outcome {
  bool accepted = false, tuned = false;
  // Of tune; of the virtual reference with a log of the same plant without friction, drift and
  // noise; and with the log as it is.
  double apart[3] = {0.0, 0.0, 0.0};    // from the controller of tune, where the loop crosses one
  double modulus[3] = {0.0, 0.0, 0.0};  // on the true plant; 0: not stable
  double missed[3] = {1e9, 1e9, 1e9};   // rms of the true loop's answer to r less M, of M
};

Outcome judged(std::uint64_t seed) {
  const RandomLog made = random_log(seed);
  const Truth& truth = made.truth;
  esokit::Log log;
  log.u = made.u;
  log.y = made.y;
  log.sample_time = truth.sample_time;
  Outcome outcome;
  const auto found = compiled::identify(log);
  if (!found || found->order != truth.order) return outcome;
  outcome.accepted = true;
  double largest = 0.0;
  for (const double u : made.u) largest = std::max(largest, std::abs(u));
  const auto model = esokit::tune_model(*found, -largest, largest);
  const auto tuning = compiled::tune(model);
  if (!tuning) return outcome;
  // With the lag in the model there are twice as many numerators, of which the band of F shows
  // half.
  const auto design =
      std::find_if(tuning->designs.begin(), tuning->designs.end(), [](const auto& one) {
        return one.feasible && !one.knows.any() && one.levels == 1 && one.extension == 1;
      });
  if (design == tuning->designs.end()) return outcome;
  LinearController form;
  const auto visit = [&](const auto& controller) { form = linear_controller(controller).value(); };
  const auto run = model.order == 1 ? with_controller<1>(model, *design, visit)
                                    : with_controller<2>(model, *design, visit);
  if (!run) return outcome;
  const auto nominal = closed_loop(model, form);
  if (!nominal) return outcome;
  const Numerators ours = numerators(form);
  const auto apart = static_cast<std::size_t>(
      std::max(1.0, std::round(2.0 * model.latency() / truth.sample_time)));
  outcome.tuned = true;
  esokit::TuneModel plant = model;
  plant.input_gain = {truth.input_gain, 0.0};
  plant.pole = truth.pole;
  plant.lag = truth.lag;
  plant.dead_time = truth.dead_time;
  const double T = truth.sample_time;
  const double w = esokit::detail::law_mean(design->settings.gains, model.order);
  RandomLog clean = made;
  const auto around = closed_loop(plant, form);
  if (!around) return outcome;
  const auto taken = [&](int row) {
    auto part = around->system();
    for (int i = 0; i < part.c.cols(); ++i) part.c(0, i) = part.c(row, i);
    part.d(0, 0) = part.d(row, 0);
    const Signal answer =
        answered(part, Eigen::Map<const Signal>(made.reference.data(),
                                                static_cast<Eigen::Index>(made.reference.size())));
    return std::vector<double>(answer.data(), answer.data() + answer.size());
  };
  clean.y = taken(0);
  clean.u = taken(1);
  const Numerators ways[3] = {ours, virtual_reference(clean, nominal->system(), ours.lambda, apart),
                              virtual_reference(made, nominal->system(), ours.lambda, apart)};
  const Signal step = Signal::Ones(
      std::max<Eigen::Index>(50, static_cast<Eigen::Index>(design->settling_time / T)));
  const Signal asked = answered(nominal->system(), step);
  for (std::size_t way = 0; way < 3; ++way) {
    // From a fifth of the law's bandwidth to twice that.
    for (double at = 0.2 * w; at < 2.0 * w && at * T < 3.0; at *= 1.2) {
      const Complex z = std::polar(1.0, at * T);
      outcome.apart[way] =
          std::max(outcome.apart[way], std::abs(ways[way].from_y(z) / ours.from_y(z) - 1.0));
    }
    const auto loop = closed_loop(plant, ways[way].form(T));
    if (!loop || !loop->stable()) continue;
    outcome.modulus[way] = margins(*loop)->modulus.value;
    outcome.missed[way] = (answered(loop->system(), step) - asked).norm() / asked.norm();
  }
  return outcome;
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

}  // namespace

int main(int argc, char** argv) {
  const auto count = static_cast<std::size_t>(take_count(argc, argv, "--count", 6));
  const auto seed = static_cast<std::uint64_t>(take_count(argc, argv, "--seed", 47100));
  Report report(
      argc, argv, "choosing", "vrft",
      {.title = "A second way to the same design",
       .description = "Virtual reference feedback tuning finds the numerators of a design "
                      "from the log alone: do they agree with those of tune?"});
  const auto outcomes =
      run_parallel("logs", count, [seed](std::size_t i) { return judged(seed + i); });
  std::size_t accepted = 0, tuned = 0, stable[3] = {0, 0, 0}, kept[3] = {0, 0, 0};
  std::vector<double> apart[3], modulus[3], missed[3];
  for (const Outcome& o : outcomes) {
    accepted += o.accepted ? 1 : 0;
    if (!o.tuned) continue;
    ++tuned;
    for (std::size_t way = 0; way < 3; ++way) {
      stable[way] += o.modulus[way] > 0.0 ? 1 : 0;
      kept[way] += o.modulus[way] >= 0.5 ? 1 : 0;
      apart[way].push_back(o.apart[way]);
      modulus[way].push_back(o.modulus[way]);
      missed[way].push_back(o.missed[way]);
    }
  }
  const char* names[3] = {"tune", "virtual reference, clean log", "virtual reference, the log"};
  std::vector<esokit::examples::CsvRow> rows;
  for (std::size_t way = 0; way < 3; ++way) {
    rows.push_back({names[way], std::to_string(tuned), std::to_string(stable[way]),
                    std::to_string(kept[way]), number_text(quantile(modulus[way], 0.5), 3),
                    number_text(100.0 * quantile(apart[way], 0.5), 3),
                    number_text(100.0 * quantile(apart[way], 0.9), 3),
                    number_text(100.0 * quantile(missed[way], 0.5), 3)});
  }
  report.table("vrft",
               "On the true plants; the difference of two controllers is the largest from a fifth "
               "of the law's bandwidth to twice that. Of " +
                   std::to_string(accepted) + " logs with a model of the right order",
               {"numerators of", "designs", "stable", "modulus margin of 0.5", "median of it",
                "away from tune, %, median", "90th percentile", "step away from M, %, median"},
               rows);
  report.expect("clean logs of random plants", "difference of the two ways (median)",
                quantile(apart[1], 0.5), tuned > 0 && quantile(apart[1], 0.5) < 0.2, "below 0.2");
  return report.finish();
}
