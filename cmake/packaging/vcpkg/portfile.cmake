# An overlay port that installs the tree it lies in:
#   vcpkg install esokit --overlay-ports=<esokit>/cmake/packaging/vcpkg
# For a port of a release, fetch the archive here instead of the next line.
get_filename_component(SOURCE_PATH "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)

vcpkg_cmake_configure(SOURCE_PATH "${SOURCE_PATH}")
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH share/cmake/esokit)
vcpkg_fixup_pkgconfig()

# Headers alone: nothing differs in debug.
file(REMOVE_RECURSE "${CURRENT_PACKAGES_DIR}/debug")
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE")
