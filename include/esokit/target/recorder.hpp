/// @file
/// Recorder: the operations of a finished observer or controller, recorded from its own calls.
#pragma once

#include <cstddef>
#include <cstring>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/target/recording_scalar.hpp>
#include <functional>
#include <type_traits>
#include <utility>
#include <vector>

namespace esokit {

/// One call of an object as a list of operations. The arguments of the list are first all numbers
/// of the object, then the arguments of the call.
struct RecordedCall {
  OperationList list{};        ///< what is done; if a check does not hold, nothing is
  std::vector<int> next{};     ///< for each number of the object the index of its next value; -1:
                               ///< it stays as it is
  std::vector<int> outputs{};  ///< indices of what the call returns
};

/// What a Recorder found.
struct RecordedObject {
  std::vector<double> numbers{};  ///< all numbers of the object when it was recorded
  std::vector<bool> moves{};      ///< whether any call changes a number; the others are constants

  /// In the order of Recorder::add; a call that goes through several states of the object's
  /// counters has one list for each, in their order.
  std::vector<std::vector<RecordedCall>> calls{};
  /// What is no number, as bytes (counters, modes, statuses of the two lanes of a pack): before
  /// call i goes by its list k it is `counters[i][k]`. For other counters the list is not valid.
  std::vector<std::vector<std::vector<unsigned char>>> counters{};
};

namespace detail {

/// Calls found(x) for each number of type S in `object`, and found(address, bytes) for all else.
template <class S, class Object, class Found>
void visit_members(Object& object, const Found& found) {
  using T = std::remove_const_t<Object>;
  const auto deeper = [&](auto& member) { visit_members<S>(member, found); };
  if constexpr (std::is_empty_v<T>) {
    return;
  } else if constexpr (std::is_same_v<T, S>) {
    found(object);
  } else if constexpr (HoldsElements<T>) {
    for (decltype(object.size()) k = 0; k < object.size(); ++k) deeper(object.data()[k]);
  } else if constexpr (IsOptional<T>::value) {
    if (object) deeper(*object);
  } else if constexpr (IsTuple<T>::value) {
    std::apply([&](auto&... member) { (deeper(member), ...); }, object);
  } else if constexpr (LaneAccess::has_members<T>) {
    LaneAccess::with_members(object, [&](auto&... members) { (deeper(members), ...); });
  } else {
    found(&object, sizeof object);
  }
}

/// What is found, one type for all objects: what takes apart a part of two is compiled once.
/// @{
template <class S>
struct FoundNumbers {
  void operator()(S& number) const { numbers->push_back(&number); }
  void operator()(const void*, std::size_t) const {}
  std::vector<S*>* numbers;
};
template <class S>
struct FoundBytes {
  void operator()(const S&) const {}
  void operator()(const void* from, std::size_t size) const {
    const auto* first = static_cast<const unsigned char*>(from);
    bytes->insert(bytes->end(), first, first + size);
  }
  std::vector<unsigned char>* bytes;
};
/// @}

/// All numbers of an object.
template <class S, class Object>
auto numbers_of(Object& object) {
  std::vector<S*> numbers;
  visit_members<S>(object, FoundNumbers<S>{&numbers});
  return numbers;
}

/// All else in it, as bytes.
template <class S, class Object>
std::vector<unsigned char> counters_of(const Object& object) {
  std::vector<unsigned char> bytes;
  visit_members<S>(object, FoundBytes<S>{&bytes});
  return bytes;
}

/// Records a call. @param constants the numbers in the beginning @param numbers those of the object
/// that is called @param grew becomes true if the call changes a number that was thought constant
template <class V>
RecordedCall record_call(
    int count,
    const std::function<std::vector<RecordingScalar<V>>(const std::vector<RecordingScalar<V>>&)>&
        call,
    const std::vector<RecordingScalar<V>*>& constants,
    const std::vector<RecordingScalar<V>*>& numbers, std::vector<bool>& moves, bool& grew,
    bool& looked) {
  RecordedCall result;
  std::vector<int> before(numbers.size(), -1);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    *numbers[i] = *constants[i];
    if (!moves[i]) continue;
    *numbers[i] = RecordingScalar<V>(result.list, static_cast<int>(i), constants[i]->value());
    before[i] = numbers[i]->index_in(result.list);
  }
  std::vector<RecordingScalar<V>> arguments;
  for (int i = 0; i < count; ++i) {
    arguments.emplace_back(result.list, static_cast<int>(numbers.size()) + i, V(0.125));
  }
  const std::vector<RecordingScalar<V>> outputs = call(arguments);
  result.next.assign(numbers.size(), -1);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const V was = constants[i]->value();
    const V is = numbers[i]->value();
    const bool differs = std::memcmp(&was, &is, sizeof(V)) != 0;
    if (!moves[i] && (!numbers[i]->is_constant() || differs)) moves[i] = grew = true;
    if (!moves[i]) continue;
    const int next = numbers[i]->index_in(result.list);
    if (next != before[i]) result.next[i] = next;
  }
  for (const auto& output : outputs) result.outputs.push_back(output.index_in(result.list));
  looked = result.list.was_looked_into;
  return result;
}

}  // namespace detail

/// Records calls of an object, for example the `update` of a controller, with its settings as
/// constants. Nothing is written twice: what the object does is what is recorded.
///
/// What moves is found from the arguments: a number belongs to the state if any of the calls
/// changes it. So add all calls that will be used before `record`.
///
/// The object runs on RecordingScalar, which is a pack: it needs `with_scalar`.
/// `can_be_recorded` says this of a type.
/// @tparam Object an observer or controller of float or double
template <class Object>
class Recorder {
 public:
  using V = typename Object::scalar_type;               ///< float or double
  using Number = RecordingScalar<V>;                    ///< what the object is recorded with
  using Recorded = detail::WithScalar<Object, Number>;  ///< the object that is recorded
  using Arguments = std::vector<Number>;                ///< of a call
  using Call = std::function<Arguments(Recorded&, const Arguments&)>;  ///< returns the outputs

  /// @param object as `make` returned it, or later; its state and settings are those recorded
  explicit Recorder(const Object& object) : object_(as_recorded(object)) {}

  /// Adds a call of which every valid sample consists. It must leave all that is no number
  /// (counters, modes) as it was, perhaps after some calls (the place in a ring): then each has a
  /// list.
  /// @param arguments how many arguments it has @param call calls the object
  void add_step(int arguments, Call call) { calls_.push_back({arguments, std::move(call), true}); }

  /// Adds a call of which only the numbers matter: whoever uses the list counts itself.
  void add(int arguments, Call call) { calls_.push_back({arguments, std::move(call), false}); }

  /// Numbers that are inputs of the lists though no call changes them: settings that something else
  /// may change. @param chosen finds them in an object, by their addresses
  void keep_open(std::function<std::vector<const Number*>(Recorded&)> chosen) {
    chosen_ = std::move(chosen);
  }

  /// Records all calls.
  /// @return the lists; an error if a call looked at single lanes, because it branches on a number,
  ///         or if a step changes counters for ever
  [[nodiscard]] Expected<RecordedObject, Error<V>> record() const {
    Recorded first = object_;
    RecordedObject all;
    for (const Number* number : detail::numbers_of<Number>(first)) {
      all.numbers.push_back(static_cast<double>(number->value()));
    }
    all.moves.assign(all.numbers.size(), false);
    if (chosen_) {
      const auto numbers = detail::numbers_of<Number>(first);
      for (const Number* open : chosen_(first)) {
        for (std::size_t i = 0; i < numbers.size(); ++i) {
          if (numbers[i] == open) all.moves[i] = true;
        }
      }
    }
    for (bool grew = true; grew;) {
      grew = false;
      all.calls.clear();
      all.counters.clear();
      for (const Entry& entry : calls_) {
        all.calls.emplace_back();
        all.counters.emplace_back();
        Recorded object = object_;
        const auto before = detail::counters_of<Number>(object);
        do {
          if (all.calls.back().size() == most_lists) {
            return Error<V>{"step", V(0), "changes counters at each call, in too long a cycle"};
          }
          all.counters.back().push_back(detail::counters_of<Number>(object));
          bool looked = false;
          all.calls.back().push_back(record_one(object, entry, all.moves, grew, looked));
          if (looked) return Error<V>{"step", V(0), "branches on a number of one lane"};
        } while (entry.is_step && detail::counters_of<Number>(object) != before);
      }
    }
    return all;
  }

  /// The object on recording scalars, all numbers constants.
  [[nodiscard]] static Recorded as_recorded(const Object& object) {
    auto recorded = detail::blank<Recorded>();
    for (int lane = 0; lane < lane_count<Number>; ++lane) detail::set_lane(recorded, object, lane);
    return recorded;
  }

 private:
  struct Entry {
    int arguments;
    Call call;
    bool is_step;
  };
  static constexpr std::size_t most_lists = 64;

  /// Calls `object` with its numbers as they are in the beginning.
  RecordedCall record_one(Recorded& object, const Entry& entry, std::vector<bool>& moves,
                          bool& grew, bool& looked) const {
    Recorded beginning = object_;
    return detail::record_call<V>(
        entry.arguments, [&](const Arguments& in) { return entry.call(object, in); },
        detail::numbers_of<Number>(beginning), detail::numbers_of<Number>(object), moves, grew,
        looked);
  }

  Recorded object_;
  std::vector<Entry> calls_;
  std::function<std::vector<const Number*>(Recorded&)> chosen_;
};

namespace detail {

template <class Object>
concept Recordable = requires {
  typename WithScalar<Object, RecordingScalar<typename Object::scalar_type>>;
};

}  // namespace detail

/// Whether a Recorder takes the type: it works on packs.
template <class Object>
inline constexpr bool can_be_recorded = detail::Recordable<Object>;

}  // namespace esokit
