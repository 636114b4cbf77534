/* SPDX-License-Identifier: Apache-2.0 */
/* The summary of a run: text for a person, JSON for a program. Not RT-safe. */
#ifndef SIM_SUMMARY_H
#define SIM_SUMMARY_H

#include "sim/simulator.h"

#include <stdio.h>

struct summary {
    const struct simulator *simulator; /* after simulator_run */
    enum loop_end end;
    bool recorded;
    struct recorder_counters recorder;
    /* Writes JSON members that describe the input of the run, each preceded by a comma. They
     * replace the name of the rig file. NULL = the input was a rig file */
    void (*put_origin)(const void *context, FILE *out);
    const void *context; /* argument of put_origin */
};

/* Returns in words how a run ended: "ran its length", ... */
const char *summary_end_text(enum loop_end end);

void summary_print(const struct summary *summary, FILE *out);

/* Writes DIRECTORY/summary.json. */
enum error_code summary_write(const struct summary *summary, const char *directory,
                              struct error *error);

#endif
