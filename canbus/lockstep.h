/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The simulator's side of lockstep. The host's STEP frames drive virtual time; DONE frames report
 * its progress (docs/controller.md). This is a state machine without clock or port.
 *
 *   STEP  u32 LE expected tick, u16 LE number of ticks (0 = 1)
 *   DONE  u32 LE tick, u16 LE flags (enum lockstep_flag)
 *
 * Both sides count the ticks that have run. A STEP carries the count before it runs, and DONE the
 * count after it. The next STEP must carry the count of this DONE. A STEP with a different count
 * does not run: the answer is DONE with the simulator's count and LOCKSTEP_MISMATCH. Either side
 * may therefore restart, because the host takes the count from this answer. RT-safe.
 */
#ifndef CANBUS_LOCKSTEP_H
#define CANBUS_LOCKSTEP_H

#include "canbus/frame.h"

/* Default identifiers, and the length of both frames. */
enum { LOCKSTEP_STEP_ID = 0x6f0, LOCKSTEP_DONE_ID = 0x6ff, LOCKSTEP_LENGTH = 6 };

/* Flags of DONE. */
enum lockstep_flag {
    LOCKSTEP_OVERRUN = 1 << 0,  /* frames were lost since the last DONE */
    LOCKSTEP_FAULT = 1 << 1,    /* a board is in fault */
    LOCKSTEP_MISMATCH = 1 << 2, /* the STEP expected another tick and was not run */
    LOCKSTEP_STOPPING = 1 << 3, /* the last DONE: the simulator ends */
};

struct lockstep_config {
    uint32_t step_id, done_id;
    /* time without STEP before a report; further reports follow at growing intervals */
    int64_t silence_ns;
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
    uint32_t ticks;    /* ticks of the present STEP still to run */
    uint32_t expected; /* count in the last STEP, for messages */
    uint16_t flags;    /* flags for the next DONE */
    int64_t wait_since_ns, report_at_ns;
    int64_t backoff_ns;
    bool silent;
};

/* Starts at tick 0. */
void lockstep_init(struct lockstep *lockstep, const struct lockstep_config *config);

/* Classifies a frame of the STEP's bus, while no STEP runs. */
enum lockstep_verdict lockstep_receive(struct lockstep *lockstep, const struct bus_frame *frame);

/* Counts a tick that has run and collects flags for DONE. Returns whether it was the STEP's
 * last. */
bool lockstep_advance(struct lockstep *lockstep, uint16_t flags);

/* Makes the DONE frame with the collected flags and the flags in `more`; clears the collected
 * flags. */
struct bus_frame lockstep_done(struct lockstep *lockstep, uint16_t more);

/* Starts a wait for a STEP. */
void lockstep_wait_begin(struct lockstep *lockstep, int64_t now_ns);

/* Checks a wait for a STEP: true = report the silence now (*silent_ns: its duration). The first
 * report comes after silence_ns, further ones at intervals that double up to a minute. */
bool lockstep_wait_check(struct lockstep *lockstep, int64_t now_ns, int64_t *silent_ns);

/* Ends a wait: true = a silence was reported (*silent_ns: its duration). */
bool lockstep_wait_end(struct lockstep *lockstep, int64_t now_ns, int64_t *silent_ns);

#endif
