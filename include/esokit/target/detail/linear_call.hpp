/// @file
/// A recorded call as numbers: what is linear in states and arguments.
#pragma once

#include <cmath>
#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/target/detail/fixed_bounds.hpp>
#include <esokit/target/detail/integer_list.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <esokit/target/fixed_options.hpp>
#include <vector>

namespace esokit::detail {

/// A recorded call as numbers: what is linear in states and arguments, for each instruction.
class LinearCall {
 public:
  /// @param state_of for each number of the object which state it is, or -1
  /// @param given arguments that are numbers; NaN: the argument is a column
  /// @param settings which numbers may be changed while it runs, or empty
  LinearCall(const RecordedCall& call, const std::vector<int>& state_of,
             const std::vector<double>& values, std::size_t states,
             const std::vector<double>& given, const std::vector<bool>& settings = {});

  std::vector<LinearForm> of{};  ///< states, arguments, the constant
  std::vector<bool> linear{};
  std::vector<bool> varies{};  ///< with the settings

  [[nodiscard]] bool is_constant(int i) const;
  [[nodiscard]] double number(int i) const { return of[static_cast<std::size_t>(i)][constant_]; }
  /// Linear, without a constant.
  [[nodiscard]] bool is_linear(int i) const {
    return linear[static_cast<std::size_t>(i)] && !(std::fabs(number(i)) > 0);
  }

 private:
  /// Of an operation on what stands before it. @return whether it is linear
  [[nodiscard]] bool combine(const Instruction& one, LinearForm& form) const;

  std::size_t constant_;
};

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/linear_call.ipp>
#endif
