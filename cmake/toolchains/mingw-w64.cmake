# For Windows, from Debian: g++-mingw-w64-x86-64-posix. Programs need no DLL of the compiler.
set(CMAKE_SYSTEM_NAME Windows)
set(CMAKE_SYSTEM_PROCESSOR x86_64)
set(CMAKE_CXX_COMPILER x86_64-w64-mingw32-g++-posix)
set(CMAKE_RC_COMPILER x86_64-w64-mingw32-windres)
set(CMAKE_EXE_LINKER_FLAGS_INIT -static)
# Eigen is headers alone, that of this machine will do.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(Eigen3_DIR /usr/share/eigen3/cmake CACHE PATH "")
