/// @file
/// The controller of drive.cpp: the host designs it (print_pasted.cpp), the target runs it.
///
/// angle  rad          voltage  V, -5 .. 5
#pragma once

#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>

namespace drive {

using Controller = esokit::Adrc<esokit::LinearEso<2, float>>;  // voltage to angle: two integrations

inline Controller::Config config() {
  return {.observer = {.observer_bandwidth = 100.0f,  // rad/s
                       .input_gain = 50.0f,           // rad/s2 per V
                       .sample_time = 1e-3f},
          .controller_bandwidth = 25.0f,
          .limits = {.lower = -5.0f, .upper = 5.0f},
          .missing = {.most = 20, .input = 0.0f}};  // no voltage if the sensor stays away
}

}  // namespace drive
