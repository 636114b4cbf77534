# SPDX-License-Identifier: Apache-2.0
find_package(Simbody REQUIRED CONFIG)

foreach(name "" _invariants)
    hil_test(contact_simbody${name} SOURCES physics/contact_simbody${name}.c
             LIBS contact LABELS physics)
endforeach()

hil_test(contact_reference SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_reference.cpp
         LIBS contact SimTKsimbody SimTKmath SimTKcommon LABELS physics)
target_include_directories(test_contact_reference SYSTEM PRIVATE ${Simbody_INCLUDE_DIR})
target_compile_options(test_contact_reference PRIVATE -UNDEBUG)

hil_test(contact_memory SOURCES ${CMAKE_CURRENT_SOURCE_DIR}/physics/contact_memory.cpp
         LIBS contact LABELS physics)
