#include "panel.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace esokit::examples {
namespace {

constexpr std::array automatic_colors = {Color::blue,   Color::vermillion, Color::green,
                                         Color::purple, Color::orange,     Color::sky,
                                         Color::black};

}  // namespace

Panel::Panel() = default;
Panel::Panel(const Panel&) = default;
Panel::Panel(Panel&&) noexcept = default;
Panel::~Panel() = default;

template <class Value>
Panel& Panel::set(Value& member, Value value) {
  member = std::move(value);
  return *this;
}

Panel& Panel::title(std::string text) { return set(title_, std::move(text)); }
Panel& Panel::x_label(std::string text) { return set(x_label_, std::move(text)); }
Panel& Panel::y_label(std::string text) { return set(y_label_, std::move(text)); }
Panel& Panel::x_range(double from, double to) { return set(x_range_, Range{from, to}); }
Panel& Panel::y_range(double from, double to) { return set(y_range_, Range{from, to}); }
Panel& Panel::x_range(Range range) { return set(x_range_, range); }
Panel& Panel::y_range(Range range) { return set(y_range_, range); }
Panel& Panel::x_tick(double distance) { return set(x_tick_, std::optional(distance)); }
Panel& Panel::y_tick(double distance) { return set(y_tick_, std::optional(distance)); }
Panel& Panel::log_x() { return set(log_x_, true); }
Panel& Panel::log_y() { return set(log_y_, true); }
Panel& Panel::equal_axes() { return set(equal_axes_, true); }
Panel& Panel::hide_x_numbers() { return set(hide_x_numbers_, true); }
Panel& Panel::legend(Legend place) { return set(legend_, place); }
Panel& Panel::name(std::string text) { return set(name_, std::move(text)); }
Panel& Panel::line(Column x, Column y, Style style) {
  return add(Series::Kind::line, std::move(x), std::move(y), {}, std::move(style));
}
Panel& Panel::line(const Curve& curve, Style style) {
  return line(Column(curve.x), Column(curve.y), std::move(style));
}
Panel& Panel::points(Column x, Column y, Style style) {
  return add(Series::Kind::points, std::move(x), std::move(y), {}, std::move(style));
}
Panel& Panel::band(Column x, Column low, Column high, Style style) {
  return add(Series::Kind::band, std::move(x), std::move(low), std::move(high), std::move(style));
}
Panel& Panel::horizontal_line(double y, Style style) {
  references_.push_back({y, true, std::move(style)});
  return *this;
}
Panel& Panel::vertical_line(double x, Style style) {
  references_.push_back({x, false, std::move(style)});
  return *this;
}
Panel& Panel::note(double x, double y, std::string text) {
  notes_.push_back({x, y, std::move(text)});
  return *this;
}
Panel& Panel::inset(Inset inset) {
  insets_.push_back(inset);
  return *this;
}
Panel& Panel::map(Column x, Column y, Column z, MapStyle style) {
  map_ = Map{std::move(x).take(), std::move(y).take(), std::move(z).take(), std::move(style)};
  return *this;
}

Panel& Panel::add(Series::Kind kind, Column x, Column y, Column high, Style style) {
  if (style.color == Color::automatic) {
    const auto used = static_cast<std::size_t>(
        std::count_if(series_.begin(), series_.end(),
                      [](const Series& other) { return other.kind != Series::Kind::band; }));
    style.color = automatic_colors[used % automatic_colors.size()];
  }
  series_.push_back(
      {kind, std::move(x).take(), std::move(y).take(), std::move(high).take(), std::move(style)});
  return *this;
}

}  // namespace esokit::examples
