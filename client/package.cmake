# SPDX-License-Identifier: Apache-2.0
# The Debian package libcoman-hil-client-dev. Included by the file of the whole, as
# python/python.cmake is, whose list of components has it.
set(CPACK_DEBIAN_CLIENT_PACKAGE_NAME libcoman-hil-client-dev)
set(CPACK_DEBIAN_CLIENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_CLIENT_PACKAGE_DEPENDS "libc6-dev")
set(CPACK_DEBIAN_CLIENT_PACKAGE_RECOMMENDS "")
set(CPACK_DEBIAN_CLIENT_PACKAGE_SUGGESTS "coman-hil (= ${PROJECT_VERSION}), cmake, pkg-config")
set(CPACK_DEBIAN_CLIENT_PACKAGE_SHLIBDEPS OFF)
set(CPACK_COMPONENT_CLIENT_DESCRIPTION
    "Client library for controllers in C and C++ that drive the simulated boards
of coman-hil over its TCP gateway or SocketCAN, in real time or in lockstep,
with joints and force-torque sensors by name. Static library, header, files
for pkg-config and CMake.")

# It needs no other package of ours, so it has notices and list of changes of its own
set(folder ${CMAKE_INSTALL_DATAROOTDIR}/doc/libcoman-hil-client-dev)
install(FILES systemd/debian/copyright DESTINATION ${folder} COMPONENT client)
install(FILES ${CMAKE_BINARY_DIR}/docs/changelog.gz DESTINATION ${folder} COMPONENT client)
