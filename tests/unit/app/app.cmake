# SPDX-License-Identifier: Apache-2.0
# control: the socket and ctl
foreach(name control ctl_client hostile memory parse socket)
    hil_test(control_${name} SOURCES unit/control/${name}.c LIBS control LABELS unit
        TIMEOUT 240)
endforeach()

foreach(name doctor doctor_external eventlog firmware notify ready token_file)
    hil_test(cli_${name} SOURCES unit/app/cli/${name}.c LIBS cli LABELS unit)
endforeach()
hil_script_test(cli_accel COMMAND /usr/bin/python3
                ${CMAKE_CURRENT_SOURCE_DIR}/unit/app/cli/accel.py $<TARGET_FILE:coman-hil>
                LABELS unit)
hil_test(cli_cmd_generate SOURCES unit/app/cli/cmd_generate.c LIBS cli LABELS unit)
hil_script_test(cli COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/unit/app/cli/cli.sh
                $<TARGET_FILE:coman-hil> LABELS unit)

hil_script_test(cli_completion COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/unit/app/cli/completion.sh
                $<TARGET_FILE:coman-hil> $<TARGET_FILE:coman-hil-bench> LABELS unit)

hil_script_test(cli_tasks COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/unit/app/cli/tasks.sh
                $<TARGET_FILE:coman-hil> LABELS unit)

hil_script_test(cli_old_files COMMAND /usr/bin/python3
                ${CMAKE_CURRENT_SOURCE_DIR}/unit/app/cli/old_files.py $<TARGET_FILE:coman-hil>
                LABELS unit)

hil_script_test(cli_protocol COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/unit/app/cli/protocol.sh
                $<TARGET_FILE:coman-hil> LABELS unit)

foreach(name cylinder follow hostile mesh mjcf_include path run urdf)
    hil_test(import_${name} SOURCES unit/app/import/${name}.c LIBS import LABELS unit
             TIMEOUT 240)
endforeach()

hil_script_test(import_run_arm COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/unit/app/import/import.sh
                $<TARGET_FILE:coman-hil> LABELS unit)

hil_script_test(cli_eds COMMAND /usr/bin/python3
                ${CMAKE_CURRENT_SOURCE_DIR}/unit/app/cli/eds.py $<TARGET_FILE:coman-hil>
                LABELS unit)

hil_script_test(identify_command LABELS unit TIMEOUT 300
    COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/unit/app/identify/identify.sh $<TARGET_FILE:coman-hil>)

hil_test(identify_fit SOURCES unit/app/identify/fit.c LIBS identify LABELS unit TIMEOUT 300)

hil_script_test(report_plot LABELS unit TIMEOUT 30
    COMMAND bash ${CMAKE_CURRENT_SOURCE_DIR}/unit/app/report/plot.sh $<TARGET_FILE:coman-hil>)

foreach(name report svg)
    hil_test(report_${name} SOURCES unit/app/report/${name}.c LIBS report LABELS unit)
endforeach()

hil_test(bench_latency_tap SOURCES unit/app/bench/latency_tap.c LIBS bench LABELS unit)

foreach(name scenario judge_expectations limits signal)
    hil_test(scenario_${name} SOURCES unit/app/scenario/${name}.c LIBS scenario LABELS unit)
endforeach()
target_link_options(test_scenario_judge_expectations PRIVATE -Wl,--wrap=scenario_signal_find)

hil_test(sweep_sweep SOURCES unit/app/sweep/sweep.c LIBS sweep LABELS unit)

hil_test(fail_memory SOURCES unit/app/fail_memory.c LIBS cli LABELS unit TIMEOUT 120)
target_link_options(test_fail_memory PRIVATE
    -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc,--wrap=free,--wrap=arena_alloc)
