/* SPDX-License-Identifier: Apache-2.0 */
/*
 * One part of a soak in lockstep: a simulator of its own, run under faults and checked at every
 * tick.
 */
#ifndef SOAK_PART_H
#define SOAK_PART_H

#include "sim/simulator.h"
#include "tests/soak/fault_lines.h"
#include "tests/soak/player.h"
#include "tests/soak/intruder.h"
#include "tests/soak/listener.h"

#define SECOND INT64_C(1000000000)
#define MS INT64_C(1000000)

/* The allocators of the sanitizers keep what is freed: their memory grows. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { PAGES_ARE_COUNTED = 0 };
#else
enum { PAGES_ARE_COUNTED = 1 };
#endif

/* In the harness there are no faults in the last seconds of a round; a task may take TASK_S. */
enum { ROUND_S = 30, BROKEN_S = 22, TASK_S = 26 };

struct part {
    const char *name, *rig;
    const char *task; /* NULL: the player, in a harness */
    bool wire;
    size_t faults; /* of a task, so many at once that all kinds have their turn; 0: a few */
};

/* What is kept through all parts. */
struct totals {
    uint64_t hash, ticks, frames, faults, events, switched_on, starts, intruder, refused;
    uint64_t of_kind[LINE_KINDS_MAX];
    size_t parts, kind;
    long pages_first, pages_minute_2, pages_last; /* between two parts; 0 = not yet */
    int descriptors, threads;
};

/* One part while it runs. */
struct run {
    const struct part *part;
    struct rig rig;
    struct arena arena;
    struct simulator *simulator;
    struct listener listener;
    struct player player;
    struct intruder intruder;
    struct fault_lines fault_lines;
    struct random_stream random;
    uint64_t ticks;   /* it is to run */
    bool odd;         /* the intruder is rude in the second, not the first round */
    int64_t last_ns;  /* virtual, of the last look; -1 = none yet */
    int waits;        /* calls for which the STEP is still withheld */
    int64_t quiet_ns; /* until when the controller sends STEP frames only */
    int64_t quiet_due_ns;
    double held[7]; /* where the harness holds the base */
    double error_before[6];
    double fastest[RIG_JOINTS_MAX]; /* rotor of each joint, rad/s */
    struct bus_status before[RIG_BUSES_MAX];
    uint64_t faults, events;
    bool was_active[FAULTS_MAX];
    long pages_early;
    char failure[512];
};

/* Runs a part and adds it to the totals. False with a message on stderr when a rule was broken.
 * record: a directory, NULL = none. */
bool part_run(const struct part *part, struct totals *totals, uint64_t seed, uint64_t ticks,
              const char *record);

/* A rule is broken: the run ends, and says so; the first counts. */
void part_fail(struct run *run, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* The rules (rules.c): before each tick, and after the run. */
void rules_check_tick(struct run *run, int64_t time_ns);
void rules_check_end(struct run *run, enum loop_end end);

/* Memory of this process, in pages. */
long rules_resident_pages(void);

#endif
