/// @file
/// Any observer of the library, chosen at run time, over a recorded log as it is.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "common/log_file.hpp"

namespace from_log {

/// How the observer is set.
struct LogSettings {
  std::string observer = "linear";
  int order = 2;
  double input_gain = 1;    ///< b0
  double bandwidth = 0;     ///< omega_o, rad/s
  double sample_time = 0;   ///< nominal, s
  double tolerance = 0.01;  ///< steps within this share of the nominal one count as nominal
};

/// What it found, a row a sample: y, y', .., d.
struct LogEstimates {
  std::vector<std::vector<double>> columns;  ///< NaN before the first measurement
  std::size_t rejected = 0;                  ///< measurements that were missing or bad
  std::size_t inputs = 0;    ///< inputs that were missing or bad; the one before was taken
  std::size_t restarts = 0;  ///< gaps too long to bridge
};

/// Runs the log through the chosen observer. @param time s, rising; empty: every sample_time
/// @param y measurement, NaN where missing @param u input that is held from its row to the next
[[nodiscard]] LogEstimates run_observer(const LogSettings& settings,
                                        const std::vector<double>& time,
                                        const std::vector<double>& y, const std::vector<double>& u);

}  // namespace from_log
