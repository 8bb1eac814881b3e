// expect: LoopObserver|constraints not satisfied for class template 'Adrc'
#include <esokit/control/adrc.hpp>

auto controller = esokit::Adrc<double>::make({});
