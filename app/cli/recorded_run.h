/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The recorded run whose controller --stimulus plays: its length, its state hash, and the requests
 * of clients of the control socket or the page. Such requests are not frames, so they are not
 * played. Not RT-safe.
 */
#ifndef APP_CLI_RECORDED_RUN_H
#define APP_CLI_RECORDED_RUN_H

#include "sim/simulator.h"

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

struct recorded_run {
    uint64_t ticks;      /* 0 = unknown: a log without a recording, or a killed run */
    char state_hash[24]; /* at its end */
    size_t requests;     /* number of requests: pushes, tunables, manual faults */
    char first[160];     /* "TIME s TEXT" of the first of them */
};

/* Reads summary.json and events.log of a recording; missing or damaged values stay 0. */
void recorded_run_read(const char *directory, struct recorded_run *run);

/* Prints a warning about requests, before the run. */
void recorded_run_warn(const struct recorded_run *run, const char *directory, FILE *out);

/* Prints whether a run with this number of ticks has ended in the recording's state; prints
 * nothing if the lengths differ. */
void recorded_run_compare(const struct recorded_run *run, uint64_t ticks, uint64_t state_hash,
                          FILE *out);

/* ---- files beside the recording of a run ---- */

/* Writes DIRECTORY/firmware-BOARD.bin after the run for every board that has kept a download (rig
 * key keep_firmware): program memory, then data memory, 65536 words of 16 bits each, low byte
 * first, 0xffff for words that were not received. A '/' in the board's name becomes '-'.
 * ERROR_SYSTEM. */
enum error_code firmware_write(const struct simulator *simulator, const char *directory,
                               struct error *error);

#endif
