/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The run of a recording whose controller --stimulus plays: how long it was, its state hash, and
 * what a client of the control socket or the page has done in it, which is in no frame and so is
 * not played. Not RT-safe.
 */
#ifndef APP_CLI_RECORDED_RUN_H
#define APP_CLI_RECORDED_RUN_H

#include "sim/simulator.h"

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

struct recorded_run {
    uint64_t ticks;      /* 0 = unknown: a log without a recording, or a run that was killed */
    char state_hash[24]; /* at its end */
    size_t requests;     /* pushes, tunables, faults by hand */
    char first[160];     /* "TIME s TEXT" of the first of them */
};

/* Reads summary.json and events.log of a recording; what is missing or damaged stays 0. */
void recorded_run_read(const char *directory, struct recorded_run *run);

/* Prints a warning about requests, before the run. */
void recorded_run_warn(const struct recorded_run *run, const char *directory, FILE *out);

/* Prints whether a run of that many ticks has ended in the recording's state; nothing when it was
 * of another length. */
void recorded_run_compare(const struct recorded_run *run, uint64_t ticks, uint64_t state_hash,
                          FILE *out);

/* ---- files beside the recording of a run ---- */

/* Writes DIRECTORY/firmware-BOARD.bin after the run for every board that has kept a download (rig
 * key keep_firmware): program memory, then data memory, 65536 words of 16 bits each, low byte
 * first, 0xffff where nothing came. A '/' in the board's name becomes '-'. ERROR_SYSTEM. */
enum error_code firmware_write(const struct simulator *simulator, const char *directory,
                               struct error *error);

#endif
