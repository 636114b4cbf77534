/* SPDX-License-Identifier: Apache-2.0 */
/* What the parts of the simulator share: simulator.c (assembly, running, looking in),
 * simulator_machine.c (what the loop calls), simulator_signals.c (recording), simulator_events.c. */
#ifndef SIM_PRIVATE_H
#define SIM_PRIVATE_H

#include "model/symbolic/builtin.h"
#include "sim/injection.h"
#include "sim/interfaces.h"
#include "rt/pace.h"
#include "sim/simulator.h"
#include "sim/steered.h"

#include <pthread.h>
#include <stdatomic.h>

/* When the links of a held robot are let go. */
struct release {
    bool due;      /* when every motor is on */
    int64_t at_ns; /* virtual time; -1 = not yet or done */
};

struct simulator {
    struct simulator_config config;
    struct arena *arena;
    struct clock *time;
    struct dynamics dynamics;
    struct symbolic_library library; /* of a module that is not built in */
    struct error dynamics_notice;    /* which implementation, and why */
    struct contact_world *contact;   /* NULL = none */
    struct plant *plant;
    struct settled settled;
    struct faults *faults;
    struct injection *injection;
    struct sensing *sensing;
    const struct plant_sensors *measured; /* what the boards see; the plant's are true */
    struct boards *boards;
    struct buses buses;
    struct interfaces interfaces; /* the real ones; none with local buses */
    struct bus_ports ports, task_ports, gateway_ports;
    struct gateway *gateway;
    size_t *transmit_max;
    struct loop *loop;
    struct recorder *recorder;
    const char **title; /* of the signals: those of signals.csv, then those of the buses */
    double *row;
    struct contact_patch *patch; /* of the pairs, for a row */
    size_t nrecorded, nsignal, npatch;
    struct stream *stream;
    uint64_t row_ticks;
    struct controller *controller;
    bool task_inline, task_running;
    pthread_t task_thread;
    struct realtime_config task_realtime;
    struct simulator_status status;
    struct snapshot *published; /* struct simulator_status */
    struct release release;
    _Atomic int64_t released; /* virtual time at which they were let go; -1 = told or not yet */
    char failure[256];
    struct steering *steering; /* NULL = none */
    struct steered *steered;
    struct pace *pace;           /* of a task in its own thread that is steered; NULL = none */
    size_t moves_from, moves_to; /* of the arena: what moves in virtual time */
};

/* simulator_machine.c */
struct loop_machine simulator_machine(struct simulator *simulator);
void simulator_publish(void *simulator, const struct loop_stats *stats);

/* simulator_signals.c. The streaming before the recorder, whose columns are the first of its. */
enum error_code simulator_create_signals(struct simulator *simulator, struct error *error);
enum error_code simulator_create_recorder(struct simulator *simulator, struct error *error);
void simulator_record_row(struct simulator *simulator); /* when one is due */
void simulator_stream_row(struct simulator *simulator); /* likewise, for subscribers */

#endif
