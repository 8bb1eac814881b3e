// expect: order.*observer
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
auto c = esokit::Adrc<esokit::LinearEso<2>>::make(
    {.controller_bandwidth = 3.0, .observer = {.observer_bandwidth = 3.0}});
