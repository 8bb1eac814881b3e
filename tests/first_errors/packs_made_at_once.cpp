// expect: esokit: packs are made lane by lane: Packed<LinearEso<2>, 4>::make
#include <esokit/core/pack.hpp>
#include <esokit/observer/linear_eso.hpp>

using Four = esokit::Pack<double, 4>;
const auto observer = esokit::LinearEso<2, Four>::make(
    {.observer_bandwidth = Four(50.0), .input_gain = Four(1.0), .sample_time = Four(1e-3)});
