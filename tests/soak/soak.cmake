# SPDX-License-Identifier: Apache-2.0
# Long runs, bounded here: five simulated minutes; SOAK=full makes them an hour.
add_executable(soak_lockstep ${CMAKE_CURRENT_SOURCE_DIR}/soak/lockstep.c ${CMAKE_CURRENT_SOURCE_DIR}/soak/lines.c
               ${CMAKE_CURRENT_SOURCE_DIR}/soak/player.c ${CMAKE_CURRENT_SOURCE_DIR}/soak/stranger.c
               ${CMAKE_CURRENT_SOURCE_DIR}/soak/watch.c)
target_link_libraries(soak_lockstep PRIVATE hil_flags rt)
target_compile_definitions(soak_lockstep PRIVATE HIL_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
