/// @file
/// What a sampled linear system can do at most, whatever its bounded inputs are.
#pragma once

#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/language.hpp>
#include <vector>

namespace esokit::detail {

/// Sums of the positive and of the negative values of an impulse response, both as magnitudes.
struct ResponseSums {
  double positive = 0;
  double negative = 0;

  /// The most that inputs in low .. high (zero within) can add up to, in magnitude.
  [[nodiscard]] double most(double low, double high) const;
};

/// The system x(k+1) = A x(k) + b w(k): sums over its impulse responses c A^k b to the end of time.
/// The rest follows from a geometric series of a power of A whose norm is below a half. In double:
/// the results are a millionth larger than computed.
class WorstCase {
 public:
  using Vector = std::vector<double>;  ///< a row, a column, or a matrix by rows

  WorstCase() = default;
  /// @param a A by rows @param weights the sizes of the states, all positive: the norm is in them
  WorstCase(int size, Vector a, const Vector& weights);

  /// Whether each sequence decays.
  [[nodiscard]] bool stable() const { return factor_ <= 0.5; }

  /// For each column b of `inputs` the sums over c A^k b, k >= 0.
  /// @param most_at the largest sum over the states of abs(c A^k) box, if given
  [[nodiscard]] std::vector<ResponseSums> sums(const Vector& c, const std::vector<Vector>& inputs,
                                               const Vector& box = {},
                                               double* most_at = nullptr) const;

 private:
  static constexpr int most_steps = 1 << 22;

  static double larger(double a, double b) { return a < b ? b : a; }
  [[nodiscard]] double norm(const Vector& m) const;
  [[nodiscard]] Vector times(const Vector& a, const Vector& b) const;

  std::size_t n_ = 0;
  Vector a_;
  Vector weights_;
  int step_ = 1;        ///< of the power of A
  double factor_ = 1;   ///< its norm
  double largest_ = 1;  ///< of the norms of all powers below it
};

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/fixed_bounds.ipp>
#endif
