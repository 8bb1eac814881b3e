/// @file
/// FixedDesign: a recorded design in integers, with scales that cannot overflow and the bounds of
/// what rounding does.
#pragma once

#include <cstddef>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/target/detail/fixed_bounds.hpp>
#include <esokit/target/detail/fixed_builder.hpp>
#include <esokit/target/detail/integer_list.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <utility>
#include <vector>

namespace esokit::detail {

/// A recorded design in integers.
class FixedDesign : public FixedBuilder {
 public:
  using FixedBuilder::FixedBuilder;

  /// Chooses scales, builds the lists, computes the bounds; false if refused.
  bool make();

 private:
  bool builds(const std::vector<bool>& keeps);

  // ---- Judging.

  /// The system of the lists; false if it does not decay.
  bool finds_system();

  /// The most that a form can be: of inputs and roundings of all times. @param free adds the most
  /// from states anywhere in the box
  [[nodiscard]] double most_at(const LinearForm& form, double* free) const;

  /// The owner of a line that might not fit, and how many bits its scale has to be coarser; none if
  /// all fit. @param in_box the states are anywhere in their reach, else where the inputs bring
  /// them
  std::pair<int, int> overflowing(const IntegerList& list, bool in_box);

  void bounds();

  /// Of an estimate, with what the reading of words adds.
  FixedBound bound(const LinearForm& c, double direct, bool reads);

  /// What another system with other rows does at most.
  [[nodiscard]] double change(const LinearForm& exact, const LinearForm& now, double direct) const;

  /// The first estimate above what is allowed, or -1.
  [[nodiscard]] int exceeded() const;
  [[nodiscard]] double allowed(std::size_t i) const;

  bool refuse_bound(int i);

  // ---- The law.

  bool law_fits();

  void judge_law(LinearForm form);

  bool judges_input();
};

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/fixed_design.ipp>
#endif
