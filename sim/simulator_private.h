/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the parts of the simulator share: assembly.c makes it, simulator.c runs and closes it and
 * gives access to it, machine.c is what the loop calls, status.c, signals.c and recording.c what it
 * publishes and records, events.c its log. Not RT-safe but where it says so.
 */
#ifndef SIM_PRIVATE_H
#define SIM_PRIVATE_H

#include "model/dynamics.h"
#include "rt/clock.h"
#include "sim/external.h"
#include "sim/fault_injection.h"
#include "sim/interfaces.h"
#include "sim/mechanics_events.h"
#include "sim/robot_requests.h"
#include "sim/simulator.h"
#include "sim/stimulus.h"

#include <pthread.h>
#include <stdatomic.h>

/* The state of a clamped robot's release. */
struct release {
    bool due;       /* when every motor is on */
    int64_t at_ns;  /* virtual time; -1 = not yet or done */
    uint64_t trips; /* of axes so far */
};

struct simulator {
    struct simulator_config config;
    struct arena *arena;
    struct clock *time;
    struct dynamics dynamics;
    struct error dynamics_notice;  /* which implementation, and why */
    struct contact_world *contact; /* NULL = none */
    struct plant *plant;
    struct settled settled;
    struct faults *faults;
    struct fault_injection *injection;
    struct sensing *sensing;
    const struct plant_sensors *measured; /* what the boards see; the plant's are the truth */
    struct boards *boards;
    struct external *external; /* NULL = the rig has no external boards */
    struct watch *watch;
    struct buses buses;
    struct interfaces interfaces; /* of SocketCAN; none with local buses */
    struct bus_ports ports, task_ports, gateway_ports;
    struct stimulus stimulus;
    int64_t stimulus_ns; /* virtual time up to which its frames are received */
    struct gateway *gateway;
    size_t *transmit_max;
    struct loop *loop;
    struct recorder *recorder;
    const char **title; /* of the signals: those of signals.csv, then those of the buses */
    double *row;
    struct contact_patch *patch; /* of the pairs, for a row */
    size_t nrecorded, nsignal, npatch;
    struct stream *stream;      /* for subscribers of the control socket; NULL without requests */
    struct stream *view_stream; /* simulator.h; NULL = none */
    uint64_t row_ticks;
    struct task_runner *task; /* NULL = none */
    bool task_inline, task_running;
    pthread_t task_thread;
    struct realtime_config task_realtime;
    struct simulator_status status;
    struct snapshot *published;      /* struct simulator_status */
    struct snapshot *published_view; /* simulator.h */
    void *view;                      /* the next one */
    _Atomic bool view_wanted;
    bool view_stale; /* the last tick was not published as a view */
    struct release release;
    _Atomic int64_t released; /* virtual time of the release; -1 = reported or not yet */
    _Atomic int64_t
        clamped_trip;            /* virtual time at which an axis of a clamped robot has tripped; -1
                                   * = reported or not yet */
    _Atomic int clamped_trip_on; /* motors that were on then */
    char failure[256];
    struct requests *requests; /* NULL = none */
    struct robot_requests *robot_requests;
    struct pace *pace;           /* clock of a task in its own thread; NULL = the real one */
    size_t moves_from, moves_to; /* of the arena: state that changes in virtual time */
};

/* ---- assembly.c ---- */

/* Makes all parts, or fails with some made: simulator_destroy closes them. */
enum error_code simulator_assemble(struct simulator *simulator, char notice[256],
                                   struct error *error);

/* ---- machine.c, status.c: RT-safe ---- */

struct loop_machine simulator_machine(struct simulator *simulator);

/* Publishes the status; the context is the simulator. */
void simulator_publish(void *context, int64_t now_ns, const struct loop_stats *stats);

/* Leaves out what the rig has no use for in the published status. */
void simulator_leave_out_unused(struct simulator *simulator);

/* Fills in the parts of the status that are known before the first tick. */
void simulator_fill_start(struct simulator *simulator);

/* ---- view.c ---- */

/* Creates the view; after the signals, whose number it needs. */
enum error_code simulator_create_view(struct simulator *simulator, struct error *error);

/* Publishes a view of the tick that has run, if one is wanted. RT-safe. */
void simulator_offer_view(struct simulator *simulator);

/* Returns the signals of the view of the tick that has run last, NULL without one. RT-safe. */
const double *simulator_view_signals(const struct simulator *simulator);

/* Publishes the view of the last tick, between two ticks, if it has come to be wanted only
 * since. RT-safe. */
void simulator_renew_view(struct simulator *simulator);

/* ---- signals.c ---- */

/* Returns the column of the first of the six components of a body's contact wrench in a row. */
size_t simulator_contact_column(const struct simulator *simulator, size_t contact);

/* Lists the signals and creates the streams; before the recorder, whose columns are the first of
 * the stream's. */
enum error_code simulator_create_signals(struct simulator *simulator, struct error *error);

/* Writes the present value of each signal that is recorded; returns where the next would go.
 * RT-safe. */
double *simulator_fill_signals(const struct simulator *simulator, double *to);

/* Writes a row of the stream: the recorded signals, then those of the buses. RT-safe. */
void simulator_fill_stream(const struct simulator *simulator, double *to);

/* Writes a row for each reader for whom one is due; after simulator_offer_view. RT-safe. */
void simulator_stream_row(struct simulator *simulator);

/* ---- recording.c ---- */

enum error_code simulator_create_recorder(struct simulator *simulator, struct error *error);

/* Writes a row for the recording, if one is due. RT-safe. */
void simulator_record_row(struct simulator *simulator);

#endif
