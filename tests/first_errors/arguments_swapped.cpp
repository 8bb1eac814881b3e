// expect: argument.*(template parameter list|template parameter must be an expression)|non-type
// template parameter
#include <esokit/observer/linear_eso.hpp>

auto observer = esokit::LinearEso<double, 2>::make({});
