// expect: esokit: no such form
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>

auto controller = esokit::Adrc<esokit::LinearEso<2>, int>::make({});
