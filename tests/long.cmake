# SPDX-License-Identifier: Apache-2.0
# What `./dev test` leaves to `./dev test --long` and to CI, each half a minute and more: guests
# with a kernel of their own, other machines emulated, instructions counted under valgrind, whole
# installs.
set(HIL_LONG_TESTS aarch64_same_bits aarch64_tests bench canbus_qemu clang_reads client_vcan
    clients_simulator contact_instructions dynamics_instructions fail_memory firmware
    import_hostile lockstep_vcan python_package rt_guard_runs rt_guard_vcan service_bus_plans
    service_answers_vcan service_client service_fail_nth service_gateway_lockstep
    service_overload
    service_overload_vcan service_package service_replay_vcan service_rest_bus_vcan
    service_run_vcan service_scenarios service_short_waits service_standing service_systemd
    soak_lockstep
    symbolic_module)
foreach(test ${HIL_LONG_TESTS})
    if(TEST ${test})
        set_property(TEST ${test} APPEND PROPERTY LABELS long)
    endif()
endforeach()
