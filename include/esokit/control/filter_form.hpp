/// @file
/// A sampled linear ADRC as a filter: the polynomials from y and the applied u to the new u.
///
/// G. Herbst, "Transfer function analysis and implementation of active disturbance rejection
/// control", Control Theory and Technology 19 (2021) 19-34; "A minimum-footprint implementation of
/// discrete-time ADRC", ECC 2021.
///
/// Observer (LinearEso, current estimator) and law together are
///
///     D c = -(N_y y + N_u u),  u = limited(c + k_r r),  k_r = k_0 / b0.
///
/// With delta = z - 1, Q = P - 1 (P Pascal's triangle, the predictor of the scaled chain), l = P k
/// the predictor gain, h the law as a row on scaled states and g the effect of a unit input on the
/// state:
///
///     D   = prod(delta + a_i)             = sum_j beta_j delta^(N-j)
///     N_y = n! / (b0 T^n) sum_j nu_j delta^(N-j),  nu_0 = h k,  nu_j = h Q^(j-1) l
///     N_u = sum_p m_p delta^(N-p),
///     m_p = sum_(j=1..p) (beta_(p-j) h Q^(j-1) g - nu_(p-j) e_1 Q^(j-1) g)
///
/// beta and k come from the contractions a_i = 1 - rho_i through expm1, so all coefficients are
/// accurate to a few units in the last place for every omega_o T. Expanding them in z loses a
/// factor of 1/(1-rho)^N of that accuracy.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <esokit/math/combinatorics.hpp>
#include <tuple>

namespace esokit {

/// Coefficients in descending powers of delta or z; index 0 is the N-th power.
template <int Size, Scalar S>
struct FilterForm {
  Array<S, Size + 1> denominator{};  ///< D, monic
  Array<S, Size + 1> measurement{};  ///< N_y, unit of u per unit of y
  Array<S, Size + 1> input{};        ///< N_u, the first is zero
  S reference{};                     ///< k_r, unit of u per unit of y
};

namespace detail {

/// Q x, Q_rj = C(j, r) for j > r.
template <int Size, PlainScalar S>
Array<S, Size> pascal_step(const Array<S, Size>& x) {
  Array<S, Size> result{};
  for (int r = 0; r < Size; ++r) {
    S sum(0);
    for (int j = Size - 1; j > r; --j) {
      const auto column = static_cast<std::size_t>(j);
      sum = sum + binomial_table<Size, S>[column][static_cast<std::size_t>(r)] * x[column];
    }
    result[static_cast<std::size_t>(r)] = sum;
  }
  return result;
}

template <int Size, PlainScalar S>
S inner(const Array<S, Size>& a, const Array<S, Size>& b) {
  S sum(0);
  for (std::size_t i = 0; i < Size; ++i) sum = sum + a[i] * b[i];
  return sum;
}

}  // namespace detail

/// The filter in delta = z - 1.
/// @param poles poles of the sampled observer (EqualSampledPoles, SampledPoleSet)
/// @param gains k_0 .. k_(n-1) of the law
template <int Order, int Size, PlainScalar S, class Poles>
FilterForm<Size, S> delta_form(const Poles& poles, const Array<S, Order>& gains, S input_gain,
                               S sample_time) {
  using Row = Array<S, Size>;
  Row law{};  // times n! / (b0 T^n)
  Row drive{};
  law[Order] = S(1);
  S unit(1);
  for (int r = Order - 1; r >= 0; --r) {
    unit = unit * sample_time / static_cast<S>(r + 1);
    law[static_cast<std::size_t>(r)] = gains[static_cast<std::size_t>(r)] * unit;
    drive[static_cast<std::size_t>(r)] =
        binomial_table<Order, S>[Order][static_cast<std::size_t>(r)];
  }
  const auto weights = poles.weights();
  const Row current = current_gain<Size, S>(weights);
  Row predictor = predictor_gain<Size, S>(weights);

  FilterForm<Size, S> form;
  form.denominator = poles.symmetric();
  Array<S, Size + 1> nu{};
  Array<S, Size + 1> from_law{};
  Array<S, Size + 1> from_output{};
  nu[0] = detail::inner<Size, S>(law, current);
  for (std::size_t j = 1; j <= Size; ++j) {
    nu[j] = detail::inner<Size, S>(law, predictor);
    from_law[j] = detail::inner<Size, S>(law, drive);
    from_output[j] = drive[0];
    predictor = detail::pascal_step<Size, S>(predictor);
    drive = detail::pascal_step<Size, S>(drive);
  }
  for (std::size_t p = 1; p <= Size; ++p) {
    S sum(0);
    for (std::size_t j = 1; j <= p; ++j) {
      sum = sum + (form.denominator[p - j] * from_law[j] - nu[p - j] * from_output[j]);
    }
    form.input[p] = sum;
  }
  S scale = S(1) / input_gain;
  for (int i = 1; i <= Order; ++i) scale = scale * (static_cast<S>(i) / sample_time);
  for (std::size_t j = 0; j <= Size; ++j) form.measurement[j] = scale * nu[j];
  form.reference = gains[0] / input_gain;
  return form;
}

/// The same filter in z: sum_j c_j (z-1)^(N-j) expanded.
/// @param delta result of `delta_form`
template <int Size, PlainScalar S>
FilterForm<Size, S> shift_form(const FilterForm<Size, S>& delta) {
  const auto expand = [](const Array<S, Size + 1>& in) {
    Array<S, Size + 1> out{};
    for (int i = 0; i <= Size; ++i) {
      for (int j = 0; j <= i; ++j) {
        const S weight = binomial_table<Size, S>[static_cast<std::size_t>(Size - j)]
                                                [static_cast<std::size_t>(i - j)];
        const S term = weight * in[static_cast<std::size_t>(j)];
        auto& sum = out[static_cast<std::size_t>(i)];
        sum = (i - j) % 2 == 0 ? sum + term : sum - term;
      }
    }
    return out;
  };
  return {expand(delta.denominator), expand(delta.measurement), expand(delta.input),
          delta.reference};
}

}  // namespace esokit
