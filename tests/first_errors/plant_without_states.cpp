// expect: States >= 1
#include <esokit/observer/model_eso.hpp>

auto observer = esokit::PlantEso<0, esokit::ModelParts{.order = 1}>::make({});
