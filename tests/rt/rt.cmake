# SPDX-License-Identifier: Apache-2.0
# That the loop keeps to what a real-time loop may do, proven on the program itself; its tracepoints
# and its budget.
set(rt_tests ${CMAKE_CURRENT_SOURCE_DIR}/rt)

if(HIL_PROBES AND NOT HIL_SANITIZE AND CMAKE_SYSTEM_PROCESSOR STREQUAL x86_64)
    add_library(rt_guard MODULE rt/guard.c rt/guard_calls.c rt/guard_faults.c rt/guard_probes.c
                                rt/guard_syscalls.c)
    target_link_libraries(rt_guard PRIVATE hil_flags ${CMAKE_DL_LIBS})
    set_target_properties(rt_guard PROPERTIES PREFIX "")

    foreach(victim rt_guard_victim rt_guard_victim_lazy)
        add_executable(${victim} rt/guard_victim.c)
        target_link_libraries(${victim} PRIVATE rt)
    endforeach()
    target_link_options(rt_guard_victim PRIVATE -Wl,-z,now)
    target_link_options(rt_guard_victim_lazy PRIVATE -Wl,-z,lazy)

    hil_script_test(rt_guard_bites LABELS service TIMEOUT 60
        COMMAND ${rt_tests}/guard_bites.sh $<TARGET_FILE:rt_guard> $<TARGET_FILE:rt_guard_victim>
                $<TARGET_FILE:rt_guard_victim_lazy>)
endif()
