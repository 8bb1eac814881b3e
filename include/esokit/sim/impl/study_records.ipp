#pragma once

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/sim/statistics.hpp>
#include <esokit/sim/study_records.hpp>
#include <istream>
#include <ostream>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace esokit::sim {

ESOKIT_FUNCTION Expected<Part, Error<double>> Part::parse(std::string_view text) {
  Part part;
  const char* end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, part.index);
  const bool slash = first.ec == std::errc{} && first.ptr != end && *first.ptr == '/';
  const auto second = slash ? std::from_chars(first.ptr + 1, end, part.count) : first;
  if (!slash || second.ec != std::errc{} || second.ptr != end) {
    return Error<double>{"part", 0.0, "must be two whole numbers, as in 3/8"};
  }
  if (const auto ok = part.validate(); !ok) return ok.error();
  return part;
}

ESOKIT_FUNCTION Check<double> Part::validate() const {
  return Rules<double>{}
      .demand(1 <= count && count <= 1'000'000, "part.count", static_cast<double>(count),
              "must be 1 .. 1000000")
      .demand(0 <= index && index < count, "part.index", static_cast<double>(index),
              "must be 0 .. count - 1");
}

namespace detail {

ESOKIT_FUNCTION void Hash::add(std::uint64_t word) noexcept {
  for (int i = 0; i < 8; ++i) {
    value_ = (value_ ^ (word & 255u)) * 0x100000001b3u;
    word >>= 8u;
  }
}

ESOKIT_FUNCTION void Hash::add(std::string_view text) noexcept {
  add(static_cast<std::uint64_t>(text.size()));
  for (const char c : text) add(static_cast<std::uint64_t>(static_cast<unsigned char>(c)));
}

}  // namespace detail

ESOKIT_FUNCTION Check<double> StudyIdentity::validate(const StudyIdentity& other) const {
  return Rules<double>{}
      .demand(runs == other.runs, {"records.runs", static_cast<double>(other.runs),
                                   "must be the number of runs of the study, which is", -1,
                                   static_cast<double>(runs), true})
      .demand(seed == other.seed,
              {"records.seed", static_cast<double>(other.seed),
               "must be the seed of the study, which is", -1, static_cast<double>(seed), true})
      .demand(names == other.names && limits == other.limits, "records.measures",
              static_cast<double>(other.names.size()), "must be those of the study")
      .demand(machine == other.machine,
              {"records.machine", last_digits(other.machine),
               "is of another kind: its exp, sin or pow, or its sums of products, differ from "
               "those of",
               -1, last_digits(machine), true})
      .demand(study == other.study,
              {"records.study", last_digits(other.study),
               "is another one: its program, plant, controller or settings differ from those of",
               -1, last_digits(study), true});
}

ESOKIT_FUNCTION Check<double> StudyRecords::add(BlockRecord record) {
  if (const auto ok = validate(record); !ok) return ok.error();
  blocks_.emplace(record.block, std::move(record));
  return {};
}

ESOKIT_FUNCTION Check<double> StudyRecords::add(const StudyRecords& other) {
  const bool nothing = other.identity_.runs == 0;  // of a text without a whole record
  const auto ok = nothing ? Check<double>() : identity_.validate(other.identity_);
  if (!ok) return ok.error();
  for (const auto& [block, record] : other.blocks_) {
    if (const auto fits = validate(record); !fits) return fits.error();
  }
  for (const auto& [block, record] : other.blocks_) blocks_.emplace(block, record);
  damaged_ += other.damaged_;
  return {};
}

ESOKIT_FUNCTION Expected<std::vector<std::int64_t>, Error<double>> StudyRecords::missing(
    const Part& part) const {
  if (const auto ok = part.validate(); !ok) return ok.error();
  std::vector<std::int64_t> none;
  const std::int64_t all = block_count(identity_.runs);
  for (std::int64_t i = all * part.index / part.count; i < all * (part.index + 1) / part.count;
       ++i) {
    if (!blocks_.contains(i)) none.push_back(i);
  }
  return none;
}

ESOKIT_FUNCTION void StudyRecords::write(std::ostream& out, const BlockRecord& record) const {
  std::ostringstream text;
  text << first_words << format << ' ' << identity_.study << ' ' << identity_.machine << ' '
       << identity_.runs << ' ' << identity_.seed << "\nblock " << record.block << ' '
       << record.numbers.size() << ' ' << record.failed.size();
  for (const std::int64_t run : record.failed) text << ' ' << run;
  text << '\n';
  for (const RunStatistics& number : record.numbers) {
    const RunSums& s = number.sums();
    text << "measure " << hex(number.limit()) << ' ' << in_a_line(number.name()) << "\nsums "
         << s.count << ' ' << s.kept;
    for (const double x : {s.mean, s.squares, s.smallest, s.largest}) text << ' ' << hex(x);
    text << ' ' << s.run_of_smallest << ' ' << s.run_of_largest << "\nbins";
    std::uint64_t last = 0;
    number.each_bin([&](std::uint64_t bin, std::uint64_t count) {
      text << ' ' << bin - last;
      if (count > 1) text << '*' << count;
      last = bin;
    });
    text << '\n';
  }
  const std::string lines = text.str();
  detail::Hash hash;
  hash.add(std::string_view(lines));
  out << lines << "end " << hex(hash.value()) << '\n';
}

ESOKIT_FUNCTION Expected<StudyRecords, Error<double>> StudyRecords::read(std::istream& in) {
  StudyRecords all;
  if (!in) return Error<double>{"records", 0.0, "cannot be read"};
  std::string line, lines;
  StudyIdentity of;
  BlockRecord record;
  std::size_t at = 0, measures = 0;  // lines of the record, and its measures
  const auto skip = [&] {
    if (at > 0) ++all.damaged_;
    at = 0;
  };
  for (bool first = true; std::getline(in, line); first = false) {
    if (line.ends_with('\r')) line.pop_back();  // of a file that passed through Windows
    bool good = true;
    if (line.starts_with(first_words)) {
      skip();
      of = {};
      record = {};
      lines.clear();
      double version = 0.0;
      good = read_study(line, of, version);
      if (good && version != format) {
        return Error<double>{"records.format",
                             version,
                             "is that of another release: compute the parts again, with one of "
                             "format",
                             -1,
                             format,
                             true};
      }
    } else if (first && !(in.eof() && std::string_view(first_words).starts_with(line))) {
      return Error<double>{"records", 0.0, "must begin as esokit wrote them: esokit-runs 2 .."};
    } else if (at == 0) {
      continue;  // of a record that was left out
    } else if (at == 1) {
      good = read_block(line, record, measures);
    } else if (at < 2 + 3 * measures) {
      good = at % 3 == 2   ? read_measure(line, of, record)
             : at % 3 == 0 ? read_sums(line, record.numbers.back())
                           : read_bins(line, record.numbers.back());
    } else {
      detail::Hash hash;
      hash.add(std::string_view(lines));
      good = line == "end " + hex(hash.value());
      if (good) {
        at = 0;
        if (const auto ok = all.take(of, std::move(record)); !ok) return ok.error();
        continue;
      }
    }
    ++at;
    lines += line;
    lines += '\n';
    if (!good) skip();
  }
  skip();
  return all;
}

ESOKIT_FUNCTION Check<double> StudyRecords::take(const StudyIdentity& of, BlockRecord&& record) {
  if (blocks_.empty()) identity_ = of;
  if (const auto ok = identity_.validate(of); !ok) return ok.error();
  if (blocks_.contains(record.block) && blocks_.at(record.block) == record) {
    return Error<double>{"records.block", static_cast<double>(record.block),
                         "is there twice: join each part once"};
  }
  return add(std::move(record));
}

ESOKIT_FUNCTION Check<double> StudyRecords::validate(const BlockRecord& record) const {
  const auto there = blocks_.find(record.block);
  bool fits = record.numbers.size() == identity_.names.size();
  for (std::size_t k = 0; fits && k < record.numbers.size(); ++k) {
    const RunStatistics& number = record.numbers[k];
    fits = number.name() == identity_.names[k] && number.limit() == identity_.limits[k] &&
           number.count() + static_cast<std::int64_t>(record.failed.size()) ==
               runs_of_block(record.block, identity_.runs);
  }
  return Rules<double>{}
      .demand(0 <= record.block && record.block < block_count(identity_.runs), "records.block",
              static_cast<double>(record.block), "must be one of the study")
      .demand(fits, "records.block", static_cast<double>(record.block),
              "must have a result of each measure for each run")
      .demand(there == blocks_.end() || there->second == record, "records.block",
              static_cast<double>(record.block), "is there twice, and differs");
}

ESOKIT_FUNCTION std::string StudyRecords::hex(std::uint64_t word) {
  char text[17] = {};
  std::to_chars(text, text + 16, word, 16);
  return text;
}

ESOKIT_FUNCTION std::string StudyRecords::in_a_line(std::string name) {
  std::replace(name.begin(), name.end(), '\n', ' ');
  return name;
}

ESOKIT_FUNCTION std::string_view StudyRecords::next_word(std::string_view& line) {
  const std::size_t from = (std::min)(line.find_first_not_of(' '), line.size());
  const std::size_t to = (std::min)(line.find(' ', from), line.size());
  const std::string_view found = line.substr(from, to - from);
  line.remove_prefix(to);
  return found;
}

template <class Whole>
bool StudyRecords::take(std::string_view& line, Whole& number, int base) {
  const std::string_view text = next_word(line);
  const auto end = std::from_chars(text.data(), text.data() + text.size(), number, base);
  return !text.empty() && end.ec == std::errc{} && end.ptr == text.data() + text.size();
}

ESOKIT_FUNCTION bool StudyRecords::take(std::string_view& line, double& number) {
  std::uint64_t bits = 0;
  if (!take(line, bits, 16)) return false;
  number = std::bit_cast<double>(bits);
  return true;
}

ESOKIT_FUNCTION bool StudyRecords::read_study(std::string_view line, StudyIdentity& of,
                                              double& version) {
  int number = 0;
  next_word(line);
  if (!take(line, number)) return false;
  version = number;
  return version != format || (take(line, of.study) && take(line, of.machine) &&
                               take(line, of.runs) && take(line, of.seed) && of.runs >= 1);
}

ESOKIT_FUNCTION bool StudyRecords::read_block(std::string_view line, BlockRecord& record,
                                              std::size_t& measures) {
  std::size_t failed = 0;
  if (next_word(line) != "block" || !take(line, record.block) || !take(line, measures) ||
      !take(line, failed)) {
    return false;
  }
  for (std::size_t i = 0; i < failed; ++i) {
    std::int64_t run = 0;
    if (!take(line, run)) return false;
    record.failed.push_back(run);
  }
  return true;
}

ESOKIT_FUNCTION bool StudyRecords::read_measure(std::string_view line, StudyIdentity& of,
                                                BlockRecord& record) {
  double limit = 0.0;
  if (next_word(line) != "measure" || !take(line, limit)) return false;
  if (!line.empty()) line.remove_prefix(1);
  of.names.emplace_back(line);
  of.limits.push_back(limit);
  record.numbers.emplace_back(of.names.back(), limit);
  return true;
}

ESOKIT_FUNCTION bool StudyRecords::read_sums(std::string_view line, RunStatistics& number) {
  RunSums s;
  if (next_word(line) != "sums" || !take(line, s.count) || !take(line, s.kept) ||
      !take(line, s.mean) || !take(line, s.squares) || !take(line, s.smallest) ||
      !take(line, s.largest) || !take(line, s.run_of_smallest) || !take(line, s.run_of_largest)) {
    return false;
  }
  number.set_sums(s);
  return true;
}

ESOKIT_FUNCTION bool StudyRecords::read_bins(std::string_view line, RunStatistics& number) {
  if (next_word(line) != "bins") return false;
  std::uint64_t bin = 0;
  for (std::string_view one = next_word(line); !one.empty(); one = next_word(line)) {
    std::uint64_t step = 0, count = 1;
    auto end = std::from_chars(one.data(), one.data() + one.size(), step);
    if (end.ec == std::errc{} && end.ptr != one.data() + one.size() && *end.ptr == '*') {
      end = std::from_chars(end.ptr + 1, one.data() + one.size(), count);
    }
    bin += step;
    if (end.ec != std::errc{} || end.ptr != one.data() + one.size() || bin >> 24u != 0) {
      return false;
    }
    number.set_bin(bin, count);
  }
  return true;
}

}  // namespace esokit::sim
