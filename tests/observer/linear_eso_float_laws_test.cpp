// The law suite on LinearEso in float.
#include "law_suite.hpp"

namespace esokit_test {

using FloatTypes = ::testing::Types<esokit::LinearEso<1, float>, esokit::LinearEso<2, float>,
                                    esokit::LinearEso<2, float, 2>, esokit::LinearEso<4, float>,
                                    esokit::LinearEso<8, float>>;
INSTANTIATE_TYPED_TEST_SUITE_P(LinearEsoFloat, ObserverLaws, FloatTypes);

}  // namespace esokit_test
