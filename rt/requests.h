/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Requests of another thread to a running loop: pause, resume, run so many ticks, change the speed,
 * go back to an earlier state, switch a fault, push a body, set a parameter.
 *
 * Requests and answers cross in two rings of fixed size; the loop carries requests out between two
 * ticks, in their order, and neither side ever waits for the other. One thread sends them (that of
 * the control socket, control/control.h); each takes effect from the tick that comes next. A
 * client that does not drain its answers is ignored once their ring is full. At the end of the run
 * the requests that are left are answered.
 *
 * Pause. It is intended: it costs no deadline, no overrun, no silence of a lockstep controller, and
 * the loop's beat goes on. No frame is received or sent; what arrives waits in sockets and inboxes,
 * and is lost and counted where these are full. All time-outs of boards are of virtual time and
 * stand still too. A task in a thread of its own (real clock) pauses and resumes with the loop, at
 * its speed (struct pace); controllers in other processes see a silent bus.
 *
 * Steps. REQUEST_STEP runs its ticks at the present speed, whether the loop was paused or not, then
 * pauses. Until then RESUME, STEP, RESET and RESTORE are REQUEST_BUSY, and a PAUSE ends it
 * (REQUEST_CUT). In lockstep it plays the part of a STEP frame: the frames that wait, its ticks,
 * DONE on every bus. A STEP frame that waits stays; its sender learns by a mismatch at which tick
 * the simulator is. What is left of a STEP frame comes first. An inline task sends STEPs of its
 * own, of which so many ticks run.
 *
 * Speed. The real clock's grid and all accounts of it scale, and the grid begins anew; at 0 there
 * is none, and nothing is late. Free run is paced without any account. In lockstep the STEPs are
 * the pace, and a task in a thread of its own needs one: REQUEST_CLOCK.
 *
 * Going back. A checkpoint is a copy, in memory set aside at the start, of all state that changes
 * in virtual time: plant, boards, sensors, faults, wires, an inline task, the loop's tick. Slot 0
 * holds the start and is what REQUEST_RESET restores. Time goes back with it, so that a run from a
 * checkpoint repeats bit for bit what followed it the first time, given the same frames. Faults
 * that were switched, pushes and tunables go back too; speed and pause do not. Frames in the queues
 * of other processes and threads (clients of the gateway) stay where they are; those that the loop
 * itself had taken for the next STEP are again those of then. Accounts (overruns, histograms,
 * counters of ports, the log) go on. While a recording runs time cannot go back: that of a
 * recording never does. Nor can it, REQUEST_UNAVAILABLE, with a task in a thread of its own, whose
 * state is not in a checkpoint; and there is no checkpoint while more than two thousand frames are
 * on their way between boards and an inline task on one local bus.
 *
 * All functions are RT-safe and never wait, but for requests_find and request_verdict_text, which
 * are for other threads.
 */
#ifndef RT_REQUESTS_H
#define RT_REQUESTS_H

#include "base/arena.h"
#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { CHECKPOINT_SLOTS = 4 }; /* of checkpoints; 0 is the start */

enum request_kind {
    REQUEST_PAUSE,  /* after the tick that runs */
    REQUEST_RESUME, /* real time: the grid begins anew */
    REQUEST_STEP,   /* count ticks, then pause; answered when they have run */
    REQUEST_SPEED,  /* value: virtual seconds a second, 0.001 to 1000; 0 = as fast as possible */
    REQUEST_RESET,  /* to the start; paused stays paused */
    REQUEST_CHECKPOINT, /* index: the slot, 1 to CHECKPOINT_SLOTS - 1 */
    REQUEST_RESTORE,    /* index: the slot */
    REQUEST_FAULT,      /* index of the fault, on */
    REQUEST_PUSH,       /* index of the body, force and moment (world frame), for duration_ns of
                       * virtual time, 0 = until changed */
    REQUEST_SET,        /* index of the tunable, value */
};

struct loop_request {
    uint64_t ticket; /* chosen by the client; the answer repeats it */
    enum request_kind kind;
    size_t index;
    uint64_t count;
    double value;
    bool on;
    double force_n[3], moment_nm[3];
    int64_t duration_ns;
};

enum request_verdict {
    REQUEST_OK,
    REQUEST_RANGE,       /* index, count or value out of range */
    REQUEST_EMPTY,       /* no checkpoint in this slot */
    REQUEST_RECORDING,   /* time cannot go back while a recording runs */
    REQUEST_CLOCK,       /* this clock cannot do it (speed in lockstep) */
    REQUEST_BUSY,        /* a REQUEST_STEP is under way */
    REQUEST_UNAVAILABLE, /* this run does not support it (no memory was set aside, ...) */
    REQUEST_CUT,         /* a REQUEST_PAUSE ended the REQUEST_STEP, at tick */
};

struct request_answer {
    uint64_t ticket;
    enum request_verdict verdict;
    uint64_t tick; /* at which the loop is after the request */
    int64_t time_ns;
    uint64_t state_hash; /* plant_hash */
};

/* A parameter that may change while the simulator runs. */
struct tunable {
    const char *name; /* "joint.RKneeSag.position_kp", "supply_v", ...; owned by the requests */
    const char *unit; /* "" = a count */
    double min, max;
    bool whole; /* takes whole numbers only */
};

struct requests;

/* Sends a request; false when the ring is full or the run has ended. From one thread other than the
 * loop's. */
bool requests_ask(struct requests *requests, const struct loop_request *request);

/* Takes one answer, false when none waits. From the thread that sends requests. */
bool requests_answer(struct requests *requests, struct request_answer *answer);

/* Returns a sentence for the user; static. */
const char *request_verdict_text(enum request_verdict verdict);

/* Return the number of tunables, one of them (NULL = there is none), and the index of a name;
 * any thread. */
size_t requests_tunables(const struct requests *requests);
const struct tunable *requests_tunable(const struct requests *requests, size_t index);
int requests_find(const struct requests *requests, const char *name); /* -1 = none */

/* Returns the value of a tunable as of the last tick; any thread, consistent. */
double requests_value(const struct requests *requests, size_t index);

/* Return whether the loop is paused, and its speed (0 = as fast as possible); any thread. */
bool requests_paused(const struct requests *requests);
double requests_speed(const struct requests *requests);

#endif
