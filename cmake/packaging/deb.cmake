# cpack -G DEB: one package for all architectures.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME libesokit-dev)
set(CPACK_PACKAGE_VENDOR "The esokit authors")
set(CPACK_PACKAGE_CONTACT "The esokit authors <esokit@example.org>")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_RESOURCE_FILE_LICENSE "${CMAKE_CURRENT_SOURCE_DIR}/LICENSE")
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
# With the examples from_log is in it, a program.
if(NOT ESOKIT_BUILD_EXAMPLES)
  set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE all)
endif()
set(CPACK_DEBIAN_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "libeigen3-dev (>= 3.3)")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
    "Linear, cascade, algebraic, switched and nonlinear extended state observers, the
extended state filter, and the ADRC controllers built on them, for Eigen.")
# Debian wants the licence under this name.
install(FILES "${CMAKE_CURRENT_SOURCE_DIR}/LICENSE" DESTINATION share/doc/libesokit-dev
        RENAME copyright)
include(CPack)
