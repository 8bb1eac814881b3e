# What the Cortex-M toolchain files share. The core is chosen by the file that includes this one;
# it sets esokit_cpu_flags.
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_ASM_COMPILER arm-none-eabi-gcc)

set(CMAKE_C_FLAGS_INIT "-mthumb ${esokit_cpu_flags}")
set(CMAKE_CXX_FLAGS_INIT "-mthumb ${esokit_cpu_flags}")
set(CMAKE_ASM_FLAGS_INIT "-mthumb ${esokit_cpu_flags}")

# A program of the compiler's test would lack its start-up code; a library links without.
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_EXECUTABLE_SUFFIX_CXX .elf)
