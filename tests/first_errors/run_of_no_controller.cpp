// expect: esokit: a controller for this plant has u = update\(y, r\)
#include <esokit/sim/run.hpp>

const auto plant = esokit::LinearPlant<1>::chain({}).value();
auto run = esokit::sim::run(plant, [](double y) { return -y; }, {.duration = 1.0});
