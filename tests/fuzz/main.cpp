// Plays random cases of every type until the time is out; shrinks what fails and prints it.
// usage: fuzz [--seconds N | --cases N] [--seed S] [--only NAME] [--case HEX]; seed 0: that of the
// clock
#include <support/no_allocation.hpp>
//
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "fuzz/kinds.hpp"

namespace fuzz {

long allocations() { return esokit_test::allocation_count; }

void add_kind(std::vector<Kind>& kinds, const char* name, Failure (*run)(Episode&)) {
  kinds.push_back({name, run, 1});
}

std::vector<unsigned char> memory_of(const void* object, std::size_t size) {
  const auto* first = static_cast<const unsigned char*>(object);
  return {first, first + size};
}

namespace {

struct Options {
  double seconds = 10;
  std::uint64_t cases = 0;  ///< of each type, instead of a time: the same ones on every machine
  std::uint64_t seed = 1;
  std::string only{};
  std::optional<std::uint64_t> one_case{};
};

struct Tally {
  long made = 0;
  long refused = 0;
  long calls = 0;
  long recovered = 0;
  long longest = 0;
  std::set<std::string> failures{};
};

// For a case that ends the program.
const char* running_kind = "";
std::uint64_t running_case = 0;

void last_words() {
  std::fprintf(stderr, "the case was: fuzz --only '%s' --case %llx\n", running_kind,
               static_cast<unsigned long long>(running_case));
}
void on_signal(int signal) {
  last_words();
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

/// A case by its seed: how bad its numbers are, and how long it is, follow from it.
Episode drawn(const Kind& kind, std::uint64_t seed, Failure& failure) {
  Random random(seed);
  Episode episode;
  constexpr std::array<Mix, 4> mixes{{{0, 0}, {4, 2}, {30, 10}, {60, 0}}};
  // The config of its own, so that wild calls meet good settings most of the time.
  episode.random = &random;
  episode.mix = mixes[static_cast<std::size_t>(random.index(10) < 6 ? 0 : random.index(4))];
  episode.call_mix = mixes[static_cast<std::size_t>(random.index(4))];
  episode.length = random.index(4) == 0 ? 60 + random.index(200) : random.index(30);
  failure = kind.run(episode);
  episode.random = nullptr;
  return episode;
}

Failure replay(const Kind& kind, Episode& episode) {
  episode.text.clear();
  return kind.run(episode);
}

/// Leaves out calls, and makes numbers round, as long as it fails.
Episode shrunk(const Kind& kind, Episode episode) {
  const auto still_fails = [&](Episode& candidate) { return replay(kind, candidate).has_value(); };
  for (std::size_t size = episode.calls.size(); size > 0; size /= 2) {
    for (std::size_t at = 0; at + size <= episode.calls.size();) {
      Episode candidate = episode;
      const auto from = candidate.calls.begin() + static_cast<std::ptrdiff_t>(at);
      candidate.calls.erase(from, from + static_cast<std::ptrdiff_t>(size));
      if (still_fails(candidate)) {
        episode = std::move(candidate);
      } else {
        at += size;
      }
    }
  }
  for (std::size_t i = 0; i < episode.calls.size(); ++i) {
    for (std::size_t v = 0; v < episode.calls[i].tape.values().size(); ++v) {
      for (const long double simple : {0.0L, 1.0L}) {
        Episode candidate = episode;
        candidate.calls[i].tape.values()[v] = simple;
        if (still_fails(candidate)) {
          episode = std::move(candidate);
          break;
        }
      }
    }
  }
  return episode;
}

void report(const Kind& kind, std::uint64_t seed, const Episode& episode, const std::string& text) {
  std::printf("FAILED %s: %s\n  again by: fuzz --only '%s' --case %llx\n", kind.name.c_str(),
              text.c_str(), kind.name.c_str(), static_cast<unsigned long long>(seed));
  for (const std::string& line : episode.text) std::printf("  %s\n", line.c_str());
  std::fflush(stdout);
}

std::string without_numbers(const std::string& text) {
  std::string words;
  for (const char c : text) {
    if (std::isdigit(static_cast<unsigned char>(c)) == 0) words += c;
  }
  return words.substr(0, 60);
}

void one_case(const Kind& kind, std::uint64_t seed, Tally& tally) {
  running_kind = kind.name.c_str();
  running_case = seed;
  Failure failure;
  Episode episode = drawn(kind, seed, failure);
  (episode.made ? tally.made : tally.refused) += 1;
  tally.calls += episode.played;
  if (episode.recovery > 0) {
    ++tally.recovered;
    tally.longest = std::max(tally.longest, episode.recovery);
  }
  if (!failure || !tally.failures.insert(without_numbers(*failure)).second) return;
  Episode small = shrunk(kind, episode);
  Failure again = replay(kind, small);
  if (again) {
    report(kind, seed, small, *again);
  } else {
    (void)replay(kind, episode);
    report(kind, seed, episode, *failure + " (not when played again)");
  }
}

std::uint64_t mixed(std::uint64_t seed, std::size_t kind, std::uint64_t round) {
  return Random(seed * 0x9e3779b97f4a7c15u + kind * 0x100000001b3u + round).bits();
}

int run(const Options& options) {
  std::vector<Kind> all;
  add_observers(all);
  add_filters(all);
  add_controllers(all);
  add_studies(all);
  std::vector<Kind> kinds;
  for (Kind& kind : all) {
    if (kind.name.find(options.only) != std::string::npos) kinds.push_back(std::move(kind));
  }
  if (kinds.empty()) return std::fprintf(stderr, "no such type\n"), 2;
  std::vector<Tally> tallies(kinds.size());
  const std::uint64_t seed_of_all =
      options.seed != 0 ? options.seed : static_cast<std::uint64_t>(std::time(nullptr));
  std::printf("seed %llu, %zu types\n", static_cast<unsigned long long>(seed_of_all), kinds.size());
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(options.seconds);
  for (std::uint64_t round = 0;; ++round) {
    for (std::size_t i = 0; i < kinds.size(); ++i) {
      // The same time to all types, not the same number of cases.
      const auto turn = Clock::now() + std::chrono::milliseconds(2);
      std::uint64_t within = 0;
      do {
        const auto seed =
            options.one_case.value_or(mixed(seed_of_all, i, (round << 16u) + within++));
        one_case(kinds[i], seed, tallies[i]);
      } while (!options.one_case && (options.cases > 0 ? within < options.cases / kinds[i].one_of
                                                       : Clock::now() < turn && within < 65536));
    }
    if (options.one_case || options.cases > 0 || Clock::now() >= end) break;
  }
  Tally sum;
  std::size_t failures = 0;
  std::printf("%-58s %9s %9s %11s %9s %9s\n", "type", "made", "refused", "calls", "back",
              "longest");
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const Tally& t = tallies[i];
    std::printf("%-58s %9ld %9ld %11ld %9ld %9ld\n", kinds[i].name.c_str(), t.made, t.refused,
                t.calls, t.recovered, t.longest);
    sum.made += t.made;
    sum.refused += t.refused;
    sum.calls += t.calls;
    failures += t.failures.size();
  }
  std::printf("%ld configs made, %ld refused, %ld calls\n", sum.made, sum.refused, sum.calls);
  std::printf("%zu passed, %zu failed\n", kinds.size(), failures);
  return failures == 0 ? 0 : 1;
}

}  // namespace
}  // namespace fuzz

#if defined(__SANITIZE_ADDRESS__)
#define FUZZ_SANITIZED
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define FUZZ_SANITIZED
#endif
#endif
#ifdef FUZZ_SANITIZED
extern "C" void __sanitizer_set_death_callback(void (*)());
#endif

int main(int argc, char** argv) {
  fuzz::Options options;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i];
    const char* value = argv[i + 1];
    if (name == "--seconds")
      options.seconds = std::strtod(value, nullptr);
    else if (name == "--cases")
      options.cases = std::min<std::uint64_t>(std::strtoull(value, nullptr, 10), 65536);
    else if (name == "--seed")
      options.seed = std::strtoull(value, nullptr, 10);
    else if (name == "--only")
      options.only = value;
    else if (name == "--case")
      options.one_case = std::strtoull(value, nullptr, 16);
    else
      return std::fprintf(stderr, "fuzz: no option %s\n", name.c_str()), 2;
  }
#ifdef FUZZ_SANITIZED
  __sanitizer_set_death_callback(fuzz::last_words);
#endif
  std::signal(SIGABRT, fuzz::on_signal);
  std::signal(SIGFPE, fuzz::on_signal);
  std::signal(SIGSEGV, fuzz::on_signal);
  return fuzz::run(options);
}
