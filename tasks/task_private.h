/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The parts of a task: the host and the servo loops are shared, the behavior is its own. Angles in
 * rad, times in s since the start. RT-safe but for what creates and finds.
 */
#ifndef TASKS_TASK_PRIVATE_H
#define TASKS_TASK_PRIVATE_H

#include "tasks/host.h"
#include "tasks/servo.h"

#include <stdatomic.h>

struct task;

struct task_ops {
    const char *name, *summary;
    /* Makes task->state; checks that the host has the joints it needs. */
    enum error_code (*create)(struct task *task, struct arena *arena, struct error *error);
    /* Starts: the boards are ready and hold still, and t_s = 0 is now. */
    void (*start)(struct task *task);
    /* Sets the servo's references for t_s. Writes task->message when it ends or task->tells: a
     * text in every step would take a tenth of the time. */
    enum task_status (*step)(struct task *task, double t_s);
    /* Returns whether it goes on until it is stopped or fails; NULL: it does not. */
    bool (*endless)(const struct task *task);
    /* Signals that it estimates and plans, for recordings; none when nsignal is 0. */
    const char *const *signal_name;
    size_t nsignal;
    void (*signals)(const struct task *task, double *value);
    const char *const *setting_name; /* names of its settings, NULL at the end; NULL: none */
    /* Does what a changed setting asks for beside its value; NULL: nothing. Called from another
     * thread than step. */
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
    double *from;   /* by axis: the joints' angles at the start, rad */
    size_t foot[2]; /* of task_find_feet: their force-torque boards */
    size_t nsetting;
    struct task_setting *setting;
    _Atomic double *value; /* by setting; another thread writes them */
    unsigned steps;
    _Atomic uint64_t changes; /* number of changes of settings */
    bool tells; /* this step writes the message even if there is only progress to tell */
    char message[192];
};

extern const struct task_ops task_squat, task_grasp, task_hold, task_stand, task_walk, task_sweep,
    task_follow, task_pose, task_excite;

/* Find the index of a joint's axis, of that by --joint, or of a force-torque board; the error says
 * which one is missing. */
enum error_code task_find_axis(const struct task *task, const char *joint, size_t *axis,
                               struct error *error);
enum error_code task_find_input_axis(const struct task *task, size_t *axis, struct error *error);
enum error_code task_find_force(const struct task *task, const char *name, size_t *ft,
                                struct error *error);

/* Finds the force-torque boards of both feet, and returns the vertical force on them, N. */
enum error_code task_find_feet(struct task *task, struct error *error);
double task_feet_force(const struct task *task);

/* Makes room for n settings; task_make_settings fills them, too. ERROR_MEMORY. */
enum error_code task_reserve_settings(struct task *task, size_t n, struct arena *arena,
                                      struct error *error);
enum error_code task_make_settings(struct task *task, const struct task_setting *setting, size_t n,
                                   struct arena *arena, struct error *error);

/* Sets the references of every joint: it moves smoothly (cubic) from where it was at the start to
 * an angle (to, by axis; NULL: the initial pose) within ramp_s, and stays there. */
void task_move_pose(struct task *task, const double *to, double ramp_s, double t_s);

/* Adds the joints with the largest of these deviations (rad, by axis) to the message. */
void task_tell_worst(struct task *task, const double *worst);

/* Checks whether a joint may swing that far to both sides of the initial pose; false with a
 * message. */
bool task_can_swing(struct task *task, size_t axis, double radians);

/* Checks whether every motor is near its reference; false with a message. Keeps the worst error. */
bool task_motors_follow(struct task *task, double *worst_error_rad);

/* ---- pose.c ---- */

/* Moves a reference to a goal with bounded rate and acceleration: it speeds up, moves at its
 * greatest rate, and slows down so that it comes to rest at the goal without overshoot. The goal
 * may change at any time, also to the other side. rad, s. */
struct motion_profile {
    double angle_rad, rate_rad_s; /* the reference */
};

/* Moves the reference by one step of dt_s > 0. rate_rad_s, acceleration_rad_s2: its bounds, > 0. */
void motion_profile_step(struct motion_profile *profile, double goal_rad, double rate_rad_s,
                         double acceleration_rad_s2, double dt_s);

#endif
