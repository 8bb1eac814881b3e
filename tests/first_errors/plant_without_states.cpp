// expect: esokit: PlantEso needs the number of states
#include <esokit/observer/model_eso.hpp>

auto observer = esokit::PlantEso<0, esokit::ModelParts{.order = 1}>::make({});
