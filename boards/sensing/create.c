/* SPDX-License-Identifier: Apache-2.0 */
/* Creates a channel of a sensor: its error's ranges checked, filter, delay line and random streams
 * laid out. */
#include "boards/sensing/private.h"

#include "base/portable_math.h"
#include "base/vec3.h"
#include "faults/kinds.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Checks whether a number is finite and not negative. */
static bool sensing_is_not_negative(double value)
{
    return isfinite(value) && value >= 0.0;
}

/* Returns the number of samples that a delay needs: the newest and those up to one beyond it. */
static size_t sensing_delay_line_length(int64_t delay_ns, int64_t tick_ns)
{
    return delay_ns > 0 ? (size_t)((delay_ns + tick_ns - 1) / tick_ns) + 1 : 0;
}

/* Checks that the terms of a sensor's error are numbers of the right sign. */
static enum error_code sensor_error_check_terms(const struct sensor_error *e, const char *name,
                                                struct error *error)
{
    const double any[] = {e->gain_error, e->offset, e->ramp_per_s, e->offset_per_k, e->gain_per_k};
    const double positive[] = {e->noise_rms,    e->drift_per_sqrt_s, e->full_scale,     e->lsb,
                               e->bandwidth_hz, e->hysteresis,       e->instability_rms};
    bool good = true;

    for (size_t i = 0; i < sizeof any / sizeof *any; i++) {
        good = good && isfinite(any[i]);
    }
    for (size_t i = 0; i < sizeof positive / sizeof *positive; i++) {
        good = good && sensing_is_not_negative(positive[i]);
    }
    return good
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "sensor %s: found an error term that is negative or not a number", name);
}

/* Checks that the terms of a sensor's error are possible. */
static enum error_code sensor_error_check(const struct sensor_error *e, const char *name,
                                          int64_t tick_ns, struct error *error)
{
    enum error_code code = sensor_error_check_terms(e, name, error);

    if (code) {
        return code;
    }
    if (e->latency_ns < 0 || e->latency_ns > SENSING_LATENCY_MAX_NS) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found a latency of %g s, expected 0 to %g s", name,
                         (double)e->latency_ns * 1e-9, (double)SENSING_LATENCY_MAX_NS * 1e-9);
    }
    if (!(e->bandwidth_hz * (double)tick_ns < 0.5e9)) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found a bandwidth of %g Hz, expected less than half the rate "
                         "of the ticks, %g Hz",
                         name, e->bandwidth_hz, 0.5e9 / (double)tick_ns);
    }
    if (e->hysteresis > 0.0 && !(e->full_scale > 0.0)) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found hysteresis without the full scale that it needs", name);
    }
    return e->instability_rms > 0.0 && !(e->instability_s > 0.0 && isfinite(e->instability_s))
               ? error_set(error, ERROR_INPUT,
                           "sensor %s: found instability without a time above 0", name)
               : ERROR_NONE;
}

/* Returns whether a sensor has no error at all. */
static bool sensor_error_is_ideal(const struct sensor_error *e)
{
    return e->gain_error == 0.0 && e->offset == 0.0 && e->noise_rms == 0.0 &&
           e->drift_per_sqrt_s == 0.0 && e->ramp_per_s == 0.0 && e->full_scale == 0.0 &&
           e->lsb == 0.0 && e->latency_ns == 0 && e->bandwidth_hz == 0.0 && e->hysteresis == 0.0 &&
           e->instability_rms == 0.0 && e->offset_per_k == 0.0 && e->gain_per_k == 0.0;
}

/* Returns the Butterworth low pass of second order by the bilinear transform, its corner where it
 * is asked for. */
static struct low_pass low_pass_make(double bandwidth_hz, int64_t tick_ns)
{
    const double root_two = 1.4142135623730951;
    double k = portable_tan(3.141592653589793 * bandwidth_hz * 1e-9 * (double)tick_ns);
    double norm = 1.0 / (1.0 + root_two * k + k * k);

    return (struct low_pass){.b0 = k * k * norm,
                             .a1 = 2.0 * (k * k - 1.0) * norm,
                             .a2 = (1.0 - root_two * k + k * k) * norm};
}

/* Returns the random stream of a channel for one of its errors. */
static struct random_stream channel_stream(const struct sensing *s, const char *error,
                                           const char *name, const char *what)
{
    char stream[160];

    snprintf(stream, sizeof stream, "%s %s.%s", error, name, what);
    return random_named(s->config.seed, stream);
}

/* Creates channel `index`, with random streams that bear its name: they depend on the seed and
 * nothing else. ERROR_INPUT on an impossible error, ERROR_MEMORY. */
static enum error_code sensing_make_channel(struct sensing *s, size_t index, const char *name,
                                            const char *what, const struct sensor_error *from,
                                            struct sensor_device *device, struct arena *arena,
                                            struct error *error)
{
    const int64_t tick_ns = s->config.tick_ns;
    struct channel *channel = &s->channel[index];
    enum error_code code = sensor_error_check(from, name, tick_ns, error);
    int64_t oldest_ns = from->latency_ns;

    if (code) {
        return code;
    }
    channel->error = *from;
    channel->device = device;
    /* A filtered attitude is of readings that are as old as their board's last sample already */
    channel->clocked =
        device->clock && !(s->config.imu.ahrs.on && index >= sensing_imu_channel(s, 9));
    channel->ideal = sensor_error_is_ideal(from) && !channel->clocked;
    s->ideal = s->ideal && channel->ideal;
    channel->noise = channel_stream(s, "noise", name, what);
    channel->walk = channel_stream(s, "drift", name, what);
    channel->wander = channel_stream(s, "instability", name, what);
    channel->bias_keep = from->instability_rms > 0.0
                             ? portable_exp(-1e-9 * (double)tick_ns / from->instability_s)
                             : 0.0;
    channel->low_pass = low_pass_make(from->bandwidth_hz, tick_ns);

    /* The delay line reaches back to the oldest sample */
    oldest_ns += channel->clocked ? (int64_t)device->clock->period_ns + 1 : 0;
    channel->length = sensing_delay_line_length(oldest_ns, tick_ns);
    channel->line = arena_alloc(arena, channel->length + 1, sizeof *channel->line);
    return channel->line ? ERROR_NONE
                         : error_set(error, ERROR_MEMORY, "no memory left for sensor %s", name);
}

/* Creates the sensors: ranges checked, delay lines and random streams laid out. */

/* Checks the warming of a sensor and that its board has a clock; sets up what its channels have in
 * common. */
static enum error_code sensing_make_device(struct sensing *s, struct sensor_device *device,
                                           const char *name, const struct sensor_warm_up *warm_up,
                                           size_t clock, struct error *error)
{
    const bool warms = warm_up->rise_k != 0.0;

    if (!isfinite(warm_up->rise_k) ||
        (warms && !(warm_up->time_constant_s > 0.0 && isfinite(warm_up->time_constant_s)))) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found a warming without a time constant above 0", name);
    }
    device->warm_up = *warm_up;
    device->keep =
        warms ? portable_exp(-1e-9 * (double)s->config.tick_ns / warm_up->time_constant_s) : 0.0;
    device->clock = s->nclock > 0 ? &s->clock[clock] : NULL;
    return ERROR_NONE;
}

/* Draws the phases of an eccentric encoder. */
static enum error_code sensing_make_eccentricity(struct sensing *s, size_t j, struct error *error)
{
    const struct sensor_joint *joint = &s->joint[j];
    struct random_stream random;
    char stream[160];

    if (!sensing_is_not_negative(joint->eccentricity_rad[0]) ||
        !sensing_is_not_negative(joint->eccentricity_rad[1])) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found an eccentricity that is negative or not a number",
                         joint->name);
    }
    snprintf(stream, sizeof stream, "eccentricity %s", joint->name);
    random = random_named(s->config.seed, stream);
    for (int k = 0; k < 2; k++) {
        s->state[j].eccentric_phase_rad[k] = 6.283185307179586 * random_uniform(&random);
        if (joint->eccentricity_rad[k] > 0.0) {
            s->channel[sensing_joint_channel(j, SENSOR_LINK_ENCODER)].ideal = s->ideal = false;
        }
    }
    return ERROR_NONE;
}

bool sensing_sees_bending(const struct sensing_config *config)
{
    for (size_t j = 0; config->joint && j < config->njoint; j++) {
        if (config->joint[j].crosstalk > 0.0) {
            return true;
        }
    }
    return false;
}

/* Draws the signs by which the moments across a joint's axis show in its torque. */
static enum error_code sensing_make_bending(struct sensing *s, size_t j, struct error *error)
{
    const struct sensor_joint *joint = &s->joint[j];
    struct random_stream random;
    char stream[160];

    if (!sensing_is_not_negative(joint->crosstalk)) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found a crosstalk that is negative or not a number",
                         joint->name);
    }
    snprintf(stream, sizeof stream, "bending %s", joint->name);
    random = random_named(s->config.seed, stream);
    for (int k = 0; k < 2; k++) {
        s->state[j].bending_part[k] =
            random_uniform(&random) < 0.5 ? -joint->crosstalk : joint->crosstalk;
    }
    s->ideal = s->ideal && joint->crosstalk == 0.0;
    return ERROR_NONE;
}

/* Creates the channels of a joint and the thermal model of its winding. */
static enum error_code sensing_make_joint(struct sensing *s, size_t j, struct arena *arena,
                                          struct error *error)
{
    static const char *const what[SENSOR_JOINT_CHANNELS] = {"link_encoder", "motor_encoder",
                                                            "current", "torque", "temperature"};
    const struct sensor_joint *joint = &s->joint[j];
    const struct sensor_error *from[SENSOR_JOINT_CHANNELS] = {
        [SENSOR_LINK_ENCODER] = &joint->link_encoder,
        [SENSOR_MOTOR_ENCODER] = &joint->motor_encoder,
        [SENSOR_CURRENT] = &joint->current,
        [SENSOR_TORQUE] = &joint->torque,
        [SENSOR_TEMPERATURE] = &joint->temperature,
    };
    const struct sensor_thermal *thermal = &joint->thermal;
    struct sensor_device *device = &s->device[j];
    enum error_code code;

    /* The winding's heat */
    if (!sensing_is_not_negative(thermal->resistance_ohm) || !isfinite(thermal->ambient_c) ||
        (thermal->resistance_ohm > 0.0 &&
         (!(thermal->k_per_w > 0.0) || !isfinite(thermal->k_per_w) ||
          !(thermal->time_constant_s > 0.0)))) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found a winding without resistance to heat or time constant",
                         joint->name);
    }
    s->ideal = s->ideal && !joint->incremental && thermal->resistance_ohm == 0.0;
    s->state[j].keep =
        thermal->resistance_ohm > 0.0
            ? portable_exp(-1e-9 * (double)s->config.tick_ns / thermal->time_constant_s)
            : 0.0;

    code = sensing_make_device(s, device, joint->name, &joint->warm_up, joint->clock, error);
    for (size_t i = 0; i < SENSOR_JOINT_CHANNELS && !code; i++) {
        code = sensing_make_channel(s, sensing_joint_channel(j, i), joint->name, what[i], from[i],
                                    device, arena, error);
    }
    code = code ? code : sensing_make_bending(s, j, error);
    return code ? code : sensing_make_eccentricity(s, j, error);
}

/* Fills the mixing matrix of a force-torque sensor: ones on the diagonal, crosstalk as a part of
 * the full scales beside it, with random signs. */
static enum error_code sensing_make_crosstalk(struct sensing *s, size_t f, struct error *error)
{
    const struct sensor_ft *ft = &s->ft[f];
    double force = ft->force.full_scale, torque = ft->torque.full_scale;
    double range[SENSOR_FT_CHANNELS] = {force, force, force, torque, torque, torque};
    struct random_stream sign;
    char stream[160];

    if (!sensing_is_not_negative(ft->crosstalk) ||
        (ft->crosstalk > 0.0 && (!(force > 0.0) || !(torque > 0.0)))) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found crosstalk without the full scales that it needs",
                         ft->name);
    }
    snprintf(stream, sizeof stream, "crosstalk %s", ft->name);
    sign = random_named(s->config.seed, stream);
    s->ideal = s->ideal && ft->crosstalk == 0.0;
    for (int to = 0; to < SENSOR_FT_CHANNELS; to++) {
        for (int from = 0; from < SENSOR_FT_CHANNELS; from++) {
            double part = random_uniform(&sign) < 0.5 ? -ft->crosstalk : ft->crosstalk;

            s->mix[f][to][from] = to == from             ? 1.0
                                  : ft->crosstalk == 0.0 ? 0.0
                                                         : part * range[to] / range[from];
        }
    }
    return ERROR_NONE;
}

/* Creates the channels of a force-torque sensor. */
static enum error_code sensing_make_ft(struct sensing *s, size_t f, struct arena *arena,
                                       struct error *error)
{
    static const char *const what[SENSOR_FT_CHANNELS] = {"fx", "fy", "fz", "tx", "ty", "tz"};

    const struct sensor_ft *ft = &s->ft[f];
    struct sensor_device *device = &s->device[s->config.njoint + f];
    enum error_code code = sensing_make_device(s, device, ft->name, &ft->warm_up, ft->clock, error);

    for (size_t i = 0; i < SENSOR_FT_CHANNELS && !code; i++) {
        code = sensing_make_channel(s, sensing_ft_channel(s, f, i), ft->name, what[i],
                                    i < 3 ? &ft->force : &ft->torque, device, arena, error);
    }
    return code ? code : sensing_make_crosstalk(s, f, error);
}

/* Checks the inertial sensor's attitude filter and misalignments, and computes the turned axes. */
static enum error_code sensing_make_attitude(struct sensing *s, struct error *error)
{
    const struct sensor_imu *imu = &s->config.imu;
    const double *const turn[2] = {imu->gyro_misalignment_rad, imu->accel_misalignment_rad};

    for (int i = 0; i < 2; i++) {
        double angle = vec3_norm(turn[i]), axis[3], R[9];

        if (!isfinite(angle)) {
            return error_set(error, ERROR_INPUT,
                             "sensor imu: found a misalignment that is not a number");
        }
        mat3_identity(s->misaligned[i]);
        if (angle > 0.0) {
            for (int k = 0; k < 3; k++) {
                axis[k] = turn[i][k] / angle;
            }
            mat3_about_axis(axis, angle, R);
            mat3_transpose(R, s->misaligned[i]);
            s->ideal = false;
        }
    }
    s->ideal = s->ideal && !imu->ahrs.on;
    return sensing_is_not_negative(imu->ahrs.accel_per_s) &&
                   sensing_is_not_negative(imu->ahrs.magnetic_per_s) &&
                   sensing_is_not_negative(imu->ahrs.bias_per_s2)
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "sensor imu: found a gain of the attitude filter that is negative or "
                           "not a number");
}

/* Creates the channels of the inertial sensor. */
static enum error_code sensing_make_imu(struct sensing *s, struct arena *arena, struct error *error)
{
    const struct sensor_imu *imu = &s->config.imu;
    const struct sensor_error *const from[] = {&imu->gyro, &imu->accel, &imu->magnetic,
                                               &imu->orientation};
    struct sensor_device *device = &s->device[s->config.njoint + s->config.nft];
    enum error_code code = sensing_make_attitude(s, error);

    code = code ? code : sensing_make_device(s, device, "imu", &imu->warm_up, imu->clock, error);
    for (size_t i = 0; i < SENSOR_IMU_CHANNELS && !code; i++) {
        code = sensing_make_channel(s, sensing_imu_channel(s, i), "imu", sensor_imu_channels[i],
                                    from[i < 9 ? i / 3 : 3], device, arena, error);
    }
    return code;
}

/* Adds the entry of channel k of a fault. */
static enum error_code sensing_add_fault(struct sensing *s, const struct fault *fault, size_t k,
                                         struct arena *arena, struct error *error)
{
    struct sensor_fault *to = &s->fault[s->nfault++];
    char stream[FAULT_NAME_SIZE + 64];

    snprintf(stream, sizeof stream, "fault %s %zu", fault->name, k);
    to->fault = fault;
    to->channel = fault->index + k;
    to->random = random_named(faults_seed(s->config.faults), stream);
    if (fault->kind == FAULT_DELAYED) {
        to->length = sensing_delay_line_length((int64_t)(fault->value[0] * 1e9), s->config.tick_ns);
    }
    to->line = arena_alloc(arena, to->length + 1, sizeof *to->line);
    return to->line ? ERROR_NONE
                    : error_set(error, ERROR_MEMORY, "no memory left for fault %s", fault->name);
}

/* Creates one entry for each channel of each fault of a sensor. */
static enum error_code sensing_make_faults(struct sensing *s, struct arena *arena,
                                           struct error *error)
{
    const struct faults *faults = s->config.faults;
    size_t count = 0, n = faults ? faults_count(faults) : 0;

    for (size_t i = 0; i < n; i++) {
        const struct fault *fault = faults_at(faults, i);

        count += fault->target == FAULT_SENSOR ? fault->channels : 0;
    }
    s->fault = arena_alloc(arena, count + 1, sizeof *s->fault);
    if (!s->fault) {
        return error_set(error, ERROR_MEMORY, "no memory left for faults");
    }
    for (size_t i = 0; i < n; i++) {
        const struct fault *fault = faults_at(faults, i);

        for (size_t k = 0; fault->target == FAULT_SENSOR && k < fault->channels; k++) {
            enum error_code code = sensing_add_fault(s, fault, k, arena, error);

            if (code) {
                return code;
            }
        }
    }
    s->ideal = s->ideal && s->nfault == 0;
    return ERROR_NONE;
}

/* Draws how fast the boards' clocks run and when they sample. */
static enum error_code sensing_make_clocks(struct sensing *s, struct arena *arena,
                                           struct error *error)
{
    const struct sensor_clocks *clocks = &s->config.clocks;
    size_t count = s->config.imu.clock + 1;

    if (clocks->period_ns < 0 || clocks->period_ns > SENSING_LATENCY_MAX_NS ||
        !sensing_is_not_negative(clocks->drift_ppm) ||
        clocks->drift_ppm > SENSING_CLOCK_DRIFT_MAX_PPM) {
        return error_set(error, ERROR_INPUT, "sensors: found clocks of %g s and %g ppm",
                         1e-9 * (double)clocks->period_ns, clocks->drift_ppm);
    }
    if (clocks->period_ns == 0) {
        return ERROR_NONE;
    }
    for (size_t j = 0; j < s->config.njoint; j++) {
        count = s->joint[j].clock >= count ? s->joint[j].clock + 1 : count;
    }
    for (size_t f = 0; f < s->config.nft; f++) {
        count = s->ft[f].clock >= count ? s->ft[f].clock + 1 : count;
    }
    s->clock = arena_alloc(arena, count, sizeof *s->clock);
    if (!s->clock) {
        return error_set(error, ERROR_MEMORY, "no memory left for the sensors' clocks");
    }
    s->nclock = count;
    s->ideal = false;
    for (size_t c = 0; c < count; c++) {
        struct random_stream random;
        char stream[160];

        snprintf(stream, sizeof stream, "clock %zu", c);
        if (clocks->name) {
            snprintf(stream, sizeof stream, "clock %s", clocks->name[c]);
        }
        random = random_named(s->config.seed, stream);
        s->clock[c].period_ns =
            (double)clocks->period_ns *
            (1.0 + 1e-6 * clocks->drift_ppm * (2.0 * random_uniform(&random) - 1.0));
        s->clock[c].phase_ns = s->clock[c].period_ns * random_uniform(&random);
    }
    return ERROR_NONE;
}

/* Allocates all arrays by joint, force-torque sensor and channel; returns false without memory. */
static bool sensing_allocate(struct sensing *s, struct arena *arena)
{
    size_t njoint = s->config.njoint, nft = s->config.nft;

    s->nchannel = sensing_imu_channel(s, SENSOR_IMU_CHANNELS);
    s->channel = arena_alloc(arena, s->nchannel, sizeof *s->channel);
    s->joint = arena_alloc(arena, njoint + 1, sizeof *s->joint);
    s->ft = arena_alloc(arena, nft + 1, sizeof *s->ft);
    s->mix = arena_alloc(arena, nft + 1, sizeof *s->mix);
    s->state = arena_alloc(arena, njoint + 1, sizeof *s->state);
    s->device = arena_alloc(arena, njoint + nft + 1, sizeof *s->device);
    s->measured.motor = arena_alloc(arena, njoint + 1, sizeof *s->measured.motor);
    s->measured.ft = arena_alloc(arena, nft + 1, sizeof *s->measured.ft);
    if (!s->channel || !s->joint || !s->ft || !s->mix || !s->state || !s->device ||
        !s->measured.motor || !s->measured.ft) {
        return false;
    }
    for (size_t j = 0; j < njoint; j++) {
        s->joint[j] = s->config.joint ? s->config.joint[j] : (struct sensor_joint){.name = "joint"};
    }
    for (size_t f = 0; f < nft; f++) {
        s->ft[f] = s->config.ft ? s->config.ft[f] : (struct sensor_ft){.name = "ft"};
    }
    return true;
}

enum error_code sensing_create(const struct sensing_config *config, struct arena *arena,
                               struct sensing **out, struct error *error)
{
    struct sensing *s = arena_alloc(arena, 1, sizeof *s);
    enum error_code code;

    if (config->tick_ns <= 0) {
        return error_set(error, ERROR_INPUT, "sensors: the tick must be above 0");
    }
    if (!s) {
        return error_set(error, ERROR_MEMORY, "no memory left for the sensors");
    }
    s->config = *config;
    s->noise_scale = 1.0;
    s->ideal = true; /* until a sensor says otherwise */
    if (!sensing_allocate(s, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory left for the sensors");
    }

    /* Clocks, every sensor with its channels, then the faults that act on them */
    code = sensing_make_clocks(s, arena, error);
    if (code) {
        return code;
    }
    for (size_t j = 0; j < config->njoint; j++) {
        code = sensing_make_joint(s, j, arena, error);
        if (code) {
            return code;
        }
    }
    for (size_t f = 0; f < config->nft; f++) {
        code = sensing_make_ft(s, f, arena, error);
        if (code) {
            return code;
        }
    }
    code = sensing_make_imu(s, arena, error);
    if (code) {
        return code;
    }
    code = sensing_make_faults(s, arena, error);
    if (code) {
        return code;
    }
    *out = s;
    return ERROR_NONE;
}
