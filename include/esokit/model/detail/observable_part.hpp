/// @file
/// The part of a model that the measurement corrects, for the design of the gain.
#pragma once

#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/math/detail/dense.hpp>

namespace esokit {

/// The part of a model's states for which a gain is designed, and how its correction carries over
/// to the whole model. A model that declares `ModelTraits::corrects_part` passes it to the design.
///
/// Known and stable states need no correction: an actuator, say, is simulated from u.
/// @tparam Size states of the part @tparam Whole states of the model @tparam Pairs poles that the
/// model places itself
template <int Size, int Whole, int Pairs, Scalar S>
struct CorrectedPart {
  static constexpr int size = Size;        ///< states of the part
  static constexpr int own_pairs = Pairs;  ///< poles that the model places

  Matrix<S, Size, Size> step;         ///< Phi - I, scaled as the states of a model are
  Array<S, Size> output{};            ///< C: the measurement as a function of the states
  Array<int, Size> degrees{};         ///< see SampledModel: a state is smaller by a^degree
  Array<int, Size> states{};          ///< their indices among the model's states
  Matrix<S, Whole, Size> whole;       ///< maps a correction of the part to one of the whole model
  Array<Array<S, 2>, Pairs> pairs{};  ///< real and imaginary part of a pair of poles, 1/s

  /// The measured states follow from those of the part. @param shown by these rows
  template <int Rows>
  void set_shown(const Matrix<S, Rows, Size>& shown) noexcept {
    detail::set_block(whole, 0, 0, shown);
    for (int j = 0; j < Size; ++j) output[static_cast<std::size_t>(j)] = shown(0, j);
  }
};

/// The CorrectedPart of a model that is corrected as a whole; the placement places all poles except
/// `Pairs`.
template <int Pairs = 0, class Model>
auto corrected_whole(const Model& model) {
  constexpr int size = Model::size;
  using S = std::remove_cvref_t<decltype(model.sample_time())>;
  CorrectedPart<size, size, Pairs, S> all;
  all.step = model.increment();
  all.output.fill(S(0.0));
  all.output[0] = S(1.0);
  for (int i = 0; i < size; ++i) {
    all.degrees[static_cast<std::size_t>(i)] = model.degree(i);
    all.states[static_cast<std::size_t>(i)] = i;
  }
  all.whole = Matrix<S, size, size>::Identity();
  return all;
}

}  // namespace esokit
