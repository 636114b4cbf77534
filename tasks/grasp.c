/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Task grasp: both arms move symmetrically along a path of motor angles, press an object between
 * the wrists and lift it (paper section 6). All other joints hold the initial pose.
 *
 * The verdict uses only telemetry. While the grip is closed, both wrists must press, and the motors
 * must follow. If the feet carry the robot before the grasp, they must carry it until the end. At
 * the end, the wrists must carry the object's weight by friction.
 */
#include "base/portable_math.h"
#include "tasks/task_private.h"

#include <string.h>

enum { RIGHT, LEFT, SIDES };

static const char *const joint_name[SIDES][GRASP_JOINTS] = {
    {"RShSag", "RShLat", "RShYaw", "RElbj"},
    {"LShSag", "LShLat", "LShYaw", "LElbj"},
};
static const double mirrored[GRASP_JOINTS] = {1, -1, -1, 1}; /* the left arm's angles */
static const char *const wrist_name[SIDES] = {"r_arm_ft", "l_arm_ft"};

static const double WEIGH_S = 0.2; /* duration of the weighing, at the end of settling */
/* the robot has fallen if its feet carry less than this fraction of the weight for LOST_S */
static const double LIGHT = 0.3;
static const double LOST_S = 0.05; /* duration of too little load or grip that counts */

struct grasp {
    size_t axis[SIDES][GRASP_JOINTS], wrist[SIDES];
    double feet_sum, wrist_sum[SIDES][3]; /* sums of the forces before the grasp */
    size_t weighed;
    size_t phase; /* phase of the path */
    /* sum of the samples of the force that both wrists carry in the final hold */
    double carried_sum;
    size_t carried_count;
    double least_n; /* smallest force of a wrist while the grip was closed */
    double fine_s;  /* last time without a problem */
    double worst_error_rad;
};

/* Finds the axes of an arm and checks that all points of the path are within their limits. */
static enum error_code grasp_find_arm(struct task *task, int side, struct error *error)
{
    const struct grasp_config *config = &task->config.grasp;
    struct grasp *grasp = task->state;

    for (int k = 0; k < GRASP_JOINTS; k++) {
        enum error_code code =
            task_find_axis(task, joint_name[side][k], &grasp->axis[side][k], error);
        const struct host_axis *axis;

        if (code) {
            return code;
        }
        axis = &task->config.host.axis[grasp->axis[side][k]];
        for (size_t i = 0; i < config->nphase; i++) {
            double angle = config->phase[i].arm_rad[k] * (side == LEFT ? mirrored[k] : 1);

            if (angle < axis->lower_rad || angle > axis->upper_rad) {
                return error_set(
                    error, ERROR_INPUT,
                    "grasp: phase %s needs joint %s at %.3f rad, its limits are %.3f to %.3f rad",
                    config->phase[i].name, axis->joint, angle, axis->lower_rad, axis->upper_rad);
            }
        }
    }
    return ERROR_NONE;
}

/* Creates the task's state and finds arms, wrists and feet. Returns ERROR_INPUT if one is
 * missing. */
static enum error_code grasp_create(struct task *task, struct arena *arena, struct error *error)
{
    const struct grasp_config *config = &task->config.grasp;
    struct grasp *grasp = arena_alloc(arena, 1, sizeof *grasp);
    enum error_code code = ERROR_NONE;

    if (!grasp) {
        return error_set(error, ERROR_MEMORY, "no memory for the grasp");
    }
    grasp->least_n = HUGE_VAL;
    task->state = grasp;

    /* Check that the rig has a path, and that the end times of its phases increase */
    if (config->nphase == 0) {
        return error_set(error, ERROR_INPUT, "grasp: the rig has no path for it (tasks: grasp)");
    }
    for (size_t i = 0; i < config->nphase; i++) {
        const struct grasp_phase *phase = &config->phase[i];

        if (!(phase->until_s > (i ? config->phase[i - 1].until_s : 0))) {
            return error_set(error, ERROR_INPUT,
                             "grasp: phase %s ends at %g s, expected later than the one before",
                             phase->name, phase->until_s);
        }
    }
    for (int side = 0; side < SIDES && !code; side++) {
        code = grasp_find_arm(task, side, error);
        code = code ? code : task_find_force(task, wrist_name[side], &grasp->wrist[side], error);
    }
    return code ? code : task_find_feet(task, error);
}

/* Sets the references of both arms for time t of the piecewise linear path. Sets grasp->phase. */
static void grasp_move_arms(struct task *task, double t)
{
    const struct grasp *grasp = task->state;
    const struct grasp_phase *to = &task->config.grasp.phase[grasp->phase];
    double begin = grasp->phase ? to[-1].until_s : 0, length = to->until_s - begin;
    double s = fmin((t - begin) / length, 1);

    for (int side = 0; side < SIDES; side++) {
        for (int k = 0; k < GRASP_JOINTS; k++) {
            size_t axis = grasp->axis[side][k];
            double sign = side == LEFT ? mirrored[k] : 1;
            double end = sign * to->arm_rad[k];
            double start = grasp->phase ? sign * to[-1].arm_rad[k] : task->config.initial_rad[axis];

            servo_set(task->servo, axis, start + s * (end - start),
                      s < 1 ? (end - start) / length : 0);
        }
    }
}

/* Computes the force on a wrist's sensor in the torso's axes, N. The forearm is rotated by the
 * shoulder's pitch, roll and yaw, and by the elbow. */
static void grasp_wrist_force(const struct task *task, int side, double force[3])
{
    static const int about[GRASP_JOINTS] = {1, 0, 2, 1};
    const struct grasp *grasp = task->state;

    memcpy(force, host_force(task->host, grasp->wrist[side])->force_n, 3 * sizeof *force);
    for (int k = GRASP_JOINTS - 1; k >= 0; k--) {
        double angle = host_joint(task->host, grasp->axis[side][k])->joint_rad;
        double *a = &force[(about[k] + 1) % 3], *b = &force[(about[k] + 2) % 3], old = *a;

        *a = portable_cos(angle) * old - portable_sin(angle) * *b;
        *b = portable_sin(angle) * old + portable_cos(angle) * *b;
    }
}

/* Computes the force on a wrist minus the wrist's force before the grasp, torso's axes, N. */
static void grasp_hand_force(const struct task *task, int side, double force[3])
{
    const struct grasp *grasp = task->state;

    grasp_wrist_force(task, side, force);
    for (int k = 0; k < 3; k++) {
        force[k] -= grasp->wrist_sum[side][k] / (double)grasp->weighed;
    }
}

/* Returns the force of a wrist toward the other wrist, N. */
static double grasp_press_force(const struct task *task, int side)
{
    double force[3];

    grasp_hand_force(task, side, force);
    return side == RIGHT ? -force[1] : force[1];
}

/* Returns the robot's weight on its feet before the grasp, N; 0 if the base is held and the feet
 * hang. */
static double grasp_weight(const struct grasp *grasp)
{
    return fmax(grasp->feet_sum / (double)grasp->weighed, 0);
}

/* Checks motors, feet and grip. Returns false, with a message, if the robot has fallen or has lost
 * the object. */
static bool grasp_is_healthy(struct task *task, double t)
{
    struct grasp *grasp = task->state;
    const struct grasp_config *config = &task->config.grasp;
    bool closed = config->phase[grasp->phase].closed;
    double least = fmin(grasp_press_force(task, RIGHT), grasp_press_force(task, LEFT));
    bool lost = closed && config->least_press_n > 0 && least < config->least_press_n;
    bool fallen = grasp_weight(grasp) > 0 && task_feet_force(task) < LIGHT * grasp_weight(grasp);

    if (!task_motors_follow(task, &grasp->worst_error_rad)) {
        return false;
    }

    /* A loss counts only after LOST_S; fine_s is the last time without a loss */
    if (closed) {
        grasp->least_n = fmin(grasp->least_n, least);
    }
    if (!fallen && !lost) {
        grasp->fine_s = t;
    } else if (t - grasp->fine_s > LOST_S && fallen) {
        snprintf(task->message, sizeof task->message,
                 "the robot fell: the feet carry %.0f N of %.0f N", task_feet_force(task),
                 grasp_weight(grasp));
        return false;
    } else if (t - grasp->fine_s > LOST_S) {
        snprintf(task->message, sizeof task->message,
                 "the grip is lost: the wrists press with %.1f N (right) and %.1f N (left), "
                 "expected %.1f N at least",
                 grasp_press_force(task, RIGHT), grasp_press_force(task, LEFT),
                 config->least_press_n);
        return false;
    }
    return true;
}

/* Returns the force that both wrists carry, N. */
static double grasp_carried_force(const struct task *task)
{
    double right[3], left[3];

    grasp_hand_force(task, RIGHT, right);
    grasp_hand_force(task, LEFT, left);
    return -right[2] - left[2];
}

static void grasp_describe(struct task *task, const char *doing)
{
    snprintf(task->message, sizeof task->message,
             "%s: wrists press with %.1f N and %.1f N and carry %.1f N", doing,
             grasp_press_force(task, RIGHT), grasp_press_force(task, LEFT),
             grasp_carried_force(task));
}

/* Runs one period: settle and weigh, move along the path, hold, judge. */
static enum task_status grasp_step(struct task *task, double t)
{
    struct grasp *grasp = task->state;
    const struct grasp_config *config = &task->config.grasp;
    double end = config->phase[config->nphase - 1].until_s, force[3];

    /* Stand, so that the sensors measure the robot's own weight */
    task_move_pose(task, NULL, config->settle_s / 2, t);
    /* Weigh at least once, also if the computer stalls during the weighing time */
    if (t < config->settle_s || !grasp->weighed) {
        if (t > config->settle_s - WEIGH_S) {
            for (int side = 0; side < SIDES; side++) {
                grasp_wrist_force(task, side, force);
                for (int k = 0; k < 3; k++) {
                    grasp->wrist_sum[side][k] += force[k];
                }
            }
            grasp->feet_sum += task_feet_force(task);
            grasp->weighed++;
        }
        if (task->tells) {
            snprintf(task->message, sizeof task->message, "settling, feet carry %.1f N",
                     task_feet_force(task));
        }
        return TASK_RUNNING;
    }

    /* Follow the path, then stand still with the object */
    t -= config->settle_s;
    while (grasp->phase + 1 < config->nphase && t >= config->phase[grasp->phase].until_s) {
        grasp->phase++;
    }
    grasp_move_arms(task, t);
    if (!grasp_is_healthy(task, t)) {
        return TASK_FAILED;
    }
    if (t < end + config->hold_s) {
        if (t > end) {
            grasp->carried_sum += grasp_carried_force(task);
            grasp->carried_count++;
        }
        if (task->tells) {
            grasp_describe(task, t > end ? "hold" : config->phase[grasp->phase].name);
        }
        return TASK_RUNNING;
    }

    /* The final verdict, after a grip without loss: the wrists must carry the object */
    double least = task->config.grasp.least_carry_n;
    double mean =
        grasp->carried_count ? grasp->carried_sum / (double)grasp->carried_count : HUGE_VAL;

    if (least > 0 && !(mean >= least)) {
        snprintf(task->message, sizeof task->message,
                 "not lifted: the wrists carry %.1f N, expected %.1f N at least", mean, least);
        return TASK_FAILED;
    }
    grasp_describe(task, "held to the end");
    snprintf(task->message + strlen(task->message), sizeof task->message - strlen(task->message),
             "; pressed with %.1f N at least, worst motor error %.1f mrad", grasp->least_n,
             1e3 * grasp->worst_error_rad);
    return TASK_DONE;
}

const struct task_ops task_grasp = {
    .name = "grasp",
    .summary = "both arms press an object between the wrists and lift it; for the grasp rigs",
    .create = grasp_create,
    .step = grasp_step,
};
