# SPDX-License-Identifier: Apache-2.0
# What CI runs under sanitizers, each within some minutes: `./dev sanitize --short` the tests of the
# label "short", and `./dev tsan` those of the label "threads". The targets short_tests and
# threads_tests build what these run and nothing else.

# Beside all unit tests and the corpora of the fuzz targets, one service test a kind of peer
set(HIL_SHORT_TESTS service_dbc service_described service_gateway service_goodbye service_hydraulic
    service_page service_plan service_program service_recording service_replay service_reload
    service_run service_scenarios soak_lockstep)
# What has threads: page server, recorder, gateway, requests from outside the loop, work in the
# background, a task in a thread of its own
set(HIL_THREADS_TESTS base_ring boards_event_text canbus_gateway canbus_gateway_lockstep
    canbus_local canbus_local_wire control_control control_hostile control_socket fuzz_gateway
    page_recording rt_histogram rt_loop rt_loop_requests rt_recorder rt_recorder_events rt_snapshot
    rt_stream service_page service_program service_recording service_run
    sim_robot_requests sim_robot_requests_threads sim_robot_requests_timed)

get_property(tests DIRECTORY PROPERTY TESTS)
foreach(test ${tests})
    get_property(labels TEST ${test} PROPERTY LABELS)
    if(labels MATCHES "unit|fuzz" OR test IN_LIST HIL_SHORT_TESTS)
        list(APPEND labels short)
    endif()
    if(test IN_LIST HIL_THREADS_TESTS)
        list(APPEND labels threads)
    endif()
    set_property(TEST ${test} PROPERTY LABELS ${labels})
    foreach(selection short threads)
        foreach(program test_${test} ${test})
            if(selection IN_LIST labels AND TARGET ${program})
                list(APPEND ${selection}_programs ${program})
            endif()
        endforeach()
    endforeach()
endforeach()
add_custom_target(short_tests DEPENDS coman-hil coman-hil-bench ${short_programs})
add_custom_target(threads_tests DEPENDS coman-hil ${threads_programs})
