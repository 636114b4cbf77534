/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Task squat: in each cycle, the hips sink vertically above flat feet and rise again (paper section
 * 7). Both legs are two-link chains in the sagittal plane, with hip pitch, knee and ankle pitch.
 * All other joints hold the initial pose. The verdict uses only telemetry: the feet must carry the
 * weight, and the motors must follow.
 */
#include "base/portable_math.h"
#include "tasks/task_private.h"

#include <string.h>

enum { LEGS = 2, HIP = 0, KNEE = 1, ANKLE = 2, PITCH_JOINTS = 3 };

static const char *const joint_name[LEGS][PITCH_JOINTS] = {
    {"RHipSag", "RKneeSag", "RAnkSag"},
    {"LHipSag", "LKneeSag", "LAnkSag"},
};

/* duration of the ramp from the present angles to the initial pose */
static const double RAMP_S = 1.0;
static const double SETTLE_S = 1.0; /* time of standing still before and after */
static const double WEIGH_S = 0.25; /* duration of the weighing, at the end of settling */
/* the robot has fallen if its feet carry less than this fraction of the weight */
static const double LIGHT = 0.3;
static const double LIGHT_S = 0.25;  /* for this time */
static const double STRAIGHT = 1e-6; /* limit of sin(knee angle) for a straight knee */

struct leg {
    size_t axis[PITCH_JOINTS];
    double initial[PITCH_JOINTS];
    double lean; /* forward lean of the trunk when the foot is flat, rad */
    /* height of the hip above the ankle; distance of the ankle in front of the hip */
    double hip_height, ankle_x;
};

/* Angles of a leg's pitch joints, rad, and their rates, rad/s. */
struct leg_pose {
    double angle[PITCH_JOINTS], rate[PITCH_JOINTS];
};

struct squat {
    struct leg leg[LEGS];
    bool alike; /* both legs have the same initial pose */
    double weight_sum;
    size_t weighed;
    double light_since_s; /* time since when the feet carry too little; < 0 = never */
    double deepest_m, worst_error_rad;
};

/* Returns the height of the hip above the ankle, m. thigh: pitch in the world, rad. knee: joint
 * angle, rad. */
static double squat_hip_height(const struct squat_config *config, double thigh, double knee)
{
    return config->thigh_m * portable_cos(thigh) + config->shank_m * portable_cos(thigh + knee);
}

/* Computes the joint angles and rates for a height of the hip (m) and its rate `rise` (m/s). The
 * knee bends forward, the foot is flat, and the trunk keeps its lean. Returns false if the height
 * is out of reach. */
static bool squat_leg_inverse(const struct squat_config *config, const struct leg *leg,
                              double height, double rise, struct leg_pose *pose)
{
    const double l1 = config->thigh_m, l2 = config->shank_m, ahead = leg->ankle_x;
    const double r2 = height * height + ahead * ahead;
    const double c = (r2 - l1 * l1 - l2 * l2) / (2 * l1 * l2); /* cosine of the knee's angle */
    double s, thigh, thigh_rate;

    if (!(fabs(c) <= 1)) {
        return false;
    }
    s = sqrt(1 - c * c);
    pose->angle[KNEE] = portable_acos(c);
    thigh = portable_atan2(-ahead, height) - portable_atan2(l2 * s, l1 + l2 * c);
    pose->angle[HIP] = thigh - leg->lean;
    pose->angle[ANKLE] = -thigh - pose->angle[KNEE];

    /* Compute the rates; they are 0 for a straight knee */
    pose->rate[KNEE] = s > STRAIGHT ? -height * rise / (l1 * l2 * s) : 0;
    thigh_rate = (ahead * rise - l2 * (l2 + l1 * c) * pose->rate[KNEE]) / r2;
    pose->rate[HIP] = thigh_rate;
    pose->rate[ANKLE] = -thigh_rate - pose->rate[KNEE];
    return true;
}

/* Finds the axes of a leg, and checks the joint limits at the deepest point. */
static enum error_code squat_find_leg(struct task *task, int side, struct leg *leg,
                                      struct error *error)
{
    const struct squat_config *config = &task->config.squat;
    struct leg_pose deepest;
    double thigh;

    for (int j = 0; j < PITCH_JOINTS; j++) {
        enum error_code code = task_find_axis(task, joint_name[side][j], &leg->axis[j], error);

        if (code) {
            return code;
        }
        leg->initial[j] = task->config.initial_rad[leg->axis[j]];
    }

    /* Compute lean and height of the initial pose, with a flat foot */
    leg->lean = -(leg->initial[HIP] + leg->initial[KNEE] + leg->initial[ANKLE]);
    thigh = leg->lean + leg->initial[HIP];
    leg->hip_height = squat_hip_height(config, thigh, leg->initial[KNEE]);
    leg->ankle_x = -config->thigh_m * portable_sin(thigh) -
                   config->shank_m * portable_sin(thigh + leg->initial[KNEE]);

    /* Check the deepest pose */
    if (!squat_leg_inverse(config, leg, leg->hip_height - config->depth_m, 0, &deepest)) {
        return error_set(error, ERROR_INPUT, "squat: depth %g m is out of the legs' reach",
                         config->depth_m);
    }
    for (int j = 0; j < PITCH_JOINTS; j++) {
        const struct host_axis *axis = &task->config.host.axis[leg->axis[j]];

        if (deepest.angle[j] < axis->lower_rad || deepest.angle[j] > axis->upper_rad) {
            return error_set(
                error, ERROR_INPUT,
                "squat: at depth %g m joint %s needs %.3f rad, its limits are %.3f to %.3f rad",
                config->depth_m, axis->joint, deepest.angle[j], axis->lower_rad, axis->upper_rad);
        }
    }
    return ERROR_NONE;
}

/* Creates the task's state and finds legs and feet. Returns ERROR_INPUT if one is missing. */
static enum error_code squat_create(struct task *task, struct arena *arena, struct error *error)
{
    const struct squat_config *config = &task->config.squat;
    struct squat *squat = arena_alloc(arena, 1, sizeof *squat);

    if (!squat) {
        return error_set(error, ERROR_MEMORY, "no memory for the squat");
    }
    if (config->thigh_m == 0) {
        return error_set(error, ERROR_INPUT, "squat: the rig has no squat (tasks: squat)");
    }
    if (!(config->thigh_m > 0 && config->shank_m > 0 && config->depth_m >= 0 &&
          config->period_s > 0 && config->cycles > 0)) {
        return error_set(error, ERROR_INPUT,
                         "squat: lengths, period and cycles must be greater than 0");
    }
    squat->light_since_s = -1;
    task->state = squat;
    for (int side = 0; side < LEGS; side++) {
        enum error_code code = squat_find_leg(task, side, &squat->leg[side], error);

        if (code) {
            return code;
        }
    }
    squat->alike =
        memcmp(squat->leg[0].initial, squat->leg[1].initial, sizeof squat->leg[0].initial) == 0;
    return task_find_feet(task, error);
}

/* Sets the references of both legs. t: time after the beginning of the first cycle, s. */
static void squat_bend_legs(struct task *task, double t)
{
    const struct squat *squat = task->state;
    const struct squat_config *config = &task->config.squat;
    const double length = config->period_s * config->cycles, pace = 2 * M_PI / config->period_s;
    double sine, cosine, sinking = 0, depth = 0;
    struct leg_pose pose;

    /* Compute the desired depth of the hips below the initial height, m, and its rate, m/s */
    if (t > 0 && t < length) {
        portable_sincos(pace * t, &sine, &cosine);
        sinking = config->depth_m / 2 * pace * sine;
        depth = config->depth_m / 2 * (1 - cosine);
    }

    for (int side = 0; side < LEGS; side++) {
        const struct leg *leg = &squat->leg[side];

        /* Every height is in reach, because the deepest point was checked. Legs with equal initial
         * poses have equal references */
        if (side == 0 || !squat->alike) {
            squat_leg_inverse(config, leg, leg->hip_height - depth, -sinking, &pose);
        }
        for (int j = 0; j < PITCH_JOINTS; j++) {
            servo_set(task->servo, leg->axis[j], pose.angle[j], pose.rate[j]);
        }
    }
}

/* Runs one period: the robot stands and is weighed, squats, then stands again. */
static enum task_status squat_step(struct task *task, double t)
{
    struct squat *squat = task->state;
    const struct squat_config *config = &task->config.squat;
    double begin = RAMP_S + SETTLE_S, length = config->period_s * config->cycles;
    double weight = squat->weighed ? squat->weight_sum / (double)squat->weighed : 0, depth = 0;

    /* Stand, then weigh the robot */
    task_move_pose(task, NULL, RAMP_S, t);
    if (t < begin) {
        if (t > begin - WEIGH_S) {
            squat->weight_sum += task_feet_force(task);
            squat->weighed++;
        }
        if (task->tells) {
            snprintf(task->message, sizeof task->message, "standing, feet carry %.1f N",
                     task_feet_force(task));
        }
        return TASK_RUNNING;
    }

    /* Bend and stretch, then stand again */
    squat_bend_legs(task, t - begin);
    if (!task_motors_follow(task, &squat->worst_error_rad)) {
        return TASK_FAILED;
    }
    if (task_feet_force(task) > LIGHT * weight) {
        squat->light_since_s = -1;
    } else if (squat->light_since_s < 0) {
        squat->light_since_s = t;
    } else if (t - squat->light_since_s > LIGHT_S) {
        snprintf(task->message, sizeof task->message,
                 "the robot fell: the feet carry %.0f N of %.0f N", task_feet_force(task), weight);
        return TASK_FAILED;
    }
    /* Compute the measured depth of the hips: mean of both legs, from the link encoders */
    for (int side = 0; side < LEGS; side++) {
        const struct leg *leg = &squat->leg[side];

        depth +=
            leg->hip_height -
            squat_hip_height(config, leg->lean + host_joint(task->host, leg->axis[HIP])->joint_rad,
                             host_joint(task->host, leg->axis[KNEE])->joint_rad);
    }
    depth /= LEGS;
    squat->deepest_m = fmax(squat->deepest_m, depth);
    if (t < begin + length + SETTLE_S) {
        if (task->tells) {
            int cycle = (int)fmin((t - begin) / config->period_s, config->cycles - 1);

            snprintf(task->message, sizeof task->message,
                     "cycle %d of %d, %.0f mm down, feet carry %.1f N", cycle + 1, config->cycles,
                     1e3 * depth, task_feet_force(task));
        }
        return TASK_RUNNING;
    }

    snprintf(task->message, sizeof task->message,
             "%d cycles done, %.1f mm deep, worst motor error %.1f mrad, feet carry %.1f N (%.1f N "
             "before)",
             config->cycles, 1e3 * squat->deepest_m, 1e3 * squat->worst_error_rad,
             task_feet_force(task), weight);
    return TASK_DONE;
}

const struct task_ops task_squat = {
    .name = "squat",
    .summary = "knees bend and the hips sink over flat feet, cycle after cycle",
    .create = squat_create,
    .step = squat_step,
};
