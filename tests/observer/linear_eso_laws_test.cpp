// The law suite on LinearEso in double (and one long double); float has a file of its own.
#include "law_suite.hpp"

namespace esokit_test {

using DoubleTypes =
    TypeList<esokit::LinearEso<1>, esokit::LinearEso<2>, esokit::LinearEso<3, double, 2>,
             esokit::LinearEso<5>, esokit::LinearEso<1, double, 4>, esokit::LinearEso<8, double, 4>,
             esokit::LinearEso<2, long double>>;
const bool registered = register_laws<ObserverLaws>("LinearEso", DoubleTypes{});

}  // namespace esokit_test
