/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Task sweep: identifies one drive with sines about the initial pose, one frequency after another.
 * All other joints hold the initial pose. The sine is added to the position loop's voltage, or to
 * its reference. The loop stays closed, so that the joint does not drift. With a periodic
 * excitation, the ratio of measured to commanded signal is the drive's response, independent of the
 * loop (L. Ljung, System Identification, 2nd edition, chapter 13.5: joint input-output approach).
 *
 * A signal is sampled at the arrival time of its frame. The voltage is constant between commands. A
 * response therefore includes the drive, the board and the bus. It does not include the host's
 * sampling or the hold of the host's commands.
 */
#include "base/portable_math.h"
#include "tasks/sine_fit.h"
#include "tasks/task_private.h"

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

/* duration of the ramp from the present angles to the initial pose */
static const double SWEEP_RAMP_S = 1.0;
static const double SWEEP_STAND_S = 1.0;  /* time of standing still before the first frequency */
static const double SWEEP_NYQUIST = 0.25; /* highest frequency as a fraction of the command rate */

/* Copy of the settings at the beginning of a point, because a user may change them later. */
struct sweep_now {
    double volts, radians; /* amplitudes; one of them is 0 */
    double hz, from_s;     /* phase 0 is at from_s, the beginning of the settling */
    double measure_s, end_s;
};

struct sweep {
    size_t axis;
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

/* ---- the task ---- */

/* Creates the task's state and finds the joint. The supply voltage limits the amplitude, and the
 * command rate limits the frequencies. Returns ERROR_INPUT if the joint is missing or unknown. */
static enum error_code sweep_create(struct task *task, struct arena *arena, struct error *error)
{
    const struct task_config *config = &task->config;
    double period_s =
        1e-9 * fmax((double)config->servo.command_period_ns, (double)config->host.period_ns);
    double most_hz = SWEEP_NYQUIST / period_s, volts = config->host.supply_v;
    const char *const *name = sweep_setting_name;
    const struct task_setting setting[SWEEP_SETTINGS] = {
        [SWEEP_AMPLITUDE_V] = {name[SWEEP_AMPLITUDE_V], "V", 0, volts, false, volts / 20},
        [SWEEP_AMPLITUDE_RAD] = {name[SWEEP_AMPLITUDE_RAD], "rad", 0, 0.5, false, 0},
        [SWEEP_FROM] = {name[SWEEP_FROM], "Hz", 0.01, most_hz, false, 0.5},
        [SWEEP_TO] = {name[SWEEP_TO], "Hz", 0.01, most_hz, false, fmin(20, most_hz)},
        [SWEEP_POINTS] = {name[SWEEP_POINTS], "", 1, SWEEP_POINTS_MAX, true, 20},
        [SWEEP_SETTLE_PERIODS] = {name[SWEEP_SETTLE_PERIODS], "", 0, 1000, true, 4},
        [SWEEP_SETTLE] = {name[SWEEP_SETTLE], "s", 0, 60, false, 0.5},
        [SWEEP_MEASURE_PERIODS] = {name[SWEEP_MEASURE_PERIODS], "", 2, 1000, true, 8},
    };
    struct sweep *sweep = arena_alloc(arena, 1, sizeof *sweep);
    enum error_code code = task_make_settings(task, setting, SWEEP_SETTINGS, arena, error);

    if (!sweep || code) {
        return error_set(error, ERROR_MEMORY, "no memory for the sweep");
    }
    sweep->now.end_s = SWEEP_RAMP_S + SWEEP_STAND_S;
    task->state = sweep;
    return task_find_input_axis(task, &sweep->axis, error);
}

/* Begins the next frequency at t_s. Returns false, with a message, if the amplitude is 0 or exceeds
 * the joint's limits. */
static bool sweep_begin_point(struct task *task, double t_s)
{
    struct sweep *sweep = task->state;
    const struct host_axis *axis = &task->config.host.axis[sweep->axis];
    double from = task->value[SWEEP_FROM], ratio = task->value[SWEEP_TO] / from;
    double last = task->value[SWEEP_POINTS] - 1, share = fmin((double)sweep->npoint / last, 1);
    double hz = last > 0 ? from * portable_pow(ratio, share) : from, settle;
    struct sweep_now *now = &sweep->now;

    /* Use whole periods, so that the excitation never jumps */
    settle = fmax(task->value[SWEEP_SETTLE_PERIODS], ceil(task->value[SWEEP_SETTLE] * hz));
    *now = (struct sweep_now){.hz = hz, .from_s = t_s};
    now->measure_s = t_s + settle / hz;
    now->end_s = now->measure_s + task->value[SWEEP_MEASURE_PERIODS] / hz;
    now->radians = task->value[SWEEP_AMPLITUDE_RAD];
    now->volts = now->radians > 0 ? 0 : task->value[SWEEP_AMPLITUDE_V];
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

/* ---- measuring ---- */

/* Adds a sample to a fit: the value at t_s, or the mean over hold_s centered at t_s. */
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

/* Adds the signals since the last step to the fits: sent signals to the input, received signals to
 * the outputs. */
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

    /* Add the input: the present reference, or the voltage that was held since the last step */
    if (sweep->now.radians > 0) {
        double sine = portable_sin(2 * M_PI * sweep->now.hz * (t_s - sweep->now.from_s));

        sweep_sample(sweep, &sweep->input, t_s, 0, sweep->now.radians * sine);
    } else {
        sweep_sample(sweep, &sweep->input, t_s - held / 2, held,
                     host_voltage(task->host, sweep->axis));
    }
    /* Add the outputs, each at the time of its frame */
    for (int k = 0; k < SWEEP_RESPONSES; k++) {
        if (time_ns[k] >= 0 && time_ns[k] != sweep->seen_ns[k]) {
            sweep_sample(sweep, &sweep->output[k], (double)(time_ns[k] - task->start_ns) * 1e-9, 0,
                         value[k]);
            sweep->seen_ns[k] = time_ns[k];
        }
    }
}

/* Runs one period: first the ramp into the pose, then one frequency after another. */
static enum task_status sweep_step(struct task *task, double t_s)
{
    struct sweep *sweep = task->state;
    double worst = 0, w, sine, cosine;

    /* Move into the pose; afterwards, only the excited joint moves */
    if (sweep->now.hz > 0) {
        sweep_measure(task, t_s);
    } else {
        task_move_pose(task, NULL, SWEEP_RAMP_S, t_s);
    }
    sweep->last_s = t_s;
    if (!task_motors_follow(task, &worst)) {
        return TASK_FAILED;
    }
    /* At the end of a point, evaluate it, then begin the next point or end the task */
    if (t_s >= sweep->now.end_s) {
        if (sweep->now.hz > 0) {
            struct sweep_point *point = &sweep->point[sweep->npoint++];
            struct sine input, output;
            double square;

            /* Compute the responses of the point that has ended */
            sine_fit_solve(&sweep->input, &input);
            square = input.cosine * input.cosine + input.sine * input.sine;
            point->frequency_hz = sweep->now.hz;
            point->by_angle = sweep->now.radians > 0;
            point->input = sqrt(square);
            for (int k = 0; k < SWEEP_RESPONSES; k++) {
                double re, im;

                sine_fit_solve(&sweep->output[k], &output);
                re = output.cosine * input.cosine + output.sine * input.sine;
                im = output.cosine * input.sine - output.sine * input.cosine;
                point->response[k] = (struct sweep_response){
                    .magnitude = square > 0 ? sqrt(re * re + im * im) / square : 0,
                    .phase_rad = portable_atan2(im, re),
                    .coherence = square > 0 ? output.coherence : 0,
                };
            }
        }
        if (sweep->npoint > 0 && (double)sweep->npoint >= task->value[SWEEP_POINTS]) {
            /* Write the final message, with the frequency of the largest torque response */
            const struct sweep_point *peak = &sweep->point[0];

            for (size_t i = 1; i < sweep->npoint; i++) {
                const struct sweep_point *point = &sweep->point[i];

                if (point->response[SWEEP_TORQUE].magnitude >
                    peak->response[SWEEP_TORQUE].magnitude) {
                    peak = point;
                }
            }
            snprintf(
                task->message, sizeof task->message,
                "joint %s: %zu frequencies, %.3g to %.3g Hz; most torque at %.3g Hz, %.3g N m/%s",
                task->config.input.joint, sweep->npoint, sweep->point[0].frequency_hz,
                sweep->point[sweep->npoint - 1].frequency_hz, peak->frequency_hz,
                peak->response[SWEEP_TORQUE].magnitude, peak->by_angle ? "rad" : "V");

            return TASK_DONE;
        }
        if (!sweep_begin_point(task, t_s)) {
            return TASK_FAILED;
        }
    }
    /* Excite, and report the progress */
    if (sweep->now.hz > 0) {
        w = 2 * M_PI * sweep->now.hz;
        portable_sincos(w * (t_s - sweep->now.from_s), &sine, &cosine);
        servo_excite(task->servo, sweep->axis, sweep->now.volts * sine);
        servo_set(task->servo, sweep->axis,
                  task->config.initial_rad[sweep->axis] + sweep->now.radians * sine,
                  sweep->now.radians * w * cosine);
    }
    if (task->tells && sweep->now.hz > 0) {
        snprintf(task->message, sizeof task->message, "joint %s: frequency %zu of %.0f, %.3g Hz",
                 task->config.input.joint, sweep->npoint + 1, task->value[SWEEP_POINTS],
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
    .step = sweep_step,
    .setting_name = sweep_setting_name,
};
