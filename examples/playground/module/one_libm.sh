#!/usr/bin/env bash
# The mathematics of musl, which WebAssembly's library has too, as an archive: one_libm.sh OUT.a
# What a search finds depends on the last bits of exp and sin; with these playground_log_twin has the page's.
# Without Debian's musl-dev the archive is empty, and the twin has those of this system.
set -euo pipefail
out=$(realpath -m "$1")
musl=/usr/lib/$(uname -m)-linux-musl/libc.a
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
if [[ -e $musl ]]; then
  functions='a?(cos|sin|tan)h?|sincos|atan2|a?exp(2|m1)?|log(2|10|1p)?|pow|hypot|cbrt|erf|lgamma(_r)?|scalbn|ldexp'
  complex='c(exp|log|sqrt|abs|arg)'
  parts='__(sin|cos|tan|expo2|rem_pio2|rem_pio2_large|math_[a-z]*|cexp|ldexp_cexp|log1p)|(exp|log|log2|pow)_data|signgam'
  mapfile -t members < <(ar t "$musl" | grep -E "^($functions|$complex|$parts)\.lo$")
  ar x "$musl" "${members[@]}"
  ar rcs all.a ./*.lo
else
  ar rcs all.a
fi
mv all.a "$out"
