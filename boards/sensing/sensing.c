/* SPDX-License-Identifier: Apache-2.0 */
/* The chain from a quantity to a sensor's reading of it; boards/sensing/sensing.h has its order. */
#include "boards/sensing/private.h"

#include "base/vec3.h"

#include <math.h>
#include <string.h>

/* Returns what x was delay_ns ago, linear between two ticks. The newest entry of the line is
 * line[at]; the line reaches at least that far back. */
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

/* Appends x to the delay line of a channel; returns x of its latency and its board's last sampling
 * instant ago. */
static double channel_delay(struct channel *channel, double x, int64_t tick_ns, bool started)
{
    int64_t age_ns = channel->clocked ? channel->device->clock->age_ns : 0;

    if (channel->length == 0) {
        return x;
    }
    /* Before the first sample the quantity is taken to have been constant */
    for (size_t i = 0; !started && i < channel->length; i++) {
        channel->line[i] = x;
    }
    channel->at = (channel->at + 1) % channel->length;
    channel->line[channel->at] = x;
    return sensing_read_delay_line(channel->line, channel->length, channel->at,
                                   channel->error.latency_ns + age_ns, tick_ns);
}

/* Returns x with hysteresis: less a weight of what each play operator lags behind. */
static double channel_lag(struct channel *channel, double x, bool started)
{
    /* Widths of all operators add up to (2 - 2^(1 - n)) of the widest, half the full scale */
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

/* Returns x behind the low pass, which starts settled. */
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

/* Updates what wanders: drift, ramp and instability. Returns their sum. */
static double channel_wander(struct channel *channel, double tick_s, bool started)
{
    const struct sensor_error *e = &channel->error;

    if (started) {
        channel->ramp += e->ramp_per_s * tick_s;
        if (e->drift_per_sqrt_s > 0.0) {
            channel->drift += e->drift_per_sqrt_s * sqrt(tick_s) * random_gaussian(&channel->walk);
        }
    }
    if (e->instability_rms > 0.0) {
        /* Starts with its own variance, and keeps it */
        double keep = started ? channel->bias_keep : 0.0;

        channel->bias = keep * channel->bias + e->instability_rms * sqrt(1.0 - keep * keep) *
                                                   random_gaussian(&channel->wander);
    }
    return channel->drift + channel->ramp + channel->bias;
}

/* Returns x after the converter: cut to the full scale, rounded to steps of lsb. */
static double sensor_error_convert(const struct sensor_error *e, double x)
{
    if (e->full_scale > 0.0) {
        x = fmax(-e->full_scale, fmin(e->full_scale, x));
    }
    return e->lsb > 0.0 ? e->lsb * floor(x / e->lsb + 0.5) : x;
}

/* Moves all that a channel remembers of its input, whose zero has moved. */
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

/* Returns the sensor's reading of x, in the order that boards/sensing/sensing.h gives. */
static double sensing_measure_channel(const struct sensing *s, struct channel *channel, double x)
{
    const struct sensor_error *e = &channel->error;
    double wander, warm_k = channel->device->warm_k;

    x = channel_lag(channel, x, s->started);
    x = channel_filter(channel, x, s->started);
    x = channel_delay(channel, x, s->config.tick_ns, s->started);
    wander = channel_wander(channel, 1e-9 * (double)s->config.tick_ns, s->started);
    x += (e->gain_error + e->gain_per_k * warm_k) * x + e->offset + e->offset_per_k * warm_k +
         wander;
    if (e->noise_rms > 0.0) {
        /* Noise stands still between two samples, as all else does */
        if (!channel->clocked || !s->started || channel->device->clock->sampled) {
            channel->noise_now = s->noise_scale * e->noise_rms * random_gaussian(&channel->noise);
        }
        x += channel->noise_now;
    }
    return sensor_error_convert(e, x);
}

/* Reads the sensors: what comes before the chain of every channel, and its faults. */

/* ---- faults ---- */

/* Returns x as disturbed by a fault; last is what the channel said before. */
static double sensor_fault_disturb(const struct sensing *s, struct sensor_fault *f, double x,
                                   double last)
{
    const struct fault *fault = f->fault;
    int64_t now_ns = s->measured.time_ns;
    bool begins = !f->was_active;

    switch (fault->kind) {
    case FAULT_OFF:
        return 0.0;
    case FAULT_STUCK: /* at what it said before the fault */
        f->held = begins ? last : f->held;
        return f->held;
    case FAULT_GARBAGE:
        return fault->value[0] * (2.0 * random_uniform(&f->random) - 1.0);
    case FAULT_WRONG:
        return fault->value[0] * x + fault->value[1];
    case FAULT_SLOW: /* a new value when the period is over */
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

/* Feeds the delay line of a fault also while it is not active, so that it holds the past when
 * the fault begins. */
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

/* Reads one channel: the sensor, then its faults in the order of the table. */
static double sensing_read_channel(struct sensing *s, size_t index, double x)
{
    struct channel *channel = &s->channel[index];

    x = channel->ideal ? x : sensing_measure_channel(s, channel, x);
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

/* Returns whether a channel has neither errors nor faults: it shows the truth. */
static bool sensing_channel_is_plain(const struct sensing *s, size_t channel)
{
    for (size_t i = 0; i < s->nfault; i++) {
        if (s->fault[i].channel == channel) {
            return false;
        }
    }
    return s->channel[channel].ideal;
}

/* Updates and returns the temperature of a winding after another tick of current_a; where it is
 * not modeled here, what the plant says: that of its own model, or 0. */
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

/* Returns the angle that an eccentric ring shows, without its error where it was calibrated: 0. */
static double sensing_eccentric_angle(const struct sensing *s, size_t j, double q)
{
    const double *part = s->joint[j].eccentricity_rad, *phase = s->state[j].eccentric_phase_rad;
    double shown = q;

    for (int k = 0; k < 2 && (part[0] > 0.0 || part[1] > 0.0); k++) {
        shown += part[k] * (portable_sin((k + 1) * q + phase[k]) - portable_sin(phase[k]));
    }
    return shown;
}

/* Returns the rate that an encoder's readings show, or the truth where it is ideal. */
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

    /* An incremental encoder counts from where it stands at its start */
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

/* Returns whether a fault acts on a channel now. */
static bool sensing_channel_fails(const struct sensing *s, size_t channel)
{
    for (size_t i = 0; i < s->nfault; i++) {
        if (s->fault[i].channel == channel && s->fault[i].fault->active) {
            return true;
        }
    }
    return false;
}

/* Sets the peak of a force-torque channel: as far beyond its reading as the true one is, unless a
 * fault makes the reading or the converter is at its end. */
static void sensing_set_ft_peak(const struct sensing *s, size_t f, const struct ft_sense *truth,
                                size_t channel)
{
    struct ft_sense *out = &s->measured.ft[f];
    const size_t i = channel % 3;
    const size_t number = sensing_ft_channel(s, f, channel);
    const double end = s->channel[number].error.full_scale;
    const bool fails = sensing_channel_fails(s, number);
    const double true_peak = channel < 3 ? truth->peak_n[i] : truth->peak_nm[i];
    const double *true_now = channel < 3 ? truth->force_n : truth->torque_nm;
    const double reading = channel < 3 ? out->force_n[i] : out->torque_nm[i];
    double peak = reading + (fails ? 0.0 : true_peak - true_now[i]);

    if (!fails && end > 0.0 && fabs(true_now[i]) > end) {
        peak = true_peak;
    }
    *(channel < 3 ? &out->peak_n[i] : &out->peak_nm[i]) = peak;
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
        sensing_set_ft_peak(s, f, truth, to);
    }
}

/* Computes a vector in axes that are turned from the true ones: itself where they are not. */
static void sensing_turn(const double R[9], const double angle_rad[3], const double truth[3],
                         double turned[3])
{
    if (angle_rad[0] == 0.0 && angle_rad[1] == 0.0 && angle_rad[2] == 0.0) {
        memcpy(turned, truth, 3 * sizeof *turned);
    } else {
        mat3_apply(R, truth, turned);
    }
}

/* Updates the sensor's own attitude filter by its readings of this tick. */
static void sensing_update_ahrs(struct sensing *s)
{
    const struct imu_sense *imu = &s->measured.imu;

    if (!s->started) {
        ahrs_align(&s->ahrs, imu->accel_m_s2, imu->magnetic_t, imu->gyro_rad_s);
    } else {
        ahrs_update(&s->ahrs, &s->config.imu.ahrs, imu->gyro_rad_s, imu->accel_m_s2,
                    imu->magnetic_t, 1e-9 * (double)s->config.tick_ns);
    }
}

/* Reads the orientation. A quaternion and its opposite are one rotation: the channels, which
 * interpolate, get the one near the last. Their output has any length; 0 stays 0, an unknown
 * orientation. */
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

/* Reads the inertial sensor. */
static void sensing_read_imu(struct sensing *s, const struct imu_sense *truth)
{
    const struct sensor_imu *imu = &s->config.imu;
    struct imu_sense *out = &s->measured.imu;
    double rate[3], force[3];

    sensing_turn(s->misaligned[0], imu->gyro_misalignment_rad, truth->gyro_rad_s, rate);
    sensing_turn(s->misaligned[1], imu->accel_misalignment_rad, truth->accel_m_s2, force);
    for (size_t i = 0; i < 3; i++) {
        out->gyro_rad_s[i] = sensing_read_channel(s, sensing_imu_channel(s, i), rate[i]);
        out->accel_m_s2[i] = sensing_read_channel(s, sensing_imu_channel(s, 3 + i), force[i]);
        out->magnetic_t[i] =
            sensing_read_channel(s, sensing_imu_channel(s, 6 + i), truth->magnetic_t[i]);
    }
    if (imu->ahrs.on) {
        sensing_update_ahrs(s);
    }
    sensing_read_orientation(s, imu->ahrs.on ? s->ahrs.quaternion : truth->quaternion);
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

/* Updates what sensors have in common: how long ago their boards sampled, how warm they are. */
static void sensing_update_devices(struct sensing *s, int64_t now_ns)
{
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
    sensing_update_devices(s, now_ns);
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
