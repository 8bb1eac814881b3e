// An adversary against the count of what is due after a long gap: it plays gaps beyond max_gap() as
// near together as `recovery` of the gain law allows, and looks for errors that grow. It must find
// none, and must find some if only half of what is due has to come. ESOKIT_ADVERSARY_SETTINGS=10000
// before the program runs so many settings of each type, ESOKIT_ADVERSARY_SEED other ones,
// ESOKIT_ADVERSARY_SAMPLES=1000000 so many samples of random losses.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <esokit/eigen.hpp>
#include <esokit/gain/model_gain.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <map>
#include <support/numbers.hpp>
#include <vector>

namespace observer_long_gaps_test {

using namespace esokit;
using esokit_test::Random;

std::uint64_t asked(const char* variable, std::uint64_t otherwise) {
  const char* text = std::getenv(variable);
  return text != nullptr ? std::strtoull(text, nullptr, 10) : otherwise;
}

/// The errors of an observer, and how much of what is due the adversary has to wait.
template <class Observer>
class Adversary {
 public:
  static constexpr int n = Observer::size;
  using Square = EigenMatrix<double, n, n>;
  using Column = EigenMatrix<double, n, 1>;

  /// @param unit omega_o T: states are counted in 1 / omega_o^r
  Adversary(const Observer& observer, double share, double unit, Random& random)
      : observer_(observer),
        bridged_(observer.max_gap() + 1),
        share_(share),
        unit_(unit),
        random_(random) {
    const int longest = observer.longest_gap() + 1;
    for (double m = bridged_ + 1; m < longest; m *= 1.6) long_.push_back(static_cast<int>(m));
    long_.push_back(longest);
    for (double m = 1; m < bridged_; m = m * 1.7 + 1) short_.push_back(static_cast<int>(m));
    short_.push_back(bridged_);
  }

  /// Logarithm of what the worst that it finds makes of the error, in each repetition.
  double worst() { return std::max({pairs(), sequence(false), sequence(true)}); }

 private:
  const Square& after(int samples) {
    const auto [place, is_new] = steps_.try_emplace(samples);
    for (int j = 0; is_new && j < n; ++j) {
      typename Observer::Estimate error = Observer::Estimate::Zero();
      error(j) = std::pow(unit_, j);
      observer_.reset(error);
      for (int i = 0; i < samples; ++i) observer_.predict(0);
      observer_.correct(0);
      for (int i = 0; i < n; ++i)
        place->second(i, j) = observer_.estimate()(i) / std::pow(unit_, i);
    }
    return place->second;
  }
  /// Whether a long gap is bridged while `count` corrections are due.
  bool may_be(int samples, int count) {
    return count == 0 || count + due(samples) <= 2 * due(long_.back());
  }
  /// Kept, because a law may compute it anew each time.
  int due(int samples) {
    const auto [place, is_new] = dues_.try_emplace(samples);
    if (is_new) {
      const int whole = observer_.gain_law().recovery(static_cast<unsigned>(samples));
      place->second = whole < 0 ? -1 : static_cast<int>(std::ceil(share_ * whole));
    }
    return place->second;
  }

  static double growth(Square pattern) {
    double sum = 0;
    for (int squarings = 0; squarings < 30; ++squarings) {
      const double size = pattern.norm();
      if (!(size > 0)) return -1e9;
      sum += std::ldexp(std::log(size), -squarings);
      pattern /= size;
      pattern = pattern * pattern;
    }
    return sum;
  }
  Square recovered(int samples) { return good(due(samples)) * after(samples); }
  Square good(int samples) {
    Square all = Square::Identity(), one = after(1);
    for (int rest = std::max(0, samples); rest > 0; rest /= 2) {
      if (rest % 2 != 0) all = one * all;
      one = one * one;
    }
    return all;
  }
  double pairs() {
    double most = -1e9;
    for (const int a : long_) {
      for (const int b : long_) {
        most = std::max(most, growth(recovered(a) * recovered(b)));
        if (!may_be(b, due(a))) continue;
        most = std::max(most, growth(good(due(a) + due(b)) * after(b) * after(a)));
      }
    }
    return most;
  }

  /// Random gaps, or at each step the one that leaves the largest error.
  double sequence(bool greedy) {
    Column e = Column::Random();
    double sum = 0, since = 0;
    int count = 0, gaps = 0;
    for (int k = 0; gaps < 120; ++k) {
      if (k > 20000) return -1e9;  // so few may be long that the others rule
      int pick = 1;
      if (!greedy) {
        const auto& from = count == 0 || random_.index(4) == 0 ? long_ : short_;
        const int drawn =
            from[static_cast<std::size_t>(random_.index(static_cast<int>(from.size())))];
        if (count == 0 || (random_.index(10) == 0 && (drawn <= bridged_ || may_be(drawn, count))))
          pick = drawn;
      } else {
        double most = -1;
        const auto look = [&](int samples) {
          const double size = (after(samples) * e).norm();
          if (size > most) {
            most = size;
            pick = samples;
          }
        };
        look(1);
        for (const int samples : short_) {
          if (random_.index(3) == 0) look(samples);
        }
        for (const int samples : long_) {
          if (may_be(samples, count)) look(samples);
        }
      }
      e = after(pick) * e;
      const double size = e.norm();
      if (!(size > 1e-300)) return -1e9;
      sum += std::log(size);
      e /= size;
      count = std::max(0, count + due(pick));
      if (pick > bridged_ && ++gaps == 20) since = sum;
    }
    return (sum - since) / 100;
  }

  Observer observer_;
  int bridged_;
  double share_, unit_;
  Random& random_;
  std::vector<int> long_{}, short_{};
  std::map<int, Square> steps_{};
  std::map<int, int> dues_{};
};

/// How many of the settings grow. @param share of what is due; below 1 it ends with the first
template <class Observer>
int growing(double share) {
  Random random(1 + asked("ESOKIT_ADVERSARY_SEED", 0));
  const auto settings = asked("ESOKIT_ADVERSARY_SETTINGS", esokit_test::sanitized ? 8 : 100);
  int found = 0;
  const bool too_early = share < 1;
  for (std::uint64_t done = 0; done < (too_early ? 10 * settings : settings);) {
    if (too_early && found > 0) break;
    const double unit = std::exp(random.uniform(std::log(0.02), std::log(3.0)));
    typename Observer::Config config{};
    if constexpr (requires { config.poles; }) {
      const double apart = random.uniform(0, 1.5);
      for (std::size_t i = 0; i < config.poles.size(); ++i) {
        config.poles[i] = -unit * std::exp(apart * static_cast<double>(i) / Observer::size);
      }
      if (random.index(2) == 0) {
        config.poles[0] = {-unit, random.uniform(0, 1) * unit};
        config.poles[1] = std::conj(config.poles[0]);
      }
    } else {
      config.observer_bandwidth = unit;
    }
    config.input_gain = config.sample_time = 1;
    if constexpr (requires { config.model.actuator.time_constant; }) {
      config.model.actuator.time_constant = random.uniform(0.3, 5) / unit;
    }
    if constexpr (requires { config.model.resonators; }) {
      for (auto& sine : config.model.resonators) {
        sine.frequency = std::exp(random.uniform(std::log(0.01), std::log(0.6)));
      }
    }
    config.max_gap = static_cast<int>(std::exp(random.uniform(std::log(5), std::log(3000))));
    const auto observer = Observer::make(config);
    if (!observer || observer->longest_gap() <= observer->max_gap()) continue;
    ++done;
    found += Adversary<Observer>(*observer, share, unit, random).worst() > 0;
  }
  return found;
}

/// @param too_early share of what is due after which some grow
template <class Observer>
void plays(double too_early = 0.5) {
  SCOPED_TRACE(testing::internal::GetTypeName<Observer>());
  EXPECT_EQ(growing<Observer>(1), 0);
  // With sanitizers too few settings are played.
  if (esokit_test::stride == 1) {
    EXPECT_GT(growing<Observer>(too_early), 0);
  }
}

TEST(LongGaps, NoSequenceGrowsIfWhatIsDueHasCome) {
  plays<LinearEso<2>>();
  plays<LinearEso<3>>();
  plays<LinearEso<4>>();
  plays<HalfGainEso<2>>();
  plays<HalfGainEso<3>>();
  plays<ReducedOrderEso<2>>();
  plays<ReducedOrderEso<3>>();
  plays<LinearEso<2, double, 1, PoleSet>>();
  plays<LinearEso<3, double, 1, PoleSet>>();
  plays<ModelEso<ModelParts{.order = 2, .actuator = 1}>>();
  plays<ModelEso<ModelParts{.order = 1, .resonators = 1}>>(0);
  plays<ModelEso<ModelParts{.order = 2, .resonators = 1}>>();
}

/// By how much the answer of dhat to a step of d changes if 30 % of the samples are lost, over its
/// error where none is, both in the root of the sum of squares.
template <int Order>
double changed_by_losses(double bandwidth, double frequency) {
  using Observer = ModelEso<ModelParts{.order = Order, .resonators = 1}>;
  const Observer made = Observer::make({.observer_bandwidth = bandwidth,
                                        .input_gain = 1,
                                        .sample_time = 1,
                                        .model = {.resonators = {{{.frequency = frequency}}}}})
                            .value();
  Random random(5);
  double apart = 0, whole = 0;
  for (int run = 0; run < 10; ++run) {
    Observer all = made, lossy = made;
    for (int k = 1; k < 20 / bandwidth; ++k) {
      const double y = Order == 1 ? k : 0.5 * k * k;
      all.update(y, 0);
      random.uniform(0, 1) < 0.3 ? lossy.predict(0) : lossy.update(y, 0);
      apart += std::pow(all.total_disturbance() - lossy.total_disturbance(), 2);
      whole += std::pow(all.total_disturbance() - 1, 2);
    }
  }
  return std::sqrt(apart / whole);
}

TEST(LongGaps, AnObserverWithLostSamplesAnswersAsItWasDesigned) {
  EXPECT_LT(changed_by_losses<1>(0.02, 0.01), 0.03);
  EXPECT_LT(changed_by_losses<2>(0.02, 0.01), 0.03);
  EXPECT_LT(changed_by_losses<1>(0.1, 0.05), 0.13);
  EXPECT_LT(changed_by_losses<2>(0.1, 0.05), 0.09);
}

/// Restarts while one sample in ten is lost at random.
template <int Order>
int restarts(double bandwidth, double frequency, std::uint64_t samples) {
  using Observer = ModelEso<ModelParts{.order = Order, .resonators = 1}>;
  auto observer = Observer::make({.observer_bandwidth = bandwidth,
                                  .input_gain = 1,
                                  .sample_time = 1,
                                  .model = {.resonators = {{{.frequency = frequency}}}}})
                      .value();
  Random random(6);
  int found = 0;
  for (std::uint64_t k = 0; k < samples; ++k) {
    const bool lost = random.uniform(0, 1) < 0.1;
    const StepStatus status = lost ? observer.predict(0) : observer.update(0, 0);
    found += has(status, StepStatus::restarted);
  }
  return found;
}

TEST(LongGaps, RandomLossesDoNotRestartAnObserverWithASine) {
  const auto samples = asked("ESOKIT_ADVERSARY_SAMPLES", 20000 / esokit_test::stride);
  for (const double bandwidth : {0.05, 0.1, 0.2, 0.3, 0.6}) {
    for (const double frequency : {0.01, 0.05, 0.1, 0.2, 0.4, 0.6}) {
      SCOPED_TRACE(testing::Message() << bandwidth << ", " << frequency);
      EXPECT_EQ(restarts<1>(bandwidth, frequency, samples), 0);
      EXPECT_EQ(restarts<2>(bandwidth, frequency, samples), 0);
    }
  }
}

}  // namespace observer_long_gaps_test
