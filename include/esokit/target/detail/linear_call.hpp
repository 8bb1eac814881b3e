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
  /// @param call of the design @param given arguments that are numbers; NaN: the argument is a
  ///        column
  LinearCall(const RecordedDesign& design, const RecordedCall& call,
             const std::vector<double>& given);

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
