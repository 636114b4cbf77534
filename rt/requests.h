/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Requests of another thread to a running loop: pause, resume, run a number of ticks, change the
 * speed, restore an earlier state, switch a fault, push a body, set a parameter.
 *
 * Requests and answers pass through two rings of fixed size, and neither side ever waits for the
 * other. One thread sends requests: the thread of the control socket (control/control.h). The loop
 * carries them out between two ticks, in order, with effect from the next tick. When the ring of
 * answers is full, the loop takes no further request until the client reads. At the end of the run
 * the loop answers the remaining requests.
 *
 * Pause. A requested pause counts no missed deadlines, no overruns and no silence of a lockstep
 * controller. The loop's beat continues. The loop receives and sends no frame. Arriving frames wait
 * in sockets and inboxes; frames that find these full are lost and counted. Boards measure their
 * time-outs in virtual time, so the time-outs stand still too. A task in its own thread (real
 * clock) pauses, resumes and changes speed with the loop (struct pace). Controllers in other
 * processes see a silent bus.
 *
 * Steps. REQUEST_STEP runs its ticks at the present speed, even from a pause, then pauses. While it
 * runs, RESUME, STEP, RESET and RESTORE return REQUEST_BUSY. A PAUSE ends the step, and the answer
 * to the step is REQUEST_CUT. In lockstep the request acts as a STEP frame: the loop receives the
 * waiting frames, runs the ticks, and sends DONE on every bus. The remaining ticks of an earlier
 * STEP frame run first. A waiting STEP frame stays, and is answered with LOCKSTEP_MISMATCH and the
 * simulator's tick. An inline task sends its own STEPs; the request then limits how many ticks run.
 *
 * Speed. A new speed scales the deadlines of the real clock and restarts their grid. At speed 0
 * there is no grid, and no tick is late. A free run is paced but counts no overruns. REQUEST_CLOCK
 * refuses any speed in lockstep, because the STEPs set the pace. It also refuses speed 0 with a
 * task in its own thread, because this task needs a pace.
 *
 * Going back. A checkpoint is a copy of all state that changes in virtual time: plant, boards,
 * sensors, faults, wires, an inline task, the loop's tick. Its memory is allocated at the start.
 * Slot 0 holds the start; REQUEST_RESET restores slot 0. A restore also sets time back. With the
 * same frames, a run from a checkpoint is therefore bit-identical. Switched faults, pushes and
 * tunables go back as well; speed and pause do not. Frames in queues of other processes and threads
 * (clients of the gateway) stay. Frames that the loop held for the next STEP are restored.
 * Statistics (overruns, histograms, counters of ports, the log) continue.
 *
 * Time cannot go back while a recording runs (REQUEST_RECORDING), because time in a recording
 * always increases. Time also cannot go back with a task in its own thread (REQUEST_UNAVAILABLE),
 * because a checkpoint does not contain the thread's state. A checkpoint fails while more than
 * 2,000 frames are in transit between boards and an inline task on one local bus.
 *
 * All functions are RT-safe and never wait, except request_verdict_text, which is for other
 * threads.
 */
#ifndef RT_REQUESTS_H
#define RT_REQUESTS_H

#include "base/arena.h"
#include "base/error.h"

#include <stdint.h>

enum { CHECKPOINT_SLOTS = 4 }; /* number of checkpoint slots; slot 0 is the start */

enum request_kind {
    REQUEST_PAUSE,  /* after the present tick */
    REQUEST_RESUME, /* real time: restarts the grid of deadlines */
    REQUEST_STEP,   /* run `count` ticks, then pause; answered after the last one */
    REQUEST_SPEED,  /* value: virtual seconds per second, 0.001 to 1000; 0 = as fast as possible */
    REQUEST_RESET,  /* restore the start; a paused loop stays paused */
    REQUEST_CHECKPOINT, /* save to slot `index`, 1 to CHECKPOINT_SLOTS - 1 */
    REQUEST_RESTORE,    /* restore slot `index` */
    REQUEST_FAULT,      /* switch fault `index` to `on` */
    /* push body `index`: force and moment (world frame) for duration_ns of virtual time, 0 =
     * until changed */
    REQUEST_PUSH,
    REQUEST_SET, /* set tunable `index` to `value` */
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
    REQUEST_CLOCK,       /* not possible with this clock (speed in lockstep) */
    REQUEST_BUSY,        /* a REQUEST_STEP is running */
    REQUEST_UNAVAILABLE, /* not supported by this run (no memory was allocated, ...) */
    REQUEST_CUT,         /* a REQUEST_PAUSE ended this REQUEST_STEP at `tick` */
};

struct request_answer {
    uint64_t ticket;
    enum request_verdict verdict;
    uint64_t tick; /* tick of the loop after the request */
    int64_t time_ns;
    uint64_t state_hash; /* result of plant_hash */
    double ended[2];     /* REQUEST_PUSH: the push that it ended, N and N m; 0 = none acted */
};

/* A parameter that may change while the simulator runs. */
struct tunable {
    const char *name; /* "joint.RKneeSag.position_kp", "supply_v", ...; owned by the requests */
    const char *unit; /* "" = dimensionless */
    double min, max;
    bool whole; /* value must be a whole number */
};

struct requests;

/* Sends a request. Returns false when the ring is full or the run has ended. From one thread other
 * than the loop's. */
bool requests_ask(struct requests *requests, const struct loop_request *request);

/* Removes the next answer from the ring; false = none waits. From the thread that sends
 * requests. */
bool requests_answer(struct requests *requests, struct request_answer *answer);

/* Returns the meaning of a verdict as a sentence for the user; static. */
const char *request_verdict_text(enum request_verdict verdict);

/* Returns a tunable; NULL = no such index. From any thread. */
const struct tunable *requests_tunable(const struct requests *requests, size_t index);

/* Returns the value of a tunable after the last tick. From any thread. */
double requests_value(const struct requests *requests, size_t index);

/* Return whether the loop is paused, and its speed (0 = as fast as possible). From any thread. */
bool requests_paused(const struct requests *requests);
double requests_speed(const struct requests *requests);

#endif
