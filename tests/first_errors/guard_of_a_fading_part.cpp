// expect: AugmentedModel of one constant, without first-order parts or a varying speed
#include <esokit/adapter/guarded.hpp>
#include <esokit/observer/model_eso.hpp>

using Fading = esokit::ModelEso<esokit::ModelParts{.order = 2, .first_order = 1}>;
auto observer = esokit::Guarded<Fading>::make({});
