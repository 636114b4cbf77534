/* SPDX-License-Identifier: Apache-2.0 */
/* What the parts of the loop share: loop.c (waiting, the tick), loop_events.c, loop_steering.c. */
#ifndef RT_LOOP_PRIVATE_H
#define RT_LOOP_PRIVATE_H

#include "base/ring.h"
#include "rt/loop.h"
#include "rt/steering_private.h"

#include <stdatomic.h>

enum {
    BATCH = 64,      /* frames per receive call */
    HELD_MAX = 1024, /* frames of the STEP's bus kept until the STEP comes */
    EVENT_RING = 1024,
    WAIT_SLICE_NS = 100000000, /* the stop flag is looked at as often while waiting */
    POLL_SLICE_NS = 10000000,  /* the same when the port is gone and has nothing to sleep on */
};

/* What a slot keeps of the loop, beside the frames of the STEP's bus that it held. */
struct loop_moment {
    bool kept;
    uint64_t ticks;
    struct lockstep lockstep;
    size_t held_count, held_seen;
    uint64_t lost_since_done; /* frames, which the next DONE tells */
    struct bus_frame *held;   /* HELD_MAX; NULL but in lockstep */
};

struct loop_steer {
    bool standing;
    double speed;
    uint64_t step_left;   /* ticks of the STEER_STEP under way; 0 = none is */
    uint64_t step_ticket; /* of it */
    struct loop_moment moment[STEERING_SLOTS];
};

struct loop {
    struct loop_config config;
    struct loop_stats stats;
    atomic_bool stop;
    _Atomic uint64_t beat; /* loop_beat */
    enum loop_end end;

    /* the tick being run */
    int64_t mark_ns;            /* end of the last phase */
    int64_t spent[PHASE_COUNT]; /* wait: how late the tick began */
    int64_t work_begin_ns;

    /* real clock */
    int64_t period_ns; /* of the grid: T, scaled by the speed; 0 = none, as fast as it goes */
    int64_t deadline_ns;
    int64_t reference_ns; /* when the tick could have begun: its deadline, or the end of the last */
    int64_t last_end_ns;

    /* lockstep */
    struct lockstep lockstep;
    bool step_begins; /* this tick is the first of its STEP */
    bool step_asked;  /* the present STEP is one of STEER_STEP */
    bool awaiting;    /* the wait for a STEP has begun */
    struct bus_frame *held;
    size_t held_count; /* frames in held */
    size_t held_seen;  /* of which judged; up to and with the STEP once it was found */

    struct bus_frame *batch;    /* BATCH, received */
    struct bus_frame *outgoing; /* largest transmit_max + DONE */
    enum can_port_state *state; /* of each bus, as last reported */
    uint64_t rx_lost, tx_lost;  /* of all buses, as last reported */
    uint64_t lost_at_done;
    struct ring events;

    struct loop_steer steer; /* with config.steering */
};

/* Tells the log, or counts that it could not. */
void loop_emit(struct loop *loop, enum loop_event_kind kind, int bus, int64_t a, int64_t b);

/* At each wake-up: moves the beat; true when the run is to end. */
bool loop_stop_wanted(struct loop *loop);

/* Frames received and to be sent that all ports have lost until now. */
void loop_count_lost(const struct loop *loop, uint64_t *rx, uint64_t *tx);

/* DONE on every bus. */
void loop_send_done(struct loop *loop, uint16_t flags);

/* ---- steering; only with config.steering ---- */

/* Memory from arena; false when it is used up. */
bool loop_steer_create(struct loop *loop, struct arena *arena);

/* Before the first tick: keeps the start. */
void loop_steer_begin(struct loop *loop);

/* Between two ticks: carries out what is asked, and waits while the loop stands still. False when
 * the run is to end. */
bool loop_steer(struct loop *loop);

/* Sleeps until a request comes, fd (NULL = none) can be read or until_ns has come. */
void loop_steer_sleep(struct loop *loop, struct pollfd *fd, int64_t until_ns);

/* Before and after a tick. */
void loop_steer_ticks(struct loop *loop);
void loop_steer_ticked(struct loop *loop);

/* After the last tick: nothing is carried out any more. */
void loop_steer_end(struct loop *loop);

#endif
