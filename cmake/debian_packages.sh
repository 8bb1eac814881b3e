# Bash library, to be sourced by the scripts that promise to work on a fresh Debian 12.

# What every build needs, what each kind of program needs on top.
ESOKIT_BUILD_PACKAGES=(g++ cmake ninja-build libeigen3-dev)
# The C and the Structured Text that are written: other compilers, MISRA, an interpreter.
ESOKIT_TEST_PACKAGES=(libgtest-dev libboost-dev librandom123-dev tcc sdcc cppcheck python3)
ESOKIT_BENCHMARK_PACKAGES=(libbenchmark-dev python3)
# Without a font gnuplot draws figures with no text, and reports no error.
# Python makes the pages and tables and checks the numbers of the READMEs.
ESOKIT_EXAMPLE_PACKAGES=(gnuplot-nox fontconfig fonts-dejavu-core python3)
# For the parts of a study on many processes and machines (examples/monte_carlo/cluster).
ESOKIT_CLUSTER_PACKAGES=(libopenmpi-dev openmpi-bin parallel)
# picolibc is the C library of the RISC-V compiler; its C++ headers are those of libstdc++-arm-none-eabi.
ESOKIT_FIRMWARE_PACKAGES=(gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib
  gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf qemu-system-arm qemu-system-misc
  gcc-avr avr-libc simavr)
# The written C before a prover that knows nothing of esokit.
ESOKIT_PROOF_PACKAGES=(frama-c-base python3)
# HAL of LinuxCNC, for the C as one of its components.
ESOKIT_LINUXCNC_PACKAGES=(linuxcnc-uspace-dev)
# The same headers in a browser (examples/playground); nodejs is not needed.
ESOKIT_WASM_PACKAGES=(clang-14 lld-14 wasi-libc libc++-14-dev-wasm32 libc++abi-14-dev-wasm32
  libclang-rt-14-dev-wasm32 musl-dev)
# Programs for Windows, and what runs them here; no graphics, hence not the package wine.
ESOKIT_WINDOWS_PACKAGES=(g++-mingw-w64-x86-64-posix wine64)

# require_packages [--no-install] package...
# Installs the packages that are missing. With --no-install it only names them and returns 3.
require_packages() {
  local install=yes package state
  local -a missing=() as_root=()
  if [[ "${1:-}" == --no-install ]]; then
    install=no
    shift
  fi

  # Elsewhere the user has installed the tools by other means; CMake will say what it does not find.
  if ! command -v dpkg-query >/dev/null 2>&1; then
    echo "note: no Debian package tools here; taking these for installed: $*" >&2
    return 0
  fi

  for package in "$@"; do
    state=$(dpkg-query -W -f='${db:Status-Status} ' "$package" 2>/dev/null) || state=
    [[ " $state" == *" installed "* ]] || missing+=("$package")
  done
  if ((${#missing[@]} == 0)); then
    return 0
  fi

  if [[ $install == no ]]; then
    echo "missing Debian packages: ${missing[*]}" >&2
    echo "install them with: apt-get install --no-install-recommends ${missing[*]}" >&2
    return 3
  fi

  if ((EUID != 0)); then
    if ! command -v sudo >/dev/null 2>&1; then
      echo "missing Debian packages: ${missing[*]}" >&2
      echo "installing them needs root, and there is no sudo" >&2
      return 3
    fi
    as_root=(sudo)
  fi
  echo "installing Debian packages: ${missing[*]}" >&2
  # env, as sudo drops the variables of the caller. The index may be stale or absent (containers).
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq update </dev/null >&2 || return 1
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y \
    --no-install-recommends "${missing[@]}" </dev/null >&2 || return 1
}
