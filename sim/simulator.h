/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A running rig: robot, dynamics, contact, plant, boards and buses joined behind the loop, with the
 * recorder and, optionally, a task on the other side of the buses. SI units, world frame, times in
 * ns. Not RT-safe but where it says so; one thread creates, runs and destroys it.
 */
#ifndef SIM_SIMULATOR_H
#define SIM_SIMULATOR_H

#include "base/journal.h"
#include "canbus/gateway.h"
#include "model/settle.h"
#include "rig/rig.h"
#include "rt/loop.h"
#include "rt/realtime.h"
#include "rt/snapshot.h"
#include "rt/stream.h"
#include "sim/buses.h"
#include "sim/task_runner.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    SIMULATOR_FREE_MAX = 16,
    SIMULATOR_EXTERNAL_MAX = 64,
};

/* A callback in the loop's thread, free run and lockstep only: called before each tick with the
 * virtual time at which it begins, when everything that the tick before has sent is on the buses;
 * in lockstep again, with the same time, as long as no STEP has come. Frames that it sends are
 * received in the tick; faults that it switches act on motors and wires from the next tick. Must be
 * RT-safe. */
struct simulator_observer {
    void *context;
    void (*step)(void *context, int64_t now_ns);
};

struct simulator_config {
    const struct rig *rig;
    enum loop_clock clock;
    enum rig_hold hold;
    bool settle; /* start in static equilibrium (plant_settle) */
    bool energy; /* keep its account (plant_energy) */
    enum loop_overrun overrun;
    enum bus_transport transport;
    const char *const *interface; /* "NAME=INTERFACE", as of --bus */
    size_t ninterface;
    const char *const *fault; /* lines as of --fault, after those of the rig */
    size_t nfault;
    bool seed_given;
    uint64_t seed;                       /* of noise and faults, instead of the rig's */
    uint64_t ticks;                      /* 0 = until stopped */
    const char *task;                    /* NULL = none */
    const struct task_input *task_input; /* NULL = none */
    const char *const *setting;          /* of the task, "NAME=VALUE" each, as of --set */
    size_t nsetting;
    /* A candump log or a recording whose controller's frames are received again (sim/stimulus.h);
     * NULL = none. Not with a task. Without ticks the run is as long as the log. */
    const char *stimulus;
    /* NULL = none. With it the run goes on when a task has ended, but in lockstep, where the task's
     * STEP frames drive it. */
    const struct simulator_observer *observer;
    bool requests;  /* takes requests (rt/requests.h); reserves memory for checkpoints */
    bool untouched; /* pages come at their first use, which costs least where nobody measures ticks;
                       else all are there when the run begins */
    size_t guests;  /* how often simulator_join will be called */
    bool guests_inline; /* all of them by observers, which read each tick's frames in its course */
    const struct gateway_config *gateway; /* host and port; NULL = none */
    const char *record;                   /* directory, NULL = none */
    bool overwrite;
    unsigned record_format; /* of rows: enum recorder_format; 0 = CSV */
    int64_t row_period_ns;  /* of signals.csv, a multiple of the tick */
};

struct bus_status {
    uint64_t rx_frames, tx_frames, rx_dropped, tx_dropped;
    uint64_t bits; /* nominal, of both directions */
    int64_t state; /* enum can_port_state */
};

/* Published once a tick. The counters are those of struct loop_stats. */
struct simulator_status {
    uint64_t tick, overruns, lost_ticks, pauses;
    uint64_t overruns_by[PHASE_COUNT], late_ticks, pause_ticks, events_lost;
    struct lockstep_counters lockstep;
    uint64_t clamped;                   /* plant_is_clamped */
    uint64_t fault[FAULTS_MAX / 64];    /* a bit for each that is active, of simulator_faults */
    int64_t time_ns;                    /* virtual */
    int64_t start_ns;                   /* of the clock: when the loop began */
    int64_t elapsed_ns;                 /* of the clock, since then */
    double base[7];                     /* position (m), quaternion wxyz; zeros with a fixed base */
    double q[RIG_JOINTS_MAX];           /* rad */
    double force_z[RIG_CONTACTS_MAX];   /* contact bodies, world frame, N */
    double free[SIMULATOR_FREE_MAX][7]; /* of the first free bodies: origin (m), quaternion wxyz */
    struct bus_status bus[RIG_BUSES_MAX];
    /* Of the external boards, in the rig's order, the first so many: when each was last heard, -1 =
     * never; a bit for each that is silent */
    int64_t external_heard_ns[SIMULATOR_EXTERNAL_MAX];
    uint64_t external_silent;
};

struct simulator;
struct stimulus; /* sim/stimulus.h */

/* Creates all parts or none. notice receives one line about the choice of transport, or "".
 * Memory from arena, which simulator_start seals; the configuration is borrowed. ERROR_INPUT,
 * ERROR_MEMORY, ERROR_SYSTEM, ERROR_UNSUPPORTED. */
enum error_code simulator_create(const struct simulator_config *config, struct arena *arena,
                                 struct simulator **simulator, char notice[256],
                                 struct error *error);

/* simulator_start asks the system for real-time service and starts the task's thread (both with the
 * real clock only); simulator_run runs the loop in the calling thread. */
enum error_code simulator_start(struct simulator *simulator, struct realtime_report *report,
                                struct error *error);
enum loop_end simulator_run(struct simulator *simulator);

/* Joins every bus once more, before simulator_start; the ports are the caller's to close, before
 * simulator_destroy. */
enum error_code simulator_join(struct simulator *simulator, struct bus_ports *ports,
                               struct error *error);

/* Ends the run; from any thread or signal handler. RT-safe. */
void simulator_stop(struct simulator *simulator);

/* Returns a count that changes while the loop is alive, also while it waits for a STEP; from any
 * thread. RT-safe. */
uint64_t simulator_beat(const struct simulator *simulator);

/* Flushes and closes the recording after the run. */
enum error_code simulator_finish_recording(struct simulator *simulator,
                                           struct recorder_counters *counters, struct error *error);

/* After the run: ends the connections of the gateway, reads its counters, and accounts for frames
 * that came after the last tick on the ports; false when there is none. */
bool simulator_close_gateway(struct simulator *simulator, struct gateway_counters *counters);

/* Closes ports, recording and contact engine; the arena is the caller's. NULL is allowed. */
void simulator_destroy(struct simulator *simulator);

/* Copies the last published status; from any thread. False before the first tick. */
bool simulator_read(const struct simulator *simulator, struct simulator_status *status);

/* Polls the SocketCAN interfaces, at most once a second (sim/interfaces.h); from the thread that
 * takes events. */
void simulator_watch_interfaces(struct simulator *simulator, int64_t now_ns);

/* Takes one event of the loop, the faults, the interfaces, the robot (sim/mechanics_events.h),
 * the boards or the recorder, as a line of text with a key for the event log; false when none
 * waits. What is taken is recorded. From one thread other than the loop's. */
bool simulator_next_event(struct simulator *simulator, uint64_t *key, char *text, size_t size);

/* Records an event from another source, as of now; from the thread that takes events. */
void simulator_record_event(struct simulator *simulator, uint64_t key, const char *text);

/* Returns the priority of events with such a key. */
enum journal_priority simulator_event_priority(uint64_t key);

/* Signals by the names that they have in signals.csv, then frames received and sent on each bus;
 * rows of them for one reader (rt/stream.h; NULL without requests, as no one could ask). */
size_t simulator_signals(const struct simulator *simulator);
const char *const *simulator_signal_names(const struct simulator *simulator);
struct stream *simulator_stream(const struct simulator *simulator);

/* Access to the parts; while the loop runs, only through functions whose comment allows it. */
const struct simulator_config *simulator_configuration(const struct simulator *simulator);
/* After the run; its histograms also while it runs, with histogram_copy. */
const struct loop_stats *simulator_stats(const struct simulator *simulator);
struct can_port *simulator_port(const struct simulator *simulator, size_t bus);
struct boards *simulator_boards(const struct simulator *simulator); /* counters after the run */
/* Faults are switched (faults_set) in the loop's thread, or before the run. */
struct faults *simulator_faults(const struct simulator *simulator);
struct plant *simulator_plant(const struct simulator *simulator); /* after the run */
/* What the boards see of the plant; in the loop's thread, or after the run. */
const struct plant_sensors *simulator_measured(const struct simulator *simulator);
struct gateway *simulator_gateway(const struct simulator *simulator); /* NULL = none */
const struct task_runner *
simulator_task_runner(const struct simulator *simulator);         /* NULL = none */
const char *simulator_failure(const struct simulator *simulator); /* after LOOP_END_MODEL */
/* What plant_settle found at the start; NULL without settle. */
const struct settled *simulator_settled(const struct simulator *simulator);
/* What a recorded controller has sent; NULL without config.stimulus. */
const struct stimulus *simulator_stimulus(const struct simulator *simulator);
/* Which implementation computes the rigid-body dynamics, and why; a sentence. */
const char *simulator_dynamics(const struct simulator *simulator);
/* For requests, NULL without config.requests. */
struct requests *simulator_requests(const struct simulator *simulator);
bool simulator_is_local(const struct simulator *simulator);
/* State, settings and counters of the CAN controller of a bus, now, as text; false when its
 * interface has none. */
bool simulator_can_controller_state(const struct simulator *simulator, size_t bus, char *text,
                                    size_t size);
/* The wire of a timed bus, NULL where frames take no time; after the run. */
const struct wire *simulator_wire(const struct simulator *simulator, size_t bus);

/* Contact evaluations and the time spent in them, after the run. */
const struct plant_contact_cost *simulator_contact_cost(const struct simulator *simulator);

/* ---- views ---- */

/*
 * What somebody who watches a simulator wants to know of a tick: the status, the values of all
 * signals, how each board is, all of the same moment. The loop publishes it once a tick while it is
 * wanted, and never waits for who reads it; unwanted it costs the loop one load. Where it comes to
 * be wanted while no tick runs (a pause, a controller that is silent), that of the last tick
 * follows within a tenth of a second. Arrays are in the order of simulator_signal_names and of the
 * rig's boards. SI units.
 */
struct simulator_view {
    struct simulator_status status;
    const double *signal;
    const struct board_state *board;
    void *memory; /* of the copy */
};

/* Creates room for one copy, from arena; each reader has its own. ERROR_MEMORY. Not RT-safe. */
enum error_code simulator_view_create(const struct simulator *simulator, struct arena *arena,
                                      struct simulator_view *view, struct error *error);

/* Sets whether views are wanted; from the one thread that reads them. RT-safe. */
void simulator_want_views(struct simulator *simulator, bool wanted);

/* Publishes the last tick's view, whether one is wanted or not; when the loop has ended, from the
 * thread that ran it. Not RT-safe: nothing calls it in the loop. */
void simulator_end_views(struct simulator *simulator);

/* Returns the rows of all signals, of each tick (rt/stream.h), for the same reader: what a ring
 * that holds a second at 1 kHz had no room for is counted. NULL when the simulator was created
 * without guests, or with inline ones only. RT-safe. */
struct stream *simulator_view_stream(const struct simulator *simulator);

/* Copies the last view that was published; before the first tick that of the start. Returns how
 * many were published. Not RT-safe. */
uint64_t simulator_view_read(const struct simulator *simulator, struct simulator_view *view);

#endif
