/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Task hold: every joint moves to the initial pose and stays there. It works on any robot. The
 * verdict uses the link encoders: after a second of settling, no joint may deviate by more than the
 * tolerance. The message names the joints with the largest deviations.
 */
#include "tasks/task_private.h"

/* duration of the ramp from the present angles to the pose */
static const double HOLD_RAMP_S = 1.0;
static const double HOLD_SETTLE_S = 1.0; /* wait after the ramp before deviations count */

/* Creates the task's state: the largest deviation of each link from the initial pose, rad. */
static enum error_code hold_create(struct task *task, struct arena *arena, struct error *error)
{
    task->state = arena_alloc(arena, task->config.host.naxis, sizeof(double));
    return task->state ? ERROR_NONE : error_set(error, ERROR_MEMORY, "no memory to hold the pose");
}

/* Writes the message: the time, and the joints with the largest deviations. */
static void hold_tell(struct task *task, const char *what, double held_s)
{
    snprintf(task->message, sizeof task->message, "%s for %.1f s, largest deviations:", what,
             held_s);
    task_tell_worst(task, task->state);
}

/* Runs one period: the ramp into the pose, then a check of every joint until duration_s has
 * passed. */
static enum task_status hold_step(struct task *task, double t_s)
{
    const struct hold_config *config = &task->config.hold;
    double *worst = task->state, held_s = t_s - HOLD_RAMP_S - HOLD_SETTLE_S;

    task_move_pose(task, NULL, HOLD_RAMP_S, t_s);
    /* Ignore deviations during the ramp and the settling */
    if (held_s < 0) {
        if (task->tells) {
            snprintf(task->message, sizeof task->message, "moving into the pose");
        }
        return TASK_RUNNING;
    }
    /* Fail at once if a joint exceeds the tolerance, or has no finite angle */
    for (size_t i = 0; i < task->config.host.naxis; i++) {
        double deviation = host_joint(task->host, i)->joint_rad - task->config.initial_rad[i];

        worst[i] = fmax(worst[i], fabs(deviation));
        if (!(fabs(deviation) <= config->tolerance_rad)) {
            snprintf(task->message, sizeof task->message,
                     "joint %s is %.3g rad from its angle after %.1f s, allowed are %.3g rad",
                     task->config.host.axis[i].joint, deviation, held_s, config->tolerance_rad);
            return TASK_FAILED;
        }
    }
    /* End after duration_s with a message about the worst joints */
    if (held_s < config->duration_s) {
        if (task->tells) {
            hold_tell(task, "holding", held_s);
        }
        return TASK_RUNNING;
    }
    hold_tell(task, "held", held_s);
    return TASK_DONE;
}

const struct task_ops task_hold = {
    .name = "hold",
    .summary = "every joint goes to the initial pose and stays there",
    .create = hold_create,
    .step = hold_step,
};
