// expect: esokit: MappedInput must be the outermost adapter
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/observer/linear_eso.hpp>

using Mapped = esokit::MappedInput<esokit::LinearEso<2>>;
using Late = esokit::DelayedInput<Mapped, 3>;
constexpr int states = Late::size;
