/* SPDX-License-Identifier: Apache-2.0 */
/* Records runs of the manipulation task, for the report. Not RT-safe. */
#ifndef APP_BENCH_PAPER_GRASP_H
#define APP_BENCH_PAPER_GRASP_H

#include "app/bench/paper.h"

#define GRASP_TIME "time since the arms began to move, s"

/* Columns of a result, after the time. */
enum {
    ARM = 1, /* the right arm's GRASP_JOINTS joints */
    ELBOW_MOTOR = ARM + GRASP_JOINTS,
    BOX_FORCE, /* vertical, of all contacts */
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
    GRASP_SIGNALS = BASE + 7, /* then the angle of every joint */
};

/* A recorded run of the task; pointers are valid until paper_run_end. */
struct grasp_result {
    const struct rig *rig;
    size_t count;
    double *time;               /* s since the arms began to move */
    double *const *value;       /* pressing is positive */
    double touch;               /* time at which the right wrist touches the box; NAN = never */
    double box_kg, rest_height; /* height of the box's middle at the start, m */
    double gravity;             /* m/s2 */
};

/* Runs the task and takes the results out of run, which holds them until paper_run_end. */
enum error_code paper_grasp_run(const struct paper *paper, const char *rig, struct paper_run *run,
                                struct grasp_result *result, struct error *error);

/* Draws Fig. 8, left: the robot at the start, at the touch and at the end, as lines between its
 * joints. */
void paper_draw_grasp(struct report *report, const struct grasp_result *result);

#endif
