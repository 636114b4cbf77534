/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What another thread asks of a running simulator: stand still, go on, run so many ticks, keep
 * another pace, go back to an earlier state, switch a fault, push a body, change a parameter.
 *
 * Requests and answers cross in two rings of fixed size; the loop carries requests out between two
 * ticks, in their order, and neither side ever waits for the other. One thread asks (the control
 * socket's, rt/control.h); what is asked counts for the tick that comes next.
 *
 * Going back. A checkpoint is a copy, in memory set aside at the start, of everything that moves in
 * virtual time: plant, boards, sensors, faults, wires, an inline task, the loop's tick. Slot 0 holds the
 * start and is what STEER_RESET goes back to. Time goes back with it, so that a run from a
 * checkpoint repeats bit for bit what followed it the first time, given the same frames. Frames in
 * the queues of other processes stay where they are. While a recording runs there is no way back:
 * its time never does.
 */
#ifndef RT_STEERING_H
#define RT_STEERING_H

#include "base/arena.h"
#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { STEERING_SLOTS = 4 }; /* of checkpoints; 0 is the start, written by nobody */

enum steer_kind {
    STEER_PAUSE,      /* after the tick that runs */
    STEER_RESUME,     /* real time: the grid begins anew */
    STEER_STEP,       /* count ticks, then stand still; answered when they have run */
    STEER_SPEED,      /* value: virtual seconds a second, 0.001 to 1000; 0 = as fast as it goes */
    STEER_RESET,      /* to the start; paused stays paused */
    STEER_CHECKPOINT, /* index: the slot, 1 to STEERING_SLOTS - 1 */
    STEER_RESTORE,    /* index: the slot */
    STEER_FAULT,      /* index of the fault, on */
    STEER_PUSH,       /* index of the body, force and moment (world frame), for duration_ns of virtual
                       * time, 0 = until changed */
    STEER_SET,        /* index of the tunable, value */
};

struct steer_request {
    uint64_t ticket; /* of the asker's choice; the answer carries it */
    enum steer_kind kind;
    size_t index;
    uint64_t count;
    double value;
    bool on;
    double force_n[3], moment_nm[3];
    int64_t duration_ns;
};

enum steer_verdict {
    STEER_OK,
    STEER_RANGE,       /* index, count or value out of range */
    STEER_EMPTY,       /* no checkpoint in this slot */
    STEER_RECORDING,   /* no way back while a recording runs */
    STEER_CLOCK,       /* this clock cannot do it (speed in lockstep) */
    STEER_BUSY,        /* a STEER_STEP is under way */
    STEER_UNAVAILABLE, /* this run has not what it takes (no memory was set aside, ...) */
    STEER_CUT,         /* a STEER_PAUSE ended the STEER_STEP; tick says where */
};

struct steer_answer {
    uint64_t ticket;
    enum steer_verdict verdict;
    uint64_t tick; /* after it was carried out */
    int64_t time_ns;
    uint64_t state_hash; /* plant_hash */
};

/* A parameter that may change while the simulator runs. */
struct tunable {
    const char *name; /* "joint.RKneeSag.position_kp", "supply_v", ...; owned by the steering */
    const char *unit; /* "" = a count */
    double min, max;
    bool whole; /* takes whole numbers only */
};

struct steering;

/* Asks; false when the ring is full. From one thread other than the loop's. */
bool steering_ask(struct steering *steering, const struct steer_request *request);

/* One answer, false when none waits. By the thread that asks. */
bool steering_answer(struct steering *steering, struct steer_answer *answer);

/* A sentence for the user. */
const char *steer_verdict_text(enum steer_verdict verdict);

/* The tunables; any thread. */
size_t steering_tunables(const struct steering *steering);
const struct tunable *steering_tunable(const struct steering *steering, size_t index);
int steering_find(const struct steering *steering, const char *name); /* -1 = none */

/* The value of a tunable as of the last tick; any thread, consistent. */
double steering_value(const struct steering *steering, size_t index);

/* Whether the loop stands still, and its pace (0 = as fast as it goes); any thread. */
bool steering_paused(const struct steering *steering);
double steering_speed(const struct steering *steering);

#endif
