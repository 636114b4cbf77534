/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A rig's robot without drives, boards, buses and controller, timed in our plant and in MuJoCo
 * (app/bench/peers.h): its bodies alone, from the rig's pose, or standing on its feet with springs
 * in its joints. Not RT-safe.
 */
#ifndef APP_BENCH_ROBOT_ALONE_H
#define APP_BENCH_ROBOT_ALONE_H

#include "app/bench/peers.h"
#include "base/error.h"

/* How the robot moves, and in which engine. */
enum alone_way {
    ALONE_BODIES,
    ALONE_BODIES_IMPLICIT, /* MuJoCo, implicit in the rates */
    ALONE_BODIES_EULER,    /* MuJoCo's default */
    ALONE_STANDING,
    ALONE_STANDING_EULER,
    ALONE_WAYS
};

/* Returns the engine that can step, which is MuJoCo; NULL when there is none. */
const struct peer_dynamics *alone_find_mujoco(const struct peers *peers);

/* Measures the CPU time of so many simulated seconds. mujoco is used for its own ways. *cpu_s is
 * NAN for a robot that cannot stand, or is no longer where it stood at the end. */
enum error_code alone_measure(const char *rig, enum alone_way way,
                              const struct peer_dynamics *mujoco, double seconds, double *cpu_s,
                              struct error *error);

#endif
