/// @file
/// How a design is to be written in integers, and what is said of what is written.
#pragma once

#include <array>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/target/detail/fixed_bounds.hpp>
#include <esokit/target/detail/integer_list.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <map>
#include <vector>

namespace esokit {

/// A signal that comes or goes in counts.
struct CountedSignal {
  double unit = 0;        ///< what a count is, in the unit of the design
  std::int32_t most = 0;  ///< counts are within -most .. most, 1 .. 2^24; of a counter that wraps,
                          ///< by how many counts it changes at most from one sample to the next
  int counter_bits = 0;   ///< of y only: it is a counter of so many bits that wraps, 2 .. 16; 0: it
                          ///< does not
};

struct FixedCode;

/// How a design is to be written in fixed point.
struct FixedPointOptions {
  ByName<FixedPointOptions> by_name{};  ///< nothing to set, see ByName
  CountedSignal y{};                    ///< the measurement
  CountedSignal u{};                    ///< what the actuator held
  int innovation_bits = 32;             ///< 16 (fewer instructions) or 32

  /// For each estimate what rounding may do at most, in its unit; not given or zero: what half a
  /// count of y does.
  std::vector<double> most_deviation{};
  double most_input_deviation = 0;  ///< the same of u, in counts; 0: a count, or what half a
                                    ///< count of y does
  CodeOptions code{};               ///< name and comment, and whether settings are in a struct
  const FixedCode* settings_for = nullptr;  ///< with CodeOptions::settings_in_struct: the design is
                                            ///< for `name_adopt` of this code, with its scales

  /// With CodeOptions::settings_in_struct: other designs, each written alone with these options,
  /// that are to become settings of this code. It takes scales that hold all of them; the gains of
  /// each have fewer bits then, see FixedBound::by_gains.
  std::vector<const FixedCode*> room_for{};
};

/// What rounding can do to an estimate or to u.
struct FixedBound {
  double deviation = 0;   ///< from the same design with the written gains in exact numbers, at most
  double by_gains = 0;    ///< by the rounding of the gains themselves, at most
  double half_count = 0;  ///< what half a count of y does, to compare
};

/// The written design in exact numbers: x(k+1) = A x(k) + by y(k) + bu u(k), in counts of y.
struct WrittenSystem {
  std::vector<double> a{};                       ///< by rows
  std::vector<double> by{};                      ///< of a counter that wraps: of its change
  std::vector<double> bu{};                      ///< for u in counts
  std::vector<std::vector<double>> estimates{};  ///< for each estimate its row of x, in its unit
  std::vector<double> law{};     ///< u in counts: for each state, then for the reference
  std::vector<int> scale{};      ///< state i is kept in 2^-scale counts
  std::vector<int> left_over{};  ///< and so many bits below
  std::vector<double> most{};    ///< the largest that y and u can make of state i, in counts
};

/// What settings that are changed while it runs leave as it is.
struct FixedLayout {
  std::vector<int> scale{};                    ///< of the states
  std::vector<bool> keeps{};                   ///< which of them keep what is left over
  bool rounds = false;                         ///< shifts round
  std::map<int, int> coarser{};                ///< scales of what is computed, by its owner
  std::map<int, int> narrow{};                 ///< scales of what has 16 bits, by its owner
  std::map<int, int> left_over{};              ///< scales of what is left over, by its owner
  std::array<std::vector<int>, 2> products{};  ///< scales of the products, of update and law
  std::array<std::vector<double>, 2> gains{};  ///< what is multiplied by there, in magnitude
  int law_scale = 0;                           ///< u is kept in 2^-law_scale counts
  std::uint32_t mark = 0;                      ///< of the text
};

}  // namespace esokit
