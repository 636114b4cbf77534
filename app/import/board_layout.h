/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Plans the buses of an imported robot. Limbs stay on one bus where they fit, servo valves and
 * motors are on different buses, and force-torque sensors are on the bus of their limb. The
 * worst-case load of a bus is at most four fifths, from the table of each protocol's traffic
 * (coman-hil check computes the load). Not RT-safe.
 */
#ifndef APP_IMPORT_BOARD_LAYOUT_H
#define APP_IMPORT_BOARD_LAYOUT_H

#include "app/import/model.h"
#include "boards/protocol.h"

#include <stdint.h>

enum { IMPORT_BUS_AXES = 16, IMPORT_BUSES_MAX = 32 };

/* Highest planned load of a bus, as a share of its time. */
#define IMPORT_BUS_LOAD 0.80

/* The protocol of motor and sensor boards. */
struct import_boards {
    const struct protocol *protocol; /* a protocol with bench data (boards/protocol.h) */
    bool fd;                         /* use CAN FD */
};

/* One bus of the plan. */
struct import_bus {
    size_t joint[IMPORT_BUS_AXES], njoint;
    bool valves; /* its boards drive servo valves, with protocols/servo-valve.yaml */
    int ft;      /* index of the robot's force-torque sensor, -1 = none */
    bool imu;    /* the inertial board is on this bus */
};

struct import_plan {
    struct import_boards boards;
    const struct protocol_bench *bench; /* capacities of the protocol's boards */
    struct import_bus bus[IMPORT_BUSES_MAX];
    size_t nbus;
};

/* Plans the buses of a robot. Returns ERROR_INPUT if the joints do not fit on IMPORT_BUSES_MAX
 * buses, or no joint is driven. */
enum error_code import_plan_buses(const struct robot *robot, const struct import_boards *boards,
                                  struct import_plan *plan, struct error *error);

#endif
