/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The parts of the host: the core (host.c) has phases, time and queues; what differs between
 * protocols is behind struct host_ops, one for each bus. RT-safe, as all that is called in the
 * loop.
 */
#ifndef TASKS_HOST_PRIVATE_H
#define TASKS_HOST_PRIVATE_H

#include "boards/protocol_list.h"
#include "tasks/host.h"

#define HOST_MS INT64_C(1000000) /* nanoseconds */

enum {
    HOST_ADDRESSES = 32, /* 0 to 31; each protocol has its own maximum */
    HOST_AXES = 4,       /* axes of a motor board, at most */
    HOST_SLOTS = 32,     /* slots of a bus where set-points go by slot */
    HOST_ROWS = 64,      /* frames of a described protocol */
    HOST_CHANNELS = 6,   /* channels of a force-torque or torque board */
    HOST_QUEUE = 96,     /* frames that one bus may be sent in one period */
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
    int axis[HOST_AXES];        /* HOST_MOTOR_BOARD: host axis, -1 = not ours */
    int ft;                     /* HOST_FT_BOARD: host sensor */
    int channel[HOST_CHANNELS]; /* HOST_TORQUE_BOARD: host axis, -1 = unused */
    int64_t period_ns;          /* wanted period of its telemetry; 0 = the board's own */
    bool found;                 /* answered discovery */
    int requested, answered;    /* start-up requests sent and confirmed */
    int tries;                  /* tries of the last request */
    int64_t request_time_ns;
    bool timed;                       /* the last request is answered, and was sent once */
    double full_scale[HOST_CHANNELS]; /* as the board says */

    /* cia402 motor boards, by axis */
    uint16_t statusword[HOST_AXES], controlword[HOST_AXES];
    bool wanted[HOST_AXES], clearing[HOST_AXES]; /* on; a fault is to be reset */
    bool status_seen;
    int64_t control_due_ns; /* time to repeat controlwords that have not been obeyed */
};

/* described, moteus: the reference of an axis, its switch and measured rate. */
struct host_want {
    double rad, rad_s;   /* reference; that of the motor until there is one */
    bool referred;       /* there is one */
    bool on, switch_off; /* switch_off: in this period */
    double motor_rad_s;
};

struct host_line {
    const struct protocol *protocol;
    const struct host_ops *ops;
    struct host_node node[HOST_ADDRESSES];
    struct bus_frame queue[HOST_QUEUE];
    size_t queued;
    bool done;            /* DONE of the present tick has come (lockstep) */
    bool driving;         /* motors were switched on: set-points go out every period */
    int slot[HOST_SLOTS]; /* its axes, in the order of the rig: host axis, -1 = none */
    unsigned slots;
    uint32_t slots_on, slots_off; /* switched in this period */
    uint32_t (*sent)[HOST_SLOTS]; /* described: frames with a counter, by row and number */
    int64_t targets_due_ns;       /* foc, cia402: of the next set-points */
    int64_t round_trip_ns;        /* shortest time from a request to its answer; 0 = none yet */
};

struct host {
    struct host_config config;
    struct host_line *line; /* one a bus */
    struct host_joint *joint;
    struct host_force *force;
    bool *force_watched, motion_watched;
    struct host_motion motion;
    double *volts; /* commanded voltage of each axis, within the supply */
    struct host_want *want;
    enum host_phase phase;
    int64_t phase_since_ns;
    bool asked;           /* discovery was sent */
    int64_t asked_ns;     /* time of the last discovery or of the last switching of motors */
    int enabling;         /* how often the motors were switched in the start-up: off, on, on, ... */
    int64_t now_ns;       /* host time */
    uint32_t tick;        /* lockstep: the tick that the simulator is at, as far as we know */
    uint32_t step_tick;   /* the tick that the last STEP expects */
    int64_t step_sent_ns; /* caller's time of the last STEP */
    bool step_waits;      /* a STEP is out and its DONE has not come on every bus */
    bool step_refused;    /* its tick was not the one that the simulator is at */
    bool lost;            /* HOST_FAILED: the boards are gone, or were restarted */
    char message[192];
};

/* A start-up request to one board. */
struct host_request {
    struct bus_frame frame;
    bool reply; /* an answer is due: read() sets answered = requested */
};

/* The host's side of a protocol. All functions are called in the loop; bus is an index. */
struct host_ops {
    bool extended;     /* frames with identifiers of 29 bits mean something */
    bool rotor_only;   /* the boards tell the rotor's angle alone: the host needs gear and spring
                        * for the link's */
    bool torque_apart; /* they tell no torque: only a torque board does */
    /* Queues the question who is there; the answers set found. */
    void (*discover)(struct host *host, size_t bus);
    /* The number-th request that a board gets, from 0; false when there are no more. NULL: none. */
    bool (*request)(const struct host *host, size_t bus, unsigned address, int number,
                    struct host_request *request);
    void (*read)(struct host *host, size_t bus, const struct bus_frame *frame);
    void (*set_motor)(struct host *host, size_t axis, bool on);
    /* Voltages: set_voltage queues a frame for an axis at once, end_period what is due for the
     * whole bus at the end of the period. Either may be NULL. */
    void (*set_voltage)(struct host *host, size_t axis);
    void (*end_period)(struct host *host, size_t bus);
    const char *unnamed_fault; /* why a board may be in a fault that has no bit; or NULL */
};

/* Every protocol that boards speak has a host: its source of tasks/ fills host_NAME, whose
 * name is NAME. The first is what a bus speaks of which nothing else is said. */
#define HOST_DECLARE(NAME) extern const struct host_ops host_##NAME;
PROTOCOLS(HOST_DECLARE)
#undef HOST_DECLARE

/* ---- for the protocols ---- */

void host_queue(struct host *host, size_t bus, const struct bus_frame *frame);

/* Returns the joint of a motor board's axis, NULL when it is none of ours. */
struct host_joint *host_node_joint(struct host *host, const struct host_node *node, int axis);

/* Returns the voltage of an axis as a fraction of the supply, -1 to 1. */
double host_duty(const struct host *host, size_t axis);

/* Fails the host with the message "board 3 on can0 <what>". */
void host_fail_node(struct host *host, size_t bus, unsigned address, const char *what);

/* Fails the host with the message "joint LKneeSag <what>", or with the joint's faults; returns
 * HOST_FAILED. */
enum host_phase host_fail_joint(struct host *host, size_t axis, const char *what);

/* Takes count signed 16-bit values of the inertial sensor with a scale, and notes the time. */
void host_motion_take(struct host *host, double *to, int64_t *time_ns, const uint8_t *data,
                      int count, double worth);

#endif
