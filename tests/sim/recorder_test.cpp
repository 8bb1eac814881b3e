// Recorder: files read back to the same bits, nothing is lost in silence.
#include <gtest/gtest.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <esokit/sim/decimation.hpp>
#include <esokit/sim/recorder.hpp>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

namespace {

using namespace esokit::sim;

// Named by the test as well: ctest runs the tests side by side.
std::string temporary(const char* name) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  return testing::TempDir() + "/esokit_recorder_" + test->name() + "_" + name + ".csv";
}

std::string read_all(const std::string& path) {
  std::ifstream in(path);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

template <class T>
std::vector<T> read_numbers(const std::string& path) {
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  std::vector<T> numbers;
  while (std::getline(in, line)) {
    std::stringstream cells(line);
    std::string cell;
    while (std::getline(cells, cell, ',')) {
      T value{};
      const auto result = std::from_chars(cell.data(), cell.data() + cell.size(), value);
      EXPECT_EQ(result.ptr, cell.data() + cell.size()) << cell;
      numbers.push_back(value);
    }
  }
  return numbers;
}

static_assert(std::is_invocable_v<decltype([](auto& r) -> decltype(r.record(1.0, 2.0)) {
                                    return r.record(1.0, 2.0);
                                  }),
                                  Recorder<2>&>);
static_assert(
    !std::is_invocable_v<decltype([](auto& r) -> decltype(r.record(1.0)) { return r.record(1.0); }),
                         Recorder<2>&>);

TEST(Recorder, WritesHeaderAndRows) {
  auto recorder = Recorder<3>::make({.names = {"t", "y", "u"}, .capacity = 10}).value();
  EXPECT_TRUE(recorder.record(0.0, 0.1, -2));
  EXPECT_TRUE(recorder.record(0.001, 1e-300, 1e22));
  const std::string path = temporary("header");
  ASSERT_TRUE(recorder.write_csv(path));
  EXPECT_EQ(read_all(path), "t,y,u\n0,0.1,-2\n0.001,1e-300,1e+22\n");
}

template <class T, class Bits>
void expect_round_trip() {
  const std::size_t rows = 5000;
  auto recorder = Recorder<2, T>::make({.names = {"a", "b"}, .capacity = rows}).value();
  std::mt19937_64 engine(11);
  std::vector<T> expected;
  const auto any = [&] {
    T value{};
    do {
      const Bits bits = static_cast<Bits>(engine());
      value = std::bit_cast<T>(bits);
    } while (!std::isfinite(value));
    expected.push_back(value);
    return value;
  };
  for (std::size_t i = 0; i < rows; ++i) {
    const T a = any();
    const T b = any();
    ASSERT_TRUE(recorder.record(a, b));
  }
  const std::string path = temporary("round_trip");
  ASSERT_TRUE(recorder.write_csv(path));
  EXPECT_EQ(read_numbers<T>(path), expected);
}

TEST(Recorder, RoundTripOfAnyDouble) { expect_round_trip<double, std::uint64_t>(); }
TEST(Recorder, RoundTripOfAnyFloat) { expect_round_trip<float, std::uint32_t>(); }

TEST(Recorder, WritesWhatIsNotFinite) {
  const double infinity = std::numeric_limits<double>::infinity();
  auto recorder = Recorder<2>::make({.names = {"a", "b"}, .capacity = 1}).value();
  recorder.record(std::numeric_limits<double>::quiet_NaN(), -infinity);
  const std::string path = temporary("not_finite");
  ASSERT_TRUE(recorder.write_csv(path));
  EXPECT_EQ(read_all(path), "a,b\nnan,-inf\n");
}

TEST(Recorder, Columns) {
  auto recorder = Recorder<2>::make({.names = {"t", "y"}, .capacity = 5}).value();
  for (int i = 0; i < 3; ++i) recorder.record(i, 10 * i);
  EXPECT_EQ(recorder.rows(), 3u);
  const auto y = recorder.column<1>();
  EXPECT_EQ(std::vector<double>(y.begin(), y.end()), (std::vector<double>{0, 10, 20}));
  const auto t = recorder.column("t");
  ASSERT_TRUE(t);
  EXPECT_EQ(std::vector<double>(t->begin(), t->end()), (std::vector<double>{0, 1, 2}));
  EXPECT_FALSE(recorder.column("z"));
  recorder.clear();
  EXPECT_EQ(recorder.rows(), 0u);
  EXPECT_TRUE(recorder.column<0>().empty());
}

TEST(Recorder, RowsBeyondTheCapacityAreReported) {
  auto recorder = Recorder<1>::make({.names = {"t"}, .capacity = 2}).value();
  const double* memory = recorder.column<0>().data();
  EXPECT_TRUE(recorder.record(1.0));
  EXPECT_TRUE(recorder.record(2.0));
  EXPECT_FALSE(recorder.record(3.0));
  EXPECT_EQ(recorder.dropped(), 1u);
  EXPECT_EQ(recorder.column<0>().data(), memory);
  const std::string path = temporary("full");
  const auto written = recorder.write_csv(path);
  ASSERT_FALSE(written);
  EXPECT_NE(to_text(written.error()).find("incomplete"), std::string::npos);
  EXPECT_EQ(read_all(path), "t\n1\n2\n");
  recorder.clear();
  recorder.record(4.0);
  EXPECT_TRUE(recorder.write_csv(path));
  EXPECT_EQ(read_all(path), "t\n4\n");
}

TEST(Recorder, FilesThatCannotBeWrittenAreErrors) {
  auto recorder = Recorder<1>::make({.names = {"t"}, .capacity = 200000}).value();
  recorder.record(1.0);
  const auto missing = recorder.write_csv("/no/such/folder/x.csv");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().path, "/no/such/folder/x.csv");
  EXPECT_EQ(missing.error().code, ENOENT);
  EXPECT_NE(to_text(missing.error()).find("No such file"), std::string::npos);
  // One row fits the buffer, so that only the close can fail; many rows fail before.
  EXPECT_FALSE(recorder.write_csv("/dev/full"));
  for (int i = 0; i < 100000; ++i) recorder.record(i);
  const auto full = recorder.write_csv("/dev/full");
  ASSERT_FALSE(full);
  EXPECT_EQ(full.error().code, ENOSPC);
}

TEST(Recorder, ChosenRows) {
  auto recorder = Recorder<1>::make({.names = {"t"}, .capacity = 10}).value();
  for (int i = 0; i < 10; ++i) recorder.record(i);
  const std::string path = temporary("chosen");
  ASSERT_TRUE(recorder.write_csv(path, every_nth(recorder.rows(), 4)));
  EXPECT_EQ(read_all(path), "t\n0\n4\n8\n9\n");
  const std::vector<std::size_t> beyond{0, 10};
  EXPECT_FALSE(recorder.write_csv(path, beyond));
}

TEST(Decimation, EveryNth) {
  using Rows = std::vector<std::size_t>;
  EXPECT_EQ(every_nth(0, 3), Rows{});
  EXPECT_EQ(every_nth(1, 3), Rows{0});
  EXPECT_EQ(every_nth(7, 3), (Rows{0, 3, 6}));
  EXPECT_EQ(every_nth(8, 3), (Rows{0, 3, 6, 7}));
  EXPECT_EQ(every_nth(3, 0), (Rows{0, 1, 2}));
}

TEST(Decimation, KeepsPeaksAndEnds) {
  std::vector<double> values(10000);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = std::sin(0.01 * double(i));
  values[4321] = 50.0;
  values[7777] = -50.0;
  const auto rows = peak_preserving_rows(std::span<const double>(values), 100);
  EXPECT_LE(rows.size(), 202u);
  EXPECT_GE(rows.size(), 100u);
  EXPECT_EQ(rows.front(), 0u);
  EXPECT_EQ(rows.back(), 9999u);
  EXPECT_TRUE(std::is_sorted(rows.begin(), rows.end()));
  EXPECT_TRUE(std::binary_search(rows.begin(), rows.end(), 4321u));
  EXPECT_TRUE(std::binary_search(rows.begin(), rows.end(), 7777u));
  const std::vector<double> few{1.0, 2.0, 3.0};
  EXPECT_EQ(peak_preserving_rows(std::span<const double>(few), 10),
            (std::vector<std::size_t>{0, 1, 2}));
  EXPECT_TRUE(peak_preserving_rows(std::span<const double>(), 10).empty());
}

}  // namespace
