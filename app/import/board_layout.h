/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Plans the buses of an imported robot. Limbs stay on one bus where they fit. Servo valves and
 * motors are on different buses. Sensors have boards of the motors' protocol, force-torque sensors
 * on the bus of their limb; a protocol without a layout of its own (struct protocol_bench) has one
 * board a joint, and the sensors get a bus that speaks compact. The worst-case load of a bus is at
 * most four fifths (coman-hil check computes the load). Not RT-safe.
 */
#ifndef APP_IMPORT_BOARD_LAYOUT_H
#define APP_IMPORT_BOARD_LAYOUT_H

#include "app/import/model.h"
#include "boards/protocol.h"

#include <stdint.h>

enum { IMPORT_BUS_AXES = 16, IMPORT_BUS_FT = 4, IMPORT_BUSES_MAX = 32 };

/* Highest planned load of a bus, as a share of its time. */
#define IMPORT_BUS_LOAD 0.80

/* The protocol of motor and sensor boards, and addresses of motor boards. */
struct import_boards {
    const struct protocol *protocol;
    bool fd;          /* use CAN FD */
    const char *name; /* in a rig file: of a protocol, or of a file; NULL: the protocol's */
    const char *copy; /* path of a user's own protocol file, which is copied; NULL = none */
    unsigned address_max;
    const char *const *address; /* --address options: JOINT=NUMBER; others are counted */
    size_t naddress;
};

/* Finds the protocol that --protocol names: one of the program, with "-fd" for CAN FD; the name of
 * a file in config/protocols; or the path of a file. NULL: the default. Keeps the addresses. */
enum error_code import_find_boards(const char *name, struct arena *arena,
                                   struct import_boards *boards, struct error *error);

/* One bus of the plan. */
struct import_bus {
    size_t joint[IMPORT_BUS_AXES], njoint;
    unsigned address[IMPORT_BUS_AXES]; /* by joint: of its board, with one board a joint */
    const char *protocol;              /* of servo valves or sensors alone; NULL: of the rig */
    int ft[IMPORT_BUS_FT];             /* indices of the robot's force-torque sensors */
    size_t nft;
    bool imu; /* the inertial board is on this bus */
};

struct import_plan {
    struct import_boards boards;
    const struct protocol_bench *bench; /* capacities of the protocol's boards */
    bool counted; /* the protocol has no layout: the caller lowers bus_axes until a bus can carry
                     its boards */
    size_t bus_axes;
    struct import_bus bus[IMPORT_BUSES_MAX];
    size_t nbus;
};

/* Prepares a plan of a robot: chooses its layout, and checks the given addresses. */
enum error_code import_plan_begin(const struct robot *robot, const struct import_boards *boards,
                                  struct import_plan *plan, struct error *error);

/* Plans the buses of a robot, at most plan->bus_axes axes on each. Returns ERROR_INPUT if the
 * joints do not fit on IMPORT_BUSES_MAX buses, or no joint is driven. */
enum error_code import_plan_buses(const struct robot *robot, struct import_plan *plan,
                                  struct error *error);

#endif
