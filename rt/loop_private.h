/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the parts of the loop share. loop.c runs the tick and waits for its time, loop_lockstep.c
 * for its STEP frame, overrun.c keeps the accounts of the real clock, loop_requests.c carries
 * out requests between two ticks, requests.c is their rings, loop_events.c words the log. All of
 * it runs in the loop's thread and is RT-safe unless it says otherwise.
 */
#ifndef RT_LOOP_PRIVATE_H
#define RT_LOOP_PRIVATE_H

#include "base/ring.h"
#include "rt/loop.h"
#include "rt/request_machine.h"

#include <stdatomic.h>

/* Keeps a function from being inlined: one place for a probe, a line of its own in a profile,
 * and what the test of the budget (phase_budgets) counts. */
#define LOOP_NOINLINE __attribute__((noinline))

enum {
    BATCH = 64,      /* frames per receive call */
    HELD_MAX = 1024, /* frames of the STEP's bus held back until the STEP comes */
    EVENT_RING = 1024,
    WAIT_SLICE_NS = 100000000, /* longest sleep: the stop flag is read at least this often */
    POLL_SLICE_NS = 10000000,  /* the same when the port is gone and has no descriptor to poll */
};

/* The state of the loop in a checkpoint slot, with the held frames of the STEP's bus. */
struct loop_moment {
    bool kept;
    uint64_t ticks;
    struct lockstep lockstep;
    size_t held_count, held_seen;
    uint64_t lost_since_done; /* frames, which the next DONE reports */
    struct bus_frame *held;   /* HELD_MAX; NULL but in lockstep */
};

/* The last push. One that is renewed until it ends, as that of a hand on the page, is reported
 * once and at its end. */
struct loop_push {
    size_t body;
    int64_t until_ns; /* virtual time until which it acts */
    int64_t told_mn;  /* the force of its last event */
    int64_t most_mn;  /* its greatest force */
};

struct loop_requests {
    bool paused;
    double speed;         /* virtual seconds a second; 0 = as fast as possible */
    uint64_t step_left;   /* ticks of the REQUEST_STEP under way; 0 = none is */
    uint64_t step_ticket; /* of it */
    struct loop_push push;
    struct loop_moment moment[CHECKPOINT_SLOTS];
};

struct loop {
    struct loop_config config; /* complete */
    struct loop_stats stats;
    atomic_bool stop;
    _Atomic uint64_t beat; /* loop_beat */
    enum loop_end end;

    /* The tick being run */
    int64_t mark_ns;            /* end of the last phase */
    int64_t spent[PHASE_COUNT]; /* wait: how late the tick began */
    int64_t work_begin_ns;

    /* Real clock and paced free run */
    int64_t period_ns; /* of the grid: T, scaled by the speed; 0 = none, as fast as possible */
    int64_t deadline_ns;
    int64_t reference_ns; /* when the tick could have begun: its deadline, or the end of the last */
    int64_t last_end_ns;

    /* Lockstep */
    struct lockstep lockstep;
    bool step_begins; /* this tick is the first of its STEP */
    bool step_asked;  /* the present STEP is one of REQUEST_STEP */
    bool awaiting;    /* the wait for a STEP has begun */
    struct bus_frame *held;
    size_t held_count; /* frames in held */
    size_t held_seen;  /* of which examined; up to and with the STEP once it was found */

    struct bus_frame *batch;    /* BATCH, received */
    struct bus_frame *outgoing; /* largest transmit_max + DONE */
    enum can_port_state *state; /* of each bus, as last reported */
    uint64_t rx_lost, tx_lost;  /* of all buses, as last reported */
    uint64_t lost_at_done;
    struct ring events;

    struct loop_requests requests; /* with config.requests */
};

/* ---- requests.c: takes requests, answers them and publishes what other threads may read ---- */

const struct request_machine *requests_machine(const struct requests *requests);

/* Takes the next request, if one waits and there is room for its answer; checks whether that is
 * so. */
bool requests_next(struct requests *requests, struct loop_request *request);
bool requests_waits(const struct requests *requests);

/* Answers a request that was taken, with tick and virtual time at which it was carried out. */
void requests_reply(struct requests *requests, uint64_t ticket, enum request_verdict verdict,
                    uint64_t tick, int64_t now_ns);

/* Publishes whether the loop is paused and its speed. */
void requests_publish(struct requests *requests, bool paused, double speed);

/* Publishes the values of the tunables; without `all` only when some may have changed. */
void requests_publish_values(struct requests *requests, bool all);

/* Takes no more requests: what waits is answered REQUEST_UNAVAILABLE. */
void requests_close(struct requests *requests, uint64_t tick, int64_t now_ns);

/* Begin and end a sleep until a request comes: between them the returned descriptor becomes
 * readable when one does. -1 = a request waits already. */
int requests_sleep_begin(struct requests *requests);
void requests_sleep_end(struct requests *requests, bool readable);

/* ---- loop_events.c ---- */

/* Queues an event for the log, or counts that there was no room. */
void loop_emit_event(struct loop *loop, enum loop_event_kind kind, int bus, int64_t a, int64_t b);

/* ---- loop.c ---- */

/* Moves the beat, at each wake-up; returns whether the run is to end. */
bool loop_stop_requested(struct loop *loop);

/* Steps the inline controller, if there is one; false when it has finished. */
bool loop_step_controller(struct loop *loop);

/* Receives up to max frames of a bus. */
size_t loop_take_frames(struct loop *loop, size_t bus, struct bus_frame *frames, size_t max);

/* Records a received frame and hands it to the machine. */
void loop_deliver_frame(struct loop *loop, size_t bus, const struct bus_frame *frame);

/* Counts the frames that all ports have lost until now, on receiving and on sending. */
void loop_count_lost(const struct loop *loop, uint64_t *rx, uint64_t *tx);

/* Sends DONE on every bus, on that of the STEP last: it says that all the others are there. */
void loop_send_done(struct loop *loop, uint16_t flags);

/* Checks whether the loop runs freely at a given speed, on a grid of deadlines. */
static inline bool loop_is_paced(const struct loop *loop)
{
    return loop->config.clock == LOOP_CLOCK_FREE && loop->requests.speed > 0.0;
}

/* Checks whether a request waits to be carried out between two ticks. */
static inline bool loop_request_waits(const struct loop *loop)
{
    return loop->config.requests && requests_waits(loop->config.requests);
}

/* ---- loop_lockstep.c ---- */

/* Waits for a STEP that fits; false when the tick may not begin: the run ends, or a request
 * has to be carried out first (loop->end tells). */
bool loop_wait_for_step(struct loop *loop);

/* Delivers the frames held back that came before the STEP. */
void loop_deliver_held(struct loop *loop);

/* Delivers what a wire has brought on the STEP's bus while a STEP runs; the next STEP, if it is
 * there already, and what follows it stay. */
void loop_drain_step_bus(struct loop *loop);

/* ---- overrun.c ---- */

/* Accounts for a tick that has ended at now_ns (of the clock): met its deadline, late or overrun;
 * chooses the next deadline. */
void overrun_account_tick(struct loop *loop, int64_t now_ns);

/* After a pause of the process: goes on at the next deadline of the grid, and counts the pause. */
void overrun_skip_pause(struct loop *loop, int64_t now_ns);

/* Sets the next deadline of a paced free run, which has no accounts: what is late stays late. */
void overrun_pace_tick(struct loop *loop, int64_t now_ns);

/* ---- loop_requests.c; only with config.requests ---- */

/* Allocates the state of requests in memory from arena; false = it is used up. Not RT-safe. */
bool loop_requests_create(struct loop *loop, struct arena *arena);

/* Saves the start as checkpoint 0, before the first tick. */
void loop_requests_begin(struct loop *loop);

/* Carries out the requests between two ticks, and waits while the loop is paused. False = the
 * run is to end. */
bool loop_requests_carry_out(struct loop *loop);

/* Sleeps until a request comes, fd (NULL = none) can be read or until_ns has come. */
void loop_requests_sleep(struct loop *loop, struct pollfd *fd, int64_t until_ns);

/* Moves requests on at the beginning of a tick; counts down a REQUEST_STEP at its end. */
void loop_requests_tick_begins(struct loop *loop);
void loop_requests_tick_ended(struct loop *loop);

/* Ends the requests after the last tick: those that wait are refused. */
void loop_requests_end(struct loop *loop);

#endif
