# SPDX-License-Identifier: Apache-2.0
# That the loop keeps to what a real-time loop may do, proven on the program itself; its tracepoints
# and its budget.
set(rt_tests ${CMAKE_CURRENT_SOURCE_DIR}/rt)

# the loop in a program of its own: the library rt and nothing else
add_executable(rt_ten_lines rt/ten_lines.c)
target_link_libraries(rt_ten_lines PRIVATE rt)
hil_script_test(rt_ten_lines LABELS unit TIMEOUT 10 COMMAND rt_ten_lines)

if(HIL_PROBES)
    hil_script_test(rt_probes LABELS service TIMEOUT 30
        COMMAND bash ${rt_tests}/probes.sh $<TARGET_FILE:coman-hil>)
endif()

if(NOT HIL_SANITIZE)
    foreach(rig coman grasp walkman coman-fd)
        hil_script_test(rt_page_faults_${rig} LABELS service TIMEOUT 120
            COMMAND bash ${rt_tests}/page_faults.sh $<TARGET_FILE:coman-hil> ${rig} lockstep)
    endforeach()
    hil_script_test(rt_page_faults_free LABELS service TIMEOUT 120
        COMMAND bash ${rt_tests}/page_faults.sh $<TARGET_FILE:coman-hil> coman free)
    hil_script_test(rt_page_faults_real LABELS service TIMEOUT 60 SERIAL
        COMMAND bash ${rt_tests}/page_faults.sh $<TARGET_FILE:coman-hil> coman real)
    hil_script_test(rt_phase_instructions LABELS bench TIMEOUT 180
        COMMAND bash ${rt_tests}/phase_instructions.sh $<TARGET_FILE:coman-hil>)
    hil_script_test(rt_walk_instructions LABELS bench TIMEOUT 400
        COMMAND bash ${rt_tests}/walk_instructions.sh $<TARGET_FILE:coman-hil>)
endif()

# The guard: a library for x86-64 that needs the probes. First it is shown to catch what it claims
# in a loop that misbehaves, then the program runs under it.
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
    hil_script_test(rt_guard_runs LABELS service TIMEOUT 120
        COMMAND bash ${rt_tests}/guard_runs.sh $<TARGET_FILE:rt_guard> $<TARGET_FILE:coman-hil>)
    hil_script_test(rt_guard_vcan LABELS service TIMEOUT 240
        COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/bus/uml/run.sh -t 220 bash
                ${rt_tests}/guard_vcan.sh $<TARGET_FILE:rt_guard> $<TARGET_FILE:coman-hil>)

    # the same loop with and without probes
    foreach(probes 0 1)
        add_executable(rt_probes_${probes} rt/guard_victim.c ${CMAKE_SOURCE_DIR}/rt/loop.c)
        target_link_libraries(rt_probes_${probes} PRIVATE rt)
        target_compile_definitions(rt_probes_${probes} PRIVATE HIL_PROBES=${probes})
    endforeach()
    hil_script_test(rt_probe_cost LABELS bench TIMEOUT 60
        COMMAND ${rt_tests}/probe_cost.sh $<TARGET_FILE:rt_probes_1> $<TARGET_FILE:rt_probes_0>)
endif()
