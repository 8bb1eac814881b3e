// A motor's angle under a voltage, and the controller for it: what control.cpp runs is what
// analyse.cpp judges.
#pragma once

#include <esokit/control/adrc.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/observer/linear_eso.hpp>

using Controller = esokit::Adrc<esokit::LinearEso<2>>;

/// y'' + 3 y' = 50 u + d, behind a current loop of 2 ms.
inline esokit::LinearPlant<3> servo() {
  const auto motor =
      esokit::LinearPlant<2>::chain({.coefficients = {0.0, 3.0}, .input_gain = 50.0}).value();
  return esokit::with_lag(motor, 2e-3).value();
}

inline Controller controller() {
  return Controller::make({.observer = {.observer_bandwidth = 100.0,  // rad/s
                                        .input_gain = 50.0,
                                        .sample_time = 1e-3},
                           .controller_bandwidth = 15.0,
                           .limits = {.lower = -5.0, .upper = 5.0}})  // V
      .value();  // ends the program with the reason as its last words, if it is refused
}
