/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Task follow: joints move along a trajectory from a file (tasks/trajectory.h). Other joints hold
 * the initial pose. An error is the link encoder's angle minus the reference at the time of the
 * angle's frame.
 */
#include "tasks/task_private.h"
#include "tasks/trajectory.h"

enum follow_setting { FOLLOW_TOLERANCE, FOLLOW_SETTINGS };

static const double FOLLOW_RAMP_S = 1.0;     /* minimum duration of the ramp into the first row */
static const double FOLLOW_RAMP_RAD_S = 1.0; /* largest mean rate of a joint on this ramp */
static const double FOLLOW_SETTLE_S = 1.0;   /* wait in the first row */
static const double FOLLOW_END_S = 0.5;      /* wait in the last row */
static const double FOLLOW_TOLERANCE_RAD = 0.2;

static const char *const follow_setting_name[FOLLOW_SETTINGS + 1] = {
    [FOLLOW_TOLERANCE] = "follow.tolerance_rad",
};

struct follow {
    double *first; /* joint angles in the first row */
    double ramp_s;
    int64_t *seen_ns;           /* by axis: time of the newest checked angle */
    int *column;                /* by axis: column of the trajectory, -1 = none */
    struct follow_error *error; /* by axis */
    double *square, *worst;     /* by axis: sum of the squared errors, rad^2; largest error, rad */
};

/* Creates the task's state, and maps the trajectory's columns to axes. Returns ERROR_INPUT without
 * a trajectory. */
static enum error_code follow_create(struct task *task, struct arena *arena, struct error *error)
{
    const struct trajectory *trajectory = task->config.input.trajectory;
    const struct task_setting tolerance = {
        follow_setting_name[FOLLOW_TOLERANCE], "rad", 1e-4, 10, false, FOLLOW_TOLERANCE_RAD};
    const size_t naxis = task->config.host.naxis;
    struct follow *follow = arena_alloc(arena, 1, sizeof *follow);

    if (!trajectory) {
        return error_set(error, ERROR_INPUT,
                         "follow: found no trajectory, expected a file by --trajectory");
    }
    if (follow) {
        follow->first = arena_alloc(arena, naxis, sizeof *follow->first);
        follow->seen_ns = arena_alloc(arena, naxis, sizeof *follow->seen_ns);
        follow->column = arena_alloc(arena, naxis, sizeof *follow->column);
        follow->error = arena_alloc(arena, naxis, sizeof *follow->error);
        follow->square = arena_alloc(arena, naxis, sizeof *follow->square);
        follow->worst = arena_alloc(arena, naxis, sizeof *follow->worst);
    }
    if (!follow || !follow->first || !follow->seen_ns || !follow->column || !follow->error ||
        !follow->square || !follow->worst) {
        return error_set(error, ERROR_MEMORY, "no memory to follow a trajectory");
    }
    task->state = follow;

    /* Find the moving joints and the first row */
    for (size_t i = 0; i < naxis; i++) {
        follow->error[i].joint = task->config.host.axis[i].joint;
        follow->first[i] = task->config.initial_rad[i];
        follow->column[i] = -1;
    }
    for (size_t k = 0; k < trajectory->njoint; k++) {
        follow->column[trajectory->joint[k]] = (int)k;
        follow->first[trajectory->joint[k]] = trajectory->angle[k];
        follow->error[trajectory->joint[k]].moves = true;
    }
    return task_make_settings(task, &tolerance, FOLLOW_SETTINGS, arena, error);
}

/* Computes the duration of the ramp into the first row. */
static void follow_start(struct task *task)
{
    struct follow *follow = task->state;

    follow->ramp_s = FOLLOW_RAMP_S;
    for (size_t i = 0; i < task->config.host.naxis; i++) {
        /* The peak rate on a ramp is 1.5 times the mean */
        follow->ramp_s =
            fmax(follow->ramp_s, 1.5 * fabs(follow->first[i] - task->from[i]) / FOLLOW_RAMP_RAD_S);
    }
}

/* Computes the reference of an axis at time t_s of the trajectory: rad, rad/s. */
static void follow_wanted(const struct task *task, size_t axis, double t_s, double *angle,
                          double *rate)
{
    const struct follow *follow = task->state;

    *angle = follow->first[axis];
    *rate = 0;
    if (follow->column[axis] >= 0) {
        trajectory_at(task->config.input.trajectory, (size_t)follow->column[axis], t_s, angle,
                      rate);
    }
}

/* Updates the error statistics of an axis if a new angle has arrived. Returns false, with a
 * message, if the error exceeds the tolerance. */
static bool follow_judge(struct task *task, size_t axis, double begin_s)
{
    struct follow *follow = task->state;
    const struct host_joint *joint = host_joint(task->host, axis);
    double t_s = (double)(joint->joint_time_ns - task->start_ns) * 1e-9 - begin_s;
    struct follow_error *record = &follow->error[axis];
    double angle, rate, error;

    if (joint->joint_time_ns == follow->seen_ns[axis]) {
        return true;
    }
    follow->seen_ns[axis] = joint->joint_time_ns;
    follow_wanted(task, axis, t_s, &angle, &rate);
    error = joint->joint_rad - angle;
    if (!(fabs(error) <= task->value[FOLLOW_TOLERANCE])) {
        snprintf(task->message, sizeof task->message,
                 "joint %s is %.3g rad from its angle after %.2f s, allowed are %.3g rad",
                 record->joint, error, t_s, task->value[FOLLOW_TOLERANCE]);
        return false;
    }

    follow->square[axis] += error * error;
    record->count++;
    record->rms_rad = sqrt(follow->square[axis] / (double)record->count);
    if (fabs(error) > follow->worst[axis]) {
        follow->worst[axis] = fabs(error);
        record->worst_rad = error;
        record->worst_s = t_s;
    }
    return true;
}

/* Runs one period: first the ramp into the first row, then the trajectory with error checks. */
static enum task_status follow_step(struct task *task, double t_s)
{
    struct follow *follow = task->state;
    double begin_s = follow->ramp_s + FOLLOW_SETTLE_S, at_s = t_s - begin_s, angle, rate, worst = 0;
    double length_s = trajectory_length_s(task->config.input.trajectory);

    /* Move into the first row */
    if (at_s < 0) {
        task_move_pose(task, follow->first, follow->ramp_s, t_s);
        if (task->tells) {
            snprintf(task->message, sizeof task->message, "moving into the first row");
        }
        return task_motors_follow(task, &worst) ? TASK_RUNNING : TASK_FAILED;
    }

    /* Move along the rows */
    for (size_t i = 0; i < task->config.host.naxis; i++) {
        if (at_s <= length_s && !follow_judge(task, i, begin_s)) {
            return TASK_FAILED;
        }
        follow_wanted(task, i, at_s, &angle, &rate);
        servo_set(task->servo, i, angle, rate);
    }
    if (at_s >= length_s + FOLLOW_END_S) {
        snprintf(task->message, sizeof task->message, "followed %.2f s, largest errors:", length_s);
        task_tell_worst(task, follow->worst);
        return TASK_DONE;
    }
    if (task->tells) {
        snprintf(task->message, sizeof task->message, "%.1f of %.1f s", fmin(at_s, length_s),
                 length_s);
    }
    return TASK_RUNNING;
}

size_t task_follow_errors(const struct task *task, const struct follow_error **error)
{
    const struct follow *follow = task->state;

    if (task->ops != &task_follow) {
        return 0;
    }
    *error = follow->error;
    return task->config.host.naxis;
}

const struct task_ops task_follow = {
    .name = "follow",
    .summary = "joints move along a trajectory from a file",
    .create = follow_create,
    .start = follow_start,
    .step = follow_step,
    .setting_name = follow_setting_name,
};
