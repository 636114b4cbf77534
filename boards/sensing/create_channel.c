/* SPDX-License-Identifier: Apache-2.0 */
/* Creates a channel of a sensor: its error's ranges checked, filter, delay line and random streams
 * laid out. */
#include "base/portable_math.h"
#include "boards/sensing/private.h"

#include <math.h>
#include <stdio.h>

bool sensing_is_not_negative(double value)
{
    return isfinite(value) && value >= 0.0;
}

size_t sensing_delay_line_length(int64_t delay_ns, int64_t tick_ns)
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

enum error_code sensing_make_channel(struct sensing *s, size_t index, const char *name,
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
