#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <esokit/core/version.hpp>
#include <esokit/target/detail/design_text.hpp>
#include <esokit/target/detail/linear_call.hpp>
#include <limits>
#include <string>
#include <vector>

namespace esokit::detail {

namespace design_text {

using Polynomial = std::vector<double>;  ///< monic, the constant first

inline std::string digits(double x, const char* format = "%.5g") {
  char text[40];
  std::snprintf(text, sizeof text, format, x);
  return text;
}

/// det(x I - A), by Faddeev and LeVerrier.
inline Polynomial characteristic(const std::vector<LinearForm>& a) {
  const std::size_t n = a.size();
  Polynomial c(n + 1, 0.0);
  c[n] = 1;
  std::vector<LinearForm> m(n, LinearForm(n, 0.0));
  for (std::size_t k = 1; k <= n; ++k) {
    for (std::size_t i = 0; i < n; ++i) m[i][i] += c[n - k + 1];
    std::vector<LinearForm> product(n, LinearForm(n, 0.0));
    double trace = 0;
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        for (std::size_t l = 0; l < n; ++l) product[i][j] += a[i][l] * m[l][j];
      }
      trace += product[i][i];
    }
    m = product;
    c[n - k] = -trace / static_cast<double>(k);
  }
  return c;
}

/// The root that all are, within rounding, or NaN.
inline double equal_root(const Polynomial& c, double tolerance) {
  const std::size_t n = c.size() - 1;
  const double root = -c[n - 1] / static_cast<double>(n);
  double part = 1;
  for (std::size_t k = n; k-- > 0;) {
    part *= -root * static_cast<double>(k + 1) / static_cast<double>(n - k);
    if (!(std::fabs(c[k] - part) <= tolerance * std::fabs(part))) {
      return std::numeric_limits<double>::quiet_NaN();
    }
  }
  return root;
}

/// All roots at once, by Weierstrass.
inline std::vector<std::complex<double>> roots(const Polynomial& c) {
  const std::size_t n = c.size() - 1;
  std::vector<std::complex<double>> x(n);
  for (std::size_t i = 0; i < n; ++i) x[i] = std::pow(std::complex<double>(0.4, 0.9), i);
  for (int round = 0; round < 500; ++round) {
    for (std::size_t i = 0; i < n; ++i) {
      std::complex<double> value = 0, others = 1;
      for (std::size_t k = n + 1; k-- > 0;) value = value * x[i] + c[k];
      for (std::size_t j = 0; j < n; ++j) {
        if (j != i) others *= x[i] - x[j];
      }
      if (std::norm(others) > 0) x[i] -= value / others;
    }
  }
  return x;
}

/// What an observer forgets of its state from a sample to the next; empty where the numbers are not
/// linear in it.
inline std::vector<LinearForm> transition(const RecordedDesign& design) {
  const auto states = design.states();
  const RecordedCall* call = design.called("observe");
  std::vector<LinearForm> rows;
  if (call == nullptr || !design.gain_is_kept) return rows;
  const double column = std::numeric_limits<double>::quiet_NaN();
  const LinearCall forms(design, *call, {column, column});
  for (const std::size_t state : states) {
    const int next = call->next[state];
    LinearForm row(states.size(), 0.0);
    if (next < 0) {
      row[rows.size()] = 1;
    } else if (!forms.linear[static_cast<std::size_t>(next)]) {
      return {};
    } else {
      const LinearForm& form = forms.of[static_cast<std::size_t>(next)];
      std::copy_n(form.begin(), states.size(), row.begin());
    }
    rows.push_back(row);
  }
  return rows;
}

/// s of z = e^(s T), each with its conjugate.
inline std::string poles_text(const Polynomial& c, double sample_time) {
  std::vector<std::complex<double>> poles;
  std::string text;
  int at_once = 0;
  for (const auto& z : roots(c)) {
    if (std::abs(z) < 1e-6) {
      ++at_once;
    } else {
      poles.push_back(std::log(z) / sample_time);
    }
  }
  std::sort(poles.begin(), poles.end(),
            [](const auto& a, const auto& b) { return a.real() < b.real(); });
  for (const auto& s : poles) {
    const bool is_real = std::fabs(s.imag()) < 1e-4 * std::abs(s);
    if (!is_real && s.imag() < 0) continue;
    text += (text.empty() ? "" : ", ") + digits(s.real(), "%.4g") +
            (is_real ? "" : " +- " + digits(s.imag(), "%.4g") + "j");
  }
  if (at_once > 0) text += (text.empty() ? "" : ", ") + std::to_string(at_once) + " at z = 0";
  return "observer poles " + text + " 1/s";
}

}  // namespace design_text

ESOKIT_FUNCTION std::uint32_t hash_of(const std::string& text) {
  std::uint32_t hash = 2166136261u;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619u;
  return hash;
}

ESOKIT_FUNCTION std::string structure_text(const RecordedDesign& d) {
  std::string text = "esokit " + std::to_string(ESOKIT_VERSION_MAJOR) + "." +
                     std::to_string(ESOKIT_VERSION_MINOR) + "." +
                     std::to_string(ESOKIT_VERSION_PATCH) + ": order " + std::to_string(d.order) +
                     ", " + std::to_string(d.size) + " states";
  const auto part = [&](bool has, const std::string& what) {
    if (has) text += ", " + what;
  };
  part(true, d.single ? "float" : "double");
  part(d.error_based, "error-based");
  part(d.compensates, "compensates");
  part(d.predictive, "in two phases");
  part(d.law.kind == RunningLaw::schedule, "gains by a schedule");
  part(d.law.kind == RunningLaw::filter, "gains by a recursion");
  part(!d.gain_is_kept, "gains by the innovation");
  part(!d.line.empty(), "delay " + std::to_string(d.line.size() - (d.line.empty() ? 0 : 1)));
  part(d.gate.threshold > 0, "gate");
  part(d.wrap.period > 0, "angle");
  part(d.known.on, "known model");
  part(!d.map.lines.empty(), "map");
  part(d.measured.on, "measured");
  part(d.guard.on, "guarded");
  part(d.rest.on, "rests");
  part(d.loop.divider > 1, "every " + std::to_string(d.loop.divider) + " samples");
  return text;
}

ESOKIT_FUNCTION std::string dynamics_text(const RecordedDesign& design) {
  using namespace design_text;
  const double tolerance = design.single ? 2e-6 : 1e-11;
  std::string text;
  const auto rows = transition(design);
  if (!rows.empty()) {
    const Polynomial c = characteristic(rows);
    const double pole = equal_root(c, tolerance);
    text = pole > 0 ? "omega_o = " + digits(-std::log(pole) / design.sample_time) + " rad/s"
                    : poles_text(c, design.sample_time);
  }
  if (design.law_gains.empty()) return text;
  Polynomial c = design.law_gains;
  c.push_back(1);
  const double pole = equal_root(c, tolerance);
  std::string gains;
  for (const double k : design.law_gains) gains += (gains.empty() ? "" : ", ") + digits(k);
  return (text.empty() ? "" : text + ", ") +
         (pole < 0 ? "omega_c = " + digits(-pole) + " rad/s" : "law k = " + gains);
}

ESOKIT_FUNCTION std::string scale_text(const RecordedDesign& design, std::size_t state) {
  const auto states = design.states();
  const auto place = std::find(states.begin(), states.end(), state);
  if (place == states.end()) return "";
  const auto own = static_cast<std::size_t>(place - states.begin());
  double unit = 1;  // of a chain: T^row / row!
  for (int row = 0; row < design.size; ++row) {
    if (row > 0) unit *= design.sample_time / row;
    const RecordedCall* call = design.called("estimate_" + std::to_string(row));
    if (call == nullptr) continue;
    const LinearCall forms(design, *call, {});
    const auto output = static_cast<std::size_t>(call->outputs[0]);
    if (!forms.linear[output]) continue;
    const LinearForm& form = forms.of[output];
    const double factor = form[own];
    const auto others =
        std::count_if(form.begin(), form.begin() + static_cast<std::ptrdiff_t>(states.size()),
                      [](double x) { return std::fabs(x) > 0; }) -
        1;
    if (others > 0 || !(std::fabs(factor) > 0)) continue;
    const std::string y = design.error_based ? "e" : "y";
    std::string text = row == design.order  ? "dhat"
                       : row < design.order ? y + std::string(static_cast<std::size_t>(row), '\'')
                                            : "estimate " + std::to_string(row);
    if (std::fabs(factor - 1) < 1e-6) return text;
    if (std::fabs(factor * unit - 1) < 1e-4) {
      text += row > 1 ? " T^" + std::to_string(row) : " T";
      const int factorial = static_cast<int>(std::lround(std::tgamma(row + 1)));
      return factorial > 1 ? text + "/" + std::to_string(factorial) : text;
    }
    return text + " / " + design_text::digits(factor);
  }
  return "";
}

}  // namespace esokit::detail
