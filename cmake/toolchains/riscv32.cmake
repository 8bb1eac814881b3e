# 32-bit RISC-V with single precision in hardware (RV32IMAFC).
#
# Debian has the compiler and picolibc for it, but no C++ standard library. The headers of the one
# for arm-none-eabi (the same GCC, bare metal as well) serve: the library uses templates of it and
# nothing that is compiled. A toolchain that brings its own has no need of them.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR riscv32)
set(CMAKE_C_COMPILER riscv64-unknown-elf-gcc)
set(CMAKE_CXX_COMPILER riscv64-unknown-elf-g++)
set(CMAKE_ASM_COMPILER riscv64-unknown-elf-gcc)

set(esokit_cpu_flags "-march=rv32imafc -mabi=ilp32f --specs=picolibc.specs")
set(esokit_cxx_flags "")
execute_process(COMMAND ${CMAKE_CXX_COMPILER} -march=rv32imafc -mabi=ilp32f
                        -print-file-name=libstdc++.a
                OUTPUT_VARIABLE esokit_cxx_library OUTPUT_STRIP_TRAILING_WHITESPACE)
if(NOT IS_ABSOLUTE "${esokit_cxx_library}")
  execute_process(COMMAND arm-none-eabi-g++ -print-file-name=libstdc++.a
                  OUTPUT_VARIABLE esokit_cxx_library OUTPUT_STRIP_TRAILING_WHITESPACE)
  cmake_path(GET esokit_cxx_library PARENT_PATH esokit_cxx_folder)
  file(GLOB esokit_cxx_headers "${esokit_cxx_folder}/../include/c++/[0-9]*")
  foreach(folder IN LISTS esokit_cxx_headers)
    string(APPEND esokit_cxx_flags " -isystem ${folder} -isystem ${folder}/arm-none-eabi")
  endforeach()
endif()
set(CMAKE_C_FLAGS_INIT "${esokit_cpu_flags}")
set(CMAKE_CXX_FLAGS_INIT "${esokit_cpu_flags}${esokit_cxx_flags}")
set(CMAKE_ASM_FLAGS_INIT "${esokit_cpu_flags}")

# A program of the compiler's test would lack its start-up code; a library links without.
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_EXECUTABLE_SUFFIX_CXX .elf)
