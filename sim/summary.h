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
    /* Writes members of the JSON object that say what was run, each with a comma before it, in the
     * place of the rig's file; NULL = a rig file was */
    void (*put_origin)(const void *context, FILE *out);
    const void *context; /* its argument */
};

/* Returns how a run ended, in words: "ran its length", ... */
const char *summary_end_text(enum loop_end end);

void summary_print(const struct summary *summary, FILE *out);

/* Writes DIRECTORY/summary.json. */
enum error_code summary_write(const struct summary *summary, const char *directory,
                              struct error *error);

#endif
