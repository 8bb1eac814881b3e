#!/usr/bin/env bash
# What measured_log makes of files as people have them: check_measured_log.sh PROGRAM
# Readable ones are read, whatever their separators and gaps; of the others it says what is wrong and
# where. The last line is "N passed, N failed".
set -uo pipefail
program=$(realpath "${1:?usage: check_measured_log.sh PROGRAM}")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
passed=0
failed=0

verdict() {  # verdict STATUS TEXT...
  if (($1 == 0)); then
    passed=$((passed + 1))
  else
    failed=$((failed + 1))
    shift
    echo "FAILED: $*"
  fi
}

settings=(--order 2 --b0 2 --bandwidth 20)

# run FILE [OPTION...]; what it says is in $said
run() {
  local file=$1
  shift
  said=$("$program" "$file" "${settings[@]}" --out out "$@" 2>&1)
}

refuses() {  # refuses "TEXT OF THE ERROR" FILE [OPTION...]
  local text=$1 status=0
  shift
  run "$@" || status=$?
  [[ $status == 2 && $said == *"$text"* ]]
  verdict $? "$*: expected '$text', got status $status and: $said"
}

# near EXPECTED COLUMN FILE: the column's last estimate, to a millionth
near() {
  local last
  last=$(tail -n 1 "out/control_practice/$(basename "${3%.*}")/estimates.csv" | cut -d, -f"$2")
  awk -v a="$last" -v b="$1" 'BEGIN { d = a - b; exit !(a != "" && d * d <= 1e-12 * (1 + b * b)) }'
  verdict $? "$3: column $2 ends at $last, expected $1"
}

# reads FILE [OPTION...]: to the end, and with the disturbance that is in the data
reads() {
  local status=0
  run "$@" || status=$?
  ((status == 0))
  verdict $? "$*: status $status: $said"
  near 3 4 "$1"
}

# y'' = 3 + 2 u, u = 0.5 and, from 1 s on, -1; rows t, y, u.
table() {  # table SEPARATOR [AWK CONDITION for a row with a measurement]
  awk -v s="$1" 'BEGIN {
    for (k = 0; k <= 400; ++k) {
      t = k * 0.01; u = t < 0.995 ? 0.5 : -1
      printf "%.2f%s%s%s%s\n", t, s, ('"${2:-1}"' ? sprintf("%.12g", y) : ""), s, u
      a = 3 + 2 * u; y += v * 0.01 + a * 0.5e-4; v += a * 0.01
    }
  }'
}
named=(--time t --y y --u u)

{ echo t,y,u; table ,; } >plain.csv
reads plain.csv "${named[@]}"
for observer in half-gain reduced cascade algebraic adjustable nonlinear; do
  reads plain.csv "${named[@]}" --observer "$observer"
done
reads plain.csv --time 1 --y 2 --u 3
table , >no_header.csv
reads no_header.csv --time 1 --y 2 --u 3
reads no_header.csv --y 2 --u 3 --sample-time 0.01
{ echo 't;y;u'; table ';'; } >semicolons.csv
reads semicolons.csv "${named[@]}"
{ echo 't|y|u'; table '|'; } >bars.csv
reads bars.csv "${named[@]}"
{ echo 't;y;u'; table ';' | tr . ,; } >decimal_commas.csv
reads decimal_commas.csv "${named[@]}"
{ echo '# logged by hand'; echo t,y,u; echo s,m,N; echo '// units above'; table ,; } >comments.csv
reads comments.csv "${named[@]}"
{ echo '% t y u'; table ' '; } >named_in_comment.csv
reads named_in_comment.csv "${named[@]}"
{ echo /clock/t,/joint_states/joint1/position,/joint_states/joint1/effort; table ,; } >topics.csv
reads topics.csv --time t --y position --u /joint_states/joint1/effort
{ echo t,y,u; table ,; printf 4.01,2; } >cut.csv
reads cut.csv "${named[@]}"
{ printf 't\ty\tu\n'; table '\t'; } >tabs.csv
reads tabs.csv "${named[@]}"
reads tabs.csv "${named[@]}" --separator tab
{ echo t y u; table ' '; } >spaces.csv
reads spaces.csv "${named[@]}"
{ printf '\xef\xbb\xbf"t","y","u"\r\n'; table , | sed 's/$/\r/'; } >spreadsheet.csv
reads spreadsheet.csv "${named[@]}"
{ echo '"time, s",y,u'; table ,; } >quoted.csv
reads quoted.csv --time 'time, s' --y y --u u
{ echo t,y,u; table , 'k < 100 || k > 150'; } >gap.csv
reads gap.csv "${named[@]}"
{ echo t,y,u; table , | awk -F, 'NR % 7 != 3'; } >irregular.csv
reads irregular.csv "${named[@]}"

# A name of nothing but dots is no folder: nothing is written beside the other results, nor removed.
mkdir -p out/control_practice
echo precious | tee out/summary.csv out/contents.csv out/control_practice/summary.csv >/dev/null
for dots in ..csv ...csv; do
  cp plain.csv "$dots"
  run "$dots" "${named[@]}"
  verdict $? "$dots: $said"
  [[ $(cat out/summary.csv out/contents.csv out/control_practice/summary.csv) == \
    $'precious\nprecious\nprecious' && ! -e out/estimates.csv &&
    ! -e out/control_practice/estimates.csv ]]
  verdict $? "$dots: wrote outside of its folder: $(find out -newer "$dots")"
done

{ echo t,/a/position,/b/position; table ,; } >two.csv
refuses "'position' is /a/position and /b/position" two.csv --time t --y position --u 3
refuses "no column 'torque'; there are t, y, u" plain.csv --time t --y y --u torque
refuses "there is no header and are 3 columns" no_header.csv --time 1 --y 2 --u 4
sed '5s/.*/0.03,about 2,1/' plain.csv >word.csv
refuses "word.csv, line 5: 'about 2' in column 'y' is not a number" word.csv "${named[@]}"
sed '7s/.*/0.05,1/' plain.csv >short.csv
refuses "short.csv, line 7: only 2 fields, none for 'u'" short.csv "${named[@]}"
sed '9s/^[^,]*/0.02/' plain.csv >backwards.csv
refuses "backwards.csv, line 9: time runs backwards, from 0.06 to 0.02 s" backwards.csv "${named[@]}"
sed '9s/^[^,]*/0.06/' plain.csv >still.csv
refuses "still.csv, line 9: time stands still" still.csv "${named[@]}"
sed '9s/^[^,]*//' plain.csv >timeless.csv
refuses "timeless.csv, line 9: the time is missing" timeless.csv "${named[@]}"
sed '402s/^4.00/9999/' plain.csv >leap.csv
refuses "is too short or too long for the nominal sample time" leap.csv "${named[@]}"
echo t,y,u >empty.csv
refuses "empty.csv: no line with numbers" empty.csv "${named[@]}"
refuses "cannot read nowhere.csv" nowhere.csv "${named[@]}"
refuses ". is a folder" . "${named[@]}"
refuses "--u is missing" plain.csv --time t --y y
refuses "--time or --sample-time is missing" plain.csv --y y --u u
refuses "unknown option --bandwith" plain.csv "${named[@]}" --bandwith 3
refuses "--bandwidth: 'fast' is not a number" plain.csv "${named[@]}" --bandwidth fast
refuses "observer_bandwidth = -1" plain.csv "${named[@]}" --bandwidth -1
refuses "--order: must be 1, 2 or 3" plain.csv "${named[@]}" --order 4
refuses "no observer 'luenberger'; there are linear" plain.csv "${named[@]}" --observer luenberger

echo "$passed passed, $failed failed"
((failed == 0))
