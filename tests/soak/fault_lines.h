/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Random faults of every kind, as the lines that a user would write
 * (faults/faults.h). The same stream of random numbers gives the same lines. Not RT-safe.
 */
#ifndef SOAK_FAULT_LINES_H
#define SOAK_FAULT_LINES_H

#include "base/random.h"
#include "faults/faults.h"
#include "rig/rig.h"

enum { LINE_KINDS_MAX = 64 };

struct fault_lines {
    const struct rig *rig;
    bool wire; /* the buses have a time of their own */
    struct random_stream random;
    size_t kind;        /* the one that comes next: each in its turn */
    size_t on_wire[64]; /* faults that the wire of each bus has to carry out */
    char text[FAULTS_MAX][FAULT_TEXT_SIZE];
    const char *line[FAULTS_MAX]; /* to texts */
    size_t count;
    uint64_t of_kind[LINE_KINDS_MAX]; /* how many were written, by line of faults_help */
};

/* An empty table that begins with a kind. */
void fault_lines_init(struct fault_lines *lines, const struct rig *rig, bool wire, uint64_t seed,
                      size_t kind);

/* Adds count faults, each of them active for 0.1 to longest_s within [from_s, to_s). False with a
 * message when a kind has a parameter that is unknown here. */
bool fault_lines_add(struct fault_lines *lines, size_t count, double from_s, double to_s,
                     double longest_s, struct error *error);

/* Switches every board off and on. */
void fault_lines_add_power_cycle(struct fault_lines *lines, double from_s, double to_s);

#endif
