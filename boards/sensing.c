/* SPDX-License-Identifier: Apache-2.0 */
/* Sensors as real ones: one chain for every channel, and what comes before it. */
#include "boards/sensing.h"

#include "base/random.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* One quantity on its way to the boards. */
struct channel {
    struct sensor_error error;
    bool ideal;
    struct random_stream noise, walk;
    double drift, ramp;
    double last;  /* what came out the last time */
    double *line; /* of the delay, circular, newest at line[at] */
    size_t length, at;
};

/* A fault at work on one channel. */
struct sensor_fault {
    const struct fault *fault;
    size_t channel;
    struct random_stream random;
    bool was_active;
    double held;      /* SLOW, STUCK */
    int64_t since_ns; /* SLOW: of the value held */
    bool gap;         /* INTERMITTENT */
    double *line;     /* DELAYED, circular */
    size_t length, at;
};

struct joint_state {
    double start_rad; /* incremental encoder: where it stood */
    bool restarts;    /* its counter begins anew with the next sample */
    double heated_c;  /* winding above ambient */
    double keep;      /* exp(-tick/tau) */
    double last_q, last_qm;
};

struct sensing {
    struct sensing_config config;
    struct sensor_joint *joint;
    struct sensor_ft *ft;
    size_t nchannel;
    struct channel *channel;
    double (*mix)[SENSOR_FT_CHANNELS][SENSOR_FT_CHANNELS]; /* by F/T sensor */
    struct joint_state *state;
    struct sensor_fault *fault;
    size_t nfault;
    struct plant_sensors measured;
    double noise_scale;
    bool ideal; /* nothing to do */
    bool started;
    int64_t time_ns;
};

/* ---- making ---- */

static size_t sensing_joint_channel(size_t joint, size_t channel)
{
    return joint * SENSOR_JOINT_CHANNELS + channel;
}

static size_t sensing_ft_channel(const struct sensing *s, size_t ft, size_t channel)
{
    return s->config.njoint * SENSOR_JOINT_CHANNELS + ft * SENSOR_FT_CHANNELS + channel;
}

static size_t sensing_imu_channel(const struct sensing *s, size_t channel)
{
    return sensing_ft_channel(s, s->config.nft, channel);
}

static bool sensing_is_not_negative(double value)
{
    return isfinite(value) && value >= 0.0;
}

static enum error_code sensor_error_check(const struct sensor_error *e, const char *name,
                                          struct error *error)
{
    if (!isfinite(e->gain_error) || !isfinite(e->offset) || !isfinite(e->ramp_per_s) ||
        !sensing_is_not_negative(e->noise_rms) || !sensing_is_not_negative(e->drift_per_sqrt_s) ||
        !sensing_is_not_negative(e->full_scale) || !sensing_is_not_negative(e->lsb)) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found an error that is negative or no number", name);
    }
    if (e->latency_ns < 0 || e->latency_ns > SENSING_LATENCY_MAX_NS) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found a latency of %g s, expected 0 to %g s", name,
                         (double)e->latency_ns * 1e-9, (double)SENSING_LATENCY_MAX_NS * 1e-9);
    }
    return ERROR_NONE;
}

static bool sensor_error_is_ideal(const struct sensor_error *e)
{
    return e->gain_error == 0.0 && e->offset == 0.0 && e->noise_rms == 0.0 &&
           e->drift_per_sqrt_s == 0.0 && e->ramp_per_s == 0.0 && e->full_scale == 0.0 &&
           e->lsb == 0.0 && e->latency_ns == 0;
}

/* Samples that a delay needs: the newest and those up to one beyond it. */
static size_t delay_line_length(int64_t delay_ns, int64_t tick_ns)
{
    return delay_ns > 0 ? (size_t)((delay_ns + tick_ns - 1) / tick_ns) + 1 : 0;
}

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
    enum error_code code = ERROR_NONE;

    if (!sensing_is_not_negative(thermal->resistance_ohm) || !isfinite(thermal->ambient_c) ||
        (thermal->resistance_ohm > 0.0 &&
         (!(thermal->k_per_w > 0.0) || !isfinite(thermal->k_per_w) ||
          !(thermal->time_constant_s > 0.0)))) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found a winding without resistance to heat or time constant",
                         joint->name);
    }
    s->ideal = s->ideal && !joint->incremental && thermal->resistance_ohm == 0.0;
    s->state[j].keep = thermal->resistance_ohm > 0.0
                           ? exp(-1e-9 * (double)s->config.tick_ns / thermal->time_constant_s)
                           : 0.0;
    for (size_t i = 0; i < SENSOR_JOINT_CHANNELS && !code; i++) {
        code = sensing_make_channel(s, sensing_joint_channel(j, i), joint->name, what[i], from[i],
                                    arena, error);
    }
    return code;
}

/* Ones on the diagonal; beside it crosstalk in units of the full scales, of a sign by chance. */
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

static enum error_code sensing_make_ft(struct sensing *s, size_t f, struct arena *arena,
                                       struct error *error)
{
    static const char *const what[SENSOR_FT_CHANNELS] = {"fx", "fy", "fz", "tx", "ty", "tz"};
    enum error_code code = sensing_make_crosstalk(s, f, error);

    for (size_t i = 0; i < SENSOR_FT_CHANNELS && !code; i++) {
        code = sensing_make_channel(s, sensing_ft_channel(s, f, i), s->ft[f].name, what[i],
                                    i < 3 ? &s->ft[f].force : &s->ft[f].torque, arena, error);
    }
    return code;
}

static enum error_code sensing_make_imu(struct sensing *s, struct arena *arena, struct error *error)
{
    static const char *const what[SENSOR_IMU_CHANNELS] = {"gyro_x",  "gyro_y",  "gyro_z",
                                                          "accel_x", "accel_y", "accel_z"};
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; i < SENSOR_IMU_CHANNELS && !code; i++) {
        code = sensing_make_channel(s, sensing_imu_channel(s, i), "imu", what[i],
                                    i < 3 ? &s->config.gyro : &s->config.accel, arena, error);
    }
    return code;
}

/* One entry for each channel of each fault of a sensor. */
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
    for (size_t i = 0; i < n && s->fault; i++) {
        const struct fault *fault = faults_at(faults, i);

        for (size_t k = 0; fault->target == FAULT_SENSOR && k < fault->channels; k++) {
            struct sensor_fault *to = &s->fault[s->nfault++];
            char stream[FAULT_NAME_SIZE + 64];

            snprintf(stream, sizeof stream, "fault %s %zu", fault->name, k);
            to->fault = fault;
            to->channel = fault->index + k;
            to->random = random_named(faults_seed(faults), stream);
            if (fault->kind == FAULT_DELAYED) {
                to->length = delay_line_length((int64_t)(fault->value[0] * 1e9), s->config.tick_ns);
            }
            to->line = arena_alloc(arena, to->length + 1, sizeof *to->line);
            if (!to->line) {
                return error_set(error, ERROR_MEMORY, "no memory left for fault %s", fault->name);
            }
        }
    }
    s->ideal = s->ideal && s->nfault == 0;
    return s->fault ? ERROR_NONE : error_set(error, ERROR_MEMORY, "no memory left for faults");
}

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
    enum error_code code = ERROR_NONE;

    if (config->tick_ns <= 0) {
        return error_set(error, ERROR_INPUT, "sensors: the tick must be above 0");
    }
    if (!s) {
        return error_set(error, ERROR_MEMORY, "no memory left for the sensors");
    }
    s->config = *config;
    s->noise_scale = 1.0;
    s->ideal = true;
    if (!sensing_allocate(s, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory left for the sensors");
    }
    for (size_t j = 0; j < config->njoint && !code; j++) {
        code = sensing_make_joint(s, j, arena, error);
    }
    for (size_t f = 0; f < config->nft && !code; f++) {
        code = sensing_make_ft(s, f, arena, error);
    }
    code = code ? code : sensing_make_imu(s, arena, error);
    code = code ? code : sensing_make_faults(s, arena, error);
    *out = s;
    return code;
}

/* ---- the chain ---- */

/* x of delay_ns ago from a line whose newest entry is at `at`; the line holds at least so much. */
static double delay_line_read(const double *line, size_t length, size_t at, int64_t delay_ns,
                              int64_t tick_ns)
{
    size_t whole = (size_t)(delay_ns / tick_ns);
    double part = (double)(delay_ns % tick_ns) / (double)tick_ns;
    double younger = line[(at + length - whole) % length];

    if (part == 0.0) {
        return younger;
    }
    return younger + part * (line[(at + length - whole - 1) % length] - younger);
}

static double channel_delay(struct channel *channel, double x, int64_t tick_ns, bool started)
{
    if (channel->length == 0) {
        return x;
    }
    /* before the first sample it has always been so */
    for (size_t i = 0; !started && i < channel->length; i++) {
        channel->line[i] = x;
    }
    channel->at = (channel->at + 1) % channel->length;
    channel->line[channel->at] = x;
    return delay_line_read(channel->line, channel->length, channel->at, channel->error.latency_ns,
                           tick_ns);
}

static double sensor_error_convert(const struct sensor_error *e, double x)
{
    if (e->full_scale > 0.0) {
        x = fmax(-e->full_scale, fmin(e->full_scale, x));
    }
    return e->lsb > 0.0 ? e->lsb * floor(x / e->lsb + 0.5) : x;
}

static double channel_measure(struct sensing *s, struct channel *channel, double x)
{
    const struct sensor_error *e = &channel->error;
    double tick_s = 1e-9 * (double)s->config.tick_ns;

    if (channel->ideal) {
        return x;
    }
    x = channel_delay(channel, x, s->config.tick_ns, s->started);
    if (s->started) {
        channel->ramp += e->ramp_per_s * tick_s;
        if (e->drift_per_sqrt_s > 0.0) {
            channel->drift += e->drift_per_sqrt_s * sqrt(tick_s) * random_gaussian(&channel->walk);
        }
    }
    x += e->gain_error * x + e->offset + channel->drift + channel->ramp;
    if (e->noise_rms > 0.0) {
        x += s->noise_scale * e->noise_rms * random_gaussian(&channel->noise);
    }
    return sensor_error_convert(e, x);
}

/* ---- faults ---- */

/* What a fault makes of x; last is what the channel said before. */
static double sensor_fault_disturb(const struct sensing *s, struct sensor_fault *f, double x,
                                   double last)
{
    const struct fault *fault = f->fault;
    bool begins = !f->was_active;

    switch (fault->kind) {
    case FAULT_OFF:
        return 0.0;
    case FAULT_STUCK:
        f->held = begins ? last : f->held;
        return f->held;
    case FAULT_GARBAGE:
        return fault->value[0] * (2.0 * random_uniform(&f->random) - 1.0);
    case FAULT_WRONG:
        return fault->value[0] * x + fault->value[1];
    case FAULT_SLOW:
        if (begins || s->time_ns - f->since_ns >= (int64_t)(fault->value[0] * 1e9)) {
            f->held = x;
            f->since_ns = s->time_ns;
        }
        return f->held;
    case FAULT_DELAYED:
        return delay_line_read(f->line, f->length, f->at, (int64_t)(fault->value[0] * 1e9),
                               s->config.tick_ns);
    case FAULT_INTERMITTENT:
        f->gap = random_gap(&f->random, f->gap, fault->value[0], fault->value[1],
                            1e-9 * (double)s->config.tick_ns);
        return f->gap ? 0.0 : x;
    default:
        return x;
    }
}

/* The line runs also while the fault does not, so that it knows the past when it begins. */
static void sensor_fault_remember(struct sensor_fault *f, double x, bool started)
{
    for (size_t i = 0; !started && i < f->length; i++) {
        f->line[i] = x;
    }
    if (f->length > 0) {
        f->at = (f->at + 1) % f->length;
        f->line[f->at] = x;
    }
}

static double sensing_read_channel(struct sensing *s, size_t index, double x)
{
    struct channel *channel = &s->channel[index];

    x = channel_measure(s, channel, x);
    for (size_t i = 0; i < s->nfault; i++) {
        struct sensor_fault *f = &s->fault[i];

        if (f->channel != index) {
            continue;
        }
        sensor_fault_remember(f, x, s->started);
        if (f->fault->active) {
            x = sensor_fault_disturb(s, f, x, s->started ? channel->last : x);
        }
        f->was_active = f->fault->active;
    }
    channel->last = x;
    return x;
}

/* ---- the sensors ---- */

static bool sensing_channel_is_plain(const struct sensing *s, size_t channel)
{
    for (size_t i = 0; i < s->nfault; i++) {
        if (s->fault[i].channel == channel) {
            return false;
        }
    }
    return s->channel[channel].ideal;
}

static double sensing_heat_winding(const struct sensing *s, size_t j, double current_a)
{
    const struct sensor_thermal *thermal = &s->joint[j].thermal;
    struct joint_state *state = &s->state[j];
    double goal = thermal->resistance_ohm * current_a * current_a * thermal->k_per_w;

    if (thermal->resistance_ohm == 0.0) {
        return 0.0;
    }
    if (s->started) {
        state->heated_c = goal + (state->heated_c - goal) * state->keep;
    }
    return thermal->ambient_c + state->heated_c;
}

/* The rate that an encoder's readings show, or the truth where it is ideal. */
static double sensing_encoder_rate(const struct sensing *s, size_t channel, double now,
                                   double *last, double truth)
{
    double change = s->started ? now - *last : 0.0;

    *last = now;
    return sensing_channel_is_plain(s, channel) ? truth
                                                : change / (1e-9 * (double)s->config.tick_ns);
}

static void sensing_read_joint(struct sensing *s, size_t j, const struct motor_sense *truth)
{
    struct motor_sense *out = &s->measured.motor[j];
    struct joint_state *state = &s->state[j];
    size_t link = sensing_joint_channel(j, SENSOR_LINK_ENCODER),
           motor = sensing_joint_channel(j, SENSOR_MOTOR_ENCODER);

    if (s->joint[j].incremental && (!s->started || state->restarts)) {
        state->start_rad = truth->qm;
    }
    *out = *truth;
    out->q = sensing_read_channel(s, link, truth->q);
    out->qm = sensing_read_channel(s, motor, truth->qm - state->start_rad);
    out->qd = sensing_encoder_rate(s, link, out->q, &state->last_q, truth->qd);
    if (state->restarts) {
        state->last_qm = out->qm; /* no jump for those who look at the rate */
        state->restarts = false;
    }
    out->qmd = sensing_encoder_rate(s, motor, out->qm, &state->last_qm, truth->qmd);
    out->current_a =
        sensing_read_channel(s, sensing_joint_channel(j, SENSOR_CURRENT), truth->current_a);
    out->torque_nm =
        sensing_read_channel(s, sensing_joint_channel(j, SENSOR_TORQUE), truth->torque_nm);
    out->winding_c = sensing_read_channel(s, sensing_joint_channel(j, SENSOR_TEMPERATURE),
                                          sensing_heat_winding(s, j, truth->current_a));
}

static void sensing_read_ft(struct sensing *s, size_t f, const struct ft_sense *truth)
{
    const double x[SENSOR_FT_CHANNELS] = {truth->force_n[0],   truth->force_n[1],
                                          truth->force_n[2],   truth->torque_nm[0],
                                          truth->torque_nm[1], truth->torque_nm[2]};
    struct ft_sense *out = &s->measured.ft[f];

    for (size_t to = 0; to < SENSOR_FT_CHANNELS; to++) {
        double sum = x[to];

        for (size_t from = 0; s->ft[f].crosstalk > 0.0 && from < SENSOR_FT_CHANNELS; from++) {
            sum += from == to ? 0.0 : s->mix[f][to][from] * x[from];
        }
        sum = sensing_read_channel(s, sensing_ft_channel(s, f, to), sum);
        if (to < 3) {
            out->force_n[to] = sum;
        } else {
            out->torque_nm[to - 3] = sum;
        }
    }
}

static void sensing_read_imu(struct sensing *s, const struct imu_sense *truth)
{
    for (size_t i = 0; i < 3; i++) {
        s->measured.imu.gyro_rad_s[i] =
            sensing_read_channel(s, sensing_imu_channel(s, i), truth->gyro_rad_s[i]);
        s->measured.imu.accel_m_s2[i] =
            sensing_read_channel(s, sensing_imu_channel(s, 3 + i), truth->accel_m_s2[i]);
    }
}

void sensing_scale_noise(struct sensing *s, double factor)
{
    s->noise_scale = factor;
}

double sensing_noise_scale(const struct sensing *s)
{
    return s->noise_scale;
}

bool sensing_has_noise(const struct sensing *s)
{
    for (size_t c = 0; c < s->nchannel; c++) {
        if (s->channel[c].error.noise_rms > 0.0) {
            return true;
        }
    }
    return false;
}

void sensing_restart_counter(struct sensing *s, size_t joint)
{
    if (joint < s->config.njoint) {
        s->state[joint].restarts = s->joint[joint].incremental;
    }
}

const struct plant_sensors *sensing_sample(struct sensing *s, const struct plant_sensors *truth)
{
    if (s->ideal) {
        return truth;
    }
    s->time_ns = s->measured.time_ns = truth->time_ns;
    s->measured.supply_v = truth->supply_v;
    s->measured.njoint = truth->njoint;
    s->measured.nft = truth->nft;
    for (size_t j = 0; j < s->config.njoint; j++) {
        sensing_read_joint(s, j, &truth->motor[j]);
    }
    for (size_t f = 0; f < s->config.nft; f++) {
        sensing_read_ft(s, f, &truth->ft[f]);
    }
    sensing_read_imu(s, &truth->imu);
    s->started = true;
    return &s->measured;
}
