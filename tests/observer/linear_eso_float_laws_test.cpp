// The law suite on LinearEso in float.
#include "law_suite.hpp"

namespace esokit_test {

using FloatTypes = TypeList<esokit::LinearEso<1, float>, esokit::LinearEso<2, float>,
                            esokit::LinearEso<2, float, 2>, esokit::LinearEso<4, float>,
                            esokit::LinearEso<8, float>>;
const bool registered = register_laws<ObserverLaws>("LinearEsoFloat", FloatTypes{});

}  // namespace esokit_test
