// expect: esokit: controllers and adapters take the type of an observer
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
auto controller = esokit::Adrc<esokit::Adrc<esokit::LinearEso<2>>>::make({});
