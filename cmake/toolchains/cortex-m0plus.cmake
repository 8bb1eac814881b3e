# Cortex-M0+: ARMv6-M, no floating-point unit.
set(esokit_cpu_flags "-mcpu=cortex-m0plus -mfloat-abi=soft")
include("${CMAKE_CURRENT_LIST_DIR}/arm-none-eabi.cmake")
