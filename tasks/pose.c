/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Task pose: every joint moves smoothly to its setting pose.JOINT_rad and stays there. Settings may
 * change during the run, for example by the sliders of the page. The task starts from the initial
 * pose and runs until it is stopped. It gives no verdict, because a pose may make the robot fall.
 */
#include "tasks/task_private.h"

enum { POSE_RATE, POSE_JOINTS }; /* settings: the rate, then the joints by axis */

enum { POSE_NAME_SIZE = 96 };

static const double POSE_RATE_RAD_S = 0.5; /* default rate of the joints */
static const double POSE_LEAST_RAD_S = 0.01, POSE_MOST_RAD_S = 3;
static const double POSE_SPEED_UP_S = 0.3; /* acceleration time from rest to the rate */
/* longest time step, so that a joint does not jump after a pause */
static const double POSE_LONGEST_STEP_S = 0.1;

struct pose {
    struct motion_profile *profile; /* by axis */
    double *deviation;              /* by axis: deviation of the link's angle, rad */
    double last_s;
};

/* ---- a joint's motion ---- */

void motion_profile_step(struct motion_profile *profile, double goal_rad, double rate_rad_s,
                         double acceleration_rad_s2, double dt_s)
{
    double away = goal_rad - profile->angle_rad, most = acceleration_rad_s2 * dt_s;
    /* Compute the largest rate v from which the axis can stop within the distance. The rate
     * falls by a dt per step: v dt + (v - a dt) dt + ... = v^2 / (2 a) + v dt / 2 */
    double stopping = acceleration_rad_s2 *
                      (sqrt(dt_s * dt_s / 4 + 2 * fabs(away) / acceleration_rad_s2) - dt_s / 2);
    double wanted = copysign(fmin(rate_rad_s, stopping), away);
    double change = fmin(fmax(wanted - profile->rate_rad_s, -most), most);

    profile->rate_rad_s += change;

    /* End the last step at the goal, at rest */
    if (fabs(away) <= most * dt_s && fabs(profile->rate_rad_s) <= most) {
        profile->angle_rad = goal_rad;
        profile->rate_rad_s = 0;
        return;
    }
    profile->angle_rad += profile->rate_rad_s * dt_s;
}

/* ---- settings ---- */

/* Makes the settings: the rate, and an angle for each joint. The range of an angle is the joint's
 * range, extended to include the initial angle. Returns false without memory. */
static bool pose_make_settings(struct task *task, struct arena *arena)
{
    const struct host_config *host = &task->config.host;

    if (task_reserve_settings(task, POSE_JOINTS + host->naxis, arena, NULL)) {
        return false;
    }
    task->setting[POSE_RATE] = (struct task_setting){"pose.rate_rad_s", "rad/s", POSE_LEAST_RAD_S,
                                                     POSE_MOST_RAD_S,   false,   POSE_RATE_RAD_S};
    task->value[POSE_RATE] = POSE_RATE_RAD_S;
    for (size_t i = 0; i < host->naxis; i++) {
        const struct host_axis *axis = &host->axis[i];
        double initial = task->config.initial_rad[i];
        char *name = arena_alloc(arena, POSE_NAME_SIZE, 1);

        if (!name) {
            return false;
        }
        snprintf(name, POSE_NAME_SIZE, "pose.%.80s_rad", axis->joint);
        task->setting[POSE_JOINTS + i] = (struct task_setting){
            name,  "rad",  fmin(axis->lower_rad, initial), fmax(axis->upper_rad, initial),
            false, initial};
        task->value[POSE_JOINTS + i] = initial;
    }
    return true;
}

/* ---- task ---- */

/* Creates the task's state, with a setting for each joint. */
static enum error_code pose_create(struct task *task, struct arena *arena, struct error *error)
{
    const size_t naxis = task->config.host.naxis;
    struct pose *pose = arena_alloc(arena, 1, sizeof *pose);

    if (pose) {
        pose->profile = arena_alloc(arena, naxis, sizeof *pose->profile);
        pose->deviation = arena_alloc(arena, naxis, sizeof *pose->deviation);
    }
    if (!pose || !pose->profile || !pose->deviation || !pose_make_settings(task, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory for the pose");
    }
    task->state = pose;
    return ERROR_NONE;
}

static void pose_start(struct task *task)
{
    struct pose *pose = task->state;

    pose->last_s = 0;
    for (size_t i = 0; i < task->config.host.naxis; i++) {
        pose->profile[i] = (struct motion_profile){.angle_rad = task->from[i]};
    }
}

/* Moves every reference toward its setting, with bounded rate and acceleration. */
static enum task_status pose_step(struct task *task, double t_s)
{
    struct pose *pose = task->state;
    double dt_s = fmin(t_s - pose->last_s, POSE_LONGEST_STEP_S), rate = task->value[POSE_RATE];
    size_t moving = 0;

    pose->last_s = t_s;
    for (size_t i = 0; i < task->config.host.naxis; i++) {
        struct motion_profile *profile = &pose->profile[i];

        if (dt_s > 0) {
            motion_profile_step(profile, task->value[POSE_JOINTS + i], rate, rate / POSE_SPEED_UP_S,
                                dt_s);
        }
        servo_set(task->servo, i, profile->angle_rad, profile->rate_rad_s);
    }
    /* Report the number of moving joints, and the joints with the largest deviations */
    if (task->tells) {
        for (size_t i = 0; i < task->config.host.naxis; i++) {
            moving += pose->profile[i].angle_rad != task->value[POSE_JOINTS + i];
            pose->deviation[i] =
                fabs(host_joint(task->host, i)->joint_rad - pose->profile[i].angle_rad);
        }
        snprintf(task->message, sizeof task->message,
                 "%zu joints move, largest deviations:", moving);
        task_tell_worst(task, pose->deviation);
    }
    return TASK_RUNNING;
}

const struct task_ops task_pose = {
    .name = "pose",
    .summary = "every joint goes to the angle that is set while it runs, as by the page's sliders",
    .create = pose_create,
    .start = pose_start,
    .step = pose_step,
    .endless = true,
};
