/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Declarations shared by the tasks. All tasks share the host and the servo loops; each task has its
 * own behavior. Angles in rad; times in s since the start. RT-safe, except functions that create or
 * find.
 */
#ifndef TASKS_TASK_PRIVATE_H
#define TASKS_TASK_PRIVATE_H

#include "tasks/servo.h"

#include <math.h>
#include <stdatomic.h>
#include <stdio.h>

struct task;

struct task_ops {
    const char *name, *summary;
    /* Creates task->state. Checks that the host has the required joints. */
    enum error_code (*create)(struct task *task, struct arena *arena, struct error *error);
    /* Starts the behavior at t_s = 0. The boards are ready, and the motors are at rest. */
    void (*start)(struct task *task);
    /* Sets the servo's references for t_s. Writes task->message at the end, and when task->tells is
     * set. Writing it in every step would take a tenth of the time. */
    enum task_status (*step)(struct task *task, double t_s);
    /* The task runs until it is stopped or fails, unless the rig limits the walk */
    bool endless;
    /* Estimated and planned signals, for recordings; nsignal 0 = none. */
    const char *const *signal_name;
    size_t nsignal;
    void (*signals)(const struct task *task, double *value);
    const char *const *setting_name; /* names of the settings, NULL at the end; NULL = none */
    /* Applies the side effects of a changed setting; NULL = none. The caller's thread may differ
     * from the thread of step. */
    void (*changed)(struct task *task, size_t index);
};

struct task {
    const struct task_ops *ops;
    struct task_config config;
    struct host *host;
    struct servo *servo;
    void *state;
    bool started;
    int64_t start_ns;
    double *from;   /* initial joint angles by axis, rad */
    size_t foot[2]; /* force-torque boards of task_find_feet */
    size_t nsetting;
    struct task_setting *setting;
    _Atomic double *value; /* values by setting; another thread writes them */
    unsigned steps;
    _Atomic uint64_t changes; /* number of changes of settings */
    bool tells;               /* this step must write the message, also to report progress */
    char message[192];
};

extern const struct task_ops task_squat, task_grasp, task_hold, task_stand, task_walk, task_sweep,
    task_follow, task_pose, task_excite;

/* Find the axis of a joint, the axis of the joint in --joint, or a force-torque board. The error
 * message names the missing part. */
enum error_code task_find_axis(const struct task *task, const char *joint, size_t *axis,
                               struct error *error);
enum error_code task_find_input_axis(const struct task *task, size_t *axis, struct error *error);
enum error_code task_find_force(const struct task *task, const char *name, size_t *ft,
                                struct error *error);

/* task_find_feet finds the force-torque boards of both feet. The second function returns the
 * vertical force on both feet, N. */
enum error_code task_find_feet(struct task *task, struct error *error);
double task_feet_force(const struct task *task);

/* Allocate n settings; task_make_settings also fills them. Return ERROR_MEMORY. */
enum error_code task_reserve_settings(struct task *task, size_t n, struct arena *arena,
                                      struct error *error);
enum error_code task_make_settings(struct task *task, const struct task_setting *setting, size_t n,
                                   struct arena *arena, struct error *error);

/* Sets the references of all joints. A joint moves on a smooth cubic from its start angle to its
 * angle in `to` within ramp_s, and stays there. to: rad, by axis; NULL = initial pose. */
void task_move_pose(struct task *task, const double *to, double ramp_s, double t_s);

/* Appends to the message the joints with the largest deviations. worst: deviations by axis, rad. */
void task_tell_worst(struct task *task, const double *worst);

/* Checks whether a joint may move by `radians` to both sides of the initial pose. Returns false,
 * with a message, if not. */
bool task_can_swing(struct task *task, size_t axis, double radians);

/* Checks whether every motor is close to its reference. Returns false, with a message, if not.
 * Updates the worst error. */
bool task_motors_follow(struct task *task, double *worst_error_rad);

/* ---- pose.c ---- */

/* Moves a reference to a goal with limited rate and acceleration. The reference accelerates, moves
 * at the maximum rate, and stops at the goal without overshoot. The goal may change at any time,
 * also to the other side. Units: rad, s. */
struct motion_profile {
    double angle_rad, rate_rad_s; /* the reference */
};

/* Advances the reference by dt_s > 0. The limits rate_rad_s and acceleration_rad_s2 must be > 0. */
void motion_profile_step(struct motion_profile *profile, double goal_rad, double rate_rad_s,
                         double acceleration_rad_s2, double dt_s);

#endif
