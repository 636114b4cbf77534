# SPDX-License-Identifier: Apache-2.0
# Fuzz targets: what a person, a peer, a file or a bus may say, whatever it is. Each is one file
# with LLVMFuzzerTestOneInput, a corpus in corpus/TARGET (small, minimized, with every input that
# once failed) and, for languages of words, a dictionary dictionary/TARGET.dict.
#
# In every normal build a target is a test: replay.c runs the corpus and a fixed number of seeded
# mutations of it, with gcc, and under the sanitizers in the presets of that name.
#
# To look for more, with clang's libFuzzer and the address and undefined-behavior sanitizers:
#
#     cmake --preset fuzz && cmake --build --preset fuzz && tests/fuzz/fuzz.sh build/fuzz TARGET 600
#
# which keeps what it learns and finds in build/fuzz/fuzz/TARGET: crash-*, timeout-* and oom-* are
# findings, and build/fuzz/tests/fuzz_TARGET FILE runs one again. Mend the code, then put the file
# into the corpus under a name that says what it was. What else was learned is kept with
#
#     build/fuzz/tests/fuzz_TARGET -merge=1 -set_cover_merge=1 -use_counters=0 \
#         tests/fuzz/corpus/TARGET build/fuzz/fuzz/TARGET/corpus
#
# as long as the corpora stay small: 300 kB all together. What a corpus covers:
#
#     flags="-fprofile-instr-generate -fcoverage-mapping"
#     cmake --preset fuzz -B build/coverage -D HIL_SANITIZE=fuzzer-no-link \
#         -D CMAKE_C_FLAGS="$flags" -D CMAKE_EXE_LINKER_FLAGS="$flags"
#     cmake --build build/coverage --target fuzz_TARGET
#     LLVM_PROFILE_FILE=raw build/coverage/tests/fuzz_TARGET -runs=0 tests/fuzz/corpus/TARGET
#     llvm-profdata merge -o profile raw
#     llvm-cov report build/coverage/tests/fuzz_TARGET -instr-profile=profile
set(fuzz ${CMAKE_CURRENT_LIST_DIR})

# hil_fuzz(TARGET SOURCE file LIBS library... [MUTATIONS n] [DEFINE name=value...]
#          [BEGINS_AS target])
# BEGINS_AS: the target whose corpus serves as long as there is none of its own.
# Mutations: as many as take about a second, in the release build.
function(hil_fuzz name)
    cmake_parse_arguments(F "" "SOURCE;MUTATIONS;BEGINS_AS" "LIBS;DEFINE" ${ARGN})
    set(corpus ${fuzz}/corpus/${name})
    if(NOT EXISTS ${corpus} AND F_BEGINS_AS)
        set(corpus ${fuzz}/corpus/${F_BEGINS_AS})
    endif()
    set(dictionary ${fuzz}/dictionary/${name}.dict)
    if(NOT EXISTS ${dictionary})
        set(dictionary "")
    endif()
    if(NOT F_MUTATIONS)
        set(F_MUTATIONS 10000)
    endif()
    add_executable(fuzz_${name} ${fuzz}/${F_SOURCE} ${fuzz}/fuzz.c)
    target_link_libraries(fuzz_${name} PRIVATE hil_flags ${F_LIBS} base m)
    target_compile_definitions(fuzz_${name} PRIVATE ${F_DEFINE}
                                                    HIL_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
    if(HIL_FUZZ)
        target_link_options(fuzz_${name} PRIVATE -fsanitize=fuzzer)
    else()
        target_sources(fuzz_${name} PRIVATE ${fuzz}/replay.c)
        if(HIL_SANITIZE)
            math(EXPR F_MUTATIONS "${F_MUTATIONS} / 4")
        endif()
        add_test(NAME fuzz_${name}
                 COMMAND fuzz_${name} ${corpus} ${F_MUTATIONS} ${dictionary})
        hil_test_limits(fuzz_${name} 120 "" fuzz)
    endif()
endfunction()

hil_fuzz(candump SOURCE candump.c LIBS canbus MUTATIONS 100000)
hil_fuzz(obj SOURCE obj.c LIBS contact MUTATIONS 40000)
hil_fuzz(slcan SOURCE slcan.c LIBS canbus MUTATIONS 100000)
hil_fuzz(socketcand SOURCE socketcand.c LIBS canbus MUTATIONS 100000)
hil_fuzz(wire SOURCE wire.c LIBS canbus)
foreach(name ${HIL_PROTOCOLS})
    hil_fuzz(boards_${name} SOURCE boards.c DEFINE FUZZ_PROTOCOL=protocol_${name}
             BEGINS_AS boards_compact
             MUTATIONS 4000 LIBS boards PkgConfig::CMOCKA
             -Wl,--wrap=malloc,--wrap=calloc,--wrap=realloc)
endforeach()
hil_fuzz(described SOURCE described.c MUTATIONS 4000 LIBS boards PkgConfig::CMOCKA)
hil_fuzz(yaml SOURCE yaml.c LIBS base MUTATIONS 8000)
hil_fuzz(link SOURCE link.c LIBS canbus PkgConfig::SOCKETCAN MUTATIONS 200000)
hil_fuzz(faults SOURCE faults.c LIBS boards MUTATIONS 20000)
hil_fuzz(rig SOURCE rig.c LIBS rig MUTATIONS 1500)
hil_fuzz(scenario SOURCE scenario.c LIBS scenario MUTATIONS 3000)
hil_fuzz(control SOURCE control.c LIBS control MUTATIONS 40000)
hil_fuzz(text SOURCE text.c LIBS cli MUTATIONS 50000)
hil_fuzz(results SOURCE results.c LIBS sweep scenario report MUTATIONS 3000)
hil_fuzz(page SOURCE page.c LIBS viewer MUTATIONS 60000)
hil_fuzz(playback SOURCE playback.c LIBS viewer MUTATIONS 3000)
hil_fuzz(host SOURCE host.c LIBS sim MUTATIONS 500)
hil_fuzz(import SOURCE import.c LIBS import MUTATIONS 6000)
hil_fuzz(import_mesh SOURCE import_mesh.c LIBS import MUTATIONS 40000)
hil_fuzz(trajectory SOURCE trajectory.c LIBS tasks MUTATIONS 20000)
hil_fuzz(client_tables SOURCE client_tables.c MUTATIONS 2000)
hil_fuzz(client_gateway SOURCE client_gateway.c MUTATIONS 2000)
hil_fuzz(gateway SOURCE gateway.c LIBS canbus Threads::Threads MUTATIONS 60)

if(HIL_FUZZ)
    get_property(targets DIRECTORY PROPERTY BUILDSYSTEM_TARGETS)
    list(FILTER targets INCLUDE REGEX "^fuzz_")
    add_custom_target(fuzz DEPENDS ${targets})
endif()
