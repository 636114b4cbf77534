/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Stand and walk: both keep the balance (tasks/balance.h); to stand is to walk without steps.
 */
#include "tasks/balance.h"
#include "tasks/task_private.h"

#include <math.h>
#include <stdio.h>

#define FALLEN_RAD 0.7
#define SPEED_UP_M_S2 0.1 /* of the command */

struct walk {
    struct balance *balance;
    struct gait_command command;
    double last_s;
};

static enum error_code walk_create(struct task *task, struct arena *arena, struct error *error)
{
    struct walk *walk = arena_alloc(arena, 1, sizeof *walk);

    if (!walk) {
        return error_set(error, ERROR_MEMORY, "no memory for the walk");
    }
    if (!task->config.walk || !task->config.body) {
        return error_set(error, ERROR_INPUT, "%s: the rig says nothing about it (tasks: walk)",
                         task->ops->name);
    }
    task->state = walk;
    return balance_create(&task->config.walk->balance, task->config.body, task->config.initial_rad,
                          task->host, task->servo, arena, &walk->balance, error);
}

static void walk_start(struct task *task)
{
    struct walk *walk = task->state;

    walk->last_s = 0;
    balance_start(walk->balance);
}

static double walk_approach(double now, double goal, double most)
{
    return now + fmin(fmax(goal - now, -most), most);
}

static enum task_status walk_advance(struct task *task, double t_s, bool walks)
{
    struct walk *walk = task->state;
    const struct walk_config *config = task->config.walk;
    const struct estimate *estimate = balance_estimate(walk->balance);
    const struct gait *gait = balance_gait(walk->balance);
    double dt = t_s - walk->last_s;
    bool ready = balance_ready(walk->balance);

    walk->last_s = t_s;
    walk->command.step = walks && ready && t_s > config->begin_s &&
                         (config->steps <= 0 || gait->steps < (uint64_t)config->steps);
    if (walk->command.step && gait->steps >= 2) {
        walk->command.forward_m_s =
            walk_approach(walk->command.forward_m_s, config->forward_m_s, SPEED_UP_M_S2 * dt);
        walk->command.left_m_s =
            walk_approach(walk->command.left_m_s, config->left_m_s, SPEED_UP_M_S2 * dt);
        walk->command.turn_rad_s =
            walk_approach(walk->command.turn_rad_s, config->turn_rad_s, 0.3 * dt);
    }
    balance_update(walk->balance, &walk->command, dt);
    if (fabs(estimate->pitch_rad) > FALLEN_RAD || fabs(estimate->roll_rad) > FALLEN_RAD) {
        snprintf(task->message, sizeof task->message, "the robot fell after %u steps, %.2f m",
                 gait->steps, estimate->pelvis_m[0]);
        return TASK_FAILED;
    }
    if (task->tells) {
        snprintf(task->message, sizeof task->message, "%u steps, %.2f m ahead, %.2f m left",
                 gait->steps, estimate->pelvis_m[0], estimate->pelvis_m[1]);
    }
    return TASK_RUNNING;
}

static enum task_status walk_step(struct task *task, double t_s)
{
    return walk_advance(task, t_s, true);
}

static enum task_status stand_step(struct task *task, double t_s)
{
    return walk_advance(task, t_s, false);
}

static void walk_signals(const struct task *task, double *value)
{
    const struct walk *walk = task->state;

    balance_signals(walk->balance, value);
}

const struct task_ops task_stand = {
    .name = "stand",
    .summary = "keeps its balance on both feet when it is pushed",
    .create = walk_create,
    .start = walk_start,
    .step = stand_step,
    .signal_name = balance_signal_name,
    .nsignal = BALANCE_SIGNALS,
    .signals = walk_signals,
};

const struct task_ops task_walk = {
    .name = "walk",
    .summary = "walks on two legs",
    .create = walk_create,
    .start = walk_start,
    .step = walk_step,
    .signal_name = balance_signal_name,
    .nsignal = BALANCE_SIGNALS,
    .signals = walk_signals,
};
