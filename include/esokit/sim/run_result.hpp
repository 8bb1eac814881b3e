/// @file
/// The results of a run: its samples, its end, and a recording to plot or save.
#pragma once

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <esokit/control/controller.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/sim/plant.hpp>
#include <string>
#include <type_traits>
#include <vector>

namespace esokit::sim {

namespace detail {

template <class P>
struct PlantScalarOf {};
template <class P>
requires requires { typename P::scalar_type; }
struct PlantScalarOf<P> {
  using type = typename P::scalar_type;
};
template <class P>
requires requires { typename P::State::Scalar; }
struct PlantScalarOf<P> {
  using type = typename P::State::Scalar;
};

template <class P>
constexpr int inputs_of() {
  if constexpr (requires { P::inputs; }) return P::inputs;
  return 1;
}
template <class P>
constexpr int outputs_of() {
  if constexpr (requires { P::outputs; }) return P::outputs;
  return 1;
}

/// All digits that it has.
template <class S>
void append_number(std::string& text, const S& value) {
  char digits[64];
  text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

/// The scalar in which a controller computes; that of the plant if the controller does not declare
/// one.
template <class C, class PlantScalar>
struct ControllerScalarOf {
  using type = PlantScalar;
};
template <class C, class PlantScalar>
requires requires { typename C::scalar_type; }
struct ControllerScalarOf<C, PlantScalar> {
  using type = typename C::scalar_type;
};

}  // namespace detail

/// The types that belong to a plant and a controller in a run.
template <class P, class C>
struct RunTypes {
  using S = typename detail::PlantScalarOf<P>::type;  ///< scalar of the plant
  using ControllerScalar = typename detail::ControllerScalarOf<C, S>::type;  ///< its scalar
  using Time = LaneScalar<S>;                                                ///< s
  static constexpr int inputs = detail::inputs_of<P>();                      ///< length of u
  static constexpr int outputs = detail::outputs_of<P>();                    ///< length of y
  using State = typename P::State;                                           ///< x
  using Input = ScalarOrVector<S, inputs>;                                   ///< u; a number if one
  using Output = ScalarOrVector<S, outputs>;                                 ///< y; a number if one

  /// The reference is (r, r', ..) for a controller that takes derivatives, else one number per
  /// output.
  static constexpr bool derivatives = controller_traits<C>.takes_derivatives && outputs == 1;
  /// Length of a reference.
  static constexpr int references = [] {
    if constexpr (derivatives) {
      return C::order + 1;
    } else {
      return outputs;
    }
  }();
};

/// The argument of the callback of a run, called once a sample after the controller.
template <class P, class C>
struct RunSample {
  using Types = RunTypes<P, C>;  ///< types of the numbers

  std::int64_t index{};                  ///< k
  typename Types::Time t{};              ///< s
  typename Types::State state{};         ///< x
  typename Types::Output output{};       ///< y
  typename Types::Output measurement{};  ///< what the controller was given; NaN: missing
  typename Types::Output reference{};    ///< r, without its derivatives
  typename Types::Input input{};         ///< u until the next sample
};

/// How a run ended.
template <class P, class C>
struct RunEnd {
  using Types = RunTypes<P, C>;  ///< types of the numbers

  typename Types::Time time{};    ///< s, at the end of the last sample
  std::int64_t samples{};         ///< number of samples that the controller computed
  typename Types::State state{};  ///< x at this time
  C controller;                   ///< the controller at the end
  bool completed = true;          ///< false if the callback stopped the run
};

/// The samples of a run, one column per signal: `output` is a vector of numbers, for several
/// channels an array of vectors.
template <class P, class C>
struct RunRecord {
  using Types = RunTypes<P, C>;       ///< types of the numbers
  using S = typename Types::S;        ///< scalar of the plant
  using Time = typename Types::Time;  ///< s

  /// The column of a signal with `Count` elements.
  template <int Count>
  using Column = std::conditional_t<Count == 1, std::vector<S>, Array<std::vector<S>, Count>>;

  std::vector<Time> t;                 ///< s
  Column<Types::outputs> output;       ///< y
  Column<Types::outputs> measurement;  ///< what the controller was given; NaN: missing
  Column<Types::outputs> reference;    ///< r
  Column<Types::inputs> input;         ///< u from this sample to the next

  /// dhat after the sample, in the unit of y^(n); empty if the controller has no observer.
  std::vector<S> total_disturbance;

  /// Adds a sample.
  void add(const RunSample<P, C>& sample, const C& controller) {
    t.push_back(sample.t);
    append(output, sample.output);
    append(measurement, sample.measurement);
    append(reference, sample.reference);
    append(input, sample.input);
    if constexpr (controller_traits<C>.observes) {
      total_disturbance.push_back(static_cast<S>(controller.observer().total_disturbance()));
    }
  }

  /// A table with a line of names: t, y, measurement, reference, u, total_disturbance; for several
  /// channels y1, y2, ..; numbers with all their digits. `std::ofstream("run.csv") << run.csv()`.
  [[nodiscard]] std::string csv() const requires PlainScalar<S> {
    std::string text = "t";
    std::vector<const std::vector<S>*> columns;
    const auto name = [&](const char* signal, const auto& column) {
      if constexpr (std::is_same_v<std::remove_cvref_t<decltype(column)>, std::vector<S>>) {
        if (column.size() != t.size()) return;
        (text += ",") += signal;
        columns.push_back(&column);
      } else {
        for (std::size_t i = 0; i < column.size(); ++i) {
          ((text += ",") += signal) += std::to_string(i + 1);
          columns.push_back(&column[i]);
        }
      }
    };
    name("y", output);
    name("measurement", measurement);
    name("reference", reference);
    name("u", input);
    name("total_disturbance", total_disturbance);
    for (std::size_t k = 0; k < t.size(); ++k) {
      detail::append_number(text += "\n", t[k]);
      for (const auto* column : columns) detail::append_number(text += ",", (*column)[k]);
    }
    return text += "\n";
  }

  /// A figure for gnuplot, with its numbers: y and r above, u below, then dhat if there is one.
  /// `std::ofstream("run.gp") << run.gnuplot();` and `gnuplot -p run.gp`, or, without a screen,
  /// `gnuplot -e "set terminal svg size 900,900; set output 'run.svg'" run.gp`.
  /// @param title of the figure, without quotes
  [[nodiscard]] std::string gnuplot(const std::string& title = {}) const requires PlainScalar<S> {
    constexpr int ys = Types::outputs;
    constexpr int us = Types::inputs;
    const bool observes = total_disturbance.size() == t.size();
    std::string text = "$run << END\n" + csv() + "END\nset datafile separator ','\nset grid\n";
    // Panels of one width; their names beside them, where no curve is.
    text += "set key outside samplen 2\nset multiplot layout " + std::to_string(observes ? 3 : 2) +
            ",1 margins 0.1,0.82,0.1,0.92 spacing 0.05 title '" + title + "'\nset format x ''\n";
    const auto lines = [&text](const char* name, int first, int count) {
      for (int i = 0; i < count; ++i) {
        text += (i > 0 ? ", $run" : " $run");
        text += " every ::1 using 1:" + std::to_string(first + i) + " with lines title '" + name;
        if (count > 1) text += std::to_string(i + 1);
        text += '\'';
      }
    };
    text += "plot";
    lines("r", 2 + 2 * ys, ys);
    text += ',';
    lines("y", 2, ys);
    const char* const last = "\nset format x\nset xlabel 't (s)'\nplot";
    text += observes ? "\nplot" : last;
    lines("u", 2 + 3 * ys, us);
    if (observes) {
      text += last;
      lines("dhat", 2 + 3 * ys + us, 1);
    }
    return text += "\nunset multiplot\n";
  }

 private:
  template <class Column, class Value>
  static void append(Column& column, const Value& value) {
    if constexpr (std::is_same_v<Column, std::vector<S>>) {
      column.push_back(value);
    } else {
      for (std::size_t i = 0; i < column.size(); ++i) {
        column[i].push_back(value(static_cast<int>(i)));
      }
    }
  }
};

/// The end of a run with the record of its samples.
template <class P, class C>
struct Recording : RunEnd<P, C>, RunRecord<P, C> {
  using Types = RunTypes<P, C>;  ///< types of the numbers
};

}  // namespace esokit::sim
