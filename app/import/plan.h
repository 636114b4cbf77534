/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A first plan of buses: limbs stay together where they fit, servo valves and motors apart,
 * sensors are on the bus of the limb that they are on, and no bus is loaded to more than four
 * fifths at the worst, by the table of what each personality sends (coman-hil check computes it).
 * Not RT-safe.
 */
#ifndef APP_IMPORT_PLAN_H
#define APP_IMPORT_PLAN_H

#include "app/import/model.h"

#include <stdint.h>

enum { IMPORT_BUS_AXES = 16, IMPORT_BUSES_MAX = 32 };

/* Highest share of a bus's time that a plan may take. */
#define IMPORT_BUS_LOAD 0.80

/* What boards of motors and sensors speak; the last is compact over CAN FD. */
enum import_personality { IMPORT_ICUB, IMPORT_FOC, IMPORT_COMPACT, IMPORT_COMPACT_FD };

struct import_bus {
    size_t joint[IMPORT_BUS_AXES], njoint;
    bool valves; /* its boards drive servo valves: they speak protocols/servo-valve.yaml */
    int ft;      /* sensor of the robot, -1 = none */
    bool imu;    /* the inertial board is here */
};

struct import_plan {
    enum import_personality personality;
    struct import_bus bus[IMPORT_BUSES_MAX];
    size_t nbus;
};

/* ERROR_INPUT when the joints do not fit on IMPORT_BUSES_MAX buses, or nothing is driven. */
enum error_code import_plan_buses(const struct robot *robot, enum import_personality personality,
                                  struct import_plan *plan, struct error *error);

#endif
