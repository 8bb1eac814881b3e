#!/usr/bin/env bash
# What can be tried of the packages without a network: cmake/packaging/check.sh BUILD_FOLDER
# BUILD_FOLDER is emptied; the files of a release are in BUILD_FOLDER/release afterwards. Needs
# pkg-config and dpkg; the last line says what was not tried.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
work=$(realpath -m "${1:?usage: check.sh BUILD_FOLDER}")
rm -rf "$work"
mkdir -p "$work"
cd "$root"

version=$(sed -n 's/^project(esokit VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
[[ $version =~ ^[0-9]+\.[0-9]+\.[0-9]+$ ]]
not_tried=()

fail() {
  echo "packaging: $*" >&2
  exit 1
}

# The version is that of CMakeLists.txt everywhere (configure checks core/version.hpp).
grep -q "\"version\": \"$version\"" cmake/packaging/vcpkg/vcpkg.json || fail "vcpkg.json: version"
grep -q "<version>$version</version>" cmake/packaging/ros/package.xml || fail "package.xml: version"
grep -q "^version: $version\$" CITATION.cff || fail "CITATION.cff: version"

awk '/^```cpp[ \t]*$/ { inside = 1; next } /^```/ && inside { exit } inside' README.md \
  >"$work/main.cpp"
[[ -s $work/main.cpp ]]

# --- Debian package, unpacked into a prefix; CMake and pkg-config find it there ---
cmake -S . -B "$work/build" -G Ninja
(cd "$work/build" && cpack -G DEB)
deb=("$work"/build/libesokit-dev_"$version"*_all.deb)
[[ -f ${deb[0]} ]] || fail "cpack made no all-architecture package of version $version"
dpkg-deb --info "${deb[0]}"
dpkg-deb -x "${deb[0]}" "$work/root"
while IFS= read -r header; do
  [[ -f $work/root/usr/$header ]] || fail "the package lacks $header"
done < <(find include -type f)
[[ -f $work/root/usr/share/doc/libesokit-dev/copyright ]] || fail "the package has no copyright"

cmake -S tests/consumer -B "$work/consumer" -G Ninja -DCONSUMER_MAIN="$work/main.cpp" \
  -DCMAKE_PREFIX_PATH="$work/root/usr"
cmake --build "$work/consumer"
"$work/consumer/consumer"
cmake -S tests/consumer -B "$work/newer" -G Ninja -DCONSUMER_MAIN="$work/main.cpp" \
  -DCMAKE_PREFIX_PATH="$work/root/usr" -DCONSUMER_VERSION=999.0 >"$work/newer.log" 2>&1 &&
  fail "a consumer that asks for version 999 was satisfied"

export PKG_CONFIG_PATH=$work/root/usr/share/pkgconfig
[[ $(pkg-config --modversion esokit) == "$version" ]] || fail "pkg-config: version"
read -r -a flags < <(pkg-config --cflags esokit)
"${CXX:-c++}" -std=c++20 "${flags[@]}" "$work/main.cpp" -o "$work/by_pkg_config"
read -r -a flags < <(pkg-config --cflags esokit-compiled)
"${CXX:-c++}" -std=c++20 "${flags[@]}" -c "$(pkg-config --variable=source esokit-compiled)" -o "$work/esokit.o"
"${CXX:-c++}" -std=c++20 "${flags[@]}" tests/consumer/workstation.cpp "$work/esokit.o" -o "$work/workstation"
"$work/workstation"
"$work/by_pkg_config"

# --- FetchContent, with the lines of README.md ---
mkdir "$work/fetch"
{
  echo 'cmake_minimum_required(VERSION 3.23)'
  echo 'project(my LANGUAGES CXX)'
  echo "add_executable(my_controller \"$work/main.cpp\")"
  awk '/^```cmake$/ { inside = 1; next } /^```/ && inside { exit } inside' README.md |
    sed "s|GIT_REPOSITORY <this repository> GIT_TAG main|GIT_REPOSITORY \"$root\" GIT_TAG $(git rev-parse HEAD)|"
} >"$work/fetch/CMakeLists.txt"
grep -q "GIT_REPOSITORY \"$root\"" "$work/fetch/CMakeLists.txt"
cmake -S "$work/fetch" -B "$work/fetch/build" -G Ninja
cmake --build "$work/fetch/build"
"$work/fetch/build/my_controller"

# --- one header, or one and a source file ---
mkdir -p "$work/single" "$work/release/split"
cp "${deb[0]}" "$work/release"
bash cmake/amalgamate.sh >"$work/release/esokit.hpp"
bash cmake/amalgamate.sh observer adapter control >"$work/release/esokit_control.hpp"
if grep -n '#include <esokit/' "$work"/release/*.hpp; then fail "a single header includes esokit"; fi
if grep -n '#include <Eigen/' "$work/release/esokit_control.hpp"; then fail "esokit_control.hpp includes Eigen"; fi
bash cmake/amalgamate.sh observer/linear_eso.hpp observer/cascade_eso.hpp >"$work/single/observers.hpp"
bash cmake/amalgamate.sh control/adrc.hpp >"$work/single/adrc.hpp"
# by_headers NAME HEADER...: the program of README.md with these instead of its own
by_headers() {
  local name=$1 header includes=
  shift
  for header; do includes+="#include \"$header\"\n"; done
  { printf '%b' "$includes"; grep -v '#include <esokit/' "$work/main.cpp"; } >"$work/single/$name.cpp"
  # shellcheck disable=SC2046
  "${CXX:-c++}" -std=c++20 -I"$work/single" -I"$work/release" $(pkg-config --cflags eigen3) \
    "$work/single/$name.cpp" -o "$work/single/$name"
  "$work/single/$name"
}
by_headers control esokit_control.hpp
by_headers everything esokit.hpp adrc.hpp
by_headers several observers.hpp adrc.hpp esokit_control.hpp
bash cmake/amalgamate.sh --split "$work/release/split"
if grep -n '#include <esokit/' "$work"/release/split/*; then fail "the two files include esokit"; fi
sed 's/#include <esokit.*/#include "esokit.hpp"/' tests/consumer/workstation.cpp >"$work/single/workstation.cpp"
# shellcheck disable=SC2046
"${CXX:-c++}" -std=c++20 -I"$work/release/split" $(pkg-config --cflags eigen3) \
  "$work/single/workstation.cpp" "$work/release/split/esokit.cpp" -o "$work/single/workstation"
"$work/single/workstation"

# --- vcpkg port: run with stand-ins for vcpkg's functions, which do what theirs do here ---
cat >"$work/port.cmake" <<END
cmake_minimum_required(VERSION 3.23)
set(CURRENT_PACKAGES_DIR "$work/vcpkg")
function(run)
  execute_process(COMMAND \${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()
function(vcpkg_cmake_configure)
  cmake_parse_arguments(arg "" "SOURCE_PATH" "" \${ARGN})
  run("\${CMAKE_COMMAND}" -S "\${arg_SOURCE_PATH}" -B "$work/vcpkg-build" -G Ninja)
endfunction()
function(vcpkg_cmake_install)
  run("\${CMAKE_COMMAND}" --install "$work/vcpkg-build" --prefix "\${CURRENT_PACKAGES_DIR}")
endfunction()
function(vcpkg_cmake_config_fixup)
  cmake_parse_arguments(arg "" "CONFIG_PATH" "" \${ARGN})
  if(NOT EXISTS "\${CURRENT_PACKAGES_DIR}/\${arg_CONFIG_PATH}/esokitConfig.cmake")
    message(FATAL_ERROR "no config file in \${arg_CONFIG_PATH}")
  endif()
  file(RENAME "\${CURRENT_PACKAGES_DIR}/\${arg_CONFIG_PATH}" "\${CURRENT_PACKAGES_DIR}/share/esokit")
endfunction()
function(vcpkg_fixup_pkgconfig)
endfunction()
function(vcpkg_install_copyright)
  cmake_parse_arguments(arg "" "" "FILE_LIST" \${ARGN})
  file(COPY_FILE "\${arg_FILE_LIST}" "\${CURRENT_PACKAGES_DIR}/share/esokit/copyright")
endfunction()
file(READ "$root/cmake/packaging/vcpkg/vcpkg.json" manifest)
string(JSON name GET "\${manifest}" name)
if(NOT name STREQUAL "esokit")
  message(FATAL_ERROR "vcpkg.json names \${name}")
endif()
include("$root/cmake/packaging/vcpkg/portfile.cmake")
END
cmake -P "$work/port.cmake"
[[ -f $work/vcpkg/share/esokit/esokitConfig.cmake && -f $work/vcpkg/share/esokit/copyright ]] ||
  fail "the vcpkg port installs no config file or copyright"
not_tried+=("vcpkg itself")

# --- the joint of examples/trades: a package as its README has it, by CMake and by colcon, where a
# clone in src/ is a package, and before what depends on it ---
arm=$work/workspace/src/arm
mkdir -p "$arm"
cp examples/trades/joint.hpp "$arm"
for part in cpp:arm.cpp cmake:CMakeLists.txt xml:package.xml; do
  awk -v start="\`\`\`${part%%:*}" '$0 == start { inside = 1; next } /^```/ && inside { exit } inside' \
    examples/trades/README.md >"$arm/${part#*:}"
  [[ -s $arm/${part#*:} ]]
done
if command -v colcon >/dev/null 2>&1; then
  git clone -q "$root" "$work/workspace/src/esokit"
  (cd "$work/workspace" && colcon build --cmake-args -G Ninja)
  (cd "$work" && workspace/install/arm/lib/arm/arm)
else
  not_tried+=(colcon)
  cmake -S "$arm" -B "$work/arm" -G Ninja -DCMAKE_PREFIX_PATH="$work/root/usr"
  cmake --build "$work/arm"
  (cd "$work" && arm/arm)
fi
[[ $(wc -l <"$work/joint.csv") == 10001 ]] || fail "the joint of examples/trades writes no log"

# --- Conan recipe, ROS package file ---
if command -v conan >/dev/null 2>&1; then
  conan create cmake/packaging/conan --build=missing
else
  not_tried+=(conan)
fi
if command -v python3 >/dev/null 2>&1; then
  python3 - <<'END'
import ast, xml.etree.ElementTree as tree
ast.parse(open("cmake/packaging/conan/conanfile.py").read())
root = tree.parse("cmake/packaging/ros/package.xml").getroot()
for tag in ("name", "version", "description", "maintainer", "license"):
    assert root.find(tag).text.strip(), tag
assert root.find("export/build_type").text == "cmake"
END
else
  not_tried+=("the syntax of the Conan recipe and package.xml")
fi

echo "packages are right; not tried: $(IFS=,; echo "${not_tried[*]}")"
