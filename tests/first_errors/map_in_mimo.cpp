// expect: esokit: MimoAdrc takes no MappedInput
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/observer/linear_eso.hpp>

using Mapped = esokit::MappedInput<esokit::LinearEso<1>>;
constexpr int channels = esokit::MimoAdrc<Mapped, Mapped>::channels;
