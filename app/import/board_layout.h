/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Plans the buses of an imported robot. The joints of a limb stay on one bus if they fit. Servo
 * valves and motors are on different buses. Sensor boards use the protocol of the motors;
 * force-torque sensors are on the bus of their limb. A protocol without its own layout (struct
 * protocol_bench) gets one board per joint, and the sensors get a bus with the protocol compact.
 * The worst-case load of a bus is at most IMPORT_BUS_LOAD (coman-hil check computes the load). Not
 * RT-safe.
 */
#ifndef APP_IMPORT_BOARD_LAYOUT_H
#define APP_IMPORT_BOARD_LAYOUT_H

#include "app/import/model.h"
#include "boards/protocol.h"

enum { IMPORT_BUS_AXES = 16, IMPORT_BUS_FT = 4, IMPORT_BUSES_MAX = 32 };

/* Default of the highest planned load of a bus, as a share of its capacity. */
#define IMPORT_BUS_LOAD 0.80

/* The protocol of motor and sensor boards, and addresses of motor boards. */
struct import_boards {
    const struct protocol *protocol;
    bool fd;          /* use CAN FD */
    bool optional;    /* motor boards send some frames only with transmit_at_start */
    const char *name; /* name or file of the protocol in the rig file; NULL = its own name */
    const char *copy; /* path of a user's own protocol file to copy; NULL = none */
    unsigned address_max;
    const struct described_protocol *described; /* with the models of drives; NULL = none */
    const char *const *address;                 /* --address options, JOINT=NUMBER */
    size_t naddress;
};

/* Finds the protocol of --protocol and keeps the addresses. name is a protocol in C, with "-fd" for
 * CAN FD, or the name of a file in config/protocols, also with "-fd" if its frames follow the bus,
 * or the path of a file. NULL = the default protocol. */
enum error_code import_find_boards(const char *name, struct arena *arena,
                                   struct import_boards *boards, struct error *error);

/* One bus of the plan. */
struct import_bus {
    size_t joint[IMPORT_BUS_AXES], njoint;
    unsigned address[IMPORT_BUS_AXES]; /* by joint: address, with a board per joint */
    const char *protocol;              /* if only servo valves or sensors; NULL = the rig's */
    int ft[IMPORT_BUS_FT];             /* indices of the robot's force-torque sensors */
    size_t nft;
    bool imu; /* the inertial board is on this bus */
};

struct import_plan {
    struct import_boards boards;
    const struct protocol_bench *bench; /* capacities of the protocol's boards */
    bool counted; /* no layout: the caller lowers bus_axes until each bus can carry its boards */
    size_t bus_axes;
    struct import_bus bus[IMPORT_BUSES_MAX];
    size_t nbus;
};

/* Prepares a plan for a robot: chooses the layout, and checks the given addresses. */
enum error_code import_plan_begin(const struct robot *robot, const struct import_boards *boards,
                                  struct import_plan *plan, struct error *error);

/* Plans the buses of a robot, with at most plan->bus_axes axes per bus. Returns ERROR_INPUT if the
 * joints do not fit on IMPORT_BUSES_MAX buses, or if no joint is driven. */
enum error_code import_plan_buses(const struct robot *robot, struct import_plan *plan,
                                  struct error *error);

#endif
