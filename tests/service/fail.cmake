# SPDX-License-Identifier: Apache-2.0
# The n-th allocation or system call fails. A full run of both (HIL_FAIL_NTH=full in the
# environment) belongs to a release.

# preloaded: a sanitizer's library comes with the program, not with it
add_library(fail_nth MODULE service/fail_nth.c)
target_compile_definitions(fail_nth PRIVATE _GNU_SOURCE)
target_compile_options(fail_nth PRIVATE -Wall -Wextra -Wmissing-prototypes)
set(sanitized)
if(HIL_SANITIZE)
    set(sanitized --sanitized)
endif()
hil_script_test(service_fail_nth LABELS service TIMEOUT 400
    COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/service/fail_nth.py
        $<TARGET_FILE:coman-hil>
            $<TARGET_FILE:fail_nth> ${sanitized})
