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
body { margin: 0 auto; padding: 1rem clamp(0.8rem, 3vw, 2rem) 4rem; max-width: 70rem;
  background: var(--back); color: var(--text);
  font: 1rem/1.55 system-ui, "DejaVu Sans", Verdana, sans-serif; overflow-wrap: break-word; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 1rem 0 0.3rem; }
h2 { font-size: 1.35rem; margin: 3rem 0 0.3rem; padding-top: 1rem; border-top: 1px solid var(--line); }
h3 { font-size: 1.1rem; margin: 2.2rem 0 0.3rem; }
p { margin: 0.4rem 0 0.8rem; max-width: 48rem; }
a { color: var(--link); }
.quiet, figcaption, caption { color: var(--quiet); }
.counts { display: flex; flex-wrap: wrap; gap: 0.7rem; margin: 1rem 0; padding: 0; list-style: none; }
.counts li { background: var(--card); border: 1px solid var(--line); border-radius: 0.5rem;
  padding: 0.5rem 0.9rem; flex: 1 1 8rem; }
.counts b { display: block; font-size: 1.5rem; line-height: 1.2; }
.plainly { background: var(--card); border: 1px solid var(--line); border-left: 4px solid var(--known);
  border-radius: 0.5rem; padding: 0.6rem 1rem; margin: 1rem 0; }
.plainly.failed { border-left-color: var(--bad); }
.plainly h2, .plainly h3 { margin: 0.2rem 0; padding: 0; border: 0; font-size: 1.05rem; }
.plainly ul { margin: 0.3rem 0; padding-left: 1.2rem; }
figure { margin: 1.2rem 0 1.6rem; }
figure img { display: block; width: 100%; height: auto; background: #ffffff;
  border: 1px solid var(--line); border-radius: 0.4rem; }
.thumbs { display: flex; flex-wrap: wrap; gap: 0.5rem; margin: 0.4rem 0; }
.thumbs img { display: block; object-fit: contain; background: #ffffff;
  border: 1px solid var(--line); border-radius: 0.3rem; }
nav > ul { list-style: none; padding: 0; } nav > ul > li { margin: 1.2rem 0; font-weight: 600; }
nav ul ul { font-weight: 400; }
figcaption { font-size: 0.92rem; margin-top: 0.4rem; }
.table { overflow-x: auto; margin: 1rem 0 1.4rem; }
table { border-collapse: collapse; font-size: 0.92rem; font-variant-numeric: tabular-nums; }
caption { text-align: left; padding-bottom: 0.4rem; }
th, td { padding: 0.28rem 0.7rem; border-bottom: 1px solid var(--line); text-align: right;
  white-space: nowrap; }
th:first-child, td:first-child, td.text { text-align: left; }
td.text { white-space: normal; min-width: 12rem; }
thead th { border-bottom: 2px solid var(--line); }
th.group { text-align: center; }
.pass { color: var(--good); } .fail { color: var(--bad); font-weight: 600; }
.known_miss { color: var(--known); } .reported { color: var(--quiet); }
details { margin: 0.8rem 0; } summary { cursor: pointer; }
)css";

}  // namespace esokit::examples
