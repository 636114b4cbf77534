# SPDX-License-Identifier: Apache-2.0
# 64-bit ARM under QEMU's user mode: a selection of the tests, rows of the table of bits, and the
# package, of the crossed build that ./dev makes first (./dev setup --aarch64). What is selected is
# what may differ on another processor: elementary functions, bytes and bits of frames, kernels,
# generated dynamics, integrators, allocation in the loop.
set(HIL_AARCH64_TESTS
    base_arena base_crc32 base_hash base_instruction_set base_random base_text
    boards_boards boards_icub_motor_laws boards_messages canbus_candump canbus_frame cli_doctor
    contact_broad_phase contact_friction_slope contact_native_variants contact_tangent
    model_description_robot model_drives_actuator model_dynamics model_implicit_dynamics
    model_integrator
    rig_bus_load rt_histogram rt_loop rt_loop_lockstep rt_recorder viewer_websocket
    plant plant_rt)

if(CMAKE_CROSSCOMPILING)
    list(TRANSFORM HIL_AARCH64_TESTS PREPEND test_ OUTPUT_VARIABLE programs)
    add_custom_target(aarch64_tests DEPENDS coman-hil ${programs})
elseif(NOT HIL_SANITIZE AND CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    set(folder ${CMAKE_CURRENT_SOURCE_DIR}/aarch64)
    hil_script_test(aarch64_tests LABELS unit TIMEOUT 120
        COMMAND bash ${folder}/emulate.sh tests ${HIL_AARCH64_TESTS})
    hil_script_test(aarch64_same_bits LABELS service TIMEOUT 120
        COMMAND bash ${folder}/emulate.sh bits coman:squat coman-fd:squat grasp-paper:grasp)
endif()
