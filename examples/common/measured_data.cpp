#include "measured_data.hpp"

namespace esokit::examples {

std::filesystem::path measured_data() { return ESOKIT_MEASURED_DATA; }

}  // namespace esokit::examples
