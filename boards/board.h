/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The boards of a rig: motor drivers and force-torque boards that speak on the buses. They receive
 * frames, turn them into bridge voltages, and send telemetry made from the plant's sensors.
 *
 * Once a tick the loop calls, in this order: boards_receive for every frame that arrived,
 * boards_control (state machines, time-outs, control modes -> voltages), and, after the plant has
 * moved and been sampled, boards_transmit for each bus.
 */
#ifndef BOARDS_BOARD_H
#define BOARDS_BOARD_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/frame.h"
#include "model/plant_io.h"

#include <stddef.h>

enum board_kind {
    BOARD_MOTOR,  /* two axes on one address (BLL) */
    BOARD_FT,     /* six-axis force-torque (STRAIN) */
    BOARD_TORQUE, /* six joint torques in STRAIN frames (pseudo-STRAIN) */
};

enum { BOARD_AXES = 2, BOARD_CHANNELS = 6 };

/* One axis of a motor board. */
struct board_axis_config {
    int joint;                     /* index in the plant's arrays; -1 = spare axis */
    double joint_ticks_per_rad;    /* POSITION frames, link encoder */
    double motor_ticks_per_rad;    /* MOTOR_POSITION frames, rotor encoder, per link-side rad */
    double lower_rad, upper_rad;   /* limits until the host sets its own */
    double current_limit_a;        /* over-current trip until the host sets its own */
    double torque_full_scale_nm;   /* of the torque source, TorqueMax */
};

struct board_config {
    const char *name;
    enum board_kind kind;
    int bus;          /* index of the bus */
    uint8_t address;  /* 1-14 */
    bool strict;      /* exactly as the firmware: no safety time-out of ours */
    int64_t command_timeout_ns;   /* stale voltage -> 0 V; 0 = off; ignored when strict */
    struct board_axis_config axis[BOARD_AXES];   /* BOARD_MOTOR */
    int ft;                                      /* BOARD_FT: index in the plant's ft array */
    int torque_joint[BOARD_CHANNELS];            /* BOARD_TORQUE: joints, -1 = none */
    double full_scale[BOARD_CHANNELS];           /* BOARD_FT: N, N, N, Nm, Nm, Nm; BOARD_TORQUE: Nm */
    int64_t period_ns;                           /* STRAIN period until set by the host */
    bool transmit_at_start;                      /* send without waiting for the host's command */
    bool discovery_stops_motors;  /* as BLL firmware: class 7 discovery switches PWM off */
};

struct boards_config {
    size_t nboard;
    const struct board_config *board;
    size_t nbus;
    size_t njoint, nft;
    int64_t tick_ns;      /* the control loop of the boards runs once a tick; 1 ms on real ones */
};

enum board_event_kind {
    BOARD_EVENT_MODE,           /* an axis changed its control mode: a = old, b = new */
    BOARD_EVENT_FAULT,          /* fault bits rose: a = bits, b = axis */
    BOARD_EVENT_TIMEOUT,        /* a voltage command went stale: b = axis */
    BOARD_EVENT_UNKNOWN,        /* no such command: a = id, b = first byte */
    BOARD_EVENT_MALFORMED,      /* wrong length or value: a = id, b = first byte */
};

/* Something worth a line in the log; formatted outside the loop. */
struct board_event {
    int64_t time_ns;
    enum board_event_kind kind;
    int bus;
    uint8_t address;
    uint32_t a, b;
};

/* Counts since the start. */
struct boards_counters {
    uint64_t frames;     /* received for some board */
    uint64_t foreign;    /* ids that belong to no board here */
    uint64_t unknown;    /* addressed to a board, but no such command */
    uint64_t malformed;  /* known command, wrong length or value */
    uint64_t timeouts;   /* commands gone stale */
    uint64_t trips;      /* over-current */
    uint64_t events_lost; /* events that found the ring full */
};

struct boards;

/* Checks the configuration (addresses unique per bus, joints known, ...) and makes the boards.
 * Memory from arena. Not RT-safe. */
enum error_code boards_create(const struct boards_config *config, struct arena *arena,
                              struct boards **boards, struct error *error);

/* RT-safe, all of them. Any frame whatever may be given. */
void boards_receive(struct boards *boards, size_t bus, const struct bus_frame *frame);
void boards_control(struct boards *boards, const struct plant_sensors *sensors,
                    struct plant_command *command);
size_t boards_transmit(struct boards *boards, size_t bus, const struct plant_sensors *sensors,
                       struct bus_frame *frames, size_t max);

/* Most frames that one bus's boards can send in a tick. */
size_t boards_transmit_max(const struct boards *boards, size_t bus);

/* All bridges off at once (stop, emergency). RT-safe. */
void boards_shut_down(struct boards *boards, struct plant_command *command);

/* Read from another thread: one event, false when none waits; text for a log line. */
bool boards_next_event(struct boards *boards, struct board_event *event);
void board_event_format(const struct boards *boards, const struct board_event *event, char *text,
                        size_t size);

void boards_counters(const struct boards *boards, struct boards_counters *counters);

#endif
