/// @file
/// to_structured_text: a finished controller or observer as a function block of a PLC, translated
/// from its C.
#pragma once

#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/detail/list_writer.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <esokit/target/detail/st_translator.hpp>
#include <string>

namespace esokit {

namespace detail {

/// A text, and what of its C could not be translated: a defect of esokit.
struct StructuredText {
  std::string text{};
  std::string settings{};  ///< a function, with settings_in_struct
  std::string error{};

  template <class V>
  [[nodiscard]] Expected<std::string, Error<V>> expected(const std::string& which) const {
    Rules<V> rules;
    rules.demand(error.empty(), "structured_text", V(0),
                 "cannot be written: its C has what is not translated (a defect of esokit)");
    if (!rules) return rules.error();
    return which;
  }
};

/// A function block around translated functions. In its texts `$name` is the name of the design,
/// `$real` REAL or LREAL.
class StBlock {
 public:
  /// @param begins the function that gives the state its first values
  StBlock(const CCode& code, const CodeOptions& options, bool single, const std::string& begins);

  StTranslator translator;
  std::string body{};

  void input(const std::string& declared, const std::string& comment = "") {
    inputs_ += line(declared, comment);
  }
  void output(const std::string& declared, const std::string& comment = "") {
    outputs_ += line(declared, comment);
  }
  void own(const std::string& declared) { own_ += line(declared, ""); }

  /// @param head a comment before all of it
  [[nodiscard]] StructuredText text(const std::string& head);

 private:
  static std::string line(const std::string& declared, const std::string& comment) {
    return "  " + declared + ";" + (comment.empty() ? "" : " (* " + comment + " *)") + "\n";
  }
  Words words_;
  std::string first_{};
  std::string inputs_{};
  std::string outputs_{};
  std::string own_{};
};

StructuredText structured_text(const RecordedDesign& design);

/// The block of what is neither controller nor observer. @param to_c of options its C
/// @param begins see StBlock @param what it was, and when it is called: for its head
/// @param add gives a block its inputs, outputs and body
template <class S, class ToC, class Add>
Expected<std::string, Error<S>> block_of(const CodeOptions& options, const ToC& to_c,
                                         const char* begins, const std::string& what,
                                         const std::string& when, const Add& add) {
  const auto code = to_c(options);
  if (!code) return code.error();
  const auto new_names = new_names_in_block<S>(options, [&](const CodeOptions& as) {
    return block_of<S>(as, to_c, begins, what, when, add);
  });
  if (!new_names) return new_names.error();
  StBlock block(*code, options, sizeof(S) == sizeof(float), begins);
  add(block);
  const StructuredText all =
      block.text("(* Written by esokit from a finished " + what +
                 "; do not edit.\n$COMMENT   FUNCTION_BLOCK $name is at the end: call it " + when +
                 ". *)\n\n");
  return all.template expected<S>(all.text);
}
/// @param T its sample time @return when such a block is called
template <class S>
std::string once_in_each(S T) {
  return "once in each T = " + ListWriter(c_language, false).number(static_cast<double>(T)) + " s";
}

}  // namespace detail

/// The controller or observer as a function block in Structured Text (IEC 61131-3, second edition:
/// functions with VAR_IN_OUT, no methods), REAL for float and LREAL for double. It is the C of
/// `to_c`, translated function by function, so it takes the same objects, and means the same by
/// bad and missing samples, gaps, restarts and safe mode. A call of the block is a sample; what the
/// C has functions for (a measured w, guards, settings) is inputs. NaN and infinity are refused by
/// ABS(x) <= the largest number, which every PLC has. Counts are UDINT, a status UINT.
/// @param object as for to_c @return types, functions and the block, or an error as for to_c
template <detail::Writable Object>
Expected<std::string, Error<typename Object::scalar_type>> to_structured_text(
    const Object& object, const CodeOptions& options = {}) {
  if (options.saves_state) {
    return Error<typename Object::scalar_type>{
        "saves_state", 1, "is not written in Structured Text: declare the block RETAIN there"};
  }
  const auto design = detail::recorded_design(object, options);
  if (!design) return design.error();
  const auto new_names = detail::new_names_in_block<typename Object::scalar_type>(
      options, [&](const CodeOptions& as) { return to_structured_text(object, as); });
  if (!new_names) return new_names.error();
  const detail::StructuredText all = detail::structured_text(*design);
  return all.template expected<typename Object::scalar_type>(all.text);
}

/// What cannot be written yet, by name.
template <class Other>
void to_structured_text(const Other& object, const CodeOptions& = {}) {
  to_c(object);
}

/// With CodeOptions::settings_in_struct: the settings of another design of the same structure, as a
/// function `name_set_settings_name` that gives them to a variable of type `name_settings`, for the
/// input `settings` of the block. @return its text, or an error as for to_structured_text
template <detail::Writable Object>
Expected<std::string, Error<typename Object::scalar_type>> to_structured_settings(
    const Object& object, const CodeOptions& options) {
  // Of the block, in whose text the names have to be new.
  if (const auto ok = to_structured_text(object, options); !ok) return ok.error();
  const auto design = detail::recorded_design(object, options);
  if (!design) return design.error();
  const detail::StructuredText all = detail::structured_text(*design);
  return all.template expected<typename Object::scalar_type>(all.settings);
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/structured_text.ipp>
#endif
