// A design in fixed point, its C compiled and loaded, against the same design in exact numbers (in
// double, which is a million times finer than the bounds): with random and adversarial y and u.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <esokit/target/fixed_point.hpp>
#include <string>
#include <target/written.hpp>
#include <vector>

#ifdef ESOKIT_LOADS_C

namespace esokit_test {
inline namespace fixed {

using namespace esokit;

/// The compiled C of an observer or controller called "eso", with y in `Y` (uint16_t: of a
/// counter).
template <class Y>
class FixedInC {
 public:
  FixedInC(const Folder& folder, const CCode& code, const std::string& compiler = "gcc -std=c99",
           bool controls = false) {
    const bool opens = !code.settings.empty();
    static int count = 0;
    folder.write("eso.h", code.header);
    const std::string probe = "unsigned eso_status(const eso_state *o)";
    const std::string more = "\n" + probe + ";\n" + probe + "\n{\n  return o->status;\n}\n";
    folder.write("eso.c", mutant(code.source) + (controls ? more : ""));
    const std::string out = folder.file("eso" + std::to_string(count++) + ".so");
    if (!runs(compiler + " -O2 -shared -fPIC -DESO_SELF_TEST" + std::string(strict) + "-o " + out +
              " " + folder.file("eso.c"))) {
      return;
    }
    handle_ = dlopen(out.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (handle_ == nullptr) return;
    find(init, "eso_init");
    if (controls) {
      find(control, "eso_update");
      find(miss, "eso_update_without_measurement");
      find(applied, "eso_applied");
      find(start, "eso_start");
      find(status, "eso_status");
    } else {
      find(update, "eso_update");
      find(predict, "eso_predict");
      find(reset, "eso_reset");
    }
    if (opens) {
      find(adopt, "eso_adopt");
      design = dlsym(handle_, "eso_design");
      other = dlsym(handle_, "eso_other");
    }
    find(estimate, "eso_estimate");
    find(self_test, "eso_self_test");
    init(state.data());
  }
  ~FixedInC() {
    if (handle_ != nullptr) dlclose(handle_);
  }
  FixedInC(const FixedInC&) = delete;
  FixedInC& operator=(const FixedInC&) = delete;
  [[nodiscard]] bool loaded() const { return handle_ != nullptr; }

  void (*init)(void*) = nullptr;
  unsigned (*update)(void*, Y, std::int32_t) = nullptr;
  unsigned (*predict)(void*, std::int32_t) = nullptr;
  unsigned (*reset)(void*, Y) = nullptr;
  std::int32_t (*estimate)(const void*, unsigned) = nullptr;
  int (*self_test)() = nullptr;
  // Of a controller.
  std::int32_t (*control)(void*, Y, Y) = nullptr;
  std::int32_t (*miss)(void*, Y) = nullptr;
  unsigned (*applied)(void*, std::int32_t) = nullptr;
  unsigned (*status)(const void*) = nullptr;
  unsigned (*start)(void*, Y, std::int32_t) = nullptr;
  // Of settings in a struct, two sets of which are in the files.
  unsigned (*adopt)(void*, const void*) = nullptr;
  const void* design = nullptr;
  const void* other = nullptr;
  alignas(8) std::array<std::int32_t, 40> state{};

 private:
  template <class F>
  void find(F& function, const char* name) {
    function = reinterpret_cast<F>(dlsym(handle_, name));
    ASSERT_NE(function, nullptr) << name;
  }
  void* handle_ = nullptr;
};

/// What a run saw.
struct FixedRun {
  double random = 0;  ///< the largest deviation by its bound, over all estimates, of random input
  double adversary = 0;  ///< of the adversary
  int refused = 0;       ///< samples that had a status
};

/// Plays an observer in fixed point against itself in exact numbers.
template <class Y>
class FixedPlay {
 public:
  FixedPlay(FixedInC<Y>& in_c, const FixedCode& code, const FixedPointOptions& options,
            std::uint64_t seed)
      : c_(in_c), code_(code), w_(code.written), options_(options), random_(seed) {
    n_ = w_.scale.size();
    exact_.assign(n_, 0.0);
    begin();
  }

  /// `steps` of random input: noise, edges, signs that stay for a while, sines, rest.
  double by_chance(long steps) {
    begin();
    double largest = 0;
    int kind = 0;
    int left = 0;
    double phase = 0;
    double frequency = 0;
    std::int32_t y = 0;
    std::int32_t u = 0;
    for (long k = 0; k < steps; ++k) {
      if (left-- <= 0) {
        kind = random_.index(6);
        left = 1 + random_.index(1 << (1 + random_.index(12)));
        frequency = std::pow(10.0, random_.uniform(-4, 0.4));
      }
      const std::uint32_t bits = next_bits();
      const std::int32_t ym = options_.y.most;
      const std::int32_t um = options_.u.most;
      if (kind == 0) {
        y = in_range(bits, ym);
        u = in_range(bits >> 11, um);
      } else if (kind == 1) {
        y = (bits & 1u) != 0 ? ym : -ym;
        u = (bits & 2u) != 0 ? um : -um;
      } else if (kind == 2) {
        if ((bits & 63u) == 0) y = -y;
        if ((bits & 4032u) == 0) u = -u;
      } else if (kind == 3) {
        phase += frequency;
        y = static_cast<std::int32_t>(std::lround(ym * std::sin(phase)));
        u = static_cast<std::int32_t>(std::lround(um * std::cos(phase)));
      } else if (kind == 4) {
        y = std::max(-ym, std::min(ym, y + static_cast<std::int32_t>(bits % 3u) - 1));
      }
      step(y, u);
      largest = std::max(largest, ratio());
    }
    return largest;
  }

  /// Drives one estimate: of some candidates for y and u it takes the one whose roundings do most
  /// to it `horizon` samples after the beginning (the adjoint of the system says what that is).
  /// Once for each sign, and looking one and four samples ahead.
  double by_adversary(std::size_t estimate, int horizon, int candidates) {
    double largest = 0;
    for (const double sign : {1.0, -1.0}) {
      largest = std::max(largest, driven<1>(estimate, horizon, candidates, sign));
      largest = std::max(largest, driven<4>(estimate, horizon, candidates, sign));
    }
    return largest;
  }

  template <int block>
  double driven(std::size_t estimate, int horizon, int candidates, double sign) {
    std::vector<std::vector<double>> weights(static_cast<std::size_t>(horizon));
    std::vector<double> row = w_.estimates[estimate];
    for (int k = horizon - 1; k >= 0; --k) {
      weights[static_cast<std::size_t>(k)] = row;
      std::vector<double> to(n_, 0.0);
      for (std::size_t i = 0; i < n_; ++i) {
        for (std::size_t j = 0; j < n_; ++j) to[j] += row[i] * w_.a[i * n_ + j];
      }
      row = to;
    }
    begin();
    double largest = 0;
    // What y does to the low bits shows a few samples later.
    for (int k = 0; k + block <= horizon; k += block) {
      const auto& weight = weights[static_cast<std::size_t>(k + block - 1)];
      const auto state = c_.state;
      const Y counter = counter_;
      const std::vector<double> exact = exact_;
      double best = 0;
      std::array<std::int32_t, std::size_t{2} * block> chosen{};
      for (int i = 0; i < candidates; ++i) {
        std::array<std::int32_t, std::size_t{2} * block> tried{};
        for (int j = 0; j < block; ++j) {
          const auto at = static_cast<std::size_t>(2 * j);
          tried[at] = in_range(next_bits(), options_.y.most);
          tried[at + 1] = in_range(next_bits(), options_.u.most);
          step(tried[at], tried[at + 1]);
        }
        double gained = 0;
        for (std::size_t j = 0; j < n_; ++j) gained += sign * weight[j] * (value(j) - exact_[j]);
        if (gained > best || i == 0) {
          best = gained;
          chosen = tried;
        }
        c_.state = state;
        counter_ = counter;
        exact_ = exact;
      }
      for (std::size_t j = 0; j < chosen.size(); j += 2) step(chosen[j], chosen[j + 1]);
      largest = std::max(largest, ratio());
    }
    return largest;
  }

  void begin() {
    c_.init(c_.state.data());
    counter_ = 0;
    std::fill(exact_.begin(), exact_.end(), 0.0);
  }

  void step(std::int32_t y, std::int32_t u) {
    Y given = static_cast<Y>(y);
    if (options_.y.counter_bits > 0) {
      const unsigned mask = (1u << options_.y.counter_bits) - 1u;
      counter_ =
          static_cast<Y>((static_cast<unsigned>(counter_) + static_cast<unsigned>(y)) & mask);
      given = counter_;
    }
    if (c_.update(c_.state.data(), given, u) != 0) ++refused;
    double to[12];
    for (std::size_t i = 0; i < n_; ++i) {
      double sum = w_.by[i] * y + w_.bu[i] * u;
      for (std::size_t j = 0; j < n_; ++j) sum += w_.a[i * n_ + j] * exact_[j];
      to[i] = sum;
    }
    for (std::size_t i = 0; i < n_; ++i) exact_[i] = to[i];
  }

  /// A state of the C with what is left over, in counts.
  [[nodiscard]] double value(std::size_t i) const {
    double x = std::ldexp(c_.state[i], -w_.scale[i]);
    if (w_.left_over[i] > 0) {
      std::size_t rest = n_;
      for (std::size_t j = 0; j < i; ++j) rest += w_.left_over[j] > 0 ? 1u : 0u;
      x += std::ldexp(c_.state[rest], -w_.scale[i] - w_.left_over[i]);
    }
    return x;
  }

  /// The largest deviation of an estimate now, as a share of its bound: from the words alone, as a
  /// user reads them.
  [[nodiscard]] double ratio() const {
    double largest = 0;
    for (std::size_t row = 0; row < w_.estimates.size(); ++row) {
      double off = 0;
      for (std::size_t j = 0; j < n_; ++j) {
        off += w_.estimates[row][j] * (std::ldexp(c_.state[j], -w_.scale[j]) - exact_[j]);
      }
      largest = std::max(largest, std::fabs(off) / code_.estimates[row].deviation);
    }
    return largest;
  }
  [[nodiscard]] const std::vector<double>& exact() const { return exact_; }

  /// The signs of y and u that bring a state where it can come, both ways, then gaps, numbers
  /// outside the ranges and resets. @return for each state the largest share of its range
  std::vector<double> to_the_edges(int horizon) {
    std::vector<double> reached(n_, 0.0);
    for (std::size_t target = 0; target < 2 * n_; ++target) {
      begin();
      std::vector<std::array<std::int32_t, 2>> inputs(static_cast<std::size_t>(horizon));
      std::vector<double> row(n_, 0.0);
      row[target % n_] = target < n_ ? 1.0 : -1.0;
      for (std::size_t k = inputs.size(); k-- > 0;) {
        double by_y = 0;
        double by_u = 0;
        std::vector<double> to(n_, 0.0);
        for (std::size_t i = 0; i < n_; ++i) {
          by_y += row[i] * w_.by[i];
          by_u += row[i] * w_.bu[i];
          for (std::size_t j = 0; j < n_; ++j) to[j] += row[i] * w_.a[i * n_ + j];
        }
        row = to;
        inputs[k] = {by_y > 0 ? options_.y.most : -options_.y.most,
                     by_u > 0 ? options_.u.most : -options_.u.most};
      }
      for (const auto& [y, u] : inputs) step(y, u);
      reached[target % n_] =
          std::max(reached[target % n_], std::fabs(value(target % n_)) / w_.most[target % n_]);
      for (const auto& [y, u] : inputs) {  // from there again, with gaps
        const int missing = random_.index(10) == 0 ? random_.index(9) : 0;
        for (int i = 0; i < missing; ++i) (void)c_.predict(c_.state.data(), -u);
        if (random_.index(20) == 0) {
          (void)c_.update(c_.state.data(), static_cast<Y>(next_bits()),
                          static_cast<std::int32_t>(next_bits()));
        }
        if (random_.index(500) == 0) (void)c_.reset(c_.state.data(), static_cast<Y>(next_bits()));
        step(y, u);
      }
    }
    return reached;
  }
  int refused = 0;

 private:
  std::uint32_t next_bits() {
    bits_ ^= bits_ << 13;
    bits_ ^= bits_ >> 7;
    bits_ ^= bits_ << 17;
    return static_cast<std::uint32_t>(bits_ >> 20);
  }
  static std::int32_t in_range(std::uint32_t bits, std::int32_t most) {
    return static_cast<std::int32_t>(bits % static_cast<std::uint32_t>(2 * most + 1)) - most;
  }

  FixedInC<Y>& c_;
  const FixedCode& code_;
  const WrittenSystem& w_;
  const FixedPointOptions& options_;
  Random random_;
  std::uint64_t bits_ = random_.bits() | 1u;
  std::size_t n_ = 0;
  std::vector<double> exact_;
  Y counter_ = 0;
};

}  // namespace fixed
}  // namespace esokit_test

#endif
