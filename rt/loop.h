/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The real-time loop: the same tick under three clocks. The loop keeps time, runs the phases of a
 * tick, and measures both. A table of functions, struct loop_machine, does the work of each phase.
 * Any program can supply its own machine (tests/rt/ten_lines.c). Tests script machine and clock.
 *
 * Tick k (from 0) covers virtual time [k T, (k+1) T). Virtual times are int64_t ns from 0. Clock
 * times are ns of rt/clock.h.
 *
 * Real clock. The deadlines are the grid D + k T of the monotonic clock, T the tick; they never
 * drift. A tick is an overrun when it ends after the next deadline and took longer than T. The
 * overrun is charged to the phase that took longest, or to PHASE_WAIT after a late wake-up. Then
 * the policy applies:
 *   skip  drops and counts the missed deadlines. Virtual time falls behind by one tick per
 *         deadline.
 *   slip  runs the late ticks back to back until the loop has caught up. A tick that is late only
 *         because of an earlier tick counts as late, not as an overrun.
 *   stop  acts as skip, and ends the run at overrun number stop_after.
 *
 * If the loop is more than LOOP_PAUSE_NS behind, the process was stopped, suspended or badly
 * overloaded. Under any policy, the loop then counts a pause and continues at the next deadline of
 * the grid.
 *
 * The statistics of the real clock add up unless a request changes the speed or pauses the loop.
 * start_ns + (ticks + lost_ticks + pause_ticks) T is the deadline of the next tick. The last tick
 * ended before this deadline, by less than T. With slip it may have ended up to LOOP_PAUSE_NS after
 * it. The sum of overruns[] is overrun_total.
 *
 * The loop does not use the time of day, because users may set it. The monotonic clock stands still
 * while a computer is suspended. Virtual time stands still in a pause: no board acts, and no
 * command time-out runs. The first tick after a pause receives the frames that waited on the buses,
 * in order, and counts the lost ones. If the controller sends nothing after the pause, its motors
 * are at 0 V one command time-out later.
 *
 * Arrivals. With the real clock, the loop also receives frames between two ticks. Conditions: the
 * machine has `answer`, and `listens` returns true. The machine gets each frame at once, and the
 * loop sends the answers when they are due. Set-points take effect in the next tick. The loop stops
 * receiving after LOOP_ARRIVALS_MAX frames or shortly before the deadline; later frames wait for
 * the tick. The time of this work is in PHASE_ARRIVALS, not in PHASE_WAIT. Periodic frames are sent
 * only in the tick.
 *
 * No bus can stall the loop. A tick takes at most LOOP_RECEIVE_MAX frames from each bus; the other
 * frames wait, or are lost and counted. The same limit holds between two checks for a STEP.
 *
 * Lockstep. A STEP frame requests ticks. Before the tick, the loop receives each bus in order: all
 * waiting frames, on the STEP's own bus all frames up to the STEP. A frame that arrives while a
 * STEP of several ticks runs belongs to the next STEP. A frame that a wire in virtual time delivers
 * belongs to the tick. After the last frame of the last tick, DONE follows on every bus, on the
 * STEP's own bus last. The overrun flag of DONE means that a bus has lost frames since the last
 * DONE.
 *
 * Free run. The loop never waits.
 *
 * The loop carries out requests of other threads between two ticks (rt/requests.h). A request can
 * pause the loop, change its speed or set time back. The deadlines are then D + k T / speed, with a
 * new D at each beginning and end of such a change.
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

enum loop_phase {
    PHASE_WAIT,
    PHASE_RECEIVE,
    PHASE_BOARDS,
    PHASE_PLANT,
    PHASE_SENSORS,
    PHASE_TRANSMIT,
    PHASE_PUBLISH,
    PHASE_ARRIVALS, /* part of the wait, not a phase of the tick; therefore last */
    PHASE_COUNT,
};

#define LOOP_PAUSE_NS CLOCK_SECOND

enum {
    LOOP_RECEIVE_MAX = 16384, /* most frames taken from a bus in one tick */
    LOOP_ARRIVALS_MAX = 256,  /* most frames taken from all buses between two ticks */
};

/* Statistics of a run. Only the loop's thread writes them. */
struct loop_stats {
    uint64_t ticks;
    int64_t time_ns;          /* virtual time: ticks * T */
    int64_t start_ns, end_ns; /* clock time: beginning of the run, end of the last tick */
    uint64_t overruns[PHASE_COUNT], overrun_total;
    uint64_t late_ticks;          /* ended late because an earlier tick was late (slip) */
    uint64_t lost_ticks;          /* deadlines dropped by skip and stop */
    uint64_t pauses, pause_ticks; /* number of pauses, and of deadlines dropped in them */
    uint64_t arrivals;            /* frames received between ticks */
    uint64_t arrivals_full;       /* number of times when this reached LOOP_ARRIVALS_MAX */
    uint64_t events_lost;         /* events dropped because their ring was full */
    uint64_t page_faults;         /* page faults of the loop's thread during the run */
    struct lockstep_counters lockstep;
    struct histogram phase[PHASE_COUNT];
    struct histogram wakeup; /* real clock: how late the loop woke after a sleep */
    struct histogram work;   /* duration of a tick without PHASE_WAIT */
};

/*
 * The machine that the loop drives: one function per step of a tick, in order. All functions run in
 * the loop's thread and must be RT-safe. NULL = no function. For a NULL function that returns bool,
 * the loop assumes true, except false for `fault`.
 *
 * now_ns is virtual time. The functions must use no other clock. The functions from `begin` to
 * `plant` get the beginning of the tick, the functions from `sample` to `publish` its end.
 */
struct loop_machine {
    void *context;
    /* Before the wait: starts and ends faults and other effects that are due at now_ns. The loop
     * calls it again with the same time after a request interrupts the wait; the second call must
     * change nothing. */
    void (*begin)(void *context, int64_t now_ns);
    /* Steps an inline controller, before the tick receives. In lockstep the loop repeats the call
     * with the same time until a STEP comes. False = the controller has finished: the loop runs the
     * tick that its last frames request, then ends. */
    bool (*controller)(void *context, int64_t now_ns);
    /* frame->time_ns is the virtual time of its arrival: now_ns, or earlier between two ticks. */
    void (*receive)(void *context, int64_t now_ns, size_t bus, const struct bus_frame *frame);
    /* Returns the answers to frames that `receive` delivered between two ticks. NULL = the loop
     * receives only in ticks, and `transmit` returns the answers. */
    size_t (*answer)(void *context, int64_t now_ns, size_t bus, struct bus_frame *frames,
                     size_t max);
    /* Sets the virtual time by which answers are due, for the following calls of `answer` and
     * `transmit`: the end of the tick; where the loop answers between ticks, the present time. NULL
     * = all waiting answers are due. */
    void (*set_due)(void *context, int64_t due_ns);
    /* Returns the virtual time at which the next waiting answer is due, on any bus; INT64_MAX =
     * none. NULL = no answer waits. */
    int64_t (*next_answer)(void *context);
    /* Returns whether frames can arrive between ticks. False saves the loop the system calls. NULL
     * = true. */
    bool (*listens)(void *context);
    void (*control)(void *context, int64_t now_ns);
    bool (*plant)(void *context, int64_t now_ns);  /* false = the model failed; the run ends */
    bool (*sample)(void *context, int64_t now_ns); /* as plant */
    /* Advances buses with wire time (wire mode) to the end of the tick, before the boards transmit.
     * NULL = frames take no time. In lockstep the loop then receives once per STEP, not every
     * tick. */
    void (*advance)(void *context, int64_t now_ns);
    size_t (*transmit)(void *context, int64_t now_ns, size_t bus, struct bus_frame *frames,
                       size_t max);
    bool (*fault)(void *context); /* true = some board is in fault */
    void (*publish)(void *context, int64_t now_ns, const struct loop_stats *stats);
    /* Publishes data that other threads have requested since the last tick. Must change nothing
     * else. The loop calls it at least ten times a second during long waits, for a request, a STEP
     * or a deadline. */
    void (*idle)(void *context);
    /* switches the motors off; the last call of a run */
    void (*shut_down)(void *context, int64_t now_ns);
};

/* Which frames the loop itself records. */
enum loop_recording {
    LOOP_RECORD_ALL, /* all received and sent frames */
    /* STEP, DONE and error frames; the wires record the frames that they carry */
    LOOP_RECORD_UNCARRIED
};

enum { LOOP_TRANSMIT_DEFAULT = 64 };

/* The configuration of a loop. Zero and NULL select the defaults in the comments. */
struct loop_config {
    enum loop_clock clock;
    int64_t tick_ns; /* tick T; 0 = 1 ms */
    enum loop_overrun overrun;
    int64_t stop_after;            /* number of overruns for LOOP_OVERRUN_STOP; 0 = 1 */
    struct loop_lockstep lockstep; /* equal ids = the ids of canbus/lockstep.h; timeout 0 = 1 s */
    uint64_t ticks;                /* length of the run in ticks; 0 = until stopped */
    size_t nbus;
    struct can_port *const *port;
    /* per bus: most frames that the machine sends in a tick; NULL = LOOP_TRANSMIT_DEFAULT */
    const size_t *transmit_max;
    struct clock *time; /* NULL = clock_monotonic */
    struct loop_machine machine;
    struct recorder *recorder; /* NULL = none */
    enum loop_recording recording;
    struct requests *requests; /* requests of another thread (rt/requests.h); NULL = none */
};

enum loop_end {
    LOOP_RUNNING,
    LOOP_END_LENGTH,     /* configured number of ticks has run */
    LOOP_END_STOPPED,    /* loop_stop was called */
    LOOP_END_CONTROLLER, /* the inline controller finished */
    LOOP_END_OVERRUNS,   /* overrun policy stop */
    LOOP_END_MODEL,      /* the plant failed */
};

enum loop_event_kind {
    LOOP_EVENT_OVERRUN,        /* a = phase, b = ns over */
    LOOP_EVENT_PAUSE,          /* a = ns behind the deadline */
    LOOP_EVENT_BUS_STATE,      /* a = old, b = new enum can_port_state */
    LOOP_EVENT_ARRIVALS,       /* a = LOOP_ARRIVALS_MAX frames between two ticks */
    LOOP_EVENT_FRAMES_LOST,    /* a = receive losses, b = send losses, since the last such event */
    LOOP_EVENT_SILENT,         /* a = ns without STEP */
    LOOP_EVENT_BACK,           /* STEP received again; a = ns of silence */
    LOOP_EVENT_STEP_MISMATCH,  /* a = tick that the host expected, b = tick of the simulator */
    LOOP_EVENT_STEP_MALFORMED, /* a = length, bytes */
    /* Requests that the loop carried out */
    LOOP_EVENT_PAUSED,     /* a = tick */
    LOOP_EVENT_RESUMED,    /* a = tick */
    LOOP_EVENT_SPEED,      /* a = speed in millionths, 0 = as fast as possible */
    LOOP_EVENT_CHECKPOINT, /* a = slot, b = tick */
    LOOP_EVENT_RESTORED,   /* a = slot, b = tick */
    LOOP_EVENT_PUSH,       /* a = body, b = mN */
    LOOP_EVENT_LET_GO,     /* end of a renewed push; a = body, b = greatest force, mN */
    LOOP_EVENT_SET,        /* a = tunable, b = bits of the double */
};

/* An event for the log. Another thread formats it. */
struct loop_event {
    int64_t time_ns; /* virtual time */
    enum loop_event_kind kind;
    int bus; /* -1 = none */
    int64_t a, b;
};

struct loop;

/* Creates a loop in memory from arena; borrows ports, clock, recorder and requests.
 * ERROR_MEMORY. Not RT-safe. */
enum error_code loop_create(const struct loop_config *config, struct arena *arena,
                            struct loop **loop, struct error *error);

/* Runs the loop until its end; call it once. RT-safe if the machine and the ports are. */
enum loop_end loop_run(struct loop *loop);

/* Requests a clean end of the run. From any thread or signal handler. RT-safe. */
void loop_stop(struct loop *loop);

/* Returns a counter that changes while the loop runs, even during a wait for STEP. From any thread.
 * RT-safe. */
uint64_t loop_beat(const struct loop *loop);

/* Returns the statistics of the run. During the run, other threads may only copy the histograms
 * (histogram_copy). After the run, they may read everything. */
const struct loop_stats *loop_stats(const struct loop *loop);

/* loop_next_event removes the oldest event from the queue; false = the queue is empty.
 * loop_format_event writes an event as one line of text with a terminating zero. Call both from one
 * thread other than the loop's. loop_next_event is RT-safe, loop_format_event is not. */
bool loop_next_event(struct loop *loop, struct loop_event *event);
void loop_event_format(const struct loop *loop, const struct loop_event *event, char *text,
                       size_t size);

/* Returns the name of a phase: "wait", "receive", ... */
const char *loop_phase_name(enum loop_phase phase);

/*
 * Description and cost of each phase of a tick. The budget is the mean number of x86-64
 * instructions per tick, counted by callgrind, for COMAN's squat on five buses in wire mode. At one
 * instruction per ns, which every lab PC exceeds, 10,000 instructions are 1 % of a 1 ms tick.
 * tests/rt/phase_instructions.sh checks the budget.
 */
struct phase_budget {
    const char *does;
    uint32_t instructions; /* 0 = no budget (the wait) */
    /* real time on a virtual machine of two cores: median, 99th percentile */
    double typical_us, worst_us;
};

extern const struct phase_budget phase_budgets[PHASE_COUNT];

#endif
