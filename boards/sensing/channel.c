/* SPDX-License-Identifier: Apache-2.0 */
/* The chain from a quantity to a sensor's reading of it; boards/sensing/sensing.h has its order. */
#include "boards/sensing/private.h"

#include <math.h>

double sensing_read_delay_line(const double *line, size_t length, size_t at, int64_t delay_ns,
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

void sensing_shift_channel(struct channel *channel, double shift)
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

double sensing_measure_channel(const struct sensing *s, struct channel *channel, double x)
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
