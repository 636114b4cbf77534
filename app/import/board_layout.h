/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Plans the buses of a bench: limbs stay together where they fit, servo valves and motors are on
 * different buses, force-torque sensors are on the bus of their limb, and no bus is loaded to more
 * than four fifths at the worst, by the table of what each protocol sends (coman-hil check computes
 * it). Not RT-safe.
 */
#ifndef APP_IMPORT_BOARD_LAYOUT_H
#define APP_IMPORT_BOARD_LAYOUT_H

#include "app/import/model.h"
#include "boards/protocol.h"

#include <stdint.h>

enum { IMPORT_BUS_AXES = 16, IMPORT_BUSES_MAX = 32 };

/* Highest load of a bus that a plan may have, as a share of its time. */
#define IMPORT_BUS_LOAD 0.80

/* The protocol of the boards of motors and sensors. */
struct import_boards {
    const struct protocol *protocol; /* one with a bench (boards/protocol.h) */
    bool fd;                         /* over CAN FD */
};

/* One bus of the plan. */
struct import_bus {
    size_t joint[IMPORT_BUS_AXES], njoint;
    bool valves; /* its boards drive servo valves: they speak protocols/servo-valve.yaml */
    int ft;      /* index of the robot's force-torque sensor, -1 = none */
    bool imu;    /* the inertial board is here */
};

struct import_plan {
    struct import_boards boards;
    const struct protocol_bench *bench; /* what the protocol's boards can carry */
    struct import_bus bus[IMPORT_BUSES_MAX];
    size_t nbus;
};

/* Plans the buses of a robot. ERROR_INPUT when the joints do not fit on IMPORT_BUSES_MAX buses, or
 * nothing is driven. */
enum error_code import_plan_buses(const struct robot *robot, const struct import_boards *boards,
                                  struct import_plan *plan, struct error *error);

#endif
