// The law suite on the observers with any stable pole set, complex pairs among them.
#include "law_suite.hpp"

#include <esokit/gain/pole_set.hpp>

namespace esokit_test {

using PoleSetTypes = TypeList<esokit::LinearEso<2, double, 1, esokit::PoleSet>,
                              esokit::LinearEso<4, double, 2, esokit::PoleSet>,
                              esokit::LinearEso<3, float, 1, esokit::PoleSet>,
                              esokit::CascadeEso<2, 2, double, 1, esokit::PoleSet>>;
const bool pole_set_registered = register_laws<ObserverLaws>("PoleSet", PoleSetTypes{});

}  // namespace esokit_test
