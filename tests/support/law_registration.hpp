/// @file
/// A law is a function without arguments; a suite of laws runs for a list of types. Instead of
/// GoogleTest's typed suites, which instantiate a class, a factory and a registration for every law
/// and type: a third of the compile time of a law suite.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>

namespace esokit_test {

/// A law of one type; `excuse` says why it does not apply, null if it does.
struct NamedLaw {
  const char* name;
  std::function<void()> run;
  const char* excuse = nullptr;
};

class LawTest : public ::testing::Test {
 public:
  explicit LawTest(const NamedLaw& law) : law_(law) {}
  void TestBody() override {
    if (law_.excuse != nullptr) {
      GTEST_SKIP() << law_.name << " does not apply: " << law_.excuse;
    }
    law_.run();
  }

 private:
  NamedLaw law_;
};

/// `file`: of the test that registers it, by which a program of several files finds its cases.
inline void register_law(const std::string& suite, const std::string& type, const NamedLaw& law,
                         const char* file = __builtin_FILE()) {
  ::testing::RegisterTest(suite.c_str(), law.name, type.c_str(), nullptr, file, __LINE__,
                          [law] { return new LawTest(law); });
}

template <class... Types>
struct TypeList {};

/// Registers `Suite<T>::laws()` for each T of the list, as tests of the suites NAME/0, NAME/1, ..;
/// for a global: `const bool registered = register_laws<Suite>("Name", TypeList<..>{});`.
/// With ESOKIT_ONE_TYPE (CMake: ESOKIT_TESTS_SUBSET) for the first type alone.
template <template <class> class Suite, class First, class... Rest>
bool register_laws(const std::string& name, TypeList<First, Rest...>,
                   const char* file = __builtin_FILE()) {
  int index = 0;
  const auto add = [&](const auto& laws, const std::string& type) {
    const std::string suite = name + "/" + std::to_string(index++);
    for (const NamedLaw& law : laws) register_law(suite, type, law, file);
  };
  add(Suite<First>::laws(), ::testing::internal::GetTypeName<First>());
#ifndef ESOKIT_ONE_TYPE
  (add(Suite<Rest>::laws(), ::testing::internal::GetTypeName<Rest>()), ...);
#endif
  return true;
}

}  // namespace esokit_test
