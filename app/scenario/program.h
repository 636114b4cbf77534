/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Runs a program under test as the host of a scenario (host: program). The program is a shell
 * command. It connects to the run's gateway, and advances the run with STEP frames. It has its own
 * process group, which is ended with the run. Not RT-safe.
 */
#ifndef APP_SCENARIO_PROGRAM_H
#define APP_SCENARIO_PROGRAM_H

#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

/* Environment variable with the gateway's address: 127.0.0.1:PORT. */
#define SCENARIO_PROGRAM_GATEWAY "COMAN_HIL_GATEWAY"

/* Environment variable with the program's own folder, if it has one. */
#define SCENARIO_PROGRAM_SCRATCH "COMAN_HIL_SCRATCH"

/* File in that folder, or in a recording's folder, with the program's output. */
#define SCENARIO_PROGRAM_LOG "program.log"

struct scenario_program {
    pid_t pid; /* 0 = no program runs */
};

/* Starts a command. Its output goes to the log in the folder `record`, or in `scratch` if record is
 * NULL. If both are NULL, the output is discarded. Returns ERROR_SYSTEM if the process or the log
 * cannot be created. */
enum error_code scenario_program_start(struct scenario_program *program, const char *command,
                                       uint16_t port, const char *record, const char *scratch,
                                       struct error *error);

/* Returns whether the program has ended by itself. text receives its exit status or signal. */
bool scenario_program_ended(struct scenario_program *program, char *text, size_t size);

/* Ends the program and all processes of its group: SIGTERM, then SIGKILL after a second. */
void scenario_program_stop(struct scenario_program *program);

#endif
