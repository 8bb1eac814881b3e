// expect: esokit: controllers and adapters take the type of an observer
#include <esokit/control/adrc.hpp>

auto controller = esokit::Adrc<double>::make({});
