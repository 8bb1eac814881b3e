#pragma once

#include <cmath>
#include <esokit/analysis/integrator_chain.hpp>
#include <esokit/analysis/linear_system.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <esokit/model/chain_model.hpp>
#include <esokit/model/sampled_model.hpp>
#include <esokit/observer/concepts.hpp>
#include <esokit/sim/continuous_observer.hpp>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION void put_together(const ObserverSizes& sizes, const ObserverParts& parts,
                                  DenseView<double> work, DenseView<double> a, DenseView<double> by,
                                  DenseView<double> bu, DenseView<double> c, DenseView<double> dy) {
  const auto [size, levels] = sizes;
  const int states = size * levels;
  // The correction of each level, as rows over the predicted states and y.
  const DenseView<double> added{work.data, states, states};
  double* const added_y = &work(0, states);
  double* const measured = &work(0, states + 1);
  double measured_y = 1.0;
  for (int level = 0; level < levels; ++level) {
    const int first = level * size;
    for (int r = 0; r < size; ++r) {
      const double gain = parts.gains[first + r];
      for (int j = 0; j < states; ++j) {
        const double innovation = measured[j] - (j == first ? 1.0 : 0.0);
        added(first + r, j) = gain * innovation;
      }
      added_y[first + r] = gain * measured_y;
    }
    if (level > 0) {  // plus the corrections of the disturbance by the levels before
      for (int r = 0; r < size; ++r) {
        for (int q = 0; q < size; ++q) {
          const double share = parts.disturbance(r, q);
          if (!((std::abs)(share) > 0.0)) continue;
          for (int j = 0; j < states; ++j) {
            added(first + r, j) += share * added(first - size + q, j);
          }
          added_y[first + r] += share * added_y[first - size + q];
        }
      }
    }
    for (int j = 0; j < states; ++j) {
      measured[j] = added(first, j) + (j == first ? 1.0 : 0.0);
    }
    measured_y = added_y[first];
  }

  for (int row = 0; row < states; ++row) {
    const int first = row / size * size;
    for (int k = first; k < first + size; ++k) {
      const double step = parts.step(row - first, k - first);
      const double weight = step + (k == row ? 1.0 : 0.0);
      for (int j = 0; j < states; ++j) a(row, j) += weight * added(k, j);
      a(row, k) += step;
      by(row, 0) += weight * added_y[k];
    }
    bu(row, 0) = parts.gamma(row - first, 0);
  }
  for (int r = 0; r < size; ++r) {
    const int row = states - size + parts.state_of_row[r];
    for (int j = 0; j < states; ++j) c(r, j) = added(row, j) + (j == row ? 1.0 : 0.0);
    dy(r, 0) = added_y[row];
  }
}

}  // namespace detail
}  // namespace esokit
