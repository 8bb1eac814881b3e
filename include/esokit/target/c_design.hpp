/// @file
/// What the C of a design has beside the files of target/runtime/: its features, numbers and lists.
#pragma once

#include <esokit/core/compiled.hpp>
#include <esokit/target/list_writer.hpp>
#include <esokit/target/recorded_numbers.hpp>
#include <esokit/target/runtime_text.hpp>
#include <string>
#include <utility>
#include <vector>

namespace esokit::detail {

namespace runtime {

inline constexpr const char* header =
#include <esokit/target/runtime/controller.h>
    ;

/// What is called stands before what calls it.
inline const std::vector<const char*> source = {
    head,
#include <esokit/target/runtime/recorded.c>
    ,
#include <esokit/target/runtime/law.c>
    ,
#include <esokit/target/runtime/design.c>
    ,
#include <esokit/target/runtime/observer.c>
    ,
#include <esokit/target/runtime/measured.c>
    ,
#include <esokit/target/runtime/core.c>
    ,
#include <esokit/target/runtime/angle.c>
    ,
#include <esokit/target/runtime/layers.c>
    ,
#include <esokit/target/runtime/map.c>
    ,
#include <esokit/target/runtime/guard.c>
    ,
#include <esokit/target/runtime/predictive.c>
    ,
#include <esokit/target/runtime/controller.c>
};

}  // namespace runtime

/// The C of a design.
class CDesign {
 public:
  /// @param mark of its text, if settings can be changed
  CDesign(const RecordedDesign& design, const std::string& mark);

  /// `name.h`.
  [[nodiscard]] std::string header() { return text_.header(runtime::header); }

  /// `name.c`.
  [[nodiscard]] std::string source();

  /// The settings for a file of their own.
  [[nodiscard]] std::string settings_file() const;

 private:
  void set_features();
  void set_features_of_adapters();

  void number(const char* name, double value) { text_.constant(name, writer_.number(value)); }

  void set_constants();
  void set_constants_of_adapters();
  void set_guard();
  void set_measured();

  void set_map();

  /// Gains and estimates, row by row.
  void set_rows();

  /// The members of the structs that are recorded, and what all are at first.
  void set_state();

  using Values = std::vector<std::pair<std::string, std::string>>;

  /// What adapters and laws remember of the object.
  [[nodiscard]] Values counted() const;
  template <class Real, class Count>
  void add_turns(const Real& real, const Count& count) const;
  template <class Real, class Count>
  void add_guard(const Real& real, const Count& count) const;

  void set_words();

  [[nodiscard]] std::string gain_rows() const;
  [[nodiscard]] std::string recovery() const;
  [[nodiscard]] std::string settings(const std::string& mark) const;

  static std::string at(const char* name, int i) {
    return std::string(name) + "[" + std::to_string(i) + "]";
  }
  template <class One>
  static std::string each(int count, const One& one);
  template <class One>
  static std::string listed(int count, const One& one);

  const RecordedDesign& design_;
  ListWriter writer_;
  RuntimeText text_;
  std::string settings_{};
};

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/c_design.ipp>
#endif
