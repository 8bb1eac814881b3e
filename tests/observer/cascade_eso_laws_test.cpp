// The law suite on CascadeEso.
#include "law_suite.hpp"

namespace esokit_test {

using CascadeTypes = TypeList<esokit::CascadeEso<1, 2>, esokit::CascadeEso<2, 3>,
                              esokit::CascadeEso<4, 2, double, 2>, esokit::CascadeEso<2, 1, float>,
                              esokit::CascadeEso<2, 2, float>, esokit::CascadeEso<3, 3, float>>;
const bool cascade_eso_registered = register_laws<ObserverLaws>("CascadeEso", CascadeTypes{});

}  // namespace esokit_test
