// expect: esokit: the form is OutputBased or ErrorBased
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>

auto controller = esokit::Adrc<esokit::LinearEso<2>, int>::make({});
