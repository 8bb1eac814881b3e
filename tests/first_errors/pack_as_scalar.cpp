// expect: esokit: packs are made lane by lane
// lines: 250
#include <esokit/control/adrc.hpp>
#include <esokit/core/pack.hpp>
#include <esokit/observer/linear_eso.hpp>
using Four = esokit::Pack<double, 4>;
auto c = esokit::Adrc<esokit::LinearEso<2, Four>>::make({});
