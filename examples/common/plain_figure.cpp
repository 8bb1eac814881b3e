#include "plain_figure.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <map>
#include <vector>

#include "csv.hpp"

namespace esokit::examples {
namespace {

constexpr double width = 900.0;  // px, as draw_figure.py has it, also what follows
constexpr std::array colors = {"#000000", "#0072B2", "#D55E00", "#009E73", "#CC79A7",
                               "#E69F00", "#56B4E9", "#000000", "#808080"};
constexpr std::array dashes = {"none", "9,4", "2,3", "10,3,2,3"};

struct Point {
  double x, y, more;
};

/// What a row `draw` says; the lines across have no points.
struct Drawn {
  CsvRow words;
  std::vector<Point> points;
  [[nodiscard]] const std::string& kind() const { return words[1]; }
  [[nodiscard]] const std::string& name() const { return words[3]; }
  [[nodiscard]] std::size_t number(std::size_t i) const {
    return static_cast<std::size_t>(std::atoi(words[i].c_str()));
  }
};

/// One axis: from value to px.
struct Axis {
  double from, to, low, high;  ///< values, and their px
  bool log;
  [[nodiscard]] double at(double value) const {
    const double share =
        log ? std::log(value / from) / std::log(to / from) : (value - from) / (to - from);
    return low + (high - low) * share;
  }
};

struct Place {
  std::size_t row, column, rows, columns;
};

struct PlainPanel {
  Place place{};
  std::map<std::string, CsvRow> settings;
  std::vector<Drawn> drawn;
  std::vector<CsvRow> notes;
  double left = 0, right = 0, top = 0, bottom = 0;  // of its axes, px

  [[nodiscard]] std::string get(const char* key) const {
    const auto found = settings.find(key);
    return found == settings.end() ? "" : found->second[1];
  }
  [[nodiscard]] std::size_t legend() const {
    const auto named = [](const Drawn& one) { return !one.name().empty(); };
    if (std::none_of(drawn.begin(), drawn.end(), named)) return 0;
    const std::string set = get("legend");
    return set.empty() ? 2 : static_cast<std::size_t>(std::atoi(set.c_str()));
  }
};

/// The rows of a CSV text.
std::vector<CsvRow> rows_of(const std::string& text) {
  std::vector<CsvRow> rows;
  bool quoted = false, begun = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (!begun) rows.push_back({""});
    begun = true;
    if (text[i] == '"') {
      if (quoted && i + 1 < text.size() && text[i + 1] == '"')
        rows.back().back() += text[++i];
      else
        quoted = !quoted;
    } else if (!quoted && text[i] == ',') {
      rows.back().emplace_back();
    } else if (!quoted && text[i] == '\n') {
      begun = false;
    } else if (text[i] != '\r') {
      rows.back().back() += text[i];
    }
  }
  return rows;
}

/// The series of the numbers: two empty rows begin one, one is a gap.
std::vector<std::vector<Point>> series_of(const std::string& numbers) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::vector<Point>> all(1);
  int empty = 0;
  for (const CsvRow& row : rows_of(numbers)) {
    if (row.size() < 5) {
      if (++empty == 2) all.emplace_back();
      if (empty < 2) all.back().push_back({nan, nan, nan});
      continue;
    }
    empty = 0;
    const auto number = [&row](std::size_t i) {
      return row[i].empty() ? nan : std::strtod(row[i].c_str(), nullptr);
    };
    all.back().push_back({number(2), number(3), number(4)});
  }
  all.erase(all.begin());  // the heading
  return all;
}

std::string px(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1f", value);
  return text.data();
}

/// gnuplot's marks: `z_3`, `y^{(n)}`.
std::string marked(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if ((c == '_' || c == '^') && i + 1 < text.size()) {
      const bool braced = text[i + 1] == '{';
      const std::size_t end = braced ? std::min(text.find('}', i), text.size()) : i + 2;
      const std::size_t begin = i + (braced ? 2 : 1);
      out += c == '_' ? "<tspan dy=\"4\" font-size=\"9\">" : "<tspan dy=\"-5\" font-size=\"9\">";
      out += text.substr(begin, end - begin);
      out += c == '_' ? "</tspan><tspan dy=\"-4\">\u200b</tspan>"
                      : "</tspan><tspan dy=\"5\">\u200b</tspan>";
      i = braced ? end : i + 1;
    } else if (c == '&' || c == '<' || c == '>') {
      out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : "&gt;";
    } else {
      out += c;
    }
  }
  return out;
}

std::string label(const std::string& text, double x, double y, const char* anchor,
                  const std::string& more = "") {
  return "<text x=\"" + px(x) + "\" y=\"" + px(y) + "\" text-anchor=\"" + anchor + "\"" + more +
         ">" + marked(text) + "</text>\n";
}

/// How a curve is drawn, without its fill.
std::string stroke(const Drawn& one, double factor) {
  return std::string("stroke=\"") + colors[one.number(4)] + "\" stroke-width=\"" +
         px(factor * std::atof(one.words[6].c_str())) + "\" stroke-dasharray=\"" +
         dashes[one.number(5)] + "\" stroke-opacity=\"" + one.words[9] + "\" ";
}

/// The ends of an axis: those that are set, the others by the data.
Axis axis_of(const PlainPanel& panel, bool is_x) {
  const std::string which = is_x ? "x" : "y";
  double from = std::numeric_limits<double>::infinity(), to = -from;
  const bool log = !panel.get((which + "_log").c_str()).empty();
  const auto take = [&](double value) {
    if (!std::isfinite(value) || (log && value <= 0)) return;
    from = std::min(from, value);
    to = std::max(to, value);
  };
  for (const Drawn& one : panel.drawn) {
    if (!is_x && one.kind() == "horizontal") take(std::atof(one.words[2].c_str()));
    for (const Point& point : one.points) {
      take(is_x ? point.x : point.y);
      if (!is_x && one.kind() == "band") take(point.more);
    }
  }
  if (!(from <= to)) from = log ? 0.1 : 0, to = 1;
  if (from == to) from -= log ? 0.5 * from : 1, to += log ? to : 1;
  if (!is_x && log) {
    from = std::pow(10, std::floor(std::log10(from)));
    to = std::pow(10, std::ceil(std::log10(to)));
  } else if (!is_x) {
    const double spare = 0.04 * (to - from);
    from -= spare;
    to += spare;
  }
  if (const auto set = panel.settings.find(which + "_range"); set != panel.settings.end()) {
    if (set->second[1] != "*") from = std::atof(set->second[1].c_str());
    if (set->second[2] != "*") to = std::atof(set->second[2].c_str());
  }
  return is_x ? Axis{from, to, panel.left, panel.right, log}
              : Axis{from, to, panel.bottom, panel.top, log};
}

/// Where an axis has numbers.
std::vector<double> ticks_of(const Axis& axis, const std::string& asked, double apart) {
  std::vector<double> ticks;
  const double room = std::abs(axis.high - axis.low) / apart;
  if (axis.log) {
    const int first = static_cast<int>(std::ceil(std::log10(axis.from) - 1e-9));
    const int last = static_cast<int>(std::floor(std::log10(axis.to) + 1e-9));
    const int step = std::max(1, static_cast<int>(std::ceil((last - first) / room)));
    for (int i = first; i <= last; i += step) ticks.push_back(std::pow(10, i));
    return ticks;
  }
  double step = (axis.to - axis.from) / std::max(room, 1.0);
  const double power = std::pow(10, std::floor(std::log10(step)));
  step = power * (step <= power ? 1 : step <= 2 * power ? 2 : step <= 5 * power ? 5 : 10);
  if (!asked.empty() && asked != "*") step = std::atof(asked.c_str());
  const double first = std::ceil(axis.from / step - 1e-9);
  for (double i = first; i * step <= axis.to + 1e-9 * step; ++i) ticks.push_back(i * step + 0.0);
  return ticks;
}

std::string frame(const PlainPanel& panel, const Axis& x, const Axis& y) {
  const bool hidden = !panel.get("x_hidden").empty();
  std::string out;
  const auto tick = [](const Axis& axis, double value) {
    return axis.log ? "10^{" + number_text(std::round(std::log10(value))) + "}"
                    : number_text(value, 6);
  };
  const auto grid = [&out](double x1, double y1, double x2, double y2) {
    out += "<path stroke=\"#dedede\" d=\"M" + px(x1) + " " + px(y1) + "L" + px(x2) + " " + px(y2) +
           "\"/>";
  };
  for (const double value : ticks_of(x, panel.get("x_tick"), 60)) {
    grid(x.at(value), panel.top, x.at(value), panel.bottom);
    if (!hidden) out += label(tick(x, value), x.at(value), panel.bottom + 16, "middle");
  }
  for (const double value : ticks_of(y, panel.get("y_tick"), 26)) {
    grid(panel.left, y.at(value), panel.right, y.at(value));
    out += label(tick(y, value), panel.left - 6, y.at(value) + 4, "end");
  }
  const double middle = (panel.left + panel.right) / 2;
  if (!hidden) out += label(panel.get("x_label"), middle, panel.bottom + 36, "middle");
  out += "<g transform=\"translate(" + px(panel.left - 48) + " " +
         px((panel.top + panel.bottom) / 2) + ") rotate(-90)\">" +
         label(panel.get("y_label"), 0, 0, "middle") + "</g>\n";
  return out + label(panel.get("title"), middle, panel.top - 8 - (panel.legend() == 5 ? 20 : 0),
                     "middle");
}

std::string curve(const Drawn& one, const PlainPanel& panel, const Axis& x, const Axis& y) {
  const auto point = [&](double at_x, double at_y) {
    return px(x.at(at_x)) + " " + px(y.at(at_y));
  };
  const double at = std::atof(one.words[2].c_str());
  const auto path = [](const std::string& way, const std::string& how) {
    return "<path d=\"" + way + "\" " + how + "/>\n";
  };
  if (one.kind() == "vertical") {
    return path("M" + px(x.at(at)) + " " + px(panel.top) + "V" + px(panel.bottom),
                stroke(one, 0.75));
  }
  if (one.kind() == "horizontal") {
    return path("M" + px(panel.left) + " " + px(y.at(at)) + "H" + px(panel.right),
                stroke(one, 0.75));
  }
  const auto shown = [&](const Point& p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && !(x.log && p.x <= 0) && !(y.log && p.y <= 0);
  };
  const std::string fill =
      std::string("fill=\"") + colors[one.number(4)] + "\" fill-opacity=\"" + one.words[9] + "\"";
  std::string way;
  if (one.kind() == "points") {
    const double size = std::atof(one.words[8].c_str());
    std::string out;
    for (const Point& p : one.points) {
      if (!shown(p)) continue;
      out += "<circle cx=\"" + px(x.at(p.x)) + "\" cy=\"" + px(y.at(p.y)) + "\" r=\"" +
             px(size * (one.number(7) == 0 ? 1.8 : 3.2)) + "\" " +
             (one.number(7) == 2 ? stroke(one, 0.75) : fill) + "/>\n";
    }
    return out;
  }
  if (one.kind() == "band") {
    std::vector<Point> inside;
    for (const Point& p : one.points) {
      if (shown(p) && std::isfinite(p.more) && !(y.log && p.more <= 0)) inside.push_back(p);
    }
    for (const Point& p : inside) way += (way.empty() ? "M" : "L") + point(p.x, p.y);
    for (auto p = inside.rbegin(); p != inside.rend(); ++p) way += "L" + point(p->x, p->more);
    return way.empty() ? "" : path(way + "Z", fill);
  }
  if (one.kind() != "line") return "";
  bool pen = false;
  for (const Point& p : one.points) {
    const bool here = shown(p);
    if (here) way += (pen ? "L" : "M") + point(p.x, p.y);
    pen = here;
  }
  return path(way, stroke(one, 1));
}

std::string legend(const PlainPanel& panel) {
  const std::size_t place = panel.legend();
  if (place == 0) return "";
  std::vector<const Drawn*> named;
  double longest = 0, all = 0;
  for (const Drawn& one : panel.drawn) {
    if (one.name().empty()) continue;
    named.push_back(&one);
    const double wide = 46 + 6.4 * static_cast<double>(one.name().size());
    longest = std::max(longest, wide);
    all += wide;
  }
  const bool above = place == 5, left = place == 1 || place == 3, top = place <= 2;
  const double high = 17 * static_cast<double>(named.size());
  double x = above  ? std::max(0.0, (panel.left + panel.right - all) / 2)
             : left ? panel.left + 6
                    : panel.right - longest - 2;
  double y = above ? panel.top - 10 : top ? panel.top + 14 : panel.bottom - high + 8;
  std::string out;
  if (!above) {
    out += "<rect x=\"" + px(x - 3) + "\" y=\"" + px(y - 11) + "\" width=\"" + px(longest) +
           "\" height=\"" + px(high + 2) + "\" fill=\"#ffffff\"/>\n";
  }
  for (const Drawn* one : named) {
    out += one->kind() == "points"
               ? "<circle cx=\"" + px(x + 13) + "\" cy=\"" + px(y - 1) + "\" r=\"3\" "
               : "<path d=\"M" + px(x) + " " + px(y - 1) + "h26\" ";
    out += stroke(*one, 1) + "/>" + label(one->name(), x + 32, y + 3, "start");
    if (above)
      x += 46 + 6.4 * static_cast<double>(one->name().size());
    else
      y += 17;
  }
  return out;
}

}  // namespace

std::string plain_svg(const std::string& description, const std::string& numbers) {
  auto series = series_of(numbers);
  std::vector<PlainPanel> panels;
  std::size_t next = 0, lines = 1, columns = 1;
  double panel_height = 190;
  std::string title;
  const auto count = [](const std::string& text) {
    return static_cast<std::size_t>(std::atoi(text.c_str()));
  };
  for (CsvRow& row : rows_of(description)) {
    if (row[0] == "figure") {
      title = row[3];
      lines = count(row[4]);
      columns = count(row[5]);
      panel_height = std::atof(row[6].c_str());
    } else if (row[0] == "panel") {
      panels.emplace_back().place = {count(row[1]), count(row[2]), count(row[3]), count(row[4])};
    } else if (row[0] == "draw") {
      Drawn one{std::move(row), {}};
      const bool across = one.kind() == "horizontal" || one.kind() == "vertical";
      if (!across && next < series.size()) one.points = std::move(series[next++]);
      panels.back().drawn.push_back(std::move(one));
    } else if (row[0] == "note") {
      panels.back().notes.push_back(std::move(row));
    } else if (row[0] != "inset") {
      const std::string key = row[0];
      panels.back().settings[key] = std::move(row);
    }
  }

  const double head = title.empty() ? 0 : 28, room_top = 34, room_bottom = 48, room_left = 74;
  const double wide = width / static_cast<double>(columns);
  const double tall = panel_height + room_top + room_bottom;
  const double height = head + static_cast<double>(lines) * tall;
  std::string out = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + px(width) + " " +
                    px(height) + "\" width=\"" + px(width) + "\" height=\"" + px(height) +
                    "\" font-family=\"DejaVu Sans, Verdana, Arial, sans-serif\" font-size=\"11\" "
                    "fill=\"none\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n";
  std::string words;  // over all that is drawn
  words += label(title, width / 2, 18, "middle", " font-size=\"14\"");
  std::size_t clip = 0;
  for (PlainPanel& panel : panels) {
    const auto [row, column, rows, all] = panel.place;
    panel.left = static_cast<double>(column) * wide + room_left;
    panel.right = static_cast<double>(column + all) * wide - 18;
    panel.top = head + static_cast<double>(row) * tall + room_top;
    panel.bottom = head + static_cast<double>(row + rows) * tall - room_bottom;
    const Axis x = axis_of(panel, true), y = axis_of(panel, false);
    const std::string box = "<rect x=\"" + px(panel.left) + "\" y=\"" + px(panel.top) +
                            "\" width=\"" + px(panel.right - panel.left) + "\" height=\"" +
                            px(panel.bottom - panel.top) + "\"";
    out += "<g fill=\"#202020\">" + frame(panel, x, y) + "</g>\n";
    const std::string id = "c" + std::to_string(clip++);
    out += "<clipPath id=\"" + id + "\">" + box + "/></clipPath>\n<g clip-path=\"url(#" + id +
           ")\">\n";
    for (const Drawn& one : panel.drawn) out += curve(one, panel, x, y);
    out += "</g>\n" + box + " stroke=\"#404040\" stroke-width=\"0.8\"/>\n";
    words += legend(panel);
    for (const CsvRow& note : panel.notes) {
      words += label(note[3], x.at(std::atof(note[1].c_str())), y.at(std::atof(note[2].c_str())),
                     "start");
    }
  }
  return out + "<g fill=\"#202020\">" + words + "</g>\n</svg>\n";
}

}  // namespace esokit::examples
