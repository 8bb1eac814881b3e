// expect: esokit: Guarded needs a constant gain on the chain of integrators
#include <esokit/adapter/guarded.hpp>
#include <esokit/observer/algebraic_eso.hpp>

auto observer = esokit::Guarded<esokit::AlgebraicEso<2>>::make({});
