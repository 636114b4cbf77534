# SPDX-License-Identifier: Apache-2.0
# The Python package: its modules, and a Debian package of its own, python3-coman-hil. Included by
# the file of the whole, whose variables of CPack it adds to.
include(GNUInstallDirs)
set(HIL_PYTHON_DIR "" CACHE STRING
    "where Python looks for modules, below the prefix; empty = as Debian's python3 does there")

# Below /usr/local Debian's python3 looks in a folder of its version alone; the prefix is known
# when it is installed
install(CODE "set(HIL_PYTHON_DIR \"${HIL_PYTHON_DIR}\")" COMPONENT python)
install(CODE [[
    if(NOT HIL_PYTHON_DIR AND CMAKE_INSTALL_PREFIX STREQUAL "/usr/local")
        execute_process(COMMAND /usr/bin/python3 -c "import site
for path in site.getsitepackages():
    if path.startswith('/usr/local/'):
        print(path.removeprefix('/usr/local/'))
        break"
            OUTPUT_VARIABLE HIL_PYTHON_DIR OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    endif()
    if(NOT HIL_PYTHON_DIR)
        set(HIL_PYTHON_DIR lib/python3/dist-packages)
    endif()
]] COMPONENT python)
install(DIRECTORY python/coman_hil DESTINATION "\${HIL_PYTHON_DIR}" COMPONENT python
        FILES_MATCHING PATTERN "*.py" PATTERN __pycache__ EXCLUDE)

# A Debian package a component: what has no other belongs to the program
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL Unspecified python client)
set(CPACK_DEBIAN_UNSPECIFIED_PACKAGE_NAME coman-hil)

set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-coman-hil)
set(CPACK_DEBIAN_PYTHON_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
    "coman-hil (= ${PROJECT_VERSION}), python3 (>= 3.9), python3-can (>= 4), python3-canmatrix")
set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "")
set(CPACK_DEBIAN_PYTHON_PACKAGE_SUGGESTS python3-pytest)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${CMAKE_SOURCE_DIR}/python/debian/postinst
                                              ${CMAKE_SOURCE_DIR}/python/debian/prerm)
set(CPACK_COMPONENT_PYTHON_DESCRIPTION
    "Starts simulators from Python and drives them in lockstep over all their
CAN buses at once, with commands and telemetry by joint name for every
protocol of the boards; switches faults, pushes bodies, keeps checkpoints.
With a plugin for pytest.")

# The notices of the program are those of the package too
set(link ${CMAKE_CURRENT_BINARY_DIR}/python3-coman-hil)
file(CREATE_LINK coman-hil ${link} SYMBOLIC)
install(FILES ${link} DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc COMPONENT python)
