// expect: esokit: KnownModel and MimoAdrc need an observer
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
auto c = esokit::MimoAdrc<esokit::LinearEso<2>, double>::make({});
