/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Functions and state that the files of the loop share. loop.c runs the tick and waits for its
 * time. loop_lockstep.c waits for its STEP frame. overrun.c counts overruns and pauses of the real
 * clock. loop_requests.c carries out requests between two ticks, and requests.c holds their rings.
 * loop_events.c formats events for the log. All functions run in the loop's thread and are RT-safe
 * unless noted.
 */
#ifndef RT_LOOP_PRIVATE_H
#define RT_LOOP_PRIVATE_H

#include "base/ring.h"
#include "rt/loop.h"
#include "rt/request_machine.h"

#include <stdatomic.h>

/* Prevents inlining of a function. Its probe then has one address, a profile shows its name, and
 * the budget test (phase_budgets) counts its instructions. */
#define LOOP_NOINLINE __attribute__((noinline))

enum {
    BATCH = 64,      /* frames per receive call */
    HELD_MAX = 1024, /* most frames of the STEP's bus held back until the STEP comes */
    EVENT_RING = 1024,
    WAIT_SLICE_NS = 100000000, /* longest sleep between two checks of the stop flag */
    POLL_SLICE_NS = 10000000,  /* longest sleep when the port has closed and has no descriptor */
};

/* The loop's own state in a checkpoint slot, with the held frames of the STEP's bus. */
struct loop_moment {
    bool kept;
    uint64_t ticks;
    struct lockstep lockstep;
    size_t held_count, held_seen;
    uint64_t lost_since_done; /* lost frames that the next DONE reports */
    struct bus_frame *held;   /* HELD_MAX frames; NULL except in lockstep */
};

/* The last push. A viewer renews a push while the user drags. The log then has one event at the
 * beginning and one at the end of the whole push. */
struct loop_push {
    size_t body;
    int64_t until_ns; /* virtual time at which it ends */
    int64_t told_mn;  /* force in the last event about it */
    int64_t most_mn;  /* its greatest force */
};

/* Capacity of the ring of requests and of the ring of answers. */
enum { REQUESTS = 64 };

/* Bits of `sleep`. Both sides change it with atomic read-modify-write operations, so all changes
 * have one order. Either the loop sees the request before it sleeps, or the client sees that the
 * loop sleeps and wakes it. */
enum { SLEEPING = 1, REQUESTED = 2 };

struct requests {
    struct request_machine machine;
    struct ring requests, answers; /* struct loop_request, struct request_answer */
    size_t open;                   /* number of requests taken and not yet answered */
    int wake;                      /* eventfd that ends the loop's sleep */
    _Atomic uint32_t sleep;
    atomic_bool closed, paused;
    _Atomic double speed;
    _Atomic double *value; /* one per tunable */
    uint64_t changes;      /* the machine's counter of changes at the last publication */
};

struct loop_requests {
    bool paused;
    double speed;         /* virtual seconds a second; 0 = as fast as possible */
    uint64_t step_left;   /* ticks left of the present REQUEST_STEP; 0 = none runs */
    uint64_t step_ticket; /* ticket of the present REQUEST_STEP */
    double ended[2];      /* of the present push (struct request_answer) */
    struct loop_push push;
    struct loop_moment moment[CHECKPOINT_SLOTS];
};

struct loop {
    struct loop_config config; /* with defaults applied */
    struct loop_stats stats;
    atomic_bool stop;
    _Atomic uint64_t beat; /* counter of loop_beat */
    enum loop_end end;

    /* The tick being run */
    int64_t mark_ns;            /* clock time at the end of the last phase */
    int64_t spent[PHASE_COUNT]; /* duration of each phase; wait: how late the tick began */
    int64_t work_begin_ns;

    /* Real clock and paced free run */
    int64_t period_ns; /* tick T divided by the speed; 0 = no grid, as fast as possible */
    int64_t deadline_ns;
    /* earliest possible start of the tick: max of its deadline and the end of the last tick */
    int64_t reference_ns;
    int64_t last_end_ns;

    /* Lockstep */
    struct lockstep lockstep;
    bool step_begins; /* this tick is the first of its STEP */
    bool step_asked;  /* a REQUEST_STEP started the present STEP */
    bool awaiting;    /* the wait for a STEP has begun */
    struct bus_frame *held;
    size_t held_count; /* frames in held */
    /* number of held frames examined; up to and including the STEP once it is found */
    size_t held_seen;

    /* Frames between ticks */
    struct pollfd *poll;                   /* descriptors of the buses, and room for one more */
    size_t arrivals;                       /* frames since the last tick */
    int64_t arrivals_ns, arrivals_late_ns; /* work for these frames; part after the deadline */
    bool arrivals_ended;                   /* the loop receives no more frames before the tick */
    int64_t early_ns; /* virtual time from the arrival of the present frames to the tick */

    struct bus_frame *batch;    /* BATCH received frames */
    struct bus_frame *outgoing; /* frames to send: largest transmit_max + DONE */
    enum can_port_state *state; /* last reported state of each bus */
    uint64_t rx_lost, tx_lost;  /* last reported losses, sum of all buses */
    uint64_t lost_at_done;
    struct ring events;

    struct loop_requests requests; /* used with config.requests */
};

/* ---- loop_events.c ---- */

/* Queues an event for the log, or counts it as lost when the ring is full. */
void loop_emit_event(struct loop *loop, enum loop_event_kind kind, int bus, int64_t a, int64_t b);

/* ---- loop.c ---- */

/* Advances the beat, at each wake-up. Returns whether the run must end. */
bool loop_stop_requested(struct loop *loop);

/* Steps the inline controller. Returns false when it has finished; true if there is none. */
bool loop_step_controller(struct loop *loop);

/* Sends the first `count` outgoing frames, and records the frames that the port accepted. */
void loop_send_frames(struct loop *loop, size_t bus, size_t count);

/* Receives up to max frames of a bus. */
size_t loop_take_frames(struct loop *loop, size_t bus, struct bus_frame *frames, size_t max);

/* Records a received frame and hands it to the machine with the time of its arrival. */
void loop_deliver_frame(struct loop *loop, size_t bus, struct bus_frame *frame);

/* Counts the frames that all ports have lost so far, on receive and on send. */
void loop_count_lost(const struct loop *loop, uint64_t *rx, uint64_t *tx);

/* Sends DONE on every bus, on the STEP's bus last. A controller that reads this last DONE has
 * therefore received all other frames. */
void loop_send_done(struct loop *loop, uint16_t flags);

/* Checks whether the loop runs free at a given speed, on a grid of deadlines. */
static inline bool loop_is_paced(const struct loop *loop)
{
    return loop->config.clock == LOOP_CLOCK_FREE && loop->requests.speed > 0.0;
}

/* Calls machine.idle, if it exists, before a sleep. */
static inline void loop_idle(const struct loop *loop)
{
    if (loop->config.machine.idle) {
        loop->config.machine.idle(loop->config.machine.context);
    }
}

/* Checks whether a request waits and the ring of answers has room. */
static inline bool loop_request_waits(const struct loop *loop)
{
    const struct requests *requests = loop->config.requests;

    return requests && ring_count(&requests->requests) > 0 &&
           ring_count(&requests->answers) + requests->open < REQUESTS;
}

/* ---- loop_arrivals.c ---- */

/* Allocates the descriptors; false = out of memory. Not RT-safe. */
bool loop_arrivals_create(struct loop *loop, struct arena *arena);

/* Checks whether the loop answers between ticks: with the real clock, while somebody listens. */
bool loop_arrivals_possible(const struct loop *loop);

/* Returns the virtual time at a time of the clock. A tick begins at virtual time tick_ns and at
 * loop->deadline_ns. */
int64_t loop_virtual_time(const struct loop *loop, int64_t tick_ns, int64_t clock_ns);

/* Begins a sleep that arriving frames and due answers end: fills in the descriptors of loop->poll
 * and lowers *until_ns. Returns false when the loop receives in the tick only. */
bool loop_arrivals_begin(struct loop *loop, int64_t now_ns, int64_t *until_ns);

/* Receives and answers frames of the readable buses, up to the limits in rt/loop.h. Returns the
 * time at the end. */
int64_t loop_arrivals_serve(struct loop *loop, int64_t begin_ns);

/* Subtracts the work for arrivals from the wait, after the wait has ended. */
void loop_arrivals_end(struct loop *loop);

/* ---- loop_lockstep.c ---- */

/* Waits for a valid STEP. Returns false when no tick may begin: the run has ended (loop->end) or a
 * request must be carried out first. */
bool loop_wait_for_step(struct loop *loop);

/* Delivers the held frames that came before the STEP. */
void loop_deliver_held(struct loop *loop);

/* Delivers the frames that a wire carried on the STEP's bus while a STEP runs. If the next STEP has
 * arrived, holds this STEP and the frames after it. */
void loop_drain_step_bus(struct loop *loop);

/* ---- overrun.c ---- */

/* Counts a tick that ended at clock time now_ns as in time, late or overrun. Sets the next
 * deadline. */
void overrun_account_tick(struct loop *loop, int64_t now_ns);

/* Counts a pause of the process and continues at the next deadline of the grid. */
void overrun_skip_pause(struct loop *loop, int64_t now_ns);

/* Sets the next deadline of a paced free run. A paced free run counts no overruns, and lost time
 * stays lost. */
void overrun_pace_tick(struct loop *loop, int64_t now_ns);

/* ---- loop_requests.c; only with config.requests ---- */

/* Publishes the values of the tunables. all false: only if a value may have changed. */
void requests_publish_values(struct requests *requests, bool all);

/* Allocates the state of requests from arena; false = out of memory. Not RT-safe. */
bool loop_requests_create(struct loop *loop, struct arena *arena);

/* Saves the start as checkpoint 0, before the first tick. */
void loop_requests_begin(struct loop *loop);

/* Carries out the requests between two ticks, and waits while the loop is paused. False = the run
 * must end. */
bool loop_requests_carry_out(struct loop *loop);

/* Sleeps until a request comes, one of the first `count` descriptors of loop->poll is readable, or
 * until_ns. */
void loop_requests_sleep(struct loop *loop, size_t count, int64_t until_ns);

/* loop_requests_tick_begins advances the effects of requests. loop_requests_tick_ended counts down
 * a REQUEST_STEP. */
void loop_requests_tick_begins(struct loop *loop);
void loop_requests_tick_ended(struct loop *loop);

/* Ends the requests after the last tick and refuses the waiting ones. */
void loop_requests_end(struct loop *loop);

#endif
