/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The simulator's side of lockstep: the host's STEP frames drive virtual time, DONE frames say that
 * it has got there (docs/controller.md). A state machine without clock or port.
 *
 *   STEP  u32 LE expected tick, u16 LE number of ticks (0 = 1)
 *   DONE  u32 LE tick, u16 LE flags (enum lockstep_flag)
 *
 * Both sides count the ticks that have been run: a STEP expects the count before it runs, DONE
 * carries the count after, which is what the next STEP must expect. A STEP that expects another
 * count is answered with the true one and LOCKSTEP_MISMATCH, and nothing runs; so either side may
 * be restarted: the host takes its count from that answer. RT-safe.
 */
#ifndef CANBUS_LOCKSTEP_H
#define CANBUS_LOCKSTEP_H

#include "canbus/frame.h"

#include <stdbool.h>
#include <stdint.h>

/* The identifiers unless a rig says others, and the length of both frames. */
enum { LOCKSTEP_STEP_ID = 0x6f0, LOCKSTEP_DONE_ID = 0x6ff, LOCKSTEP_LENGTH = 6 };

/* Flags of DONE. */
enum lockstep_flag {
    LOCKSTEP_OVERRUN = 1 << 0,  /* frames were lost since the last DONE */
    LOCKSTEP_FAULT = 1 << 1,    /* a board is in fault */
    LOCKSTEP_MISMATCH = 1 << 2, /* the STEP expected another tick and was not run */
    LOCKSTEP_STOPPING = 1 << 3, /* the simulator ends: the last DONE */
};

struct lockstep_config {
    uint32_t step_id, done_id;
    int64_t silence_ns; /* without STEP for so long: report, then again after growing intervals */
};

struct lockstep_counters {
    uint64_t steps, mismatches, malformed, silences;
};

enum lockstep_verdict {
    LOCKSTEP_OTHER,     /* no STEP frame */
    LOCKSTEP_RUN,       /* accepted: run lockstep->ticks ticks */
    LOCKSTEP_REFUSED,   /* wrong expected tick: answer with lockstep_done and LOCKSTEP_MISMATCH */
    LOCKSTEP_MALFORMED, /* wrong length or format: counted, not answered */
};

struct lockstep {
    struct lockstep_config config;
    struct lockstep_counters counters;
    uint32_t tick;     /* ticks run so far, modulo 2^32 */
    uint32_t ticks;    /* still to run of the present STEP */
    uint32_t expected; /* of the last STEP, for messages */
    uint16_t flags;    /* gathered for the next DONE */
    int64_t wait_since_ns, report_at_ns;
    int64_t backoff_ns;
    bool silent;
};

/* Starts at tick 0. */
void lockstep_init(struct lockstep *lockstep, const struct lockstep_config *config);

/* Decides what a frame of the STEP's bus is, while no STEP runs. */
enum lockstep_verdict lockstep_receive(struct lockstep *lockstep, const struct bus_frame *frame);

/* Counts a tick that has run; flags go into the DONE. Returns whether it was the STEP's last. */
bool lockstep_advance(struct lockstep *lockstep, uint16_t flags);

/* Makes the DONE frame of the ticks that have run, with the gathered flags and `more`; clears
 * the gathered ones. */
struct bus_frame lockstep_done(struct lockstep *lockstep, uint16_t more);

/* Begins to wait for a STEP. */
void lockstep_wait_begin(struct lockstep *lockstep, int64_t now_ns);

/* Checks a wait that goes on: true = the silence is to be reported now (*silent_ns: how long it
 * has been), first after silence_ns, then at intervals that double up to a minute. */
bool lockstep_wait_check(struct lockstep *lockstep, int64_t now_ns, int64_t *silent_ns);

/* Ends a wait: true = a silence had been reported before (*silent_ns: how long it was). */
bool lockstep_wait_end(struct lockstep *lockstep, int64_t now_ns, int64_t *silent_ns);

#endif
