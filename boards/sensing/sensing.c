/* SPDX-License-Identifier: Apache-2.0 */
/* The sensors: creation, processing chain of each channel, and faults. */
#include "boards/sensing/sensing.h"

#include "base/portable_math.h"
#include "base/random.h"
#include "base/vec3.h"
#include "faults/kinds.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define SENSING_PLAYS 6 /* number of play operators of a hysteresis */

/* The sampling clock of a board. */
struct sampling_clock {
    double period_ns, phase_ns; /* in simulation time */
    int64_t age_ns;             /* age of the last sample */
    bool sampled;               /* a sample was taken in this tick */
};

/* State shared by the channels of a sensor. */
struct sensor_device {
    const struct sampling_clock *clock;
    struct sensor_warm_up warm_up;
    double keep;   /* exp(-tick / tau) of the warm-up */
    double warm_k; /* temperature above the temperature at the start, K */
};

/* Low pass: y = b0 (x + 2 x1 + x2) - a1 y1 - a2 y2. */
struct low_pass {
    double b0, a1, a2;
    double x[2], y[2];
};

/* A channel: one quantity that a sensor reads. */
struct channel {
    struct sensor_error error;
    bool ideal;
    struct random_stream noise, walk, wander;
    double noise_now, drift, ramp;
    double bias, bias_keep; /* bias: value of the instability; bias_keep: exp(-tick / tau) */
    double play[SENSING_PLAYS];
    struct low_pass low_pass;
    const struct sensor_device *device;
    bool clocked; /* the clock of the board samples the channel */
    double last;  /* output of the last tick */
    double *line; /* circular delay line; line[at] is the newest entry */
    size_t length, at;
};

/* A fault of one channel. */
struct sensor_fault {
    const struct fault *fault;
    size_t channel;
    struct random_stream random;
    bool was_active;
    double held;      /* output held by SLOW and STUCK */
    int64_t since_ns; /* SLOW: time when `held` was stored */
    bool gap;         /* INTERMITTENT: in a gap */
    double *line;     /* DELAYED: circular delay line */
    size_t length, at;
};

struct joint_state {
    double start_rad; /* incremental encoder: angle at which counting began */
    bool restarts;    /* the counter restarts at the next sample */
    double heated_c;  /* temperature of the winding above ambient */
    double keep;      /* exp(-tick / tau) of the winding */
    double last_q, last_qm;
    double eccentric_phase_rad[2];
    double bending_part[2]; /* fraction of each bending moment in the torque reading */
};

struct sensing {
    struct sensing_config config;
    struct sensor_joint *joint;
    struct sensor_ft *ft;
    size_t nchannel;
    struct channel *channel;
    double (*mix)[SENSOR_FT_CHANNELS][SENSOR_FT_CHANNELS]; /* mixing matrix of each F/T sensor */
    size_t nclock;
    struct sampling_clock *clock;
    struct sensor_device *device; /* joints, F/T sensors, inertial sensor */
    /* rotations from the true axes to the axes of gyro and accelerometer */
    double misaligned[2][9];
    struct ahrs ahrs;
    struct joint_state *state;
    struct sensor_fault *fault;
    size_t nfault;
    struct plant_sensors measured;
    double noise_scale;
    bool ideal; /* all sensors read the true values, so no reading is computed */
    /* true quaternion of the inertial sensor at the last tick, with a continuous sign */
    double last_quaternion[4];
    bool started;
};

/* ---- the number of a channel (faults/faults.h) ---- */

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

/* Creation of a channel: checks of its error model, filter, delay line, random streams. */

/* Returns whether a number is finite and not negative. */
static bool sensing_is_not_negative(double value)
{
    return isfinite(value) && value >= 0.0;
}

/* Returns the number of entries of a delay line: the newest sample, and older samples up to one
 * beyond the delay. */
static size_t sensing_delay_line_length(int64_t delay_ns, int64_t tick_ns)
{
    return delay_ns > 0 ? (size_t)((delay_ns + tick_ns - 1) / tick_ns) + 1 : 0;
}

/* Checks that the parameters of a sensor's error are valid. */
static enum error_code sensor_error_check(const struct sensor_error *e, const char *name,
                                          int64_t tick_ns, struct error *error)
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
    if (!good) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found an error term that is negative or not a number", name);
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

/* Returns the random stream for one error of a sensor, a channel or a clock. */
static struct random_stream sensing_stream(const struct sensing *s, const char *error,
                                           const char *name)
{
    char stream[160];

    snprintf(stream, sizeof stream, "%s %s", error, name);
    return random_named(s->config.seed, stream);
}

/* Creates channel `index`. Its random streams depend only on its name and the seed. Returns
 * ERROR_INPUT for an invalid error, or ERROR_MEMORY. */
static enum error_code sensing_make_channel(struct sensing *s, size_t index, const char *name,
                                            const char *what, const struct sensor_error *from,
                                            struct sensor_device *device, struct arena *arena,
                                            struct error *error)
{
    const int64_t tick_ns = s->config.tick_ns;
    struct channel *channel = &s->channel[index];
    enum error_code code = sensor_error_check(from, name, tick_ns, error);
    int64_t oldest_ns = from->latency_ns;
    const double root_two = 1.4142135623730951;
    double k = portable_tan(3.141592653589793 * from->bandwidth_hz * 1e-9 * (double)tick_ns);
    double norm = 1.0 / (1.0 + root_two * k + k * k);
    char full_name[160];

    if (code) {
        return code;
    }
    snprintf(full_name, sizeof full_name, "%s.%s", name, what);
    channel->error = *from;
    channel->device = device;
    /* A filtered attitude needs no clock, because its inputs already have the age of the last
     * sample */
    channel->clocked =
        device->clock && !(s->config.imu.ahrs.on && index >= sensing_imu_channel(s, 9));
    channel->ideal = from->gain_error == 0.0 && from->offset == 0.0 && from->noise_rms == 0.0 &&
                     from->drift_per_sqrt_s == 0.0 && from->ramp_per_s == 0.0 &&
                     from->full_scale == 0.0 && from->lsb == 0.0 && from->latency_ns == 0 &&
                     from->bandwidth_hz == 0.0 && from->hysteresis == 0.0 &&
                     from->instability_rms == 0.0 && from->offset_per_k == 0.0 &&
                     from->gain_per_k == 0.0 && !channel->clocked;
    s->ideal = s->ideal && channel->ideal;
    channel->noise = sensing_stream(s, "noise", full_name);
    channel->walk = sensing_stream(s, "drift", full_name);
    channel->wander = sensing_stream(s, "instability", full_name);
    channel->bias_keep = from->instability_rms > 0.0
                             ? portable_exp(-1e-9 * (double)tick_ns / from->instability_s)
                             : 0.0;
    /* A second-order Butterworth low pass, by the bilinear transform with prewarping */
    channel->low_pass = (struct low_pass){.b0 = k * k * norm,
                                          .a1 = 2.0 * (k * k - 1.0) * norm,
                                          .a2 = (1.0 - root_two * k + k * k) * norm};

    /* Make the delay line long enough for the oldest sample */
    oldest_ns += channel->clocked ? (int64_t)device->clock->period_ns + 1 : 0;
    channel->length = sensing_delay_line_length(oldest_ns, tick_ns);
    channel->line = arena_alloc(arena, channel->length + 1, sizeof *channel->line);
    return channel->line ? ERROR_NONE
                         : error_set(error, ERROR_MEMORY, "no memory left for sensor %s", name);
}

/* Creation of the sensors: checks, delay lines, random streams. */

/* Checks the warm-up of a sensor and the number of its clock, and sets up the state shared by its
 * channels. */
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
    struct random_stream random = sensing_stream(s, "eccentricity", joint->name);

    if (!sensing_is_not_negative(joint->eccentricity_rad[0]) ||
        !sensing_is_not_negative(joint->eccentricity_rad[1])) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found an eccentricity that is negative or not a number",
                         joint->name);
    }
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

/* Draws the signs of the bending moments in a joint's torque reading. */
static enum error_code sensing_make_bending(struct sensing *s, size_t j, struct error *error)
{
    const struct sensor_joint *joint = &s->joint[j];
    struct random_stream random = sensing_stream(s, "bending", joint->name);

    if (!sensing_is_not_negative(joint->crosstalk)) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found a crosstalk that is negative or not a number",
                         joint->name);
    }
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

    /* Thermal model of the winding */
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

/* Fills the mixing matrix of a force-torque sensor. The diagonal is 1. All other elements are the
 * crosstalk, with random signs, scaled by the full scales. */
static enum error_code sensing_make_crosstalk(struct sensing *s, size_t f, struct error *error)
{
    const struct sensor_ft *ft = &s->ft[f];
    double force = ft->force.full_scale, torque = ft->torque.full_scale;
    double range[SENSOR_FT_CHANNELS] = {force, force, force, torque, torque, torque};
    struct random_stream sign = sensing_stream(s, "crosstalk", ft->name);

    if (!sensing_is_not_negative(ft->crosstalk) ||
        (ft->crosstalk > 0.0 && (!(force > 0.0) || !(torque > 0.0)))) {
        return error_set(error, ERROR_INPUT,
                         "sensor %s: found crosstalk without the full scales that it needs",
                         ft->name);
    }
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

/* Checks the attitude filter and the misalignments of the inertial sensor. Computes the misaligned
 * axes. */
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

/* Creates one entry for each channel of each sensor fault. */
static enum error_code sensing_make_faults(struct sensing *s, struct arena *arena,
                                           struct error *error)
{
    const struct faults *faults = s->config.faults;
    size_t count = 0, n = faults ? faults_count(faults) : 0;
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; i < n; i++) {
        const struct fault *fault = faults_at(faults, i);

        count += fault->target == FAULT_SENSOR ? fault->channels : 0;
    }
    s->fault = arena_alloc(arena, count + 1, sizeof *s->fault);
    if (!s->fault) {
        return error_set(error, ERROR_MEMORY, "no memory left for faults");
    }
    for (size_t i = 0; i < n && !code; i++) {
        const struct fault *fault = faults_at(faults, i);

        for (size_t k = 0; fault->target == FAULT_SENSOR && k < fault->channels && !code; k++) {
            /* Add an entry for channel `k` of a fault */
            struct sensor_fault *to = &s->fault[s->nfault++];
            char stream[FAULT_NAME_SIZE + 64];

            snprintf(stream, sizeof stream, "fault %s %zu", fault->name, k);
            to->fault = fault;
            to->channel = fault->index + k;
            to->random = random_named(faults_seed(s->config.faults), stream);
            if (fault->kind == FAULT_DELAYED) {
                to->length =
                    sensing_delay_line_length((int64_t)(fault->value[0] * 1e9), s->config.tick_ns);
            }
            to->line = arena_alloc(arena, to->length + 1, sizeof *to->line);
            code = to->line
                       ? ERROR_NONE
                       : error_set(error, ERROR_MEMORY, "no memory left for fault %s", fault->name);
        }
    }
    s->ideal = s->ideal && s->nfault == 0;
    return code;
}

/* Draws the rate error and the phase of each board's clock. */
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
        char number[24];

        snprintf(number, sizeof number, "%zu", c);
        random = sensing_stream(s, "clock", clocks->name ? clocks->name[c] : number);
        s->clock[c].period_ns =
            (double)clocks->period_ns *
            (1.0 + 1e-6 * clocks->drift_ppm * (2.0 * random_uniform(&random) - 1.0));
        s->clock[c].phase_ns = s->clock[c].period_ns * random_uniform(&random);
    }
    return ERROR_NONE;
}

/* Allocates all arrays. Returns false when out of memory. */
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
    s->ideal = true; /* stays true until a sensor has an error */
    if (!sensing_allocate(s, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory left for the sensors");
    }

    /* Create the clocks, the sensors with their channels, then the faults */
    code = sensing_make_clocks(s, arena, error);
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

/* Returns x as it was delay_ns ago, interpolated linearly between ticks. line[at] is the newest
 * entry. */
static double sensing_read_delay_line(const double *line, size_t length, size_t at,
                                      int64_t delay_ns, int64_t tick_ns)
{
    size_t whole = (size_t)(delay_ns / tick_ns);
    double part = (double)(delay_ns % tick_ns) / (double)tick_ns;
    double younger = line[(at + length - whole) % length];

    if (part == 0.0) {
        return younger;
    }
    return younger + part * (line[(at + length - whole - 1) % length] - younger);
}

/* Appends x to a delay line. Fills the whole line with x at the first sample. */
static void sensing_push_delay_line(double *line, size_t length, size_t *at, double x, bool started)
{
    for (size_t i = 0; !started && i < length; i++) {
        line[i] = x;
    }
    if (length > 0) {
        *at = (*at + 1) % length;
        line[*at] = x;
    }
}

/* Appends x to a channel's delay line. Returns x as it was latency_ns before the last sampling
 * instant of the board. */
static double channel_delay(struct channel *channel, double x, int64_t tick_ns, bool started)
{
    int64_t age_ns = channel->clocked ? channel->device->clock->age_ns : 0;

    if (channel->length == 0) {
        return x;
    }
    sensing_push_delay_line(channel->line, channel->length, &channel->at, x, started);
    return sensing_read_delay_line(channel->line, channel->length, channel->at,
                                   channel->error.latency_ns + age_ns, tick_ns);
}

/* Returns x with hysteresis: x minus the weighted lag of each play operator. */
static double channel_lag(struct channel *channel, double x, bool started)
{
    /* The widths of all operators sum to (2 - 2^(1 - n)) times the widest width. The widest width
     * is half the full scale */
    const double sum = 2.0 - 2.0 / (1 << SENSING_PLAYS);
    const double weight = channel->error.hysteresis / sum;
    double half_width = 0.5 * channel->error.full_scale, lag = 0.0;

    if (channel->error.hysteresis == 0.0) {
        return x;
    }
    for (int i = 0; i < SENSING_PLAYS; i++, half_width *= 0.5) {
        double *play = &channel->play[i];

        *play = started ? fmax(x - half_width, fmin(x + half_width, *play)) : x;
        lag += x - *play;
    }
    return x - weight * lag;
}

/* Returns x after the low pass. The low pass starts in steady state. */
static double channel_filter(struct channel *channel, double x, bool started)
{
    struct low_pass *f = &channel->low_pass;
    double y;

    if (channel->error.bandwidth_hz == 0.0) {
        return x;
    }
    if (!started) {
        f->x[0] = f->x[1] = f->y[0] = f->y[1] = x;
    }
    y = f->b0 * (x + 2.0 * f->x[0] + f->x[1]) - f->a1 * f->y[0] - f->a2 * f->y[1];
    f->x[1] = f->x[0];
    f->x[0] = x;
    f->y[1] = f->y[0];
    f->y[0] = y;
    return y;
}

/* Shifts the stored values of a channel after the zero of its input has moved. */
static void sensing_shift_channel(struct channel *channel, double shift)
{
    for (int k = 0; k < SENSING_PLAYS; k++) {
        channel->play[k] += shift;
    }
    for (int k = 0; k < 2; k++) {
        channel->low_pass.x[k] += shift;
        channel->low_pass.y[k] += shift;
    }
    for (size_t k = 0; k < channel->length; k++) {
        channel->line[k] += shift;
    }
}

/* Returns the sensor's reading of x. boards/sensing/sensing.h gives the order of the steps. */
static double sensing_measure_channel(const struct sensing *s, struct channel *channel, double x)
{
    const struct sensor_error *e = &channel->error;
    double wander, warm_k = channel->device->warm_k;

    x = channel_lag(channel, x, s->started);
    x = channel_filter(channel, x, s->started);
    x = channel_delay(channel, x, s->config.tick_ns, s->started);

    /* Update the slow errors: drift, ramp and instability */
    double tick_s = 1e-9 * (double)s->config.tick_ns;

    if (s->started) {
        channel->ramp += e->ramp_per_s * tick_s;
        if (e->drift_per_sqrt_s > 0.0) {
            channel->drift += e->drift_per_sqrt_s * sqrt(tick_s) * random_gaussian(&channel->walk);
        }
    }
    if (e->instability_rms > 0.0) {
        /* The first value already has the stationary variance */
        double keep = s->started ? channel->bias_keep : 0.0;

        channel->bias = keep * channel->bias + e->instability_rms * sqrt(1.0 - keep * keep) *
                                                   random_gaussian(&channel->wander);
    }
    wander = channel->drift + channel->ramp + channel->bias;

    x += (e->gain_error + e->gain_per_k * warm_k) * x + e->offset + e->offset_per_k * warm_k +
         wander;
    if (e->noise_rms > 0.0) {
        /* Noise is constant between two samples */
        if (!channel->clocked || !s->started || channel->device->clock->sampled) {
            channel->noise_now = s->noise_scale * e->noise_rms * random_gaussian(&channel->noise);
        }
        x += channel->noise_now;
    }
    /* Converter: saturate at the full scale and round to steps of lsb */
    x = e->full_scale > 0.0 ? fmax(-e->full_scale, fmin(e->full_scale, x)) : x;
    return e->lsb > 0.0 ? e->lsb * floor(x / e->lsb + 0.5) : x;
}

/* Reading of the sensors. Crosstalk and encoder errors come before each channel's chain, faults
 * after it. */

/* ---- faults ---- */

/* Returns x after a fault. last: previous output of the channel. */
static double sensor_fault_disturb(const struct sensing *s, struct sensor_fault *f, double x,
                                   double last)
{
    const struct fault *fault = f->fault;
    int64_t now_ns = s->measured.time_ns;
    bool begins = !f->was_active;

    switch (fault->kind) {
    case FAULT_OFF:
        return 0.0;
    case FAULT_STUCK: /* holds the output from before the fault */
        f->held = begins ? last : f->held;
        return f->held;
    case FAULT_GARBAGE:
        return fault->value[0] * (2.0 * random_uniform(&f->random) - 1.0);
    case FAULT_WRONG:
        return fault->value[0] * x + fault->value[1];
    case FAULT_SLOW: /* takes a new value once per period */
        if (begins || now_ns - f->since_ns >= (int64_t)(fault->value[0] * 1e9)) {
            f->held = x;
            f->since_ns = now_ns;
        }
        return f->held;
    case FAULT_DELAYED:
        return sensing_read_delay_line(f->line, f->length, f->at, (int64_t)(fault->value[0] * 1e9),
                                       s->config.tick_ns);
    case FAULT_INTERMITTENT: /* gaps begin and end at random */
        f->gap = random_gap(&f->random, f->gap, fault->value[0], fault->value[1],
                            1e-9 * (double)s->config.tick_ns);
        return f->gap ? 0.0 : x;
    default:
        return x;
    }
}

/* Reads one channel: the sensor, then its faults in the order of their list. */
static double sensing_read_channel(struct sensing *s, size_t index, double x)
{
    struct channel *channel = &s->channel[index];

    x = channel->ideal ? x : sensing_measure_channel(s, channel, x);
    for (size_t i = 0; i < s->nfault; i++) {
        struct sensor_fault *f = &s->fault[i];

        if (f->channel != index) {
            continue;
        }
        /* Also fill the line before the fault begins, because the fault needs past values */
        sensing_push_delay_line(f->line, f->length, &f->at, x, s->started);
        if (f->fault->active) {
            x = sensor_fault_disturb(s, f, x, s->started ? channel->last : x);
        }
        f->was_active = f->fault->active;
    }
    channel->last = x;
    return x;
}

/* ---- the sensors ---- */

/* Returns whether a channel has a fault. now: counts only faults that act now. */
static bool sensing_channel_fails(const struct sensing *s, size_t channel, bool now)
{
    for (size_t i = 0; i < s->nfault; i++) {
        if (s->fault[i].channel == channel && (!now || s->fault[i].fault->active)) {
            return true;
        }
    }
    return false;
}

/* Returns whether a channel reads the true value, without errors and faults. */
static bool sensing_channel_is_plain(const struct sensing *s, size_t channel)
{
    return s->channel[channel].ideal && !sensing_channel_fails(s, channel, false);
}

/* Advances the temperature of a winding by one tick at current_a and returns it. Without a thermal
 * model of the winding, returns the plant's temperature, or 0. */
static double sensing_heat_winding(const struct sensing *s, size_t j,
                                   const struct motor_sense *truth)
{
    const struct sensor_thermal *thermal = &s->joint[j].thermal;
    struct joint_state *state = &s->state[j];
    double goal = thermal->resistance_ohm * truth->current_a * truth->current_a * thermal->k_per_w;

    if (thermal->resistance_ohm == 0.0) {
        return truth->winding_c;
    }
    if (s->started) {
        state->heated_c = goal + (state->heated_c - goal) * state->keep;
    }
    return thermal->ambient_c + state->heated_c;
}

/* Returns the angle that an encoder with an eccentric ring reads. The error is 0 at angle 0, where
 * the encoder was calibrated. */
static double sensing_eccentric_angle(const struct sensing *s, size_t j, double q)
{
    const double *part = s->joint[j].eccentricity_rad, *phase = s->state[j].eccentric_phase_rad;
    double shown = q;

    for (int k = 0; k < 2 && (part[0] > 0.0 || part[1] > 0.0); k++) {
        shown += part[k] * (portable_sin((k + 1) * q + phase[k]) - portable_sin(phase[k]));
    }
    return shown;
}

/* Returns the rate from the readings of an encoder. Returns the true rate for an ideal encoder. */
static double sensing_encoder_rate(const struct sensing *s, size_t channel, double now,
                                   double *last, double truth)
{
    double change = s->started ? now - *last : 0.0;

    *last = now;
    return sensing_channel_is_plain(s, channel) ? truth
                                                : change / (1e-9 * (double)s->config.tick_ns);
}

/* Reads the sensors of a joint: encoders with their rates, current, torque, temperature. */
static void sensing_read_joint(struct sensing *s, size_t j, const struct motor_sense *truth)
{
    struct motor_sense *out = &s->measured.motor[j];
    struct joint_state *state = &s->state[j];
    size_t link = sensing_joint_channel(j, SENSOR_LINK_ENCODER),
           motor = sensing_joint_channel(j, SENSOR_MOTOR_ENCODER);

    /* An incremental encoder counts from its position at the start or restart */
    if (s->joint[j].incremental && (!s->started || state->restarts)) {
        sensing_shift_channel(&s->channel[motor], state->start_rad - truth->qm);
        state->start_rad = truth->qm;
    }
    *out = *truth;
    out->q = sensing_read_channel(s, link, sensing_eccentric_angle(s, j, truth->q));
    out->qm = sensing_read_channel(s, motor, truth->qm - state->start_rad);
    out->qd = sensing_encoder_rate(s, link, out->q, &state->last_q, truth->qd);
    if (state->restarts) {
        state->last_qm = out->qm; /* the jump of the counter is no motion */
        state->restarts = false;
    }
    out->qmd = sensing_encoder_rate(s, motor, out->qm, &state->last_qm, truth->qmd);
    out->current_a =
        sensing_read_channel(s, sensing_joint_channel(j, SENSOR_CURRENT), truth->current_a);
    out->torque_nm =
        sensing_read_channel(s, sensing_joint_channel(j, SENSOR_TORQUE),
                             truth->torque_nm + state->bending_part[0] * truth->bending_nm[0] +
                                 state->bending_part[1] * truth->bending_nm[1]);
    out->winding_c = sensing_read_channel(s, sensing_joint_channel(j, SENSOR_TEMPERATURE),
                                          sensing_heat_winding(s, j, truth));
}

/* Reads a force-torque sensor: crosstalk, then each channel. */
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

        /* Set the peak of a force-torque channel to its reading plus the true peak's excess over
         * the true value. A fault on the channel removes the excess. A saturated converter gives
         * the true peak. */
        const size_t i = to % 3;
        const size_t number = sensing_ft_channel(s, f, to);
        const double end = s->channel[number].error.full_scale;
        const bool fails = sensing_channel_fails(s, number, true);
        const double true_peak = to < 3 ? truth->peak_n[i] : truth->peak_nm[i];
        const double *true_now = to < 3 ? truth->force_n : truth->torque_nm;
        const double reading = to < 3 ? out->force_n[i] : out->torque_nm[i];
        double peak = reading + (fails ? 0.0 : true_peak - true_now[i]);

        if (!fails && end > 0.0 && fabs(true_now[i]) > end) {
            peak = true_peak;
        }
        *(to < 3 ? &out->peak_n[i] : &out->peak_nm[i]) = peak;
    }
}

/* Rotates a vector into misaligned axes. Without misalignment, copies it. */
static void sensing_turn(const double R[9], const double angle_rad[3], const double truth[3],
                         double turned[3])
{
    if (angle_rad[0] == 0.0 && angle_rad[1] == 0.0 && angle_rad[2] == 0.0) {
        memcpy(turned, truth, 3 * sizeof *turned);
    } else {
        mat3_apply(R, truth, turned);
    }
}

/* Reads the orientation. A quaternion and its negative are the same rotation. The channels
 * interpolate, so they use the sign that is close to the last quaternion. The output is normalized.
 * 0 stays 0 and means an unknown orientation. */
static void sensing_read_orientation(struct sensing *s, const double truth[4])
{
    const size_t first = SENSOR_IMU_CHANNELS - 4;
    double *out = s->measured.imu.quaternion, square = 0.0, near = 0.0;
    bool plain = true;

    for (size_t i = 0; i < 4; i++) {
        near += s->started ? truth[i] * s->last_quaternion[i] : 1.0;
    }
    for (size_t i = 0; i < 4; i++) {
        size_t channel = sensing_imu_channel(s, first + i);

        s->last_quaternion[i] = near < 0.0 ? -truth[i] : truth[i];
        out[i] = sensing_read_channel(s, channel, s->last_quaternion[i]);
        square += out[i] * out[i];
        plain = plain && sensing_channel_is_plain(s, channel);
    }
    for (size_t i = 0; i < 4; i++) {
        out[i] = plain ? truth[i] : square > 0.0 ? out[i] / sqrt(square) : 0.0;
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

const struct plant_sensors *sensing_sample(struct sensing *s, int64_t now_ns,
                                           const struct plant_sensors *truth)
{
    if (s->ideal) {
        return truth;
    }
    s->measured.time_ns = now_ns;
    s->measured.supply_v = truth->supply_v;
    s->measured.oil_pa = truth->oil_pa;
    s->measured.njoint = truth->njoint;
    s->measured.nft = truth->nft;

    /* Advance the state that channels share: age of the samples, warm-up */
    for (size_t c = 0; c < s->nclock; c++) {
        struct sampling_clock *clock = &s->clock[c];
        double age = fmod((double)now_ns - clock->phase_ns, clock->period_ns);

        clock->age_ns = (int64_t)(age < 0.0 ? age + clock->period_ns : age);
        clock->sampled = clock->age_ns < s->config.tick_ns;
    }
    for (size_t d = 0; s->started && d < s->config.njoint + s->config.nft + 1; d++) {
        struct sensor_device *device = &s->device[d];

        device->warm_k =
            device->warm_up.rise_k + (device->warm_k - device->warm_up.rise_k) * device->keep;
    }

    /* Read all sensors */
    for (size_t j = 0; j < s->config.njoint; j++) {
        sensing_read_joint(s, j, &truth->motor[j]);
    }
    for (size_t f = 0; f < s->config.nft; f++) {
        sensing_read_ft(s, f, &truth->ft[f]);
    }

    /* Read the inertial sensor */
    const struct sensor_imu *imu = &s->config.imu;
    struct imu_sense *out = &s->measured.imu;
    double rate[3], force[3];

    sensing_turn(s->misaligned[0], imu->gyro_misalignment_rad, truth->imu.gyro_rad_s, rate);
    sensing_turn(s->misaligned[1], imu->accel_misalignment_rad, truth->imu.accel_m_s2, force);
    for (size_t i = 0; i < 3; i++) {
        out->gyro_rad_s[i] = sensing_read_channel(s, sensing_imu_channel(s, i), rate[i]);
        out->accel_m_s2[i] = sensing_read_channel(s, sensing_imu_channel(s, 3 + i), force[i]);
        out->magnetic_t[i] =
            sensing_read_channel(s, sensing_imu_channel(s, 6 + i), truth->imu.magnetic_t[i]);
    }
    if (imu->ahrs.on && !s->started) {
        ahrs_align(&s->ahrs, out->accel_m_s2, out->magnetic_t, out->gyro_rad_s);
    } else if (imu->ahrs.on) {
        ahrs_update(&s->ahrs, &imu->ahrs, out->gyro_rad_s, out->accel_m_s2, out->magnetic_t,
                    1e-9 * (double)s->config.tick_ns);
    }
    sensing_read_orientation(s, imu->ahrs.on ? s->ahrs.quaternion : truth->imu.quaternion);

    s->started = true;
    return &s->measured;
}
