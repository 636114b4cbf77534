/* SPDX-License-Identifier: Apache-2.0 */
/* Recorded runs of the manipulation task, for the report. Not RT-safe. */
#ifndef APP_BENCH_PAPER_GRASP_H
#define APP_BENCH_PAPER_GRASP_H

#include "app/bench/paper.h"

#define GRASP_TIME "time since the arms began to move, s"

/* Columns of a result, after the time. */
enum {
    ARM = 1, /* right, GRASP_JOINTS of them */
    ELBOW_MOTOR = ARM + GRASP_JOINTS,
    BOX_FORCE, /* of all contacts, vertical */
    PRESS_RIGHT,
    PRESS_LEFT,
    CARRY_RIGHT,
    CARRY_LEFT,
    FOOT_RIGHT,
    FOOT_LEFT,
    TORQUE_RIGHT,
    TORQUE_LEFT,
    BOX_X,
    BOX_Y,
    BOX_HEIGHT,
    BASE,                     /* position and quaternion */
    GRASP_SIGNALS = BASE + 7, /* then every joint's angle */
};

struct grasp_result {
    const struct rig *rig;
    size_t count;
    double *time;               /* s since the arms began to move */
    double *const *value;       /* pressing is positive */
    double touch;               /* when the right wrist does; NAN = never */
    double box_kg, rest_height; /* of its middle at the start */
    double gravity;             /* m/s2 */
};

/* Runs the task and takes the results out of run, which holds them until paper_run_end. */
enum error_code paper_grasp_run(const struct paper *paper, const char *rig, struct paper_run *run,
                                struct grasp_result *result, struct error *error);

/* Fig. 8, left: the robot at the start, at the touch and at the end, as its axes of rotation. */
void paper_draw_grasp(struct report *report, const struct grasp_result *result);

#endif
