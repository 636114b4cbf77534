# SPDX-License-Identifier: Apache-2.0
# Other simulators as a module that `coman-hil-bench` and tests load: those whose libraries are
# installed. Nothing of them is linked into our libraries or the program.
find_package(Simbody CONFIG QUIET)
# Debian's mujocoConfig.cmake names a folder that does not exist
find_library(MUJOCO_LIBRARY mujoco)
find_path(MUJOCO_INCLUDE mujoco/mujoco.h)
pkg_check_modules(ODE QUIET IMPORTED_TARGET ode)

add_library(hil-peers MODULE ${CMAKE_CURRENT_LIST_DIR}/peers.c)
target_link_libraries(hil-peers PRIVATE hil_flags)
if(Simbody_FOUND)
    target_sources(hil-peers PRIVATE ${CMAKE_CURRENT_LIST_DIR}/peers_simbody.cpp)
    target_compile_definitions(hil-peers PRIVATE PEERS_WITH_SIMBODY
                               PEERS_SIMBODY_VERSION="${Simbody_VERSION}")
    target_include_directories(hil-peers SYSTEM PRIVATE ${Simbody_INCLUDE_DIR})
    target_compile_options(hil-peers PRIVATE -UNDEBUG)
    target_link_libraries(hil-peers PRIVATE SimTKsimbody SimTKmath SimTKcommon)
endif()
if(MUJOCO_LIBRARY AND MUJOCO_INCLUDE)
    file(STRINGS ${MUJOCO_INCLUDE}/mujoco/mujoco.h version REGEX "define mjVERSION_HEADER")
    string(REGEX REPLACE ".* ([0-9])([0-9])([0-9]).*" "\\1.\\2.\\3" version "${version}")
    target_sources(hil-peers PRIVATE ${CMAKE_CURRENT_LIST_DIR}/peers_mujoco.c)
    target_compile_definitions(hil-peers PRIVATE PEERS_WITH_MUJOCO
        PEERS_MUJOCO_VERSION="${version}")
    target_include_directories(hil-peers SYSTEM PRIVATE ${MUJOCO_INCLUDE})
    target_link_libraries(hil-peers PRIVATE ${MUJOCO_LIBRARY} m)
endif()
if(ODE_FOUND)
    target_sources(hil-peers PRIVATE ${CMAKE_CURRENT_LIST_DIR}/peers_ode.c)
    target_compile_definitions(hil-peers PRIVATE PEERS_WITH_ODE PEERS_ODE_VERSION="${ODE_VERSION}")
    target_link_libraries(hil-peers PRIVATE PkgConfig::ODE m)
endif()

hil_test(peers_exact SOURCES ${CMAKE_CURRENT_LIST_DIR}/peers_exact.c LIBS bench random_robot
                LABELS bench)
add_dependencies(test_peers_exact hil-peers)

hil_script_test(bench COMMAND ${CMAKE_CURRENT_LIST_DIR}/bench.sh $<TARGET_FILE:coman-hil-bench>
                LABELS bench TIMEOUT 240)

# valgrind cannot run what the sanitizers build, and the budget is for optimized code
if(NOT HIL_SANITIZE AND NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
    add_executable(dynamics-count ${CMAKE_CURRENT_LIST_DIR}/dynamics_count.c)
    target_link_libraries(dynamics-count PRIVATE bench)
    hil_script_test(dynamics_instructions
                    COMMAND ${CMAKE_CURRENT_LIST_DIR}/dynamics_instructions.sh
                            $<TARGET_FILE:dynamics-count> $<TARGET_FILE:hil-peers>
                    LABELS bench TIMEOUT 240)
    add_dependencies(dynamics-count hil-peers)
endif()
