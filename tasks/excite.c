/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Task excite: a sum of sines moves one joint about the initial pose. All other joints hold the
 * pose. The command identify (docs/identify.md) fits a drive to the recording.
 *
 * The sines are added to the position loop's voltage, or to its reference. The frequencies form a
 * geometric series. Sines of the reference have equal peak speeds; sines of the voltage have equal
 * amplitudes. Schroeder's phases (IEEE Trans. Inf. Theory 16, 1970) keep the peaks low. The sum of
 * the amplitudes is the setting, so no peak exceeds the setting. The task fails if the joint
 * reaches a limit.
 */
#include "base/portable_math.h"
#include "tasks/task_private.h"

enum excite_setting {
    EXCITE_AMPLITUDE_V,
    EXCITE_AMPLITUDE_RAD,
    EXCITE_FROM,
    EXCITE_TO,
    EXCITE_SINES,
    EXCITE_DURATION,
    EXCITE_SETTINGS
};

enum { EXCITE_SINES_MAX = 32 };

static const double EXCITE_POSE_S = 1.0; /* duration of the ramp into the pose */
static const double EXCITE_RAMP_S = 1.0; /* duration of the amplitude's ramp, up and down */
/* highest frequency as a fraction of the command rate */
static const double EXCITE_NYQUIST = 0.25;
static const double EXCITE_MOST_RAD = M_PI; /* largest amplitude */
static const double EXCITE_MOST_S = 3600;   /* longest duration */

/* Copy of the settings at the beginning, because a user may change them later. */
struct excite {
    size_t axis;
    size_t nsine; /* 0 until the excitation begins */
    double amplitude[EXCITE_SINES_MAX], w[EXCITE_SINES_MAX], phase[EXCITE_SINES_MAX];
    double duration_s;
    bool by_angle; /* excites the reference instead of the voltage */
};

/* ---- settings ---- */

static const char *const excite_setting_name[EXCITE_SETTINGS + 1] = {
    [EXCITE_AMPLITUDE_V] = "excite.amplitude_v",
    [EXCITE_AMPLITUDE_RAD] = "excite.amplitude_rad",
    [EXCITE_FROM] = "excite.from_hz",
    [EXCITE_TO] = "excite.to_hz",
    [EXCITE_SINES] = "excite.sines",
    [EXCITE_DURATION] = "excite.duration_s",
};

/* ---- the task ---- */

/* Creates the task's state and finds the joint. The supply voltage limits the amplitude, and the
 * command rate limits the frequencies. Returns ERROR_INPUT if the joint is missing or unknown. */
static enum error_code excite_create(struct task *task, struct arena *arena, struct error *error)
{
    const struct task_config *config = &task->config;
    const double period_s =
        1e-9 * fmax((double)config->servo.command_period_ns, (double)config->host.period_ns);
    const double most_hz = EXCITE_NYQUIST / period_s, volts = config->host.supply_v;
    const char *const *name = excite_setting_name;
    const struct task_setting setting[EXCITE_SETTINGS] = {
        [EXCITE_AMPLITUDE_V] = {name[EXCITE_AMPLITUDE_V], "V", 0, volts, false, volts / 10},
        [EXCITE_AMPLITUDE_RAD] = {name[EXCITE_AMPLITUDE_RAD], "rad", 0, EXCITE_MOST_RAD, false, 0},
        [EXCITE_FROM] = {name[EXCITE_FROM], "Hz", 0.01, most_hz, false, 0.2},
        [EXCITE_TO] = {name[EXCITE_TO], "Hz", 0.01, most_hz, false, fmin(4, most_hz)},
        [EXCITE_SINES] = {name[EXCITE_SINES], "", 1, EXCITE_SINES_MAX, true, 8},
        [EXCITE_DURATION] = {name[EXCITE_DURATION], "s", 2 * EXCITE_RAMP_S, EXCITE_MOST_S, false,
                             10},
    };
    struct excite *excite = arena_alloc(arena, 1, sizeof *excite);
    enum error_code code = task_make_settings(task, setting, EXCITE_SETTINGS, arena, error);

    if (!excite || code) {
        return error_set(error, ERROR_MEMORY, "no memory for the excitation");
    }
    task->state = excite;
    return task_find_input_axis(task, &excite->axis, error);
}

/* Makes the sines. Returns false, with a message, if there are none, or if they would exceed the
 * joint's limits. */
static bool excite_begin(struct task *task)
{
    struct excite *excite = task->state;
    const double radians = task->value[EXCITE_AMPLITUDE_RAD];
    const double amplitude = radians > 0 ? radians : task->value[EXCITE_AMPLITUDE_V];
    const double from = task->value[EXCITE_FROM], ratio = task->value[EXCITE_TO] / from;
    double sum = 0;

    if (!(amplitude > 0)) {
        snprintf(task->message, sizeof task->message, "joint %s: the amplitude is 0",
                 task->config.input.joint);
        return false;
    }
    if (radians > 0 && !task_can_swing(task, excite->axis, radians)) {
        return false;
    }
    excite->by_angle = radians > 0;
    excite->duration_s = task->value[EXCITE_DURATION];
    excite->nsine = (size_t)task->value[EXCITE_SINES];
    for (size_t k = 0; k < excite->nsine; k++) {
        const double last = (double)excite->nsine - 1;
        const double hz = last > 0 ? from * portable_pow(ratio, (double)k / last) : from;

        excite->w[k] = 2 * M_PI * hz;
        excite->phase[k] = M_PI * (double)(k * k) / (double)excite->nsine;
        excite->amplitude[k] = excite->by_angle ? 1 / hz : 1;
        sum += excite->amplitude[k];
    }
    for (size_t k = 0; k < excite->nsine; k++) {
        excite->amplitude[k] *= amplitude / sum;
    }
    return true;
}

/* Sets the joint's reference or voltage at time t_s of the excitation. */
static void excite_move(struct task *task, double t_s)
{
    const struct excite *excite = task->state;
    const double part = fmin(fmin(t_s, excite->duration_s - t_s) / EXCITE_RAMP_S, 1);
    double angle = 0, rate = 0, sine, cosine, share, growth = 0;

    for (size_t k = 0; k < excite->nsine; k++) {
        portable_sincos(excite->w[k] * t_s + excite->phase[k], &sine, &cosine);
        angle += excite->amplitude[k] * sine;
        rate += excite->amplitude[k] * excite->w[k] * cosine;
    }

    /* Ramp the amplitude smoothly at both ends */
    share = part > 0 ? part * part * (3 - 2 * part) : 0;
    if (part > 0 && part < 1) {
        growth = 6 * part * (1 - part) / EXCITE_RAMP_S * (2 * t_s < excite->duration_s ? 1 : -1);
    }
    if (excite->by_angle) {
        servo_set(task->servo, excite->axis, task->config.initial_rad[excite->axis] + share * angle,
                  share * rate + growth * angle);
    } else {
        servo_excite(task->servo, excite->axis, share * angle);
    }
}

/* Runs one period: first the ramp into the pose, then the excitation. */
static enum task_status excite_step(struct task *task, double t_s)
{
    struct excite *excite = task->state;
    const struct host_axis *axis = &task->config.host.axis[excite->axis];
    const double angle = host_joint(task->host, excite->axis)->joint_rad;
    double worst = 0;

    /* Fail at the joint's limits. Fail if a motor does not follow, except with sines in the
     * voltage */
    if (!(angle > axis->lower_rad && angle < axis->upper_rad)) {
        snprintf(task->message, sizeof task->message,
                 "joint %s: %.3g rad is at its limits, %.3g to %.3g rad; less amplitude is needed",
                 axis->joint, angle, axis->lower_rad, axis->upper_rad);
        return TASK_FAILED;
    }
    if ((excite->nsine == 0 || excite->by_angle) && !task_motors_follow(task, &worst)) {
        return TASK_FAILED;
    }
    if (t_s < EXCITE_POSE_S) {
        task_move_pose(task, NULL, EXCITE_POSE_S, t_s);
        return TASK_RUNNING;
    }
    if (excite->nsine == 0 && !excite_begin(task)) {
        return TASK_FAILED;
    }
    excite_move(task, t_s - EXCITE_POSE_S);
    if (t_s >= EXCITE_POSE_S + excite->duration_s || task->tells) {
        snprintf(task->message, sizeof task->message, "joint %s: %.1f of %.1f s, %zu sines",
                 task->config.input.joint, fmin(t_s - EXCITE_POSE_S, excite->duration_s),
                 excite->duration_s, excite->nsine);
    }
    return t_s < EXCITE_POSE_S + excite->duration_s ? TASK_RUNNING : TASK_DONE;
}

const struct task_ops task_excite = {
    .name = "excite",
    .summary = "a sum of sines on one joint: a recording to identify its drive from",
    .create = excite_create,
    .step = excite_step,
    .setting_name = excite_setting_name,
};
