// Parts of a study and their records: any cut gives the bits of the whole; what is cut off,
// changed, foreign or there twice; what goes on where it was killed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/monte_carlo.hpp>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <random>
#include <span>
#include <sstream>
#include <string>
#include <support/refusal.hpp>
#include <tuple>
#include <utility>
#include <vector>

namespace sim_study_records_test {

using namespace esokit;
using esokit_test::refusal;
using Controller = Adrc<LinearEso<1>>;
using Plant = LinearPlant<1>;
using Config = sim::MonteCarloConfig<Plant, Controller>;
using sim::StudyRecords;

constexpr double T = 1e-2;
// Three blocks, the last one short, and not a multiple of batches, of packs or of parts.
constexpr std::int64_t runs = 2 * 4096 + 1003;

Config config() {
  return {.runs = runs, .loop = {.duration = 5 * T, .reference = 1.0, .noise = 1e-2, .seed = 52}};
}
Plant plant(double gain = 2.0) {
  return Plant::chain({.coefficients = {0.5}, .input_gain = gain}).value();
}
Controller adrc(double bandwidth = 5.0) {
  return Controller::make(
             {.observer = {.observer_bandwidth = 20, .input_gain = 2, .sample_time = T},
              .controller_bandwidth = bandwidth})
      .value();
}
constexpr auto vary = [](auto& trial, sim::Draw& draw) -> Check<double> {
  trial.plant.b(0) *= draw.uniform_ratio(0.5, 2.0);
  if (draw.run() % 1500 == 1400) return Error<double>{"design", 3.0, "was refused"};
  return {};
};
const auto error = [](const auto& sample) { return sample.output - sample.reference; };
const auto largest = sim::largest("largest error, of y", error, {.limit = 0.0});
const auto mean_input = sim::average("u", [](const auto& sample) { return sample.input; });

auto study(Config of = config()) { return sim::monte_carlo(plant(), adrc(), std::move(of), vary); }

using Outcome = sim::MonteCarloOutcome<double>;
void expect_same(const Outcome& a, const Outcome& b) {
  EXPECT_EQ(a.runs, b.runs);
  EXPECT_EQ(a.failed, b.failed);
  EXPECT_EQ(a.failures, b.failures);
  EXPECT_EQ(a.first_failure.run, b.first_failure.run);
  EXPECT_STREQ(a.first_failure.error.rule, b.first_failure.error.rule);
  ASSERT_EQ(a.numbers.size(), b.numbers.size());
  for (std::size_t k = 0; k < a.numbers.size(); ++k) {
    EXPECT_TRUE(a.numbers[k].sums() == b.numbers[k].sums());
    std::vector<std::pair<std::uint64_t, std::uint64_t>> bins[2];
    a.numbers[k].each_bin([&](auto bin, auto count) { bins[0].push_back({bin, count}); });
    b.numbers[k].each_bin([&](auto bin, auto count) { bins[1].push_back({bin, count}); });
    EXPECT_EQ(bins[0], bins[1]);
    for (const double share : {0.0, 0.013, 0.5, 0.99, 1.0}) {
      EXPECT_EQ(a.numbers[k].quantile(share), b.numbers[k].quantile(share));
    }
    EXPECT_EQ(a.numbers[k].name(), b.numbers[k].name());
    EXPECT_EQ(a.numbers[k].limit(), b.numbers[k].limit());
  }
}
Outcome whole() {
  static const Outcome once = study().run(largest, mean_input).value();
  return once;
}
std::string text_of(const StudyRecords& records) {
  std::ostringstream text;
  records.write(text);
  return text.str();
}
Expected<StudyRecords, Error<double>> read(const std::string& text) {
  std::istringstream in(text);
  return StudyRecords::read(in);
}
StudyRecords all_records() {
  static const StudyRecords once = [] {
    StudyRecords records;
    study().run_part(records, {}, largest, mean_input).value();
    return records;
  }();
  return once;
}

/// A file that is gone afterwards.
struct File {
  std::string name = (std::filesystem::temp_directory_path() /
                      ("esokit_study_records_test_" + std::to_string(std::random_device{}())))
                         .string();
  File() { std::filesystem::remove(name); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  ~File() { std::filesystem::remove(name); }
  [[nodiscard]] std::string text() const {
    std::ifstream in(name, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void put(const std::string& text) const { std::ofstream(name, std::ios::binary) << text; }
};

TEST(StudyRecords, AnyCutGivesTheWholeBitForBit) {
  const Outcome one = whole();
  EXPECT_EQ(one.runs, runs);
  EXPECT_EQ(one.failed, 6);
  EXPECT_EQ(one.failures, (std::vector<std::int64_t>{1400, 2900, 4400, 5900, 7400, 8900}));
  std::mt19937 dice(1);
  for (int i = 0; i < 6; ++i) {
    Config of = config();
    of.threads = 1 + static_cast<int>(dice() % 3);
    const auto count = static_cast<std::int64_t>(1 + dice() % 5);
    std::vector<std::int64_t> order;
    for (std::int64_t k = 0; k < count; ++k) order.push_back(k);
    std::shuffle(order.begin(), order.end(), dice);
    StudyRecords joined;
    std::int64_t computed = 0;
    of.on_run = [&](std::int64_t, std::span<const double>) { ++computed; };
    for (const std::int64_t k : order) {
      StudyRecords part;
      const auto of_part = study(of);
      const auto ok = i % 2 == 0 ? of_part.run_part<4>(part, {k, count}, largest, mean_input)
                                 : of_part.run_part<1>(part, {k, count}, largest, mean_input);
      ASSERT_TRUE(ok);
      // By way of a file.
      const auto sent = read(text_of(part));
      ASSERT_TRUE(sent);
      EXPECT_EQ(sent->damaged(), 0);
      if (joined.identity().runs == 0) joined = StudyRecords(sent->identity());
      ASSERT_TRUE(joined.add(*sent));
    }
    EXPECT_EQ(computed, runs);
    expect_same(study().outcome(joined, largest, mean_input).value(), one);
  }
}

/// Cut into three, by way of texts, and whole.
template <class P, class C>
void cuts_give_the_whole(const P& of_plant, const C& of_controller,
                         const sim::MonteCarloConfig<P, C>& of, bool in_packs) {
  const auto one = sim::monte_carlo(of_plant, of_controller, of);
  const auto all = one.run(largest, mean_input);
  ASSERT_TRUE(all) << refusal(all);
  EXPECT_EQ(all->lanes > 1, in_packs && default_lanes<typename C::scalar_type> > 1);
  std::ostringstream text;
  for (int k = 0; k < 3; ++k) {
    StudyRecords part;
    ASSERT_TRUE(one.run_part(part, {k, 3}, largest, mean_input));
    part.write(text);
  }
  const auto joined = one.outcome(read(text.str()).value(), largest, mean_input);
  ASSERT_TRUE(joined) << refusal(joined);
  EXPECT_EQ(joined->runs, all->runs);
  for (std::size_t k = 0; k < 2; ++k) EXPECT_TRUE(joined->numbers[k] == all->numbers[k]);
}

// Also float, a negative b0, loops that run one by one, and one with all that may go wrong.
TEST(StudyRecords, AnyKindOfStudyMayBeCut) {
  using Float = Adrc<LinearEso<1, float>>;
  using FloatPlant = LinearPlant<1, float>;
  const auto in_float =
      Float::make(
          {.observer = {.observer_bandwidth = 20.0f, .input_gain = -2.0f, .sample_time = 0.01f},
           .controller_bandwidth = 5.0f,
           .limits = {.lower = -1.0f, .upper = 2.0f}})
          .value();
  cuts_give_the_whole(
      FloatPlant::chain({.coefficients = {0.5f}, .input_gain = -2.0f}).value(), in_float,
      {.runs = 9000,
       .loop = {.duration = 0.05f, .reference = 1.0f, .noise = 0.01f, .missing = 0.2f}},
      true);
  Config of = config();
  of.loop.jitter = 0.3;
  cuts_give_the_whole(plant(), adrc(), of, false);
  of = config();
  of.loop.missing = 0.3;
  of.loop.dead_time = 0.7 * T;
  of.loop.sensor = [](double, double y) { return std::round(100.0 * y) / 100.0; };
  of.loop.disturbance = [](double t) { return t < 2.5 * T ? 0.0 : 3.0; };
  cuts_give_the_whole(plant(), adrc(), of, true);
}

// Wherever a file ends, its whole records are kept and no other.
TEST(StudyRecords, KeepsWhatIsWholeOfATextThatIsCutOff) {
  const std::string text = text_of(all_records());
  std::vector<std::size_t> ends;  // of the records
  for (std::size_t at = text.find("\nend "); at != std::string::npos;
       at = text.find("\nend ", at + 1)) {
    ends.push_back(text.find('\n', at + 1));
  }
  ASSERT_EQ(ends.size(), 3u);
  for (std::size_t length = 0; length < text.size(); length += length < 150 ? 1 : 97) {
    const auto part = read(text.substr(0, length));
    ASSERT_TRUE(part) << length << refusal(part);
    const auto whole_ones =
        std::count_if(ends.begin(), ends.end(), [&](std::size_t end) { return end <= length; });
    EXPECT_EQ(part->blocks().size(), static_cast<std::size_t>(whole_ones)) << length;
    EXPECT_EQ(part->identity().runs, whole_ones > 0 ? runs : 0) << length;
    StudyRecords joined(all_records().identity());
    ASSERT_TRUE(joined.add(*part));
    EXPECT_EQ(joined.missing().size(), 3 - static_cast<std::size_t>(whole_ones));
  }
}

// A byte that changed on the way leaves out a record or refuses the text; no result changes.
TEST(StudyRecords, NeverTakesAChangedRecord) {
  const std::string text = text_of(all_records());
  std::mt19937 dice(2);
  int refused = 0, left_out = 0;
  for (int i = 0; i < 400; ++i) {
    std::string changed = text;
    const std::size_t at = dice() % text.size();
    switch (i % 3) {
      case 0:
        changed[at] = static_cast<char>(dice() % 256);
        break;
      case 1:
        changed.erase(at, 1 + dice() % 40);
        break;
      default:
        changed.insert(at, std::string(1 + dice() % 3, static_cast<char>('0' + dice() % 10)));
    }
    const auto now = read(changed);
    if (!now) {
      ++refused;
      continue;
    }
    const StudyRecords original = all_records();
    for (const auto& [block, record] : now->blocks()) {
      const auto& before = original.blocks().at(block);
      ASSERT_TRUE(record == before) << i;
    }
    left_out += now->missing().empty() ? 0 : 1;
  }
  EXPECT_GT(left_out, 300);
  EXPECT_LT(refused, 50);
}

TEST(StudyRecords, GoesOnWhereItWasKilled) {
  const File file;
  const auto first = study().run_part(file.name, {}, largest, mean_input);
  ASSERT_TRUE(first);
  const std::string text = file.text();
  EXPECT_EQ(text, text_of(*first));
  // In the middle of the second record.
  const std::size_t second = text.find("\nblock 1 ");
  file.put(text.substr(0, second + 400));
  Config of = config();
  std::vector<std::int64_t> computed;
  of.on_run = [&](std::int64_t run, std::span<const double>) { computed.push_back(run); };
  const auto again = study(of).run_part(file.name, {}, largest, mean_input);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->damaged(), 1);
  EXPECT_EQ(computed.size(), static_cast<std::size_t>(runs - 4096));
  EXPECT_EQ(computed.front(), 4096);
  expect_same(study().outcome(*again, largest, mean_input).value(), whole());
  // And once more: all is there now.
  computed.clear();
  const auto read_again = study(of).run_part(file.name, {}, largest, mean_input);
  ASSERT_TRUE(read_again);
  EXPECT_TRUE(computed.empty());
  expect_same(study().outcome(*read_again, largest, mean_input).value(), whole());
  // Killed in its first lines.
  for (const std::size_t length : {0u, 1u, 30u, 60u}) {
    file.put(text.substr(0, length));
    ASSERT_TRUE(study().run_part(file.name, {}, largest, mean_input));
    EXPECT_EQ(file.text(), text);
  }
  // Another file by mistake: it stays.
  file.put("time,y\n");
  EXPECT_EQ(refusal(study().run_part(file.name, {}, largest, mean_input)),
            "records: must begin as esokit wrote them: esokit-runs 2 ..");
  EXPECT_EQ(file.text(), "time,y\n");
  EXPECT_EQ(refusal(study().run_part("/nowhere/records", {}, largest, mean_input)),
            "file: cannot be written");
}

TEST(StudyRecords, NamesWhatIsMissing) {
  StudyRecords part;
  study().run_part(part, {1, 3}, largest, mean_input).value();
  EXPECT_EQ(part.missing(), (std::vector<std::int64_t>{0, 2}));
  EXPECT_TRUE(part.missing({1, 3}).value().empty());
  EXPECT_EQ(refusal(part.missing({1, 0})), "part.count: must be 1 .. 1000000");
  EXPECT_EQ(refusal(part.missing({3, 3})), "part.index: must be 0 .. count - 1");
  const auto none = study().outcome(part, largest, mean_input);
  EXPECT_EQ(refusal(none), "records.block: is missing; blocks in all:");
  EXPECT_EQ(none.error().value, 0.0);
  EXPECT_EQ(none.error().limit, 2.0);
}

TEST(StudyRecords, RefusesForeignOnes) {
  const StudyRecords own = all_records();
  const auto answer = [&](const auto& other, const auto&... measures) {
    StudyRecords records = own;
    const std::string said = refusal(other.run_part(records, {}, measures...));
    EXPECT_EQ(said, refusal(other.outcome(own, measures...)));
    const File file;  // which is not touched
    file.put(text_of(own));
    EXPECT_EQ(said, refusal(other.run_part(file.name, {}, measures...)));
    EXPECT_EQ(file.text(), text_of(own));
    return said;
  };
  const char* another =
      "records.study: is another one: its program, plant, controller or settings differ from those "
      "of";
  const char* measures = "records.measures: must be those of the study";
  Config of = config();
  of.loop.seed = 53;
  EXPECT_EQ(answer(study(of), largest, mean_input),
            "records.seed: must be the seed of the study, which is");
  of = config();
  of.loop.noise = 1.001e-2;
  EXPECT_EQ(answer(study(of), largest, mean_input), another);
  of = config();
  of.runs = runs + 1;
  EXPECT_EQ(answer(study(of), largest, mean_input),
            "records.runs: must be the number of runs of the study, which is");
  EXPECT_EQ(answer(sim::monte_carlo(plant(2.001), adrc(), config(), vary), largest, mean_input),
            another);
  EXPECT_EQ(answer(sim::monte_carlo(plant(), adrc(5.001), config(), vary), largest, mean_input),
            another);
  EXPECT_EQ(answer(sim::monte_carlo(plant(), adrc(), config()), largest, mean_input), another);
  EXPECT_EQ(answer(study(), largest), measures);
  EXPECT_EQ(answer(study(), mean_input, largest), measures);
  EXPECT_EQ(answer(study(), sim::largest("largest error, of y", error, {.limit = 0.1}), mean_input),
            measures);
  EXPECT_EQ(answer(study(), sim::largest("largest error, of y", error, {.from = T, .limit = 0.0}),
                   mean_input),
            another);
  // The same, from a machine with another exp.
  auto identity = own.identity();
  identity.machine ^= 1;
  StudyRecords elsewhere(identity);
  StudyRecords here = own;
  const char* machine =
      "records.machine: is of another kind: its exp, sin or pow, or its sums of products, differ "
      "from those of";
  EXPECT_EQ(refusal(here.add(elsewhere)), machine);
  EXPECT_EQ(refusal(study().run_part(elsewhere, {}, largest, mean_input)), machine);
  // Not of a study at all.
  EXPECT_EQ(refusal(read("time,y,u\n1,2,3\n")),
            "records: must begin as esokit wrote them: esokit-runs 2 ..");
  // Settings are refused as by `run`.
  of.runs = 0;
  StudyRecords none;
  EXPECT_EQ(refusal(study(of).run_part(none, {}, largest)), "runs: must be 1 or more");
}

TEST(StudyRecords, RefusesABlockWithTwoResults) {
  StudyRecords records = all_records();
  sim::BlockRecord block = records.blocks().at(1);
  EXPECT_TRUE(records.add(block));
  EXPECT_EQ(records.blocks().size(), 3u);
  sim::RunSums sums = block.numbers[1].sums();
  sums.mean = std::nextafter(sums.mean, 9.0);
  block.numbers[1].set_sums(sums);
  EXPECT_EQ(refusal(records.add(block)), "records.block: is there twice, and differs");
  // As many results, of other runs.
  block = records.blocks().at(1);
  block.failed.back() += 1;
  EXPECT_EQ(refusal(records.add(block)), "records.block: is there twice, and differs");
  for (const std::int64_t wrong : {-1, 3}) {
    block.block = wrong;
    EXPECT_EQ(refusal(records.add(block)), "records.block: must be one of the study");
  }
  // Two records in one file.
  std::ostringstream text;
  text << text_of(all_records());
  all_records().write(text, all_records().blocks().at(2));
  EXPECT_EQ(refusal(read(text.str())), "records.block: is there twice: join each part once");
  text.str({});
  text << text_of(all_records());
  block = all_records().blocks().at(2);
  sums = block.numbers[0].sums();
  sums.mean = std::nextafter(sums.mean, 9.0);
  block.numbers[0].set_sums(sums);
  all_records().write(text, block);
  EXPECT_EQ(refusal(read(text.str())), "records.block: is there twice, and differs");
}

/// The text of a part.
std::string part_text(const sim::Part& part, const Config& of = config()) {
  StudyRecords records;
  study(of).run_part(records, part, largest, mean_input).value();
  return text_of(records);
}

// `cat` of files: which study a record is of, it says itself.
TEST(StudyRecords, AreJoinedByCatInAnyOrder) {
  std::vector<std::string> parts;
  for (int k = 0; k < 3; ++k) parts.push_back(part_text({k, 3}));
  std::vector<int> order{0, 1, 2};
  do {
    std::string all;
    for (const int k : order) all += parts[static_cast<std::size_t>(k)];
    const auto joined = read(all);
    ASSERT_TRUE(joined) << refusal(joined);
    EXPECT_TRUE(joined->blocks() == all_records().blocks());
    expect_same(study().outcome(*joined, largest, mean_input).value(), whole());
  } while (std::next_permutation(order.begin(), order.end()));
  // The same part twice, at either place.
  for (const auto& [a, b, c] : {std::tuple{0, 0, 1}, {0, 1, 0}, {2, 1, 1}}) {
    const auto twice =
        read(parts.at(static_cast<std::size_t>(a)) + parts.at(static_cast<std::size_t>(b)) +
             parts.at(static_cast<std::size_t>(c)));
    EXPECT_EQ(refusal(twice), "records.block: is there twice: join each part once");
    EXPECT_EQ(twice.error().value, a == 2 ? 1 : 0);
  }
  // Lines that passed through Windows, empty lines between.
  std::string windows;
  for (const char c : parts[0] + "\n\n" + parts[2] + parts[1]) {
    if (c == '\n') windows += '\r';
    windows += c;
  }
  const auto from_windows = read(windows);
  ASSERT_TRUE(from_windows) << refusal(from_windows);
  EXPECT_EQ(from_windows->damaged(), 0);
  EXPECT_TRUE(from_windows->blocks() == all_records().blocks());
  EXPECT_EQ(text_of(*from_windows), text_of(all_records()));
  // One that was cut off, before another, with or without an end of its last line.
  for (const char* end : {"", "\n", "\r\n"}) {
    for (const std::size_t left : {14u, 45u, 70u, 300u}) {
      const auto cut = read(parts[0].substr(0, left) + end + parts[1] + parts[2]);
      ASSERT_TRUE(cut) << left << refusal(cut);
      EXPECT_GE(cut->blocks().size(), *end == 0 ? 1u : 2u) << left;
      EXPECT_FALSE(cut->blocks().contains(0));
      for (const auto& [block, record] : cut->blocks()) {
        EXPECT_TRUE(record == all_records().blocks().at(block));
      }
    }
  }
}

// Of two studies, whichever comes first, also if what one begins with was cut off.
TEST(StudyRecords, RefusesTheCatOfTwoStudies) {
  const std::string own = part_text({0, 3}) + part_text({1, 3});
  Config of = config();
  const auto answer = [&](const std::string& foreign) {
    const auto behind = read(own + foreign), before = read(foreign + own);
    EXPECT_FALSE(behind);
    EXPECT_FALSE(before);
    if (behind || before) return std::string("accepted");
    EXPECT_EQ(refusal(behind), refusal(before));
    // Both are named: what is found, and what it should be.
    EXPECT_TRUE(behind.error().has_limit);
    EXPECT_EQ(behind.error().value, before.error().limit);
    EXPECT_EQ(behind.error().limit, before.error().value);
    EXPECT_NE(behind.error().value, behind.error().limit);
    // Cut off in its first record, the second one says it.
    const auto cut = read(own + foreign.substr(foreign.find("sums")));
    EXPECT_EQ(cut.has_value(), foreign.find("esokit-runs", 20) == std::string::npos);
    return refusal(behind);
  };
  of.loop.seed = 53;
  EXPECT_EQ(answer(part_text({2, 3}, of)), "records.seed: must be the seed of the study, which is");
  EXPECT_EQ(answer(part_text({1, 2}, of)), "records.seed: must be the seed of the study, which is");
  of = config();
  of.loop.reference = 1.001;
  EXPECT_EQ(answer(part_text({2, 3}, of)),
            "records.study: is another one: its program, plant, controller or settings differ from "
            "those of");
  of = config();
  of.runs = runs + 1;
  EXPECT_EQ(answer(part_text({2, 3}, of)),
            "records.runs: must be the number of runs of the study, which is");
  StudyRecords elsewhere = [&] {
    auto identity = all_records().identity();
    identity.machine ^= 1;
    StudyRecords records(identity);
    EXPECT_TRUE(records.add(all_records().blocks().at(2)));
    return records;
  }();
  EXPECT_EQ(answer(text_of(elsewhere)),
            "records.machine: is of another kind: its exp, sin or pow, or its sums of products, "
            "differ from those of");
  // What version 1 wrote named the study at the head of a file alone.
  const auto old = read("esokit-runs 1 a62b3c 77de 9195 1\nmeasure 0 u\nblock 0 0\n");
  EXPECT_EQ(
      refusal(old),
      "records.format: is that of another release: compute the parts again, with one of format");
  EXPECT_EQ(old.error().value, 1);
  EXPECT_EQ(old.error().limit, 2);
  const auto behind = read(own + "esokit-runs 1 a62b3c 77de 9195 1\nmeasure 0 u\n");
  EXPECT_EQ(refusal(behind), refusal(old));
  std::ifstream nowhere("/nowhere/records");
  EXPECT_EQ(refusal(StudyRecords::read(nowhere)), "records: cannot be read");
}

TEST(Part, IsReadFromAText) {
  const auto part = sim::Part::parse("3/8").value();
  EXPECT_EQ(part.index, 3);
  EXPECT_EQ(part.count, 8);
  for (const char* text : {"", "3", "3/", "/8", "3/8x", "3.0/8", " 3/8", "a/8", "3//8", "3/8 "}) {
    EXPECT_EQ(refusal(sim::Part::parse(text)), "part: must be two whole numbers, as in 3/8")
        << text;
  }
  EXPECT_EQ(refusal(sim::Part::parse("8/8")), "part.index: must be 0 .. count - 1");
  EXPECT_EQ(refusal(sim::Part::parse("-1/8")), "part.index: must be 0 .. count - 1");
  EXPECT_TRUE(sim::Part::parse("7/8"));
  EXPECT_EQ(refusal(sim::Part::parse("0/0")), "part.count: must be 1 .. 1000000");
  EXPECT_TRUE(sim::Part::parse("999999/1000000"));
  EXPECT_EQ(refusal(sim::Part::parse("0/1000001")), "part.count: must be 1 .. 1000000");
  StudyRecords records;
  EXPECT_EQ(refusal(study().run_part(records, {2, 2}, largest)),
            "part.index: must be 0 .. count - 1");
}

// A record that lacks a result would count as a whole block.
TEST(StudyRecords, RefusesABlockThatIsNotWhole) {
  StudyRecords none(all_records().identity());
  const char* rule = "records.block: must have a result of each measure for each run";
  const sim::BlockRecord whole_one = all_records().blocks().at(2);
  sim::BlockRecord block = whole_one;
  block.failed.push_back(8200);
  EXPECT_EQ(refusal(none.add(block)), rule);
  block = whole_one;
  block.failed.pop_back();
  EXPECT_EQ(refusal(none.add(block)), rule);
  block = whole_one;
  block.numbers.pop_back();
  EXPECT_EQ(refusal(none.add(block)), rule);
  block = whole_one;
  std::swap(block.numbers[0], block.numbers[1]);
  EXPECT_EQ(refusal(none.add(block)), rule);
  block = whole_one;
  block.numbers[0] = sim::RunStatistics(whole_one.numbers[0].name(), 0.1);
  block.numbers[0].set_sums(whole_one.numbers[0].sums());
  EXPECT_EQ(refusal(none.add(block)), rule);
  block = whole_one;  // the short last block as another one
  block.block = 0;
  EXPECT_EQ(refusal(none.add(block)), rule);
  EXPECT_TRUE(none.blocks().empty());
  EXPECT_TRUE(none.add(whole_one));
}

// Joined are the results that there would be at once: counts, quantiles, and of equal extremes the
// first run.
TEST(RunStatistics, JoinedInPiecesEqualAddedAtOnce) {
  std::mt19937_64 dice(3);
  for (int trial = 0; trial < 200; ++trial) {
    sim::RunStatistics whole("x", 0.5), joined("x", 0.5), piece("x", 0.5);
    const auto results = static_cast<std::int64_t>(1 + dice() % 40);
    for (std::int64_t run = 0; run < results; ++run) {
      const double value = std::ldexp(static_cast<double>(dice() % 7) - 3.0, -2);  // many are equal
      whole.add(run, value);
      piece.add(run, value);
      if (dice() % 5 == 0) {
        joined.join(piece);
        piece = sim::RunStatistics("x", 0.5);
      }
    }
    joined.join(piece);
    ASSERT_EQ(joined.count(), whole.count());
    EXPECT_EQ(joined.kept(), whole.kept());
    EXPECT_EQ(joined.smallest(), whole.smallest());
    EXPECT_EQ(joined.run_of_smallest(), whole.run_of_smallest());
    EXPECT_EQ(joined.largest(), whole.largest());
    EXPECT_EQ(joined.run_of_largest(), whole.run_of_largest());
    EXPECT_NEAR(joined.mean(), whole.mean(), 1e-14);
    EXPECT_NEAR(joined.deviation(), whole.deviation(), 1e-13);
    for (int k = 0; k <= 20; ++k) EXPECT_EQ(joined.quantile(k / 20.0), whole.quantile(k / 20.0));
  }
}

// Every run is in one block, every block in one part, for any numbers.
TEST(Blocks, CoverAllRuns) {
  EXPECT_EQ(sim::runs_in_block(1), 4096);
  EXPECT_EQ(sim::runs_in_block(std::int64_t{4096} * 4096), 4096);
  EXPECT_EQ(sim::runs_in_block(std::int64_t{4096} * 4096 + 1), 8192);
  EXPECT_EQ(sim::block_count(4096), 1);
  EXPECT_EQ(sim::block_count(4097), 2);
  std::mt19937_64 dice(3);
  for (int i = 0; i < 2000; ++i) {
    const auto all = static_cast<std::int64_t>(dice() >> (1 + dice() % 62)) + 1;
    const std::int64_t size = sim::runs_in_block(all), blocks = sim::block_count(all);
    ASSERT_TRUE(blocks >= 1 && blocks <= 4096) << all;
    ASSERT_TRUE((all - 1) / size == blocks - 1) << all;
    if (i > 100) continue;
    const StudyRecords none(sim::StudyIdentity{.runs = all});
    const auto count = static_cast<std::int64_t>(1 + dice() % 9);
    std::int64_t next = 0;
    for (std::int64_t k = 0; k < count; ++k) {
      for (const std::int64_t block : none.missing({k, count}).value()) ASSERT_EQ(block, next++);
    }
    ASSERT_EQ(next, blocks);
  }
}

// Joined sums are those of all, wherever they are cut; the extremes and counts to the bit.
TEST(RunSums, AreJoinedAnywhere) {
  constexpr double epsilon = std::numeric_limits<double>::epsilon();
  std::mt19937_64 dice(4);
  for (int i = 0; i < 200; ++i) {
    const double offset = i % 3 == 0 ? 1e6 : 0.0;
    sim::Draw draw(5, i);
    sim::RunSums one, joined, part;
    const int count = static_cast<int>(dice() % 3000) + 1;
    long double sum = 0, squares = 0;
    std::vector<double> all;
    for (int run = 0; run < count; ++run) {
      const double x = offset + draw.normal();
      all.push_back(x);
      sum += x;
      one.add(run, x, offset);
      part.add(run, x, offset);
      if (dice() % 200 == 0) {
        joined.join(part);
        part = {};
      }
    }
    joined.join(part);
    joined.join({});
    const long double mean = sum / count;
    for (const double x : all) squares += (x - mean) * (x - mean);
    EXPECT_EQ(joined.count, one.count);
    EXPECT_EQ(joined.kept, one.kept);
    EXPECT_EQ(joined.smallest, one.smallest);
    EXPECT_EQ(joined.run_of_smallest, one.run_of_smallest);
    EXPECT_EQ(joined.largest, one.largest);
    EXPECT_EQ(joined.run_of_largest, one.run_of_largest);
    EXPECT_NEAR(joined.mean, static_cast<double>(mean), 1e-13 * (1 + offset));
    EXPECT_NEAR(joined.squares, static_cast<double>(squares),
                1e-12 * static_cast<double>(squares) + 4.0 * epsilon * count * offset);
  }
}

}  // namespace sim_study_records_test
