/// @file
/// What the failures of this folder share: a plant that is simulated finely, and traces.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <esokit/adapter/guarded.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>

#include "common/report.hpp"

namespace guards {

inline esokit::examples::About about(std::string title, std::string description) {
  return {.paper_title = "Guards against failures in operation",
          .citation =
              "No paper. How loops fail in practice even if the numerics are right, without and "
              "with a guard",
          .link = "",
          .title = std::move(title),
          .description = std::move(description)};
}

/// Random numbers, the same on each machine.
struct Random {
  std::uint64_t state;
  double operator()() {
    state += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state;
    z = (z ^ (z >> 30u)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27u)) * 0x94d049bb133111ebu;
    return static_cast<double>((z ^ (z >> 31u)) >> 11u) * 0x1p-53;
  }
  double between(double low, double high) { return low + (high - low) * (*this)(); }
  double logarithmic(double low, double high) {
    return std::exp(between(std::log(low), std::log(high)));
  }
  double normal() {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += (*this)();
    return sum;
  }
};

/// What happened, sample by sample.
struct Trace {
  std::vector<double> t, y, u, d;  ///< s, output, input, dhat

  void add(double time, double output, double input, double disturbance) {
    t.push_back(time);
    y.push_back(output);
    u.push_back(input);
    d.push_back(disturbance);
  }
};

/// Largest abs(x) from `from` to `to`, s.
inline double peak(const Trace& trace, const std::vector<double>& x, double from, double to) {
  double most = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    if (trace.t[k] >= from && trace.t[k] < to) most = std::max(most, std::abs(x[k]));
  }
  return most;
}

/// rms of x from `from` to `to`, s.
inline double rms(const Trace& trace, const std::vector<double>& x, double from, double to) {
  double sum = 0;
  double count = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    if (trace.t[k] < from || trace.t[k] >= to) continue;
    sum += x[k] * x[k];
    ++count;
  }
  return std::sqrt(sum / count);
}

}  // namespace guards
