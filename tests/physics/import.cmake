# SPDX-License-Identifier: Apache-2.0
# The importer beside MuJoCo; Debian's mujocoConfig.cmake names a folder that does not exist
find_library(MUJOCO_LIBRARY mujoco)
find_path(MUJOCO_INCLUDE mujoco/mujoco.h)
if(MUJOCO_LIBRARY AND MUJOCO_INCLUDE)
    hil_test(import_mujoco SOURCES physics/import_mujoco.c LIBS import PkgConfig::LIBXML2
             ${MUJOCO_LIBRARY} LABELS physics)
    target_include_directories(test_import_mujoco SYSTEM PRIVATE ${MUJOCO_INCLUDE})
endif()

# Drives imported robots on wheels
hil_test(wheels SOURCES physics/wheels.c LIBS import sim PkgConfig::LIBXML2 TIMEOUT 120
         LABELS physics)

# Compares the importer with MuJoCo 3 of npm on generated files
if(NOT HIL_SANITIZE)
    add_executable(test_import_dump physics/import_dump.c)
    target_link_libraries(test_import_dump PRIVATE import PkgConfig::LIBXML2)
    hil_script_test(import_generated LABELS physics TIMEOUT 240
        COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/physics/generated/run.sh
                $<TARGET_FILE:test_import_dump>)
endif()
