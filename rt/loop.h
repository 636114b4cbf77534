/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The real-time loop: one step function behind three clocks. It owns time, the phases of a tick and
 * the accounts of both; what happens in a phase comes in as a table of functions, struct
 * loop_machine, so that any program can bring a machine of its own (tests/rt/ten_lines.c) and tests
 * script machine and clock.
 *
 * Tick k (from 0) stands for virtual time [k T, (k+1) T). Virtual times are int64_t ns from 0;
 * times of the clock are ns of rt/clock.h.
 *
 * Real clock. The deadlines are the grid D + k T of the monotonic clock, T the tick; they never
 * drift. A tick that ends after the next deadline and took longer than T itself is an overrun,
 * charged to the phase that took longest (PHASE_WAIT when it was the late wake-up). Then
 *   skip  drops the deadlines that have passed and counts them: virtual time falls behind by them;
 *   slip  runs the late ticks back to back until the grid is caught up; a tick that is late only
 *         because an earlier one was counts as late, not as an overrun;
 *   stop  is skip, and ends the run at the stop_after-th overrun.
 * More than LOOP_PAUSE_NS behind (stopped by SIGSTOP, suspended, hopelessly overloaded) the loop
 * goes on at the next deadline of the grid whatever the policy, and counts a pause.
 *
 * The accounts of the real clock balance, as long as no request changes the speed or pauses the
 * loop: start_ns + (ticks + lost_ticks + pause_ticks) T is the deadline of the tick that would come
 * next. The last tick has ended before it, by less than T; with slip it may have ended up to
 * LOOP_PAUSE_NS after it. The sum of overruns[] is overrun_total.
 *
 * The loop does not use the time of day, which may be set forward and back. While a machine is
 * suspended its monotonic clock does not run. Virtual time stands still in a pause: no board does
 * anything, and the time-outs of commands, which are of virtual time, do not run. The first tick
 * after it receives what the buses have kept, in its order, and counts what they could not keep; a
 * motor whose controller did not survive the pause is at 0 V a command time-out later.
 *
 * No bus can stall the loop: it takes at most LOOP_RECEIVE_MAX frames of each in a tick, the rest
 * waits or is lost and counted; between two looks for a STEP it takes no more either.
 *
 * Lockstep. Ticks run when a STEP frame asks for them. Before the tick, each bus is received in the
 * order of the buses: everything that waits, on the STEP's own bus everything up to the STEP. What
 * arrives while a STEP of several ticks runs belongs to the next one, but for what a wire in
 * virtual time delivers, which belongs to the tick. DONE follows on every bus after the last frame
 * of the last tick, on the STEP's own bus as the last frame of all. Its overrun flag says that a
 * bus lost frames since the last DONE.
 *
 * Free run. No waiting at all.
 *
 * Requests of other threads are carried out between two ticks (rt/requests.h): the loop may be
 * paused, run at another speed and go back in time; the deadlines are then D + k T / speed, with a
 * new D wherever one of these begins or ends.
 */
#ifndef RT_LOOP_H
#define RT_LOOP_H

#include "canbus/lockstep.h"
#include "canbus/port.h"
#include "rt/clock.h"
#include "rt/histogram.h"
#include "rt/recording/recorder.h"
#include "rt/requests.h"
#include "rt/timing.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum loop_phase {
    PHASE_WAIT,
    PHASE_RECEIVE,
    PHASE_BOARDS,
    PHASE_PLANT,
    PHASE_SENSORS,
    PHASE_TRANSMIT,
    PHASE_PUBLISH,
    PHASE_COUNT,
};

#define LOOP_PAUSE_NS CLOCK_SECOND

enum { LOOP_RECEIVE_MAX = 16384 }; /* frames taken from a bus in one tick */

/* The accounts of a run, written by the loop's thread. */
struct loop_stats {
    uint64_t ticks;
    int64_t time_ns;          /* virtual: ticks * T */
    int64_t start_ns, end_ns; /* of the clock: the run's beginning, the last tick's end */
    uint64_t overruns[PHASE_COUNT], overrun_total;
    uint64_t late_ticks;          /* ended late because an earlier tick did (slip) */
    uint64_t lost_ticks;          /* deadlines dropped by skip and stop */
    uint64_t pauses, pause_ticks; /* deadlines that the pauses dropped */
    uint64_t events_lost;         /* events that found their ring full */
    uint64_t page_faults;         /* of the loop's thread while it ran */
    struct lockstep_counters lockstep;
    struct histogram phase[PHASE_COUNT];
    struct histogram wakeup; /* real clock: how late the loop woke after a sleep */
    struct histogram work;   /* a tick without PHASE_WAIT */
};

/*
 * What the loop drives, in the order of a tick. All are called in the loop's thread and have to be
 * RT-safe. A function that is NULL does nothing; one that returns bool is then true, but for fault.
 *
 * now_ns is virtual time, and the only clock that a phase may use: the beginning of the tick for
 * begin to plant, its end for sample to publish.
 */
struct loop_machine {
    void *context;
    /* Before the wait: what is due at now_ns begins and ends. Called again with the same time when
     * a request interrupts the wait, and must then change nothing. */
    void (*begin)(void *context, int64_t now_ns);
    /* An inline controller, before the tick's receive; in lockstep again, with the same time, as
     * long as no STEP has come. False: it has finished, the loop runs the tick that its last frames
     * ask for and ends. */
    bool (*controller)(void *context, int64_t now_ns);
    void (*receive)(void *context, int64_t now_ns, size_t bus, const struct bus_frame *frame);
    void (*control)(void *context, int64_t now_ns);
    bool (*plant)(void *context, int64_t now_ns);  /* false: the model failed, the run ends */
    bool (*sample)(void *context, int64_t now_ns); /* likewise */
    /* Moves buses that have a time of their own to the end of the tick, before the boards transmit.
     * NULL: frames take no time, and in lockstep a bus is received once a STEP, not every tick. */
    void (*advance)(void *context, int64_t now_ns);
    size_t (*transmit)(void *context, int64_t now_ns, size_t bus, struct bus_frame *frames,
                       size_t max);
    bool (*fault)(void *context); /* some board is in fault */
    void (*publish)(void *context, int64_t now_ns, const struct loop_stats *stats);
    /* While the loop waits for a request, a STEP or a deadline that is far off, ten times a second
     * at least: publishes what other threads have come to want since the last tick. Must change
     * nothing else. */
    void (*idle)(void *context);
    void (*shut_down)(void *context, int64_t now_ns); /* motors off; the last call of a run */
};

/* Which frames the loop records itself. */
enum loop_recording {
    LOOP_RECORD_ALL,      /* all that it receives and sends */
    LOOP_RECORD_UNCARRIED /* STEP, DONE and error frames; the wires record what they carry */
};

enum { LOOP_TRANSMIT_DEFAULT = 64 };

/* Zero and NULL choose what the comments say. */
struct loop_config {
    enum loop_clock clock;
    int64_t tick_ns; /* T; 0 = 1 ms */
    enum loop_overrun overrun;
    int64_t stop_after;            /* overruns, for LOOP_OVERRUN_STOP; 0 = 1 */
    struct loop_lockstep lockstep; /* equal ids = those of canbus/lockstep.h; timeout 0 = 1 s */
    uint64_t ticks;                /* length of the run, 0 = until stopped */
    size_t nbus;
    struct can_port *const *port;
    const size_t *transmit_max; /* most frames that the machine sends on each bus in a tick; NULL =
                                 * LOOP_TRANSMIT_DEFAULT */
    struct clock *time;         /* NULL = clock_monotonic */
    struct loop_machine machine;
    struct recorder *recorder; /* NULL = none */
    enum loop_recording recording;
    struct requests *requests; /* requests of another thread (rt/requests.h); NULL = none */
};

enum loop_end {
    LOOP_RUNNING,
    LOOP_END_LENGTH,     /* ran the ticks it was to run */
    LOOP_END_STOPPED,    /* loop_stop */
    LOOP_END_CONTROLLER, /* the inline controller finished */
    LOOP_END_OVERRUNS,   /* policy stop */
    LOOP_END_MODEL,      /* the plant failed */
};

enum loop_event_kind {
    LOOP_EVENT_OVERRUN,        /* a = phase, b = ns over */
    LOOP_EVENT_PAUSE,          /* a = ns behind */
    LOOP_EVENT_BUS_STATE,      /* a = old, b = new enum can_port_state */
    LOOP_EVENT_FRAMES_LOST,    /* a = received, b = to be sent; since the last of these */
    LOOP_EVENT_SILENT,         /* a = ns without STEP */
    LOOP_EVENT_BACK,           /* STEP again after a ns */
    LOOP_EVENT_STEP_MISMATCH,  /* a = expected by the host, b = tick that we are at */
    LOOP_EVENT_STEP_MALFORMED, /* a = length */
    /* Events of requests that were carried out */
    LOOP_EVENT_PAUSED,     /* a = tick */
    LOOP_EVENT_RESUMED,    /* a = tick */
    LOOP_EVENT_SPEED,      /* a = millionths of virtual seconds a second, 0 = as fast as possible */
    LOOP_EVENT_CHECKPOINT, /* a = slot, b = tick */
    LOOP_EVENT_RESTORED,   /* a = slot, b = tick */
    LOOP_EVENT_PUSH,       /* a = body, b = mN */
    LOOP_EVENT_LET_GO,     /* a = body, b = mN at most: of a push that was renewed until it ended */
    LOOP_EVENT_SET,        /* a = tunable, b = bits of the double */
};

/* Something worth a line in the log; formatted outside the loop. */
struct loop_event {
    int64_t time_ns; /* virtual */
    enum loop_event_kind kind;
    int bus; /* -1 = none */
    int64_t a, b;
};

struct loop;

/* Creates a loop in memory from arena; borrows ports, clock, recorder and requests.
 * ERROR_MEMORY. Not RT-safe. */
enum error_code loop_create(const struct loop_config *config, struct arena *arena,
                            struct loop **loop, struct error *error);

/* Runs until an end, once. RT-safe as far as the machine and the ports are. */
enum loop_end loop_run(struct loop *loop);

/* Asks for a clean end; from any thread or signal handler. RT-safe. */
void loop_stop(struct loop *loop);

/* Returns a count that changes while the loop is alive, also while it waits for a STEP; from any
 * thread. RT-safe. */
uint64_t loop_beat(const struct loop *loop);

/* Returns the accounts of the run; other threads than the loop's read them after the run, except
 * the histograms (histogram_copy). */
const struct loop_stats *loop_stats(const struct loop *loop);

/* Takes one event, false = none waits; writes an event as text for a line of the log, with its
 * zero. From one other thread. RT-safe to take, not to format. */
bool loop_next_event(struct loop *loop, struct loop_event *event);
void loop_event_format(const struct loop *loop, const struct loop_event *event, char *text,
                       size_t size);

/* Returns the name of a phase: "wait", "receive", ... */
const char *loop_phase_name(enum loop_phase phase);

/*
 * What each phase of a tick does and may cost: COMAN's squat on its five buses in wire mode, in
 * instructions of an x86-64 processor as callgrind counts them, the mean of a tick. At one
 * instruction in a nanosecond, which every lab PC exceeds, 10,000 are one per cent of the tick of 1
 * ms. tests/rt/phase_instructions.sh holds the loop to it.
 */
struct phase_budget {
    const char *does;
    uint32_t instructions;       /* 0 = none: the wait */
    double typical_us, worst_us; /* in real time on a virtual machine of two cores: median, 99 % */
};

extern const struct phase_budget phase_budgets[PHASE_COUNT];

#endif
