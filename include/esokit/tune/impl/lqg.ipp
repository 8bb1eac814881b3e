#pragma once

#include <algorithm>
#include <cmath>
#include <esokit/analysis/linear_controller.hpp>
#include <esokit/analysis/loop.hpp>
#include <esokit/math/detail/dense.hpp>
#include <esokit/tune/lqg.hpp>
#include <esokit/tune/specification.hpp>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION DynamicMatrix<double> transposed(const DynamicMatrix<double>& a) {
  DynamicMatrix<double> out(a.cols(), a.rows());
  for (int i = 0; i < a.rows(); ++i) {
    for (int j = 0; j < a.cols(); ++j) out(j, i) = a(i, j);
  }
  return out;
}

inline DynamicMatrix<double> identity_matrix(int size, double value = 1.0) {
  DynamicMatrix<double> out(size, size);
  for (int i = 0; i < size; ++i) out(i, i) = value;
  return out;
}

ESOKIT_FUNCTION DynamicMatrix<double> solve_riccati(DynamicMatrix<double> a,
                                                    const DynamicMatrix<double>& b, double r,
                                                    DynamicMatrix<double> q) {
  const int n = a.rows();
  DynamicMatrix<double> g = product(b, transposed(b));
  for (int i = 0; i < n * n; ++i) g.data()[i] /= r;
  for (int step = 0; step < 60; ++step) {
    auto inner = product(g, q);
    for (int i = 0; i < n; ++i) inner(i, i) += 1.0;
    // (I + G H)^-1 (A, G)
    DynamicMatrix<double> right(n, 2 * n);
    add(right, 0, 0, a);
    add(right, 0, n, g);
    solve_in_place(inner.view(), right.view());
    DynamicMatrix<double> ia(n, n), ig(n, n);
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        ia(i, j) = right(i, j);
        ig(i, j) = right(i, n + j);
      }
    }
    const auto at = transposed(a);
    const auto more = product(at, product(q, ia));
    add(g, 0, 0, product(a, product(ig, at)));
    add(q, 0, 0, more);
    a = product(a, ia);
    double change = 0.0, size = 0.0;
    for (int i = 0; i < n; ++i) {
      change = (std::max)(change, (std::abs)(more(i, i)) / (std::max)(q(i, i), 1e-300));
      size = (std::max)(size, q(i, i));
    }
    if (!(change > 1e-15) || !is_finite(size)) break;
  }
  return q;
}

}  // namespace detail

ESOKIT_FUNCTION Lqg::Lqg(const TuneModel& model)
    : plant_(detail::sampled_plant(detail::dense_plant(model), model.sample_time)),
      b0_(model.input_gain.value),
      order_(model.order) {
  using detail::add;
  using detail::product;
  const int n = plant_.a.rows();
  const double T = model.sample_time;
  whole_ = plant_.whole[0];
  fraction_ = plant_.remembered(0) > whole_;
  // The estimated states: (x, d).
  phi_ = detail::identity_matrix(n + 1);
  add(phi_, 0, 0, plant_.a);
  add(phi_, 0, n, plant_.e);
  DynamicMatrix<double> c(n + 1, 1), walk(n + 1, n + 1);
  for (int j = 0; j < n; ++j) c(j, 0) = plant_.c(0, j);
  walk(n, n) = model.disturbance * T;
  const double r = model.noise * model.noise;
  const auto p = detail::solve_riccati(detail::transposed(phi_), c, r, walk);
  kalman_ = product(p, c);
  const double innovation = product(detail::transposed(c), kalman_)(0, 0) + r;
  for (int i = 0; i <= n; ++i) kalman_(i, 0) /= innovation;
  // The regulated states: (x, and u of the last sample if a fraction of it still acts).
  const int states = n + (fraction_ ? 1 : 0);
  a_ = DynamicMatrix<double>(states, states);
  add(a_, 0, 0, phi_block(n));
  b_ = DynamicMatrix<double>(states, 1);
  add(b_, 0, 0, plant_.now);
  if (fraction_) {
    add(a_, 0, n, plant_.before);
    b_(n, 0) = 1.0;
  }
  // The states at rest under d = 1: the lag at -1 / b0.
  rest_ = DynamicMatrix<double>(states, 1);
  for (int i = 0; i < n; ++i) {
    const double input = plant_.now(i, 0) + plant_.before(i, 0);
    if (model.lag > 0.0 && i == order_) rest_(i, 0) = input / (b0_ * plant_.a(i, i));
  }
  if (fraction_) rest_(n, 0) = -1.0 / b0_;
}

ESOKIT_FUNCTION DynamicMatrix<double> Lqg::feedback(double rho) const {
  using detail::product;
  const int states = a_.rows();
  DynamicMatrix<double> q(states, states);
  for (int i = 0; i < plant_.a.rows(); ++i) {
    for (int j = 0; j < plant_.a.rows(); ++j) q(i, j) = plant_.c(0, i) * plant_.c(0, j);
  }
  const double r = rho * b0_ * b0_;
  const auto x = detail::solve_riccati(a_, b_, r, q);
  const auto bx = product(detail::transposed(b_), x);
  auto k = product(bx, a_);
  const double size = r + product(bx, b_)(0, 0);
  for (int j = 0; j < states; ++j) k(0, j) /= size;
  return k;
}

ESOKIT_FUNCTION LinearController Lqg::controller(double rho) const {
  using detail::add;
  using detail::product;
  const int n = plant_.a.rows();
  const int memory = whole_ + (fraction_ ? 1 : 0);
  const auto k = feedback(rho);
  // u = -(dhat / b0) - k (x ahead - rest dhat), by rows over (x, d, u[k-1], u[k-2], ..).
  DynamicMatrix<double> kx(1, n);
  for (int j = 0; j < n; ++j) kx(0, j) = k(0, j);
  DynamicMatrix<double> row(1, n + 1 + memory);
  double of_d = -1.0 / b0_;
  for (int j = 0; j < a_.rows(); ++j) of_d += k(0, j) * rest_(j, 0);
  row(0, n) = of_d;
  // x[k + D] = Phi^D x + sum of Phi^(D-1-i) (now u[k-D+i] + before u[k-D-1+i] + e d)
  auto ahead = kx;
  for (int i = whole_; i > 0; --i) {
    const int back = whole_ - i;  // u[k - 1 - back] acts in this sample
    row(0, n + 1 + back) -= product(ahead, plant_.now)(0, 0);
    if (fraction_) row(0, n + 2 + back) -= product(ahead, plant_.before)(0, 0);
    row(0, n) -= product(ahead, plant_.e)(0, 0);
    ahead = product(ahead, phi_block(n));
  }
  for (int j = 0; j < n; ++j) row(0, j) = -ahead(0, j);
  if (fraction_) row(0, n + 1) -= k(0, n);
  // The states: predicted (x, d) and past inputs.
  const int states = n + 1 + memory;
  LinearController form(states, 1, 0, plant_.sample_time);
  DynamicMatrix<double> output(1, n + 1);
  add(output, 0, 0, plant_.c);
  // zhat = z + kalman (y - c z)
  auto corrected = product(kalman_, output);
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j) corrected(i, j) = (i == j ? 1.0 : 0.0) - corrected(i, j);
  }
  DynamicMatrix<double> first(1, n + 1);
  for (int j = 0; j <= n; ++j) first(0, j) = row(0, j);
  add(form.to_u, 0, 0, product(first, corrected));
  for (int j = 0; j < memory; ++j) form.to_u(0, n + 1 + j) = row(0, n + 1 + j);
  form.y_to_u = product(first, kalman_);
  add(form.a, 0, 0, product(phi_, corrected));
  for (int i = 0; i <= n; ++i) form.a(i, i) -= 1.0;
  add(form.from_y, 0, 0, product(phi_, kalman_));
  for (int i = 0; i < n; ++i) {
    if (whole_ == 0) {
      form.from_u(i, 0) = plant_.now(i, 0);
    } else {
      form.a(i, n + whole_) += plant_.now(i, 0);
    }
    if (fraction_) form.a(i, n + 1 + whole_) += plant_.before(i, 0);
  }
  for (int j = 0; j < memory; ++j) {
    form.a(n + 1 + j, n + 1 + j) -= 1.0;
    if (j > 0) form.a(n + 1 + j, n + j) += 1.0;
  }
  if (memory > 0) form.from_u(n + 1, 0) = 1.0;
  return detail::closed_upon_itself(form);
}

ESOKIT_FUNCTION DynamicMatrix<double> Lqg::phi_block(int n) const {
  auto phi = plant_.a;
  for (int i = 0; i < n; ++i) phi(i, i) += 1.0;
  return phi;
}

}  // namespace esokit
