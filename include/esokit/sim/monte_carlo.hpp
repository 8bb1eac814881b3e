/// @file
/// monte_carlo(plant, controller, config, vary): many runs of a loop with different random numbers
/// and plants, on all cores and in the lanes of packs.
#pragma once

#include <algorithm>
#include <bit>
#include <concepts>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/sim/measure.hpp>
#include <esokit/sim/monte_carlo_config.hpp>
#include <esokit/sim/run.hpp>
#include <esokit/sim/statistics.hpp>
#include <esokit/sim/study_records.hpp>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <mutex>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace esokit::sim {

namespace detail {

/// The results of a batch of runs.
template <class Time>
struct RunResults {
  std::int64_t count;
  std::vector<double> numbers;  ///< those of run 0, then of run 1, ..
  std::vector<FailedRun<Time>> failed;
};

/// Computes a run and stores the results of its lanes; an error if one is not finite. No member, as
/// the run is the same whatever varies it.
template <class Time, class Plant, class Control, class... Reduce, class... F>
Check<Time> drive(const Plant& plant, const Control& controller,
                  const RunConfig<Plant, Control>& loop, RunResults<Time>& results, std::int64_t at,
                  int lanes, const Measure<Reduce, F>&... measures) {
  using S = typename RunTypes<Plant, Control>::S;
  std::tuple<Meter<S, Reduce, F>...> meters{Meter<S, Reduce, F>(measures)...};
  const auto end = sim::run(
      plant, controller, loop, [&](const auto& sample, const Control& now) ESOKIT_INLINE_LAMBDA {
        std::apply([&](auto&... meter) { (meter.add(sample, now), ...); }, meters);
      });
  if (!end) return end.error();
  constexpr std::size_t count = sizeof...(measures);
  for (int lane = 0; lane < lanes; ++lane) {
    double numbers[count + 1];
    const char* wrong[count + 1];
    std::size_t i = 0;
    std::apply(
        [&](const auto&... meter) {
          ((numbers[i] = meter.number(lane), wrong[i] = meter.wrong(numbers[i]), ++i), ...);
        },
        meters);
    for (i = 0; i < count; ++i) {
      if (wrong[i] != nullptr) return Error<Time>{"measure", static_cast<Time>(i), wrong[i]};
      results.numbers[static_cast<std::size_t>(at + lane) * count + i] = numbers[i];
    }
  }
  return {};
}

}  // namespace detail

/// Many runs of a loop, see monte_carlo.
template <SampledPlant P, class C, class Vary = NoVariation>
requires ControllerOf<C, P>
class MonteCarlo {
 public:
  using Types = RunTypes<P, C>;             ///< types of the numbers
  using Time = typename Types::Time;        ///< s
  using Config = MonteCarloConfig<P, C>;    ///< settings
  using Outcome = MonteCarloOutcome<Time>;  ///< the result

  /// Number of runs that a thread takes at a time, a part of a block.
  static constexpr std::int64_t batch = 256;

  /// Stores its arguments; runs nothing yet.
  MonteCarlo(P plant, C controller, Config config, Vary vary)
      : plant_(std::move(plant)),
        controller_(std::move(controller)),
        config_(std::move(config)),
        vary_(std::move(vary)) {}

  /// The varied plant, controller, state and noise of a run, or the error of `vary`.
  [[nodiscard]] Expected<Trial<P, C>, Error<Time>> trial(std::int64_t run) const {
    Trial<P, C> one{plant_, controller_, config_.loop.state, config_.loop.noise};
    Draw draw(config_.loop.seed, run);
    using Answer = std::invoke_result_t<const Vary&, Trial<P, C>&, Draw&>;
    if constexpr (std::is_void_v<Answer>) {
      vary_(one, draw);
    } else {
      if (const auto ok = vary_(one, draw); !ok) return detail::as_error<Time>(ok.error());
    }
    return one;
  }

  /// The settings with which sim::run repeats a run with the plant and controller of its trial.
  [[nodiscard]] RunConfig<P, C> settings(std::int64_t run, const Trial<P, C>& trial) const {
    RunConfig<P, C> loop = config_.loop;
    set(loop, run, trial.state, trial.noise);
    return loop;
  }

  /// Repeats one of the runs, for example the worst, and records it.
  [[nodiscard]] Expected<Recording<P, C>, Error<Time>> replay(std::int64_t run) const {
    const auto one = trial(run);
    if (!one) return one.error();
    return sim::run(one->plant, one->controller, settings(run, *one));
  }

  /// Computes all runs. The results are the same for any number of threads and lanes, bit for bit
  /// with -ffp-contract=off (the compiler must not fuse products and sums).
  ///
  /// Runs are computed in packs if plant and controller allow it: all linear plants,
  /// `nonlinear_plant` with functions that take any scalar, and controllers of esokit. Others are
  /// computed one by one, as are loops with jitter, and the runs of a pack in which one fails.
  /// @tparam Lanes runs at once on a thread
  /// @return the outcome, or an error in the settings
  template <int Lanes = default_lanes<LaneScalar<typename Types::S>>, class... Reduce, class... F>
  [[nodiscard]] Expected<Outcome, Error<Time>> run(const Measure<Reduce, F>&... measures) const {
    Work work(*this, all_blocks(), statistics(measures...));
    if (const auto ok = compute<Lanes>(work, measures...); !ok) return ok.error();
    return std::move(work.outcome);
  }

  /// The same, and each run as a line of a table: run, and the number of each Measure under its
  /// name; nan for a run that failed. `csv` becomes the table, with a line of names, and has the
  /// finished runs if the study was stopped. `on_run` is called, too.
  /// @return the outcome, or an error in the settings
  template <int Lanes = default_lanes<LaneScalar<typename Types::S>>, class... Reduce, class... F>
  [[nodiscard]] Expected<Outcome, Error<Time>> run_to_csv(
      std::string& csv, const Measure<Reduce, F>&... measures) const {
    csv = "run";
    const auto name = [&csv](const std::string& text) {
      const bool plain = text.find_first_of(",\"\n") == std::string::npos;
      csv += plain ? "," : ",\"";
      for (const char c : text) csv.append(c == '"' ? 2 : 1, c);
      if (!plain) csv += '"';
    };
    (name(measures.name), ...);
    csv += '\n';
    MonteCarlo study = *this;
    study.config_.on_run = [&](std::int64_t run, std::span<const double> numbers) {
      csv += std::to_string(run);
      for (const double number : numbers) detail::append_number(csv += ',', number);
      csv += '\n';
      if (config_.on_run) config_.on_run(run, numbers);
    };
    return study.template run<Lanes>(measures...);
  }

  /// What tells this study from others: its settings, the measures, the results of its first runs,
  /// and the kind of machine.
  template <int Lanes = default_lanes<LaneScalar<typename Types::S>>, class... Reduce, class... F>
  [[nodiscard]] Expected<StudyIdentity, Error<Time>> identity(
      const Measure<Reduce, F>&... measures) const {
    StudyIdentity of{.machine = machine_probe(), .runs = config_.runs, .seed = config_.loop.seed};
    detail::Hash hash;
    for (const double x :
         {static_cast<double>(config_.loop.duration), static_cast<double>(config_.loop.sample_time),
          static_cast<double>(config_.loop.missing), static_cast<double>(config_.loop.jitter),
          static_cast<double>(config_.loop.dead_time), static_cast<double>(config_.loop.start_time),
          static_cast<double>(config_.loop.substeps)}) {
      hash.add(x);
    }
    hash.add(config_.loop.seed);
    const auto note = [&](const auto& measure) {
      of.names.push_back(measure.name);
      of.limits.push_back(measure.options.limit);
      hash.add(measure.options.from);
      hash.add(measure.options.to);
    };
    (note(measures), ...);
    MonteCarlo some = *this;
    some.config_.runs = std::min<std::int64_t>(config_.runs, 4);
    some.config_.threads = 1;
    some.config_.progress = {};
    some.config_.on_run = [&](std::int64_t, std::span<const double> numbers) {
      for (const double x : numbers) hash.add(is_finite(x) ? x : 0.0);
    };
    if (const auto ok = some.template run<Lanes>(measures...); !ok) return ok.error();
    of.study = hash.value();
    return of;
  }

  /// Computes one of several parts of the study, on this or another machine, and adds its records
  /// to `records` (see StudyRecords): only the blocks that are not there yet. The config's
  /// `progress` and `on_run` see the runs that are computed.
  /// @param keep (const BlockRecord&), called with each new record, to write it at once
  /// @return an error in the settings, or of records of another study; then nothing was computed
  template <int Lanes = default_lanes<LaneScalar<typename Types::S>>, class Keep, class... Reduce,
            class... F>
  requires std::invocable<Keep&, const BlockRecord&> Check<Time> run_part(
      StudyRecords& records, const Part& part, Keep&& keep, const Measure<Reduce, F>&... measures)
  const {
    const auto own = identity<Lanes>(measures...);
    if (!own) return own.error();
    if (const auto ok = fits(*own, records, part); !ok) return ok.error();
    if (records.identity().runs == 0) records = StudyRecords(*own);
    Work work(*this, records.missing(part).value(), statistics(measures...));
    work.keep = [&](BlockRecord&& record) {
      keep(std::as_const(record));
      (void)records.add(std::move(record));  // its block was missing
    };
    return compute<Lanes>(work, measures...);
  }

  /// The same without `keep`.
  template <int Lanes = default_lanes<LaneScalar<typename Types::S>>, class... Reduce, class... F>
  Check<Time> run_part(StudyRecords& records, const Part& part,
                       const Measure<Reduce, F>&... measures) const {
    return run_part<Lanes>(
        records, part, [](const BlockRecord&) {}, measures...);
  }

  /// The same into a file, block by block. If it is there, its records are kept and what is missing
  /// is appended: so a part that was killed goes on where it was.
  /// @return the records of the file, or an error, also of the field `file` if it cannot be written
  template <int Lanes = default_lanes<LaneScalar<typename Types::S>>, class... Reduce, class... F>
  [[nodiscard]] Expected<StudyRecords, Error<Time>> run_part(
      const std::string& file, const Part& part, const Measure<Reduce, F>&... measures) const {
    const auto own = identity<Lanes>(measures...);
    if (!own) return own.error();
    StudyRecords records(*own);
    std::ifstream there(file);
    const bool begun = there && there.peek() != std::ifstream::traits_type::eof();
    if (begun) {
      auto read = StudyRecords::read(there);
      if (!read) return detail::as_error<Time>(read.error());
      // Of a part that was killed at once not even one record is whole.
      if (!read->blocks().empty()) records = *std::move(read);
    }
    if (const auto ok = fits(*own, records, part); !ok) return ok.error();
    std::ofstream out(file, records.blocks().empty() ? std::ios::trunc : std::ios::app);
    if (!records.blocks().empty()) out << '\n';  // ends a line that was cut off
    out.flush();
    const auto ok = run_part<Lanes>(
        records, part,
        [&](const BlockRecord& record) {
          records.write(out, record);
          out.flush();
        },
        measures...);
    if (!ok) return ok.error();
    if (!out) return Error<Time>{"file", Time(0), "cannot be written"};
    return records;
  }

  /// The outcome of all runs from their records, the same as that of `run`, bit for bit.
  /// @return an error if records are of another study, or if one is missing
  template <int Lanes = default_lanes<LaneScalar<typename Types::S>>, class... Reduce, class... F>
  [[nodiscard]] Expected<Outcome, Error<Time>> outcome(
      const StudyRecords& records, const Measure<Reduce, F>&... measures) const {
    const auto own = identity<Lanes>(measures...);
    if (!own) return own.error();
    if (const auto ok = own->validate(records.identity()); !ok) {
      return detail::as_error<Time>(ok.error());
    }
    const auto missing = records.missing();
    if (!missing.empty()) {
      return Error<Time>{"records.block",
                         static_cast<Time>(missing.front()),
                         "is missing; blocks in all:",
                         -1,
                         static_cast<Time>(missing.size()),
                         true};
    }
    Work work(*this, {}, statistics(measures...));
    for (const auto& [block, record] : records.blocks()) {
      work.join(record);
      work.outcome.runs += runs_of_block(block, config_.runs);
    }
    Outcome all = std::move(work.outcome);
    if (all.failed > 0) {  // the error itself, by its run
      Results results{1, std::vector<double>(sizeof...(measures)), {}};
      run_one(all.failures.front(), results, 0, measures...);
      if (!results.failed.empty()) all.first_failure = results.failed.front();
    }
    return all;
  }

 private:
  using Results = detail::RunResults<Time>;

  /// Runs that a thread computes at once.
  struct Batch {
    std::int64_t first, runs, block;
    bool last;  ///< of its block
  };

  /// The blocks in work: their batches are computed in any order, and collected in sequence.
  struct Work {
    Work(const MonteCarlo& of, std::vector<std::int64_t> of_blocks,
         std::vector<RunStatistics> without_results)
        : study(of),
          blocks(std::move(of_blocks)),
          empty(std::move(without_results)),
          now{0, {}, empty} {
      outcome.numbers = empty;
      if (!blocks.empty()) {
        const auto in_last =
            static_cast<std::size_t>(runs_of_block(blocks.back(), study.config_.runs));
        batches = (blocks.size() - 1) * batches_of_a_block() + (in_last + batch - 1) / batch;
      }
    }
    [[nodiscard]] std::size_t batches_of_a_block() const {
      return static_cast<std::size_t>(runs_in_block(study.config_.runs) / batch);
    }
    [[nodiscard]] Batch batch_number(std::size_t i) const {
      const std::int64_t block = blocks[i / batches_of_a_block()];
      const std::int64_t from = static_cast<std::int64_t>(i % batches_of_a_block()) * batch;
      const std::int64_t runs = runs_of_block(block, study.config_.runs);
      return {block * runs_in_block(study.config_.runs) + from, (std::min)(batch, runs - from),
              block, from + batch >= runs};
    }

    template <class Compute>
    void go(const Compute& compute) {
      const auto cores = static_cast<int>(std::thread::hardware_concurrency());
      const int wanted = study.config_.threads > 0 ? study.config_.threads : (std::max)(cores, 1);
      outcome.threads = static_cast<int>(
          (std::min)(static_cast<std::size_t>(wanted), std::max<std::size_t>(batches, 1)));
      const auto work = [&] { take_batches(compute); };
      std::vector<std::thread> others;
      for (int i = 1; i < outcome.threads; ++i) others.emplace_back(work);
      work();
      for (auto& other : others) other.join();
      if (!keep) join(now);  // of a block in which it was stopped
    }

    template <class Compute>
    void take_batches(const Compute& compute) {
      std::unique_lock lock(mutex);
      for (;;) {
        // Limits how far threads get ahead of a slow one, because waiting results take memory.
        news.wait(lock, [&] {
          return stopped || next >= batches ||
                 next < taken + 4 * static_cast<std::size_t>(outcome.threads);
        });
        if (stopped || next >= batches) return;
        const std::size_t mine = next++;
        lock.unlock();
        const Batch own = batch_number(mine);
        Results results{own.runs, {}, {}};
        results.numbers.assign(static_cast<std::size_t>(results.count) * empty.size(),
                               std::numeric_limits<double>::quiet_NaN());
        compute(own.first, results);
        lock.lock();
        waiting.emplace(mine, std::move(results));
        while (!stopped && !waiting.empty() && waiting.begin()->first == taken) {
          take(batch_number(taken), waiting.begin()->second);
          waiting.erase(waiting.begin());
          ++taken;
        }
        news.notify_all();
      }
    }

    void take(const Batch& of, const Results& results) {
      now.block = of.block;
      for (const auto& failure : results.failed) {
        if (outcome.failures.empty() && now.failed.empty()) outcome.first_failure = failure;
        now.failed.push_back(failure.run);
      }
      auto failure = results.failed.begin();
      for (std::int64_t i = 0; i < results.count; ++i) {
        const std::int64_t run = of.first + i;
        const std::span<const double> numbers(
            results.numbers.data() + static_cast<std::size_t>(i) * empty.size(), empty.size());
        if (failure != results.failed.end() && failure->run == run) {
          ++failure;
        } else {
          for (std::size_t k = 0; k < empty.size(); ++k) now.numbers[k].add(run, numbers[k]);
        }
        if (study.config_.on_run) study.config_.on_run(run, numbers);
      }
      outcome.runs += results.count;
      if (of.last) {
        if (keep) {
          keep(std::move(now));
        } else {
          join(now);
        }
        now = {0, {}, empty};
      }
      if (study.config_.progress && !study.config_.progress(outcome.runs)) {
        stopped = true;
        outcome.completed = taken + 1 == batches;
      }
    }

    /// Adds a block to the outcome.
    void join(const BlockRecord& record) {
      for (std::size_t k = 0; k < empty.size(); ++k) outcome.numbers[k].join(record.numbers[k]);
      outcome.failed += static_cast<std::int64_t>(record.failed.size());
      for (const std::int64_t run : record.failed) {
        if (outcome.failures.size() < 1000) outcome.failures.push_back(run);
      }
    }

    const MonteCarlo& study;
    std::vector<std::int64_t> blocks;
    std::vector<RunStatistics> empty;           ///< statistics without results
    std::function<void(BlockRecord&&)> keep{};  ///< takes the record of a block; left out: `join`
    std::size_t batches = 0;
    Outcome outcome;
    BlockRecord now;  ///< the block that is being collected
    std::mutex mutex;
    std::condition_variable news;
    std::size_t next = 0;   ///< next batch that no thread has taken
    std::size_t taken = 0;  ///< number of batches that were collected
    bool stopped = false;
    std::map<std::size_t, Results> waiting;
  };

  /// Whether records may be those of a part of this study; they may be empty.
  static Check<Time> fits(const StudyIdentity& own, const StudyRecords& records, const Part& part) {
    auto ok = part.validate();
    if (ok && records.identity().runs != 0) ok = own.validate(records.identity());
    if (!ok) return detail::as_error<Time>(ok.error());
    return {};
  }

  /// Statistics without results.
  template <class... Measures>
  static std::vector<RunStatistics> statistics(const Measures&... measures) {
    return {RunStatistics(measures.name, measures.options.limit)...};
  }

  /// All blocks.
  [[nodiscard]] std::vector<std::int64_t> all_blocks() const {
    return StudyRecords({.runs = config_.runs}).missing();
  }
  /// Computes the blocks of `work`.
  template <int Lanes, class... Reduce, class... F>
  Check<Time> compute(Work& work, const Measure<Reduce, F>&... measures) const {
    Rules<Time> rules;
    rules.demand(config_.runs >= 1, "runs", static_cast<Time>(config_.runs), "must be 1 or more")
        .demand(config_.threads >= 0 && config_.threads <= 4096, "threads",
                static_cast<Time>(config_.threads), "must be 0 .. 4096")
        .demand(!config_.loop.number, "loop.number",
                static_cast<Time>(config_.loop.number.value_or(0)), "must be left out");
    if (!rules) return rules.error();
    // Checks the settings by a run that ends at once, and counts its samples.
    const auto first =
        sim::run(plant_, controller_, config_.loop, [](const auto&) { return false; });
    if (!first && is_setting(first.error().field)) return first.error();
    const auto sample_time = detail::run_sample_time<P, C>(controller_, config_.loop);
    const double end = static_cast<double>(config_.loop.start_time + config_.loop.duration -
                                           *sample_time / Time(2));
    (validate(rules, measures, end), ...);
    if (!rules) return rules.error();

    constexpr bool possible = detail::runs_in_packs<P, C, Lanes>;
    const bool in_packs = possible && !(config_.loop.jitter > Time(0)) && !config_.loop.step_time;
    work.outcome.lanes = in_packs ? Lanes : 1;
    work.go([&](std::int64_t from, Results& results) {
      if constexpr (possible) {
        if (in_packs) {
          run_in_packs<Lanes>(from, results, measures...);
          return;
        }
      }
      for (std::int64_t i = from; i < from + results.count; ++i)
        run_one(i, results, i - from, measures...);
    });
    return {};
  }

  static bool is_setting(std::string_view field) {
    // Errors that occur during a run; with another plant it may succeed.
    return field != "plant" && field != "controller" && field != "disturbance";
  }

  template <class Reduce, class F>
  static void validate(Rules<Time>& rules, const Measure<Reduce, F>& measure, double end) {
    const MeasureOptions& options = measure.options;
    const auto from = static_cast<Time>(options.from);
    if constexpr (std::is_same_v<Reduce, detail::SettlingTime>) {
      rules.not_negative("measure.band", static_cast<Time>(measure.reduce.band));
    }
    rules
        .demand(options.from < end, "measure.from", from,
                "must be before the last sample of the loop")
        .demand(options.to >= options.from, "measure.to", static_cast<Time>(options.to),
                "must not be before measure.from")
        .demand(
            is_finite(options.limit) || std::bit_cast<std::uint64_t>(options.limit) ==
                                            std::bit_cast<std::uint64_t>(MeasureOptions{}.limit),
            "measure.limit", static_cast<Time>(options.limit), "must be finite, or left out");
  }

  template <class Loop, class State, class Output>
  static void set(Loop& loop, std::int64_t run, const State& state, const Output& noise) {
    loop.number = static_cast<std::uint64_t>(run);
    loop.state = state;
    loop.noise = noise;
  }

  template <class... Measures>
  void run_one(std::int64_t run, Results& results, std::int64_t at,
               const Measures&... measures) const {
    const auto one = trial(run);
    if (!one) {
      results.failed.push_back({run, one.error()});
      return;
    }
    auto loop = settings(run, *one);
    if (const auto ok =
            detail::drive(one->plant, one->controller, loop, results, at, 1, measures...);
        !ok)
      results.failed.push_back({run, ok.error()});
  }

  template <int lanes, class... Measures>
  void run_in_packs(std::int64_t from, Results& results, const Measures&... measures) const {
    Packed<P, lanes> plants(plant_);
    Packed<C, lanes> controllers(controller_);
    auto loop = packed_loop<typename Packed<P, lanes>::Together, Packed<C, lanes>>();
    auto state = loop.state;
    auto noise = loop.noise;
    constexpr bool varied = !std::is_same_v<Vary, NoVariation>;
    for (std::int64_t at = 0; at < results.count; at += lanes) {
      bool good = at + lanes <= results.count;
      if constexpr (varied) {
        for (int i = 0; i < lanes && good; ++i) {
          const auto one = trial(from + at + i);
          good = one.has_value();
          if (!good) break;
          plants.set(i, one->plant);
          controllers.set(i, one->controller);
          esokit::detail::set_lane(state, one->state, i);
          esokit::detail::set_lane(noise, one->noise, i);
        }
      }
      if (good) {
        set(loop, from + at, state, noise);
        good = detail::drive(plants.together(), controllers, loop, results, at, lanes, measures...)
                   .has_value();
      }
      // Repeated one by one to find out which of them failed.
      for (std::int64_t i = at; !good && i < (std::min)(at + lanes, results.count); ++i) {
        run_one(from + i, results, i, measures...);
      }
    }
  }

  /// The settings of the loop for packs.
  template <class Plant, class Control>
  RunConfig<Plant, Control> packed_loop() const {
    using S = typename RunTypes<Plant, Control>::S;
    const RunConfig<P, C>& plain = config_.loop;
    RunConfig<Plant, Control> loop;
    const auto broadcast = [](auto& packed, const auto& one) {
      for (int i = 0; i < lane_count<S>; ++i) esokit::detail::set_lane(packed, one, i);
    };
    loop.duration = plain.duration;
    loop.sample_time = plain.sample_time;
    loop.reference = plain.reference;
    loop.disturbance = plain.disturbance;
    loop.measured = plain.measured;
    broadcast(loop.noise, plain.noise);
    if (plain.sensor) {
      using Output = typename RunTypes<Plant, Control>::Output;
      loop.sensor = [&plain](const Time& t, const Output& y) {
        Output seen = y;
        for (int i = 0; i < lane_count<S>; ++i) {
          typename Types::Output one{};
          esokit::detail::copy_lane<false>(y, one, i);
          esokit::detail::set_lane(seen, plain.sensor(t, one), i);
        }
        return seen;
      };
    }
    loop.missing = plain.missing;
    loop.seed = plain.seed;
    loop.dead_time = plain.dead_time;
    loop.substeps = plain.substeps;
    loop.start_time = plain.start_time;
    broadcast(loop.initial_input, plain.initial_input);
    broadcast(loop.state, plain.state);
    return loop;
  }

  P plant_;
  C controller_;
  Config config_;
  Vary vary_;
};

/// Prepares many runs of the loop of `sim::run`, each with its own random numbers and, through
/// `vary`, its own plant, controller, initial state and noise:
///
/// ```cpp
/// auto study = sim::monte_carlo(plant, controller,
///     {.runs = 100'000, .loop = {.duration = 2.0, .reference = 1.0, .noise = 1e-3}},
///     [](auto& trial, sim::Draw& draw) { trial.plant.b(1) *= draw.uniform_ratio(0.5, 2.0); });
/// auto outcome = study.run(sim::largest("overshoot",
///     [](const auto& s) { return s.output - s.reference; }, {.limit = 0.2}));
/// auto worst = study.replay(outcome->numbers[0].run_of_largest());
/// ```
///
/// A run depends only on the seed and its number.
/// @param vary (Trial&, Draw&): changes the trial, which holds the given plant and controller, to
///        that of a run. It must be a pure function, and may return a Check, whose error makes the
///        run fail.
template <SampledPlant P, class C, class Vary>
requires(detail::is_a_controller<C, P>()) MonteCarlo<P, C, Vary> monte_carlo(
    P plant, C controller, std::type_identity_t<MonteCarloConfig<P, C>> config, Vary vary) {
  return {std::move(plant), std::move(controller), std::move(config), std::move(vary)};
}

/// The same without `vary`: the runs differ only by the random numbers of the loop.
template <SampledPlant P, class C>
requires(detail::is_a_controller<C, P>()) MonteCarlo<P, C> monte_carlo(
    P plant, C controller, std::type_identity_t<MonteCarloConfig<P, C>> config) {
  return {std::move(plant), std::move(controller), std::move(config), {}};
}

}  // namespace esokit::sim
