/* SPDX-License-Identifier: Apache-2.0 */
/* Tasks stand and walk. Both use the balance controller (tasks/balance.h). Task stand takes no
 * steps. */
#include "tasks/balance.h"
#include "tasks/task_private.h"

#include <string.h>

#define FALLEN_RAD 0.7
#define SPEED_UP_M_S2 0.1 /* acceleration of the commanded velocity */
#define TURN_UP_RAD_S2 0.3
#define TURN_MOST_RAD_S 0.5
#define HEADING_RAD_S 0.3 /* maximum turn rate to a heading */
#define HEADING_STEPS 3   /* steps to reach a heading, slow enough for TURN_UP_RAD_S2 */
#define STOOD_S 2.0       /* time of standing after the walk, before the task ends */

/* Settings that a user may change, in this order. A step is a transfer and a swing. */
enum walk_setting {
    WALK_ON,
    WALK_FORWARD,
    WALK_LEFT,
    WALK_TURN,
    WALK_HEADING,
    WALK_STEP_TIME,
    WALK_STEP_LENGTH, /* WALK_FORWARD as a length per step */
    WALK_SETTINGS,
};

struct walk {
    struct balance *balance;
    struct gait_command command;
    double last_s;
    unsigned from_steps;       /* the gait's number of steps at the beginning of the walk */
    _Atomic double *value;     /* values of the settings; another thread writes them */
    atomic_bool holds_heading; /* turn to WALK_HEADING, not at a turn rate */
    /* heading to keep while the turn rate is 0: from the beginning of the walk, or from the end of
     * the last turn */
    double kept_rad;
    double from_m[2]; /* estimated position at the first step */
    bool arrived;     /* the robot has walked the distance */
    double stood_s;   /* time at rest since arrival */
};

/* ---- settings ---- */

static const char *const walk_setting_name[WALK_SETTINGS + 1] = {
    [WALK_ON] = "walk.on",
    [WALK_FORWARD] = "walk.forward_m_s",
    [WALK_LEFT] = "walk.left_m_s",
    [WALK_TURN] = "walk.turn_rad_s",
    [WALK_HEADING] = "walk.heading_rad",
    [WALK_STEP_TIME] = "walk.step_s",
    [WALK_STEP_LENGTH] = "walk.step_length_m",
};

/* Returns a setting for a velocity. Its range is the reach of a step divided by the rig's step
 * duration, extended to include the rig's value. */
static struct task_setting walk_rate(const char *name, const char *unit, double least, double most,
                                     double asked)
{
    return (struct task_setting){name, unit, fmin(least, asked), fmax(most, asked), false, asked};
}

/* Keeps related settings consistent. A step length sets the speed. Speed and duration set the step
 * length. A heading replaces a turn rate, and a turn rate replaces a heading. */
static void walk_changed(struct task *task, size_t index)
{
    struct walk *walk = task->state;

    if (index == WALK_STEP_LENGTH) {
        walk->value[WALK_FORWARD] = walk->value[WALK_STEP_LENGTH] / walk->value[WALK_STEP_TIME];
    } else if (index == WALK_FORWARD || index == WALK_STEP_TIME) {
        walk->value[WALK_STEP_LENGTH] = walk->value[WALK_FORWARD] * walk->value[WALK_STEP_TIME];
    } else if (index == WALK_HEADING || index == WALK_TURN) {
        walk->holds_heading = index == WALK_HEADING;
    }
}

/* ---- task ---- */

/* Creates the task's state and its balance controller. */
static enum error_code walk_create(struct task *task, struct arena *arena, struct error *error)
{
    struct walk *walk = arena_alloc(arena, 1, sizeof *walk);
    enum error_code code;

    if (!walk) {
        return error_set(error, ERROR_MEMORY, "no memory for the walk");
    }
    if (!task->config.walk || !task->config.body) {
        return error_set(error, ERROR_INPUT, "%s: the rig says nothing about it (tasks: walk)",
                         task->ops->name);
    }
    task->state = walk;
    if (task->ops == &task_walk) {
        const struct walk_config *config = task->config.walk;
        const struct gait_config *gait = &config->balance.gait;
        const char *const *name = walk_setting_name;
        double step_s = gait->swing_s + gait->transfer_s;
        const struct task_setting setting[WALK_SETTINGS] = {
            [WALK_ON] = {name[WALK_ON], "", 0, 1, true, 1},
            [WALK_FORWARD] = walk_rate(name[WALK_FORWARD], "m/s", -gait->reach_back_m / step_s,
                                       gait->reach_ahead_m / step_s, config->forward_m_s),
            [WALK_LEFT] = walk_rate(name[WALK_LEFT], "m/s", -gait->reach_out_m / step_s,
                                    gait->reach_out_m / step_s, config->left_m_s),
            [WALK_TURN] = walk_rate(name[WALK_TURN], "rad/s", -TURN_MOST_RAD_S, TURN_MOST_RAD_S,
                                    config->turn_rad_s),
            [WALK_HEADING] = {name[WALK_HEADING], "rad", -1e3, 1e3, false, 0},
            [WALK_STEP_TIME] = {name[WALK_STEP_TIME], "s", step_s / 2, step_s * 2, false, step_s},
            [WALK_STEP_LENGTH] = {name[WALK_STEP_LENGTH], "m", -gait->reach_back_m,
                                  gait->reach_ahead_m, false, config->forward_m_s * step_s},
        };

        /* Make the settings with their ranges and the rig's values */
        code = task_make_settings(task, setting, WALK_SETTINGS, arena, error);
        walk->value = task->value;
        if (code) {
            return code;
        }
    }
    return balance_create(&task->config.walk->balance, task->config.body, task->config.initial_rad,
                          task->host, task->servo, arena, &walk->balance, error);
}

static void walk_start(struct task *task)
{
    struct walk *walk = task->state;

    walk->last_s = 0;
    balance_start(walk->balance);
}

/* Returns `now` moved toward `goal` by at most `most`. */
static double walk_approach(double now, double goal, double most)
{
    return now + fmin(fmax(goal - now, -most), most);
}

/* Returns the turn rate (rad/s) that turns the next foot to the desired heading, relative to the
 * standing foot. Without it, a straight walk becomes a curve, because feet slip and land askew. */
static double walk_turn(struct walk *walk, const struct gait *gait)
{
    bool holds = walk->holds_heading;
    double rate = walk->value[WALK_TURN], off;

    if (!holds && rate != 0) {
        walk->kept_rad = gait->next.yaw;
        return rate;
    }
    off =
        (holds ? walk->value[WALK_HEADING] : walk->kept_rad) - gait->now.foot[gait->now.stance].yaw;
    rate = off / (HEADING_STEPS * walk->value[WALK_STEP_TIME]);
    return fmin(fmax(rate, -HEADING_RAD_S), HEADING_RAD_S);
}

/* Begins and ends stepping: at the user's setting, or when the walk of the rig is complete. */
static void walk_begin_or_halt(struct task *task, double t_s)
{
    struct walk *walk = task->state;
    const struct walk_config *config = task->config.walk;
    const struct gait *gait = balance_gait(walk->balance);
    const double *at = balance_estimate(walk->balance)->pelvis_m;
    double x = at[0] - walk->from_m[0], y = at[1] - walk->from_m[1];
    bool on = walk->value[WALK_ON] > 0 && balance_ready(walk->balance) && t_s > config->begin_s;

    /* Check whether the rig's number of steps or distance is reached */
    if (walk->command.step) {
        walk->arrived = walk->arrived || (config->distance_m > 0 &&
                                          x * x + y * y > config->distance_m * config->distance_m);
    }
    if (walk->command.step &&
        (walk->arrived ||
         (config->steps > 0 && gait->steps - walk->from_steps >= (uint64_t)config->steps))) {
        walk->value[WALK_ON] = 0;
        atomic_fetch_add(&task->changes, 1);
        on = false;
    }

    /* Begin only from standing at rest */
    if (on && !walk->command.step) {
        if (gait->now.phase != GAIT_STAND) {
            return;
        }
        walk->from_steps = gait->steps;
        walk->kept_rad = gait->now.yaw;
        memcpy(walk->from_m, at, sizeof walk->from_m);
        walk->arrived = false;
        walk->command = (struct gait_command){.step = true};
    }
    walk->command.step = on;
}

/* Runs one period of standing or walking: command, balance, verdict. */
static enum task_status walk_step(struct task *task, double t_s)
{
    struct walk *walk = task->state;
    const struct estimate *estimate = balance_estimate(walk->balance);
    const struct gait *gait = balance_gait(walk->balance);
    double dt = t_s - walk->last_s;

    walk->last_s = t_s;
    if (task->ops == &task_walk) {
        walk_begin_or_halt(task, t_s);

        /* Update the command of this period: two steps in place, then an acceleration. The
         * speed is limited so that no step exceeds the reach of the legs. */
        const struct gait_config *reach = &task->config.walk->balance.gait;
        struct gait_command *command = &walk->command;
        double step_s = walk->value[WALK_STEP_TIME], ahead = reach->reach_ahead_m / step_s;
        double back = reach->reach_back_m / step_s, out = reach->reach_out_m / step_s;
        double forward = fmin(fmax(walk->value[WALK_FORWARD], -back), ahead);
        double left = fmin(fmax(walk->value[WALK_LEFT], -out), out);

        if (command->step) {
            command->step_s = step_s;
            if (gait->steps - walk->from_steps >= 2) {
                command->forward_m_s =
                    walk_approach(command->forward_m_s, forward, SPEED_UP_M_S2 * dt);
                command->left_m_s = walk_approach(command->left_m_s, left, SPEED_UP_M_S2 * dt);
                command->turn_rad_s =
                    walk_approach(command->turn_rad_s, walk_turn(walk, gait), TURN_UP_RAD_S2 * dt);
            }
        }
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
    walk->stood_s = walk->arrived && gait->now.phase == GAIT_STAND ? walk->stood_s + dt : 0;
    return walk->stood_s > STOOD_S ? TASK_DONE : TASK_RUNNING;
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
    .step = walk_step,
    .endless = true,
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
    .endless = true,
    .signal_name = balance_signal_name,
    .nsignal = BALANCE_SIGNALS,
    .signals = walk_signals,
    .setting_name = walk_setting_name,
    .changed = walk_changed,
};
