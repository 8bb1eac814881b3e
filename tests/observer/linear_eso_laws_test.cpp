// The law suite on LinearEso.
#include "law_suite.hpp"

namespace esokit_test {

using LinearTypes = TypeList<esokit::LinearEso<2>, esokit::LinearEso<1>,
                             esokit::LinearEso<3, double, 2>, esokit::LinearEso<1, double, 4>,
                             esokit::LinearEso<8, double, 4>, esokit::LinearEso<2, long double>,
                             esokit::LinearEso<1, float>, esokit::LinearEso<2, float>,
                             esokit::LinearEso<3, float, 2>, esokit::LinearEso<8, float>>;
const bool linear_eso_registered = register_laws<ObserverLaws>("LinearEso", LinearTypes{});

}  // namespace esokit_test
