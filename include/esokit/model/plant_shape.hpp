/// @file
/// The states of a LinearPlantModel, and which elements of its Phi and Gamma can differ from zero.
#pragma once

#include <esokit/model/matrix_model.hpp>
#include <esokit/model/model_parts.hpp>

namespace esokit {

namespace detail {

/// The Shape that MatrixModel takes. The states are those of a sensor, y .. y^(n-1), D, the
/// remaining states of the plant, and the states of the disturbance. If y .. y^(n-1) are all of the
/// plant, D takes the place of the first state of the disturbance.
template <int States, ModelParts Parts>
struct PlantShape {
  static constexpr ModelParts parts = Parts;
  static constexpr int order = Parts.order;
  static constexpr int sinusoids = States + Parts.constants;
  static constexpr int size = Parts.sensor + States + disturbance_size(Parts);
  static constexpr int measured_rows = Parts.sensor;
  static constexpr int first = size - disturbance_size(Parts);  ///< first disturbance state
  static constexpr int replaced = order == States ? 1 : 0;  ///< of its states, how many D replaces

  static constexpr int degree(int state) noexcept {
    if (state < Parts.sensor) return 0;
    if (state <= Parts.sensor + order) return state - Parts.sensor;
    const int element = state - first;
    return order + (element > 0 && element < Parts.constants ? element : 0);
  }
  static constexpr ModelPattern<size> pattern = [] {
    ModelPattern<size> all{};
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j <= size; ++j) {
        const int sinusoid = first + Parts.constants;
        const int fading = sinusoid + 2 * Parts.resonators;
        bool couples = i < Parts.sensor || j >= Parts.sensor;
        if (i >= first + replaced) {
          couples = j < size && j >= first + replaced &&
                    (i < sinusoid ? j > i && j < sinusoid
                     : i < fading ? j >= sinusoid && (j - sinusoid) / 2 == (i - sinusoid) / 2
                                  : j == i);
        }
        const auto row = static_cast<std::size_t>(i);
        const auto column = static_cast<std::size_t>(j);
        all.couples[row][column] = couples;
        if (couples) all.place[row][column] = all.kept++;
      }
    }
    return all;
  }();
};

}  // namespace detail
}  // namespace esokit
