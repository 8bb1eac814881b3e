#include <gtest/gtest.h>

#include <esokit/core/error.hpp>
#include <esokit/core/error_text.hpp>
#include <esokit/core/expected.hpp>
#include <memory>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

namespace core_expected_test {

using esokit::Error;
using esokit::Expected;
using Result = Expected<std::string, Error<double>>;
using Outcome = Expected<void, Error<double>>;

const Error<double> refused{"input_gain", 0.0, "must not be zero"};

TEST(Expected, HoldsAValue) {
  Result result = std::string("good");
  EXPECT_TRUE(result.has_value());
  EXPECT_TRUE(static_cast<bool>(result));
  EXPECT_EQ(result.value(), "good");
  EXPECT_EQ(*result, "good");
  EXPECT_EQ(result->size(), 4u);
  result.value() += "!";
  *result += "!";
  EXPECT_EQ(std::as_const(result).value(), "good!!");
  EXPECT_EQ(*std::as_const(result), "good!!");
  EXPECT_EQ(std::as_const(result)->size(), 6u);
}

TEST(Expected, HoldsAnError) {
  const Result result = refused;
  EXPECT_FALSE(result.has_value());
  EXPECT_FALSE(static_cast<bool>(result));
  EXPECT_STREQ(result.error().field, "input_gain");
  EXPECT_EQ(result.error().value, 0.0);
  EXPECT_STREQ(result.error().rule, "must not be zero");
}

TEST(Expected, FallsBack) {
  EXPECT_EQ(Result(std::string("good")).value_or("other"), "good");
  EXPECT_EQ(Result(refused).value_or("other"), "other");
}

TEST(Expected, ChainsOnSuccessOnly) {
  int calls = 0;
  const auto length = [&](const std::string& text) -> Expected<std::size_t, Error<double>> {
    ++calls;
    return text.size();
  };
  EXPECT_EQ(Result(std::string("four")).and_then(length).value(), 4u);
  EXPECT_EQ(calls, 1);
  const auto passed_on = Result(refused).and_then(length);
  EXPECT_EQ(calls, 1);
  EXPECT_STREQ(passed_on.error().field, "input_gain");
}

TEST(Expected, MovesWhatCannotBeCopied) {
  Expected<std::unique_ptr<int>, Error<double>> result = std::make_unique<int>(7);
  EXPECT_EQ(**result, 7);
  const std::unique_ptr<int> taken = std::move(result).value();
  EXPECT_EQ(*taken, 7);
  Expected<std::unique_ptr<int>, Error<double>> again = std::make_unique<int>(8);
  const std::unique_ptr<int> dereferenced = *std::move(again);
  EXPECT_EQ(*dereferenced, 8);
  // What is copied as bytes, but only by a move; and an error.
  struct Handle {
    explicit Handle(int given) : number(given) {}
    Handle(Handle&&) = default;
    Handle& operator=(Handle&&) = default;
    int number;
  };
  static_assert(std::is_trivially_copyable_v<Handle>);
  Expected<Handle, Error<double>> handle = Handle(9);
  handle = Handle(10);
  EXPECT_EQ(std::move(handle).value().number, 10);
  const Expected<void, std::unique_ptr<int>> reason = std::make_unique<int>(11);
  EXPECT_EQ(*reason.error(), 11);
}

TEST(Expected, IsAssignedTheOtherKind) {
  Expected<int, Error<double>> number = 5;
  Expected<int, Error<double>> other = refused;
  std::swap(number, other);
  EXPECT_STREQ(number.error().field, "input_gain");
  EXPECT_EQ(*other, 5);
  number = other;
  EXPECT_EQ(*number, 5);
}

TEST(Expected, OfNothing) {
  EXPECT_TRUE(Outcome().has_value());
  EXPECT_TRUE(static_cast<bool>(Outcome()));
  Outcome().value();
  const Outcome bad = refused;
  EXPECT_FALSE(bad.has_value());
  EXPECT_FALSE(static_cast<bool>(bad));
  EXPECT_STREQ(bad.error().field, "input_gain");
}

TEST(ExpectedDeathTest, ValueOfAnErrorSaysWhichAndEndsTheProgram) {
  const Result bad = refused;
  EXPECT_DEATH((void)bad.value(), "input_gain = 0: must not be zero");
  EXPECT_DEATH((void)*bad, "input_gain");
  EXPECT_DEATH((void)bad->size(), "input_gain");
  EXPECT_DEATH((void)Result(refused).value(), "input_gain");
  EXPECT_DEATH(Outcome(refused).value(), "input_gain = 0: must not be zero");
  const Expected<int, Error<float>> indexed =
      Error<float>{"poles", 2.5f, "is bad, limit", 3, 1.0f, true};
  EXPECT_DEATH((void)indexed.value(), "poles\\[3\\] = 2.5: is bad, limit 1");
}

TEST(ExpectedDeathTest, ErrorOfAValueEndsTheProgram) {
  EXPECT_DEATH((void)Result(std::string("good")).error(), "");
  EXPECT_DEATH((void)Outcome().error(), "");
}

/// Its move throws.
struct Thrown {
  explicit Thrown(int) {}
  Thrown(Thrown&&) { throw 1; }
  Thrown& operator=(Thrown&&) { throw 1; }
  Thrown(const Thrown&) {}
  Thrown& operator=(const Thrown&) { return *this; }
};

TEST(ExpectedDeathTest, ErrorAfterAnAssignmentThatThrewEndsTheProgram) {
  const Thrown given(0);
  Expected<Thrown, Error<double>> result = refused;
  const Expected<Thrown, Error<double>> value = given;
  try {
    result = Expected<Thrown, Error<double>>(value);
  } catch (int) {
  }
  EXPECT_FALSE(result.has_value());
  EXPECT_DEATH((void)result.error(), "");
  EXPECT_DEATH((void)result.value(), "");
}

TEST(Expected, IsUsableAtCompileTime) {
  using Number = Expected<int, int*>;
  static_assert(Number(3).value() == 3);
  static_assert(!std::is_convertible_v<Number, bool>, "only explicitly");
  static_assert(std::is_same_v<Number::value_type, int>);
  static_assert(std::is_same_v<Outcome::value_type, void>);
}

TEST(ErrorText, NamesFieldValueAndRule) {
  EXPECT_EQ(to_text(refused), "input_gain = 0: must not be zero");
  EXPECT_EQ(to_text(Error<float>{"poles", -1.5f, "must be so", 2}), "poles[2] = -1.5: must be so");
  EXPECT_EQ(to_text(Error<double>{"alpha", 1.0, "must be finite and above", -1, 1.25, true}),
            "alpha = 1: must be finite and above 1.25");
  std::ostringstream out;
  out << refused << ';';
  EXPECT_EQ(out.str(), "input_gain = 0: must not be zero;");
}

/// Takes C strings and nothing else: what a logger of firmware may be.
struct Logger {
  std::string text;
  Logger& operator<<(const char* more) {
    text += more;
    return *this;
  }
};

struct Opaque {};

template <class Stream, class T>
concept Writes = requires(Stream& out, const T& value) {
  out << value;
};

TEST(Expected, IsWrittenAsItsErrorOrItsValue) {
  EXPECT_EQ(to_text(Result(refused)), "input_gain = 0: must not be zero");
  EXPECT_EQ(to_text(Result(std::string("good"))), "good");
  EXPECT_EQ(to_text(Outcome()), "ok");
  EXPECT_EQ(to_text(Outcome(refused)), "input_gain = 0: must not be zero");
  EXPECT_EQ(to_text(Expected<Opaque, Error<double>>(Opaque{})), "ok");
  Logger log;
  log << Expected<Opaque, const char*>("no memory");
  EXPECT_EQ(log.text, "no memory");
  static_assert(Writes<std::ostream, Result> && Writes<std::ostream, Error<float>>);
  static_assert(!Writes<Logger, Error<double>>, "it takes no numbers");
  static_assert(!Writes<std::ostream, Error<Opaque>>, "nobody can write its value");
  static_assert(!Writes<int, Error<double>> && !Writes<int, Result>);
}

TEST(Expected, ValueOfATemporaryOutlivesIt) {
  const auto make = [] { return Expected<std::vector<int>, Error<double>>(std::vector{1, 2, 3}); };
  int sum = 0;
  for (const int x : make().value()) sum += x;
  for (const int x : *make()) sum += x;
  EXPECT_EQ(sum, 12);
  static_assert(std::is_same_v<decltype(make().value()), std::vector<int>>);
}

}  // namespace core_expected_test
