/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Declarations shared by the files of the host. The core (host.c) has phases, time and queues.
 * struct host_ops, one per bus, has the parts that depend on the protocol. RT-safe, because all
 * functions run in the loop.
 */
#ifndef TASKS_HOST_PRIVATE_H
#define TASKS_HOST_PRIVATE_H

#include "boards/protocol_list.h"
#include "tasks/host.h"

#include <math.h>
#include <string.h>

#define HOST_MS INT64_C(1000000) /* nanoseconds */

enum {
    HOST_ADDRESSES = 255, /* 0 to 254; each protocol has its own maximum */
    HOST_AXES = 4,        /* maximum number of axes of a motor board */
    HOST_SLOTS = 32,      /* slots of a bus, if its protocol addresses set points by slot */
    HOST_ROWS = 64,       /* frames of a described protocol */
    HOST_CHANNELS = 6,    /* channels of a force-torque or torque board */
    HOST_QUEUE = 96,      /* maximum number of frames to one bus in one period */
};

enum host_kind {
    HOST_NO_BOARD,
    HOST_MOTOR_BOARD,
    HOST_FT_BOARD,
    HOST_TORQUE_BOARD,
    HOST_INERTIAL_BOARD,
};

/* The board at one address of one bus. */
struct host_node {
    enum host_kind kind;
    int axis[HOST_AXES];        /* HOST_MOTOR_BOARD: host axis; -1 = not used by this host */
    int ft;                     /* HOST_FT_BOARD: host sensor */
    int channel[HOST_CHANNELS]; /* HOST_TORQUE_BOARD: host axis, -1 = unused */
    int64_t period_ns;          /* requested telemetry period; 0 = the board's own */
    bool found;                 /* has answered discovery */
    int requested, answered;    /* start-up requests sent and answered */
    int tries;                  /* attempts of the last request */
    uint32_t request_id;        /* identifier of the last request */
    int64_t request_time_ns;
    bool timed;                       /* the round trip of the last request is measured */
    double full_scale[HOST_CHANNELS]; /* full scales that the board reported */

    /* cia402 motor boards, by axis */
    uint16_t statusword[HOST_AXES], controlword[HOST_AXES];
    bool wanted[HOST_AXES], clearing[HOST_AXES]; /* requested on; fault to be reset */
    bool status_seen;
    int64_t control_due_ns; /* time to repeat controlwords without effect */
};

/* described, moteus: reference, switch and measured rate of an axis. */
struct host_want {
    double rad, rad_s;   /* reference; before the first reference, the motor's position */
    bool referred;       /* a reference has been set */
    bool on, switch_off; /* switch_off: switched off in this period */
    double motor_rad_s;
};

struct host_line {
    const struct protocol *protocol;
    const struct host_ops *ops;
    struct host_node node[HOST_ADDRESSES];
    struct bus_frame queue[HOST_QUEUE];
    size_t queued;
    uint64_t frames_sent, frames_received;
    bool done;            /* DONE of the present tick has arrived (lockstep) */
    bool driving;         /* motors are on: set points are sent every period */
    int slot[HOST_SLOTS]; /* host axes of the bus in the rig's order; -1 = none */
    unsigned slots;
    uint32_t slots_on, slots_off;     /* slots switched in this period */
    uint32_t (*sent)[HOST_ADDRESSES]; /* described: counters of frames, by row and number */
    int64_t targets_due_ns;           /* foc, cia402: time of the next set points */
    int64_t round_trip_ns;            /* shortest time from a request to its answer; 0 = none yet */
};

struct host {
    struct host_config config;
    struct host_line *line; /* one per bus */
    struct host_joint *joint;
    struct host_force *force;
    bool *force_watched, motion_watched;
    struct host_motion motion;
    double *volts; /* commanded voltage of each axis, limited to the supply */
    struct host_want *want;
    enum host_phase phase;
    int64_t phase_since_ns;
    bool asked;           /* discovery has been sent */
    int64_t asked_ns;     /* time of the last discovery, or of the last switching of motors */
    int enabling;         /* number of switch commands in the start-up: off, on, on, ... */
    int64_t now_ns;       /* host time */
    uint32_t tick;        /* lockstep: the simulator's tick, from the last DONE */
    uint32_t step_tick;   /* tick in the last STEP */
    int64_t step_sent_ns; /* time of the last STEP on the caller's clock */
    bool step_waits;      /* a STEP is sent, and DONE has not arrived on every bus */
    bool step_refused;    /* the simulator refused its tick */
    bool lost;            /* HOST_FAILED: the boards are gone or have restarted */
    char message[256];
};

/* A start-up request to one board. */
struct host_request {
    struct bus_frame frame;
    bool reply; /* expects an answer: read() sets answered = requested */
};

/* The host's side of a protocol. All functions run in the loop; bus is an index. */
struct host_ops {
    bool extended; /* uses 29-bit identifiers */
    /* boards report only the rotor's angle: the host computes the link's angle from the spring */
    bool rotor_only;
    bool torque_apart; /* motor boards report no torque; a separate torque board does */
    bool restarts;     /* discovery restarts the boards */
    /* Queues the discovery request; answers set `found`. */
    void (*discover)(struct host *host, size_t bus);
    /* Makes request `number` (from 0) of a board. Returns false if there are no more. NULL =
     * none. */
    bool (*request)(const struct host *host, size_t bus, unsigned address, int number,
                    struct host_request *request);
    void (*read)(struct host *host, size_t bus, const struct bus_frame *frame);
    void (*set_motor)(struct host *host, size_t axis, bool on);
    /* Send voltages. set_voltage immediately queues a frame for an axis. end_period queues the
     * frames of the whole bus at the end of the period. One of them may be NULL. */
    void (*set_voltage)(struct host *host, size_t axis);
    void (*end_period)(struct host *host, size_t bus);
    const char *unnamed_fault; /* cause of a fault without a bit, or NULL */
};

/* Declares host_NAME for every protocol NAME. A source in tasks/ defines it. The first protocol of
 * the list is the default. */
#define HOST_DECLARE(NAME) extern const struct host_ops host_##NAME;
PROTOCOLS(HOST_DECLARE)
#undef HOST_DECLARE

/* ---- for the protocols ---- */

void host_queue(struct host *host, size_t bus, const struct bus_frame *frame);

/* Returns the joint of a motor board's axis; NULL = this host does not use the axis. */
struct host_joint *host_node_joint(struct host *host, const struct host_node *node, int axis);

/* Returns the voltage of an axis as a fraction of the supply, -1 to 1. */
double host_duty(const struct host *host, size_t axis);

/* Fails the host with the message "board 3 on can0 <what>". */
void host_fail_node(struct host *host, size_t bus, unsigned address, const char *what);

/* Fails the host with the message "joint LKneeSag <what>", or with the joint's faults; returns
 * HOST_FAILED. */
enum host_phase host_fail_joint(struct host *host, size_t axis, const char *what);

/* Stores count signed 16-bit values with a scale, and their time. */
void host_read_values(struct host *host, double *to, int64_t *time_ns, const uint8_t *data,
                      int count, double worth);

#endif
