/* SPDX-License-Identifier: Apache-2.0 */
/* Creates the sensors: ranges checked, delay lines and random streams laid out. */
#include "base/portable_math.h"
#include "faults/kinds.h"
#include "boards/sensing/private.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Checks whether a number is finite and not negative. */
static bool sensing_is_not_negative(double value)
{
    return isfinite(value) && value >= 0.0;
}

/* Checks that the terms of a sensor's error are possible. */
static enum error_code sensor_error_check(const struct sensor_error *e, const char *name,
                                          struct error *error)
{
    if (!isfinite(e->gain_error) || !isfinite(e->offset) || !isfinite(e->ramp_per_s) ||
        !sensing_is_not_negative(e->noise_rms) || !sensing_is_not_negative(e->drift_per_sqrt_s) ||
        !sensing_is_not_negative(e->full_scale) || !sensing_is_not_negative(e->lsb)) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found an error term that is negative or not a number", name);
    }
    if (e->latency_ns < 0 || e->latency_ns > SENSING_LATENCY_MAX_NS) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found a latency of %g s, expected 0 to %g s", name,
                         (double)e->latency_ns * 1e-9, (double)SENSING_LATENCY_MAX_NS * 1e-9);
    }
    return ERROR_NONE;
}

/* Returns whether a sensor has no error at all. */
static bool sensor_error_is_ideal(const struct sensor_error *e)
{
    return e->gain_error == 0.0 && e->offset == 0.0 && e->noise_rms == 0.0 &&
           e->drift_per_sqrt_s == 0.0 && e->ramp_per_s == 0.0 && e->full_scale == 0.0 &&
           e->lsb == 0.0 && e->latency_ns == 0;
}

/* Returns the number of samples that a delay needs: the newest and those up to one beyond it. */
static size_t delay_line_length(int64_t delay_ns, int64_t tick_ns)
{
    return delay_ns > 0 ? (size_t)((delay_ns + tick_ns - 1) / tick_ns) + 1 : 0;
}

/* Creates a channel, with random streams that bear its name: they depend on the seed and nothing
 * else. */
static enum error_code sensing_make_channel(struct sensing *s, size_t index, const char *name,
                                            const char *what, const struct sensor_error *from,
                                            struct arena *arena, struct error *error)
{
    struct channel *channel = &s->channel[index];
    char stream[160];
    enum error_code code = sensor_error_check(from, name, error);

    if (code) {
        return code;
    }
    channel->error = *from;
    channel->ideal = sensor_error_is_ideal(from);
    s->ideal = s->ideal && channel->ideal;
    snprintf(stream, sizeof stream, "noise %s.%s", name, what);
    channel->noise = random_named(s->config.seed, stream);
    snprintf(stream, sizeof stream, "drift %s.%s", name, what);
    channel->walk = random_named(s->config.seed, stream);
    channel->length = delay_line_length(from->latency_ns, s->config.tick_ns);
    channel->line = arena_alloc(arena, channel->length + 1, sizeof *channel->line);
    return channel->line ? ERROR_NONE
                         : error_set(error, ERROR_MEMORY, "no memory left for sensor %s", name);
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

    for (size_t i = 0; i < SENSOR_JOINT_CHANNELS; i++) {
        enum error_code code = sensing_make_channel(s, sensing_joint_channel(j, i), joint->name,
                                                    what[i], from[i], arena, error);

        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
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

    for (size_t i = 0; i < SENSOR_FT_CHANNELS; i++) {
        enum error_code code =
            sensing_make_channel(s, sensing_ft_channel(s, f, i), s->ft[f].name, what[i],
                                 i < 3 ? &s->ft[f].force : &s->ft[f].torque, arena, error);

        if (code) {
            return code;
        }
    }
    return sensing_make_crosstalk(s, f, error);
}

/* Creates the channels of the inertial sensor. */
static enum error_code sensing_make_imu(struct sensing *s, struct arena *arena, struct error *error)
{
    const struct sensor_error *const from[] = {&s->config.gyro, &s->config.accel,
                                               &s->config.magnetic, &s->config.orientation};

    for (size_t i = 0; i < SENSOR_IMU_CHANNELS; i++) {
        enum error_code code =
            sensing_make_channel(s, sensing_imu_channel(s, i), "imu", sensor_imu_channels[i],
                                 from[i < 9 ? i / 3 : 3], arena, error);

        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
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
        to->length = delay_line_length((int64_t)(fault->value[0] * 1e9), s->config.tick_ns);
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
    s->measured.motor = arena_alloc(arena, njoint + 1, sizeof *s->measured.motor);
    s->measured.ft = arena_alloc(arena, nft + 1, sizeof *s->measured.ft);
    if (!s->channel || !s->joint || !s->ft || !s->mix || !s->state || !s->measured.motor ||
        !s->measured.ft) {
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

    /* Every sensor with its channels, then the faults that act on them */
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
