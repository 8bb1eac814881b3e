// expect: Adrc.*esokit
#include <esokit/observer/linear_eso.hpp>
auto c = esokit::Adrc<esokit::LinearEso<2>>::make({});
