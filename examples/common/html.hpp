/// @file
/// Text and addresses as HTML wants them, and the look of the pages.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace esokit::examples {

/// For text and for quoted attributes.
[[nodiscard]] inline std::string html_text(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

/// A relative address of a file.
[[nodiscard]] inline std::string html_address(const std::filesystem::path& file) {
  constexpr std::string_view digits = "0123456789ABCDEF";
  std::string address;
  for (const char c : file.generic_string()) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '_' || c == '.' || c == '/' || c == '~';
    if (plain) {
      address += c;
    } else {
      const auto byte = static_cast<unsigned char>(c);
      address += {'%', digits[byte / 16U], digits[byte % 16U]};
    }
  }
  return address;
}

/// A name for an anchor.
[[nodiscard]] inline std::string html_anchor(std::string_view text) {
  std::string anchor;
  for (const char c : text) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '_';
    anchor += plain ? c : '-';
  }
  return anchor;
}

/// Everything that the pages need, so that they load nothing from elsewhere.
inline constexpr std::string_view page_style = R"css(
:root { color-scheme: light dark;
  --back: #ffffff; --card: #f5f6f8; --text: #1c2330; --quiet: #566072; --line: #d8dce3;
  --link: #0b5cad; --good: #14703a; --bad: #b3261e; --known: #8a5a00; }
@media (prefers-color-scheme: dark) { :root {
  --back: #14171c; --card: #1d2229; --text: #e4e8ee; --quiet: #a2acbb; --line: #363d49;
  --link: #7db8f5; --good: #6fd197; --bad: #ff8f85; --known: #e6b450; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem clamp(0.8rem, 3vw, 2rem) 4rem; max-width: 110rem;
  background: var(--back); color: var(--text);
  font: 1rem/1.55 system-ui, "DejaVu Sans", Verdana, sans-serif; overflow-wrap: break-word; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 1rem 0 0.3rem; }
h2 { font-size: 1.35rem; margin: 2.5rem 0 0.3rem; padding-top: 1rem; border-top: 1px solid var(--line); }
h3 { font-size: 1.1rem; margin: 2.2rem 0 0.3rem; }
h3 .quiet { font-weight: 400; font-size: 0.9rem; }
p, figcaption { margin: 0.4rem 0 0.8rem; max-width: 56rem; }
a { color: var(--link); }
.quiet, figcaption { color: var(--quiet); }
.counts span { margin-right: 0.3rem; }
.counts > span { display: inline-block; margin-right: 1.2rem; }
.cards { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(19rem, 100%), 1fr));
  gap: 1rem; padding: 0; list-style: none; }
.cards li { background: var(--card); border: 1px solid var(--line); border-radius: 0.5rem;
  padding: 0.7rem; font-size: 0.92rem; }
.cards svg { display: block; width: 100%; height: 13rem; overflow: hidden; background: #ffffff;
  border-radius: 0.3rem; margin-bottom: 0.4rem; }
.cards p { margin: 0.3rem 0 0; }
.plainly { background: var(--card); border: 1px solid var(--line); border-left: 4px solid var(--known);
  border-radius: 0.5rem; padding: 0.6rem 1rem; margin: 1rem 0; max-width: 70rem; }
.plainly.failed { border-left-color: var(--bad); }
.plainly h2 { margin: 0.2rem 0; padding: 0; border: 0; font-size: 1.05rem; }
.plainly ul { margin: 0.3rem 0; padding-left: 1.2rem; }
figure { margin: 1.2rem 0 1.6rem; max-width: 70rem; }
figure.tab { max-width: none; }
figure img { display: block; width: 100%; height: auto; background: #ffffff;
  border: 1px solid var(--line); border-radius: 0.4rem; }
figcaption { font-size: 0.92rem; margin-top: 0.4rem; }
/* A box with more to the side has a scroll bar at all times and a shadow at that side. */
.table { overflow-x: auto; width: fit-content; max-width: 100%; scrollbar-width: auto;
  background: linear-gradient(to right, var(--back) 30%, transparent) left / 3rem 100% no-repeat local,
    linear-gradient(to left, var(--back) 30%, transparent) right / 3rem 100% no-repeat local,
    linear-gradient(to right, var(--quiet), transparent) left / 0.7rem 100% no-repeat scroll,
    linear-gradient(to left, var(--quiet), transparent) right / 0.7rem 100% no-repeat scroll; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.28rem 0.6rem; border-bottom: 1px solid var(--line); text-align: right;
  vertical-align: top; }
td { white-space: nowrap; }
th { max-width: 12rem; font-weight: 600; }
th:first-child, td:first-child, .text { text-align: left; }
tbody th { font-weight: 400; min-width: 7rem; }
td.text { white-space: normal; min-width: 9rem; max-width: 34rem; }
td.narrow { min-width: 5rem; }
thead th { border-bottom: 2px solid var(--line); vertical-align: bottom; }
.pass { color: var(--good); } .fail { color: var(--bad); font-weight: 600; }
.known_miss { color: var(--known); } .reported { color: var(--quiet); }
details { margin: 0.8rem 0; } summary { cursor: pointer; }
)css";

}  // namespace esokit::examples
