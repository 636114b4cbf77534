/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Declarations shared by the parts of the simulator. assembly.c creates it. simulator.c runs it,
 * closes it and gives access to it. machine.c has the functions that the loop calls. status.c,
 * signals.c and recording.c publish and record. events.c collects the event log. Not RT-safe unless
 * a function says so.
 */
#ifndef SIM_PRIVATE_H
#define SIM_PRIVATE_H

#include "base/memory_file.h"
#include "model/dynamics.h"
#include "sim/external.h"
#include "sim/interfaces.h"
#include "sim/mechanics_events.h"
#include "sim/robot_requests.h"
#include "sim/simulator.h"
#include "sim/stimulus.h"

#include <pthread.h>
#include <string.h>

/* The release of a clamped robot. */
struct release {
    bool due;       /* waits until every motor is on */
    int64_t at_ns;  /* virtual time of the release; -1 = not yet or done */
    uint64_t trips; /* number of axis trips so far */
};

/* A bus of the simulator, for a function that the bus calls. */
struct simulator_bus {
    struct simulator *simulator;
    size_t bus;
};

struct simulator {
    struct simulator_config config;
    struct arena *arena;
    struct clock *time;
    struct dynamics dynamics;
    struct error dynamics_notice;  /* implementation of the dynamics, and the reason */
    struct contact_world *contact; /* NULL = none */
    struct plant *plant;
    struct settled settled;
    struct faults *faults;
    struct fault_injection *injection;
    struct sensing *sensing;
    /* measured values of the boards; the plant's values are the truth */
    const struct plant_sensors *measured;
    struct boards *boards;
    struct external *external; /* NULL = the rig has no external boards */
    struct watch *watch;
    struct buses buses;
    struct interfaces interfaces; /* the SocketCAN interfaces; empty for local buses */
    struct bus_ports ports, task_ports, gateway_ports;
    struct stimulus stimulus;
    int64_t stimulus_ns; /* replay receives recorded frames up to this virtual time */
    struct gateway *gateway;
    struct memory_file client_table; /* what the gateway tells its clients */
    struct {
        pthread_mutex_t lock;
        int64_t time_ns;
        char reason[256]; /* event of the last command that a board dropped */
        char told[300];
    } dropped;
    size_t *transmit_max;
    struct simulator_bus listener[RIG_BUSES_MAX];
    int64_t advance_ns; /* end of the present tick, while the wires advance */
    int64_t due_ns;     /* virtual time by which answers are due */
    struct loop *loop;
    struct recorder *recorder;
    const char **title; /* signal names: columns of signals.csv, then bus counters */
    double *row;
    struct contact_patch *patch; /* buffer for the pairs of a row */
    size_t nrecorded, nsignal, npatch;
    struct stream *stream;      /* for subscribers of the control socket; NULL without requests */
    struct stream *view_stream; /* see simulator.h; NULL = none */
    uint64_t row_ticks;
    struct task_runner *task; /* NULL = none */
    bool task_inline, task_running;
    pthread_t task_thread;
    struct realtime_config task_realtime;
    struct simulator_status status;
    struct snapshot *published;      /* the last struct simulator_status */
    struct snapshot *published_view; /* the last view (simulator.h) */
    void *view;                      /* the view under construction */
    _Atomic bool view_wanted;
    bool view_stale; /* the last tick was not published as a view */
    struct release release;
    _Atomic int64_t released; /* virtual time of an unreported release; -1 = none */
    /* virtual time of an unreported axis trip in a clamped robot; -1 = none */
    _Atomic int64_t clamped_trip;
    _Atomic int clamped_trip_on; /* number of motors that were on at the trip */
    char failure[256];
    struct requests *requests; /* NULL = none */
    struct robot_requests *robot_requests;
    struct pace *pace;           /* clock of a task in its own thread; NULL = the real clock */
    size_t moves_from, moves_to; /* range of the arena that changes in virtual time */
};

/* ---- assembly.c ---- */

/* Creates all parts. After a failure some exist; simulator_destroy closes them. */
enum error_code simulator_assemble(struct simulator *simulator, char notice[256],
                                   struct error *error);

/* ---- machine.c, status.c: RT-safe ---- */

struct loop_machine simulator_machine(struct simulator *simulator);

/* Hands a frame to its board at the end of its wire time; context: struct simulator_bus. Returns
 * the time of the next answer. */
int64_t simulator_hear(void *context, const struct bus_frame *frame);

/* Publishes the status; the context is the simulator. */
void simulator_publish(void *context, int64_t now_ns, const struct loop_stats *stats);

/* Excludes the unused ends of arrays from the published status. */
void simulator_leave_out_unused(struct simulator *simulator);

/* Fills the parts of the status that are known before the first tick. */
void simulator_fill_start(struct simulator *simulator);

/* ---- view.c ---- */

/* Creates the view; call it after the signals, because it needs their number. */
enum error_code simulator_create_view(struct simulator *simulator, struct error *error);

/* Returns the signals in the last tick's view; NULL without one. RT-safe. */
const double *simulator_view_signals(const struct simulator *simulator);

/* Publishes the last tick's view between two ticks, if a reader asked for views after that tick.
 * RT-safe. */
void simulator_renew_view(struct simulator *simulator);

/* ---- signals.c ---- */

/* Returns the first of the six columns of a body's contact wrench in a row. */
size_t simulator_contact_column(const struct simulator *simulator, size_t contact);

/* Lists the signals and creates the streams. Call it before the recorder is created; the recorder
 * records the first columns of the stream. */
enum error_code simulator_create_signals(struct simulator *simulator, struct error *error);

/* Writes the present value of each recorded signal; returns the address after the last one.
 * RT-safe. */
double *simulator_fill_signals(const struct simulator *simulator, double *to);

/* Writes a row of the stream: the recorded signals, then those of the buses. RT-safe. */
void simulator_fill_stream(const struct simulator *simulator, double *to);

/* Writes a row for each reader with a due row; call it after simulator_publish. RT-safe. */
void simulator_stream_row(struct simulator *simulator);

/* ---- recording.c ---- */

enum error_code simulator_create_recorder(struct simulator *simulator, struct error *error);

/* Writes a row to the recording if one is due. RT-safe. */
void simulator_record_row(struct simulator *simulator);

#endif
