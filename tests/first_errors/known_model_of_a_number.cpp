// expect: esokit: KnownModel needs the type of a function fbar
#include <esokit/adapter/known_model.hpp>
#include <esokit/observer/linear_eso.hpp>
auto f() { return esokit::KnownModel<esokit::LinearEso<2>, double>::make({}); }
