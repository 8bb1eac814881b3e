// expect: template argument|template parameter
#include <esokit/observer/linear_eso.hpp>

auto observer = esokit::LinearEso<double, 2>::make({});
