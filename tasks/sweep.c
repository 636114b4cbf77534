/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sweep: identification of one drive by sines, one frequency after the other, around the initial
 * pose; all other joints hold it. A voltage is added to what the position loop gives the motor, or
 * the loop's reference moves. The loop stays closed, so that the joint does not drift away: with a
 * periodic excitation the ratio of what was measured to what was sent is that of the drive,
 * whatever the loop adds (L. Ljung, System Identification, 2nd edition, chapter 13.5: the
 * joint input-output approach).
 *
 * Signals are taken when their frames arrive, and the voltage as what it is, constant from command
 * to command: a response holds the drive, the board and the bus, and neither the sampling of the
 * host nor the hold of its commands.
 */
#include "base/portable_math.h"
#include "tasks/sine_fit.h"
#include "tasks/task_private.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum sweep_setting {
    SWEEP_AMPLITUDE_V,
    SWEEP_AMPLITUDE_RAD,
    SWEEP_FROM,
    SWEEP_TO,
    SWEEP_POINTS,
    SWEEP_SETTLE_PERIODS,
    SWEEP_SETTLE,
    SWEEP_MEASURE_PERIODS,
    SWEEP_SETTINGS,
};

static const double SWEEP_RAMP_S = 1.0;   /* duration of the ramp from where the joints were to
                                           * the pose */
static const double SWEEP_STAND_S = 1.0;  /* time of standing still before the first frequency */
static const double SWEEP_NYQUIST = 0.25; /* highest frequency, as a fraction of the commands'
                                           * rate */

/* A copy of the settings at the beginning of a point, since they may change meanwhile. */
struct sweep_now {
    double volts, radians; /* amplitudes, one of them 0 */
    double hz, from_s;     /* phase 0 at from_s, the beginning of the settling */
    double measure_s, end_s;
};

struct sweep {
    size_t axis;
    double *from; /* joint angles at the start */
    struct task_setting setting[SWEEP_SETTINGS];
    _Atomic double value[SWEEP_SETTINGS]; /* another thread writes them */
    struct sweep_now now;
    size_t npoint;
    struct sweep_point point[SWEEP_POINTS_MAX];
    struct sine_fit input, output[SWEEP_RESPONSES];
    int64_t seen_ns[SWEEP_RESPONSES]; /* time of the newest sample */
    double last_s;                    /* time of the last step */
};

/* ---- settings ---- */

static const char *const sweep_setting_name[SWEEP_SETTINGS + 1] = {
    [SWEEP_AMPLITUDE_V] = "sweep.amplitude_v",
    [SWEEP_AMPLITUDE_RAD] = "sweep.amplitude_rad",
    [SWEEP_FROM] = "sweep.from_hz",
    [SWEEP_TO] = "sweep.to_hz",
    [SWEEP_POINTS] = "sweep.points",
    [SWEEP_SETTLE_PERIODS] = "sweep.settle_periods",
    [SWEEP_SETTLE] = "sweep.settle_s",
    [SWEEP_MEASURE_PERIODS] = "sweep.measure_periods",
};

/* Makes the settings with their ranges and defaults: amplitudes by the supply, frequencies by
 * the commands' rate. */
static void sweep_make_settings(struct sweep *sweep, const struct task_config *config)
{
    double period_s = 1e-9 * (double)(config->servo.command_period_ns > config->host.period_ns
                                          ? config->servo.command_period_ns
                                          : config->host.period_ns);
    double most_hz = SWEEP_NYQUIST / period_s, volts = config->host.supply_v;
    const struct task_setting setting[SWEEP_SETTINGS] = {
        [SWEEP_AMPLITUDE_V] = {sweep_setting_name[SWEEP_AMPLITUDE_V], "V", 0, volts, false},
        [SWEEP_AMPLITUDE_RAD] = {sweep_setting_name[SWEEP_AMPLITUDE_RAD], "rad", 0, 0.5, false},
        [SWEEP_FROM] = {sweep_setting_name[SWEEP_FROM], "Hz", 0.01, most_hz, false},
        [SWEEP_TO] = {sweep_setting_name[SWEEP_TO], "Hz", 0.01, most_hz, false},
        [SWEEP_POINTS] = {sweep_setting_name[SWEEP_POINTS], "", 1, SWEEP_POINTS_MAX, true},
        [SWEEP_SETTLE_PERIODS] = {sweep_setting_name[SWEEP_SETTLE_PERIODS], "", 0, 1000, true},
        [SWEEP_SETTLE] = {sweep_setting_name[SWEEP_SETTLE], "s", 0, 60, false},
        [SWEEP_MEASURE_PERIODS] = {sweep_setting_name[SWEEP_MEASURE_PERIODS], "", 2, 1000, true},
    };

    memcpy(sweep->setting, setting, sizeof setting);
    sweep->value[SWEEP_AMPLITUDE_V] = volts / 20;
    sweep->value[SWEEP_FROM] = 0.5;
    sweep->value[SWEEP_TO] = fmin(20, most_hz);
    sweep->value[SWEEP_POINTS] = 20;
    sweep->value[SWEEP_SETTLE_PERIODS] = 4;
    sweep->value[SWEEP_SETTLE] = 0.5;
    sweep->value[SWEEP_MEASURE_PERIODS] = 8;
}

static size_t sweep_settings(const struct task *task, const struct task_setting **setting)
{
    const struct sweep *sweep = task->state;

    *setting = sweep->setting;
    return SWEEP_SETTINGS;
}

static void sweep_set(struct task *task, size_t index, double value)
{
    struct sweep *sweep = task->state;

    sweep->value[index] = value;
}

static double sweep_get(const struct task *task, size_t index)
{
    const struct sweep *sweep = task->state;

    return sweep->value[index];
}

/* ---- the task ---- */

/* Creates the task's state and finds the joint. ERROR_INPUT when it is not named or not there. */
static enum error_code sweep_create(struct task *task, struct arena *arena, struct error *error)
{
    struct sweep *sweep = arena_alloc(arena, 1, sizeof *sweep);
    double *from = arena_alloc(arena, task->config.host.naxis, sizeof *from);

    if (!sweep || !from) {
        return error_set(error, ERROR_MEMORY, "no memory for the sweep");
    }
    if (!task->config.input.joint) {
        return error_set(error, ERROR_INPUT, "sweep: found no joint, expected one by --joint");
    }
    sweep->from = from;
    task->state = sweep;
    sweep_make_settings(sweep, &task->config);
    return task_find_axis(task, task->config.input.joint, &sweep->axis, error);
}

static void sweep_start(struct task *task)
{
    struct sweep *sweep = task->state;

    for (size_t i = 0; i < task->config.host.naxis; i++) {
        sweep->from[i] = servo_wanted(task->servo, i);
    }
    sweep->npoint = 0;
    sweep->now = (struct sweep_now){.end_s = SWEEP_RAMP_S + SWEEP_STAND_S};
}

/* Returns the frequency of a point, Hz: points are at equal ratios. */
static double sweep_frequency(const struct sweep *sweep, size_t point)
{
    double from = sweep->value[SWEEP_FROM], to = sweep->value[SWEEP_TO];
    double last = sweep->value[SWEEP_POINTS] - 1;

    return last > 0 ? from * portable_pow(to / from, fmin((double)point / last, 1)) : from;
}

/* Begins the next frequency at t_s. Returns false with a message when the amplitude is 0 or
 * leaves the joint's limits. */
static bool sweep_begin_point(struct task *task, double t_s)
{
    struct sweep *sweep = task->state;
    const struct host_axis *axis = &task->config.host.axis[sweep->axis];
    double hz, settle;
    struct sweep_now *now = &sweep->now;

    /* Whole periods, so that the excitation never jumps */
    hz = sweep_frequency(sweep, sweep->npoint);
    settle = fmax(sweep->value[SWEEP_SETTLE_PERIODS], ceil(sweep->value[SWEEP_SETTLE] * hz));
    *now = (struct sweep_now){.hz = hz, .from_s = t_s};
    now->measure_s = t_s + settle / hz;
    now->end_s = now->measure_s + sweep->value[SWEEP_MEASURE_PERIODS] / hz;
    now->radians = sweep->value[SWEEP_AMPLITUDE_RAD];
    now->volts = now->radians > 0 ? 0 : sweep->value[SWEEP_AMPLITUDE_V];
    sine_fit_start(&sweep->input);
    for (int k = 0; k < SWEEP_RESPONSES; k++) {
        sine_fit_start(&sweep->output[k]);
    }

    if (!(now->radians > 0 || now->volts > 0)) {
        snprintf(task->message, sizeof task->message, "joint %s: the amplitude is 0", axis->joint);
        return false;
    }
    return !(now->radians > 0) || task_can_swing(task, sweep->axis, now->radians);
}

/* Sets the excitation of this step: a voltage, or the reference. */
static void sweep_excite(struct task *task, double t_s)
{
    const struct sweep *sweep = task->state;
    double w = 2 * M_PI * sweep->now.hz, sine, cosine;

    portable_sincos(w * (t_s - sweep->now.from_s), &sine, &cosine);
    servo_excite(task->servo, sweep->axis, sweep->now.volts * sine);
    servo_set(task->servo, sweep->axis,
              task->config.initial_rad[sweep->axis] + sweep->now.radians * sine,
              sweep->now.radians * w * cosine);
}

/* ---- measuring ---- */

/* Adds a sample to a fit: taken at t_s, or a mean over hold_s about it. */
static void sweep_sample(const struct sweep *sweep, struct sine_fit *fit, double t_s, double hold_s,
                         double value)
{
    const struct sweep_now *now = &sweep->now;
    double x = M_PI * now->hz * hold_s;

    if (t_s >= now->measure_s && t_s <= now->end_s) {
        sine_fit_add(fit, 2 * M_PI * now->hz * (t_s - now->from_s),
                     2 * (t_s - now->measure_s) / (now->end_s - now->measure_s) - 1,
                     x > 0 ? portable_sin(x) / x : 1, value);
    }
}

/* Adds what was sent since the last step to the input, and what has arrived since to the
 * outputs. */
static void sweep_measure(struct task *task, double t_s)
{
    struct sweep *sweep = task->state;
    const struct host_joint *joint = host_joint(task->host, sweep->axis);
    const double value[SWEEP_RESPONSES] = {[SWEEP_JOINT] = joint->joint_rad,
                                           [SWEEP_MOTOR] = joint->motor_rad,
                                           [SWEEP_TORQUE] = joint->torque_nm};
    const int64_t time_ns[SWEEP_RESPONSES] = {[SWEEP_JOINT] = joint->joint_time_ns,
                                              [SWEEP_MOTOR] = joint->motor_time_ns,
                                              [SWEEP_TORQUE] = joint->torque_time_ns};
    double held = t_s - sweep->last_s;

    /* The input: the reference now, or the voltage as it was held since the last step */
    if (sweep->now.radians > 0) {
        double sine = portable_sin(2 * M_PI * sweep->now.hz * (t_s - sweep->now.from_s));

        sweep_sample(sweep, &sweep->input, t_s, 0, sweep->now.radians * sine);
    } else {
        sweep_sample(sweep, &sweep->input, t_s - held / 2, held,
                     host_voltage(task->host, sweep->axis));
    }
    /* The outputs, each at the time of its frame */
    for (int k = 0; k < SWEEP_RESPONSES; k++) {
        if (time_ns[k] >= 0 && time_ns[k] != sweep->seen_ns[k]) {
            sweep_sample(sweep, &sweep->output[k], (double)(time_ns[k] - task->start_ns) * 1e-9, 0,
                         value[k]);
            sweep->seen_ns[k] = time_ns[k];
        }
    }
}

/* Returns the ratio of two sines as complex numbers a - i b. */
static struct sweep_response sweep_divide(const struct sine *output, const struct sine *input)
{
    double square = input->cosine * input->cosine + input->sine * input->sine;
    double re = output->cosine * input->cosine + output->sine * input->sine;
    double im = output->cosine * input->sine - output->sine * input->cosine;

    return (struct sweep_response){
        .magnitude = square > 0 ? sqrt(re * re + im * im) / square : 0,
        .phase_rad = portable_atan2(im, re),
        .coherence = square > 0 ? output->coherence : 0,
    };
}

/* Computes the responses of the point that has ended. */
static void sweep_end_point(struct sweep *sweep)
{
    struct sweep_point *point = &sweep->point[sweep->npoint++];
    struct sine input, output;

    sine_fit_solve(&sweep->input, &input);
    point->frequency_hz = sweep->now.hz;
    point->by_angle = sweep->now.radians > 0;
    point->input = sqrt(input.cosine * input.cosine + input.sine * input.sine);
    for (int k = 0; k < SWEEP_RESPONSES; k++) {
        sine_fit_solve(&sweep->output[k], &output);
        point->response[k] = sweep_divide(&output, &input);
    }
}

/* Writes the message at the end, with the frequency at which the joint's torque responds most. */
static void sweep_tell_end(struct task *task)
{
    const struct sweep *sweep = task->state;
    const struct sweep_point *peak = &sweep->point[0];

    for (size_t i = 1; i < sweep->npoint; i++) {
        const struct sweep_point *point = &sweep->point[i];

        if (point->response[SWEEP_TORQUE].magnitude > peak->response[SWEEP_TORQUE].magnitude) {
            peak = point;
        }
    }
    snprintf(task->message, sizeof task->message,
             "joint %s: %zu frequencies, %.3g to %.3g Hz; most torque at %.3g Hz, %.3g N m/%s",
             task->config.input.joint, sweep->npoint, sweep->point[0].frequency_hz,
             sweep->point[sweep->npoint - 1].frequency_hz, peak->frequency_hz,
             peak->response[SWEEP_TORQUE].magnitude, peak->by_angle ? "rad" : "V");
}

/* Runs one period: the pose, then one frequency after the other. */
static enum task_status sweep_step(struct task *task, double t_s)
{
    struct sweep *sweep = task->state;
    double worst = 0;

    /* Into the pose; from there on only the one joint moves */
    if (sweep->now.hz > 0) {
        sweep_measure(task, t_s);
    } else {
        task_hold_pose(task, sweep->from, SWEEP_RAMP_S, t_s);
    }
    sweep->last_s = t_s;
    if (!task_motors_follow(task, &worst)) {
        return TASK_FAILED;
    }
    /* A point is over: evaluate it, then begin the next one or end */
    if (t_s >= sweep->now.end_s) {
        if (sweep->now.hz > 0) {
            sweep_end_point(sweep);
        }
        if (sweep->npoint > 0 && (double)sweep->npoint >= sweep->value[SWEEP_POINTS]) {
            sweep_tell_end(task);
            return TASK_DONE;
        }
        if (!sweep_begin_point(task, t_s)) {
            return TASK_FAILED;
        }
    }
    /* Excite, and tell the progress */
    if (sweep->now.hz > 0) {
        sweep_excite(task, t_s);
    }
    if (task->tells && sweep->now.hz > 0) {
        snprintf(task->message, sizeof task->message, "joint %s: frequency %zu of %.0f, %.3g Hz",
                 task->config.input.joint, sweep->npoint + 1, sweep->value[SWEEP_POINTS],
                 sweep->now.hz);
    } else if (task->tells) {
        snprintf(task->message, sizeof task->message, "moving into the pose");
    }
    return TASK_RUNNING;
}

size_t task_sweep_points(const struct task *task, const struct sweep_point **point)
{
    const struct sweep *sweep = task->state;

    if (task->ops != &task_sweep) {
        return 0;
    }
    *point = sweep->point;
    return sweep->npoint;
}

const struct task_ops task_sweep = {
    .name = "sweep",
    .summary = "sines on one joint: the frequency response of its drive",
    .create = sweep_create,
    .start = sweep_start,
    .step = sweep_step,
    .settings = sweep_settings,
    .setting_name = sweep_setting_name,
    .set = sweep_set,
    .get = sweep_get,
};
