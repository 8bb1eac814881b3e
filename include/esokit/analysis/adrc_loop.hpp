/// @file
/// The whole loop: nominal plant, observer and ADRC law.
#pragma once

#include <esokit/analysis/frequency_response.hpp>
#include <esokit/analysis/nominal_plant.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/analysis/poles.hpp>
#include <esokit/control/adrc_law.hpp>

namespace esokit {

namespace detail {

/// Whether two numbers were given as the same one, as far as the coarser of two scalars tells:
/// 0.01 in float and in double.
template <Scalar A, Scalar B>
bool same_as_given(double a, double b) noexcept {
  if constexpr (std::is_same_v<A, float> || std::is_same_v<B, float>) {
    return static_cast<float>(a) == static_cast<float>(b);
  } else {
    return a == b;
  }
}

/// A system without its sizes in the type, for code that is compiled once.
struct SystemView {
  DenseView<double> a, b, c, d;
  int states;

  template <int States, int Inputs, int Outputs>
  SystemView(LinearSystem<States, Inputs, Outputs>& system)
      : a{system.a.data(), States},
        b{system.b.data(), States, Inputs},
        c{system.c.data(), Outputs, States},
        d{system.d.data(), Outputs, Inputs},
        states(States) {}  // a matrix of one row is stored by rows, which is the same
};

template <class MatrixType>
DenseView<double> view_of(MatrixType& matrix) {
  return {matrix.data(), static_cast<int>(matrix.rows()), static_cast<int>(matrix.cols())};
}

struct LoopParts {
  SystemView plant;        ///< (u, d) to y
  SystemView controller;   ///< to be filled: (y, r) to u
  SystemView closed;       ///< to be filled: (r, v, d) to (y, u, zhat)
  DenseView<double> a, c;  ///< observer, as ObserverMatrices
  const double* by;
  const double* bu;
  const double* dy;
  const double* kappa;  ///< (k_0, .., k_(n-1), 1, 0, ..) / b0
  int size;             ///< N
  bool error_based;
};

/// u = -sign kappa zhat + rho r, where the observer sees sign (y + v), in the error-based form plus
/// r.
inline void assemble_loop(const LoopParts& parts) noexcept {
  const auto& [p, c, closed, a, observer_c, by, bu, dy, kappa, size, error_based] = parts;
  const double sign = error_based ? -1.0 : 1.0;
  const int plant_states = p.states;
  const int observer_states = c.states;
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < observer_states; ++j) c.c(0, j) -= sign * kappa[i] * observer_c(i, j);
    c.d(0, 0) -= kappa[i] * dy[i];  // sign of the law times sign of y
  }
  c.d(0, 1) = error_based ? -c.d(0, 0) : kappa[0];
  for (int i = 0; i < observer_states; ++i) {
    for (int j = 0; j < observer_states; ++j) c.a(i, j) = a(i, j) + bu[i] * c.c(0, j);
    c.b(i, 0) = sign * by[i] + bu[i] * c.d(0, 0);
    c.b(i, 1) = bu[i] * c.d(0, 1) + (error_based ? by[i] : 0.0);
  }

  // States: plant, observer. u = c.c z + c.d (y + v, r).
  for (int i = 0; i < plant_states; ++i) {
    for (int j = 0; j < plant_states; ++j) {
      closed.a(i, j) = p.a(i, j) + p.b(i, 0) * c.d(0, 0) * p.c(0, j);
    }
    for (int j = 0; j < observer_states; ++j) closed.a(i, plant_states + j) = p.b(i, 0) * c.c(0, j);
    closed.b(i, 0) = p.b(i, 0) * c.d(0, 1);
    closed.b(i, 1) = p.b(i, 0) * c.d(0, 0);
    closed.b(i, 2) = p.b(i, 1);
    closed.c(0, i) = p.c(0, i);
    closed.c(1, i) = c.d(0, 0) * p.c(0, i);
    for (int r = 0; r < size; ++r) closed.c(2 + r, i) = sign * dy[r] * p.c(0, i);
  }
  for (int i = 0; i < observer_states; ++i) {
    const int row = plant_states + i;
    for (int j = 0; j < plant_states; ++j) closed.a(row, j) = c.b(i, 0) * p.c(0, j);
    for (int j = 0; j < observer_states; ++j) closed.a(row, plant_states + j) = c.a(i, j);
    closed.b(row, 0) = c.b(i, 1);
    closed.b(row, 1) = c.b(i, 0);
    closed.c(1, row) = c.c(0, i);
    for (int r = 0; r < size; ++r) closed.c(2 + r, row) = observer_c(r, i);
  }
  closed.d(1, 0) = c.d(0, 1);
  closed.d(1, 1) = c.d(0, 0);
  for (int r = 0; r < size; ++r) {
    closed.d(2 + r, 0) = error_based ? dy[r] : 0.0;
    closed.d(2 + r, 1) = sign * dy[r];
  }
}

}  // namespace detail

/// Loop of a nominal plant y = P (u, d), an observer that measures y + v and a law u = C (y + v,
/// r).
///
/// Sampled: y[k] is measured, the observer corrected and u[k] set in the same moment; computing
/// time is a delay of the plant (`sampled_plant` with a delay). The loop is opened at the plant's
/// input, behind the path by which the observer is told u: L = -P C.
///
/// The system of the closed loop has inputs (r, v, d) and outputs (y, u, zhat). In the output-based
/// form r is a reference without derivatives.
/// @tparam PlantStates states of the (sampled) plant @tparam Observer the observer's type
template <int PlantStates, LinearObserver Observer>
class AdrcLoop {
 public:
  static constexpr int order = Observer::order;                       ///< n, order of the observer
  static constexpr int size = Observer::order + Observer::extension;  ///< N = n + m
  static constexpr int observer_states = size * Observer::levels;     ///< N p
  static constexpr int states = PlantStates + observer_states;        ///< of the closed loop
  using Complex = std::complex<double>;                               ///< a response at a frequency
  using Plant = NominalPlant<PlantStates>;                            ///< (u, d) to y
  using Controller = LinearSystem<observer_states, 2, 1>;             ///< (y, r) to u
  using Closed = LinearSystem<states, 3, 2 + size>;                   ///< (r, v, d) to (y, u, zhat)

  /// Closes the loop.
  /// @param plant sampled as the observer is, see `sampled_plant`; continuous for a continuous one
  /// @return error for a plant of another sample time or with a direct path, for input gains of
  ///         observer and law that do not belong together, and for a loop that the scalar cannot
  ///         hold
  template <Scalar S, AdrcForm Form = OutputBased>
  static Expected<AdrcLoop, Error<double>> make(const Plant& plant, const Observer& observer,
                                                const AdrcLaw<order, S>& law, Form /*form*/ = {}) {
    auto m = detail::observer_matrices(observer);
    const double direct = plant.d(0, 0) != 0.0 ? plant.d(0, 0) : plant.d(0, 1);
    constexpr bool error_based = std::is_same_v<Form, ErrorBased>;
    const double gain = error_based ? -m.input_gain : m.input_gain;
    const auto law_gain = static_cast<double>(law.input_gain());
    using ObserverScalar = typename Observer::scalar_type;
    Rules<double> rules;
    rules.all_of(detail::check_system(plant))
        .require(detail::same_as_given<ObserverScalar, double>(plant.sample_time, m.sample_time),
                 {"plant.sample_time", plant.sample_time, "must be that of the observer, which is",
                  -1, m.sample_time, true})
        .require(direct == 0.0, "plant.d", direct,
                 "must be zero: y may not follow an input at once")
        .require(detail::same_as_given<ObserverScalar, S>(gain, law_gain),
                 {"input_gain", m.input_gain,
                  error_based ? "of the observer must be minus that of the law, which is"
                              : "of the observer must be that of the law, which is",
                  -1, law_gain, true});
    if (!rules) return rules.error();

    Array<double, size> kappa{};
    for (std::size_t i = 0; i < order; ++i) {
      kappa[i] = static_cast<double>(law.gains()[i]) / law_gain;
    }
    kappa[order] = 1.0 / law_gain;

    AdrcLoop loop;
    loop.plant_ = plant;
    Controller& c = loop.controller_;
    Closed& closed = loop.closed_;
    detail::assemble_loop({loop.plant_, c, closed, detail::view_of(m.a), detail::view_of(m.c),
                           m.by.data(), m.bu.data(), m.dy.data(), kappa.data(), size, error_based});
    c.sample_time = plant.sample_time;
    c.input_names = {"y", "r"};
    c.output_names = {"u"};
    closed.sample_time = plant.sample_time;
    closed.input_names = {"r", "v", "d"};
    closed.output_names[0] = "y";
    closed.output_names[1] = "u";
    const auto names = detail::estimate_names<order, Observer::extension>();
    for (std::size_t i = 0; i < size; ++i) closed.output_names[i + 2] = names[i];

    balance(c);
    balance(closed);
    balance(loop.plant_);
    if (auto ok = detail::check_system(closed); !ok) return ok.error();
    loop.abscissa_ = esokit::stability_abscissa(closed);
    if (!is_finite(loop.abscissa_)) {
      return Error<double>{"plant.b", plant.b(0, 0),
                           "gives a closed loop whose poles the scalar cannot hold"};
    }
    return loop;
  }

  /// (u, d) to y, sampled as the observer is.
  [[nodiscard]] const Plant& plant() const noexcept { return plant_; }
  /// (y, r) to u.
  [[nodiscard]] const Controller& controller() const noexcept { return controller_; }
  /// (r, v, d) to (y, u, zhat).
  [[nodiscard]] const Closed& closed_loop() const noexcept { return closed_; }

  /// True if all poles of the closed loop are stable.
  [[nodiscard]] bool stable() const noexcept { return abscissa_ < 0.0; }

  /// As esokit::stability_abscissa of the closed loop: negative is stable.
  [[nodiscard]] double stability_abscissa() const noexcept { return abscissa_; }

  /// L = -P C. @param frequency rad/s, above 0; sampled: to pi / T
  /// @return error for a frequency outside of that, or one that is a pole
  [[nodiscard]] Expected<Complex, Error<double>> loop_gain(double frequency) const {
    return at(frequency, [](Complex l, Complex, Complex) { return l; });
  }
  /// S = 1 / (1 + L): from a disturbance at the output to y. Errors as loop_gain.
  [[nodiscard]] Expected<Complex, Error<double>> sensitivity(double frequency) const {
    return at(frequency, [](Complex l, Complex, Complex) { return 1.0 / (1.0 + l); });
  }
  /// T = L / (1 + L): from noise v to -y. Errors as loop_gain.
  [[nodiscard]] Expected<Complex, Error<double>> complementary_sensitivity(double frequency) const {
    return at(frequency, [](Complex l, Complex, Complex) { return l / (1.0 + l); });
  }
  /// C S: from noise v to u. Errors as loop_gain.
  [[nodiscard]] Expected<Complex, Error<double>> noise_to_control(double frequency) const {
    return at(frequency, [](Complex l, Complex c, Complex) { return c / (1.0 + l); });
  }
  /// P_d S: from a disturbance d of the plant to y. Errors as loop_gain.
  [[nodiscard]] Expected<Complex, Error<double>> disturbance_to_output(double frequency) const {
    return at(frequency, [](Complex l, Complex, Complex pd) { return pd / (1.0 + l); });
  }

 private:
  AdrcLoop() = default;

  template <class Function>
  Expected<Complex, Error<double>> at(double frequency, Function&& function) const {
    if (Rules<double> rules; !rules.positive("frequency", frequency)) return rules.error();
    const auto p = frequency_response(plant_, frequency);
    if (!p) return p.error();
    const auto c = frequency_response(controller_, frequency);
    if (!c) return c.error();
    const Complex value =
        function(-(*p)(0, 0) * (*c)(0, 0), Complex((*c)(0, 0)), Complex((*p)(0, 1)));
    if (!is_finite(value.real()) || !is_finite(value.imag())) {
      return Error<double>{"frequency", frequency, "is a pole of the closed loop"};
    }
    return value;
  }

  Plant plant_{};
  Controller controller_{};
  Closed closed_{};
  double abscissa_ = 0.0;
};

/// A loop, or the error that AdrcLoop::make gives.
template <int PlantStates, class Observer>
using AdrcLoopResult = Expected<AdrcLoop<PlantStates, Observer>, Error<double>>;

/// The loop of a plant, an observer and a law; see AdrcLoop::make.
template <int PlantStates, LinearObserver Observer, Scalar S, AdrcForm Form = OutputBased>
AdrcLoopResult<PlantStates, Observer> adrc_loop(const NominalPlant<PlantStates>& plant,
                                                const Observer& observer,
                                                const AdrcLaw<Observer::order, S>& law,
                                                Form form = {}) {
  return AdrcLoop<PlantStates, Observer>::make(plant, observer, law, form);
}

}  // namespace esokit
