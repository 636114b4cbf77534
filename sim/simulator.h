/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A running rig: robot, dynamics, contact, plant, boards, buses and recorder, joined by the loop.
 * Optionally a task runs on the other side of the buses. SI units, world frame, times in ns. Not
 * RT-safe unless a function says so. One thread creates, runs and destroys it.
 */
#ifndef SIM_SIMULATOR_H
#define SIM_SIMULATOR_H

#include "base/journal.h"
#include "canbus/gateway.h"
#include "model/settle.h"
#include "rt/loop.h"
#include "rt/realtime.h"
#include "rt/stream.h"
#include "sim/buses.h"
#include "sim/task_runner.h"

enum {
    SIMULATOR_FREE_MAX = 16,
    SIMULATOR_EXTERNAL_MAX = 64,
};

/* A callback in the loop's thread, only in free run and lockstep. The loop calls it before each
 * tick with the virtual time of the tick's start. All frames of the last tick are then on the
 * buses. In lockstep it is called again with the same time while no STEP has come. Frames that it
 * sends are received in the tick. Faults that it switches act on motors and wires from the next
 * tick. Must be RT-safe. */
struct simulator_observer {
    void *context;
    void (*step)(void *context, int64_t now_ns);
};

struct simulator_config {
    const struct rig *rig;
    enum loop_clock clock;
    enum rig_hold hold;
    bool settle; /* start in static equilibrium (plant_settle) */
    bool energy; /* keep the energy account (plant_energy) */
    enum loop_overrun overrun;
    enum bus_transport transport;
    const char *const *interface; /* "NAME=INTERFACE" entries, as for --bus */
    size_t ninterface;
    const char *const *fault; /* lines as for --fault, added to those of the rig */
    size_t nfault;
    bool seed_given;
    uint64_t seed;                       /* seed of noise and faults; overrides the rig's */
    uint64_t ticks;                      /* 0 = until stopped */
    const char *task;                    /* NULL = none */
    const struct task_input *task_input; /* NULL = none */
    /* settings of the task, "NAME=VALUE" each, as for --set */
    const char *const *setting;
    size_t nsetting;
    /* A candump log or a recording whose controller frames are replayed (sim/stimulus.h); NULL =
     * none. Not with a task. If ticks is 0, the run is as long as the log. */
    const char *stimulus;
    /* NULL = none. With an observer the run continues after the end of a task, except in lockstep,
     * where the task sends STEP. */
    const struct simulator_observer *observer;
    bool requests; /* accepts requests (rt/requests.h); reserves memory for checkpoints */
    /* map each memory page at its first use: cheapest if tick durations do not matter. Otherwise
     * all pages are mapped before the run */
    bool untouched;
    size_t guests;      /* number of later calls of simulator_join */
    bool guests_inline; /* all guests are observers that read each tick's frames within the tick */
    const struct gateway_config *gateway; /* host and port; NULL = none */
    const char *record;                   /* directory of the recording; NULL = none */
    bool overwrite;
    unsigned record_format; /* formats of rows: enum recorder_format; 0 = CSV */
    int64_t row_period_ns;  /* period of signals.csv, a multiple of the tick */
};

struct bus_status {
    uint64_t rx_frames, tx_frames, rx_dropped, tx_dropped;
    uint64_t bits; /* nominal bits in both directions */
    int64_t state; /* enum can_port_state */
};

/* Status published once per tick. The counters are those of struct loop_stats. */
struct simulator_status {
    uint64_t tick, overruns, lost_ticks, pauses;
    uint64_t overruns_by[PHASE_COUNT], late_ticks, pause_ticks, events_lost;
    struct lockstep_counters lockstep;
    uint64_t clamped;                   /* plant_is_clamped: 0 or 1 */
    uint64_t fault[FAULTS_MAX / 64];    /* one bit for each active fault of the rig */
    int64_t time_ns;                    /* virtual time */
    int64_t start_ns;                   /* clock time of the loop's start */
    int64_t elapsed_ns;                 /* clock time since the start */
    double base[7];                     /* position (m), quaternion wxyz; zeros with a fixed base */
    double q[RIG_JOINTS_MAX];           /* rad */
    double force_z[RIG_CONTACTS_MAX];   /* forces on contact bodies, world frame, N */
    double free[SIMULATOR_FREE_MAX][7]; /* free bodies' origins (m), quaternions wxyz */
    struct bus_status bus[RIG_BUSES_MAX];
    /* External boards in the rig's order: time when each was last heard (-1 = never), and a bit
     * mask of silent boards */
    int64_t external_heard_ns[SIMULATOR_EXTERNAL_MAX];
    uint64_t external_silent;
    struct boards_counters boards;
    struct board_event malformed; /* the last one, if boards.malformed > 0 */
};

struct simulator;
struct stimulus; /* sim/stimulus.h */

/* Creates all parts or none. notice receives one line about the choice of transport, or "". Memory
 * from arena, which simulator_start seals; the configuration is borrowed. ERROR_INPUT,
 * ERROR_MEMORY, ERROR_SYSTEM, ERROR_UNSUPPORTED. */
enum error_code simulator_create(const struct simulator_config *config, struct arena *arena,
                                 struct simulator **simulator, char notice[256],
                                 struct error *error);

/* simulator_start requests real-time scheduling and starts the task's thread, but only with the
 * real clock. simulator_run runs the loop in the calling thread. */
enum error_code simulator_start(struct simulator *simulator, struct realtime_report *report,
                                struct error *error);
enum loop_end simulator_run(struct simulator *simulator);

/* Joins each bus as one more participant. Call it before simulator_start. The caller closes the
 * ports before simulator_destroy. */
enum error_code simulator_join(struct simulator *simulator, struct bus_ports *ports,
                               struct error *error);

/* Ends the run. Call it from any thread or signal handler. RT-safe. */
void simulator_stop(struct simulator *simulator);

/* Returns a count that changes while the loop is alive, also while it waits for a STEP. Any
 * thread. RT-safe. */
uint64_t simulator_beat(const struct simulator *simulator);

/* Flushes and closes the recording after the run. */
enum error_code simulator_finish_recording(struct simulator *simulator,
                                           struct recorder_counters *counters, struct error *error);

/* Ends the connections of the gateway, reads its counters, and adds frames that arrived after the
 * last tick to the counters of the ports. Call it after the run. Returns false if there is no
 * gateway. */
bool simulator_close_gateway(struct simulator *simulator, struct gateway_counters *counters);

/* Closes ports, recording and contact engine; the caller owns the arena. NULL is allowed. */
void simulator_destroy(struct simulator *simulator);

/* Copies the last published status. Any thread. Returns false before the first tick. */
bool simulator_read(const struct simulator *simulator, struct simulator_status *status);

/* Polls the SocketCAN interfaces at most once a second (sim/interfaces.h). Call it from the thread
 * that reads events. */
void simulator_watch_interfaces(struct simulator *simulator, int64_t now_ns);

/* Reads one event as a line of text with a key for the event log. Sources are the loop, the faults,
 * the interfaces, the robot (sim/mechanics_events.h), the boards and the recorder. Returns false if
 * there is none. The event is recorded. Call it from one thread other than the loop's. */
bool simulator_next_event(struct simulator *simulator, uint64_t *key, char *text, size_t size);

/* Records an event of another source with the present time. Call it from the thread that reads
 * events. */
void simulator_record_event(struct simulator *simulator, uint64_t key, const char *text);

/* Returns the priority of events with this key. */
enum journal_priority simulator_event_priority(uint64_t key);

/* The parts that a created simulator consists of. They stay the same until simulator_destroy. */
struct simulator_parts {
    struct boards *boards;   /* read their counters after the run */
    struct faults *faults;   /* switch them (faults_set) in the loop's thread or before the run */
    struct gateway *gateway; /* NULL = none */
    const char *failure;     /* valid after LOOP_END_MODEL */
    const struct settled *settled;   /* result of plant_settle at the start; NULL = none */
    const struct stimulus *stimulus; /* frames of the recorded controller; NULL = none */
    const char *dynamics; /* names the implementation of the rigid-body dynamics and its reason */
    bool is_local;        /* the buses are local */
    /* The columns of signals.csv, then the numbers of frames received and sent on each bus */
    size_t nsignal;
    const char *const *signal; /* names */
    struct stream *stream;     /* rows for one reader (rt/stream.h); NULL without config.requests */
    /* Rows of all signals of each tick, for the reader of the views. The ring holds one second at
     * 1 kHz; rows without room are counted. NULL without guests, or with inline guests only */
    struct stream *view_stream;
};

/* Return the parts. While the loop runs, use only parts whose comment allows it. RT-safe. */
struct simulator_parts simulator_parts(const struct simulator *simulator);
const struct simulator_config *simulator_configuration(const struct simulator *simulator);
/* Returns the loop's statistics after the run. During the run, only their histograms may be read,
 * with histogram_copy. */
const struct loop_stats *simulator_stats(const struct simulator *simulator);
struct can_port *simulator_port(const struct simulator *simulator, size_t bus);
struct plant *simulator_plant(const struct simulator *simulator); /* after the run */
/* Returns the measured values of the boards. Call it in the loop's thread, or after the run. */
const struct plant_sensors *simulator_measured(const struct simulator *simulator);
const struct task_runner *
simulator_task_runner(const struct simulator *simulator); /* NULL = none */
/* Returns whether energy appeared from nowhere (sim/mechanics_events.h). If so, the results are
 * wrong. */
bool simulator_found_energy(const struct simulator *simulator);
/* Returns the queue of requests; NULL without config.requests. */
struct requests *simulator_requests(const struct simulator *simulator);
/* Writes the present state, settings and counters of a bus's CAN controller as text; returns false
 * if its interface has none. */
bool simulator_can_controller_state(const struct simulator *simulator, size_t bus, char *text,
                                    size_t size);
/* Returns the wire of a timed bus; NULL for a bus without timing. Call it after the run. */
const struct wire *simulator_wire(const struct simulator *simulator, size_t bus);

/* Returns the number of contact evaluations and their total time. Call it after the run. */
const struct plant_contact_cost *simulator_contact_cost(const struct simulator *simulator);

/* ---- views ---- */

/*
 * A view of one tick for a reader: the status, the values of all signals, and the state of each
 * board, all at the same time. While views are wanted, the loop publishes one per tick and never
 * waits for the reader. While views are not wanted, each tick costs the loop one load instruction
 * more. If views become wanted while no tick runs (a pause, a silent controller), the last tick's
 * view follows within a tenth of a second. Arrays are in the order of simulator_parts.signal and of
 * the rig's boards. SI units.
 */
struct simulator_view {
    struct simulator_status status;
    const double *signal;
    const struct board_state *board;
    void *memory; /* memory of the copy */
};

/* Allocates one copy from arena; each reader needs its own. ERROR_MEMORY. Not RT-safe. */
enum error_code simulator_view_create(const struct simulator *simulator, struct arena *arena,
                                      struct simulator_view *view, struct error *error);

/* Sets whether views are wanted. Call it from the one thread that reads them. RT-safe. */
void simulator_want_views(struct simulator *simulator, bool wanted);

/* Publishes the last tick's view even if views are not wanted. Call it after the loop has ended, in
 * the thread that ran the loop. Not RT-safe: the loop does not call it. */
void simulator_end_views(struct simulator *simulator);

/* Copies the last published view; before the first tick, the view of the initial state. Returns the
 * number of published views. Not RT-safe. */
uint64_t simulator_view_read(const struct simulator *simulator, struct simulator_view *view);

#endif
