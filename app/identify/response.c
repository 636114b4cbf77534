/* SPDX-License-Identifier: Apache-2.0 */
/* Computes responses to steps and to sweeps. */

#include "app/identify/identify.h"

#include <complex.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

/* Smallest share of the command's power in the strongest band; share of a step whose mean is its
 * end. */
#define EXCITED 0.1
#define END_SHARE 0.1

/* Returns the time at which a signal first passes a level in the direction of a step, or NAN. */
static double find_crossing(const double *time, const double *signal, size_t from, size_t count,
                            double level, double sense)
{
    for (size_t i = from; i < count; i++) {
        if (sense * (signal[i] - level) >= 0.0) {
            const double before = i > 0 ? signal[i - 1] : signal[i];
            const double share =
                signal[i] != before ? (level - before) / (signal[i] - before) : 1.0;

            return i > 0 ? time[i - 1] + share * (time[i] - time[i - 1]) : time[i];
        }
    }
    return (double)NAN;
}

static double mean_of(const double *value, size_t from, size_t end)
{
    double sum = 0.0;

    for (size_t i = from; i < end; i++) {
        sum += value[i];
    }
    return sum / (double)(end - from);
}

/* Computes the response to a command that changes at row `change`. */
static void compute_step(const double *time, const double *command, const double *signal,
                         size_t count, size_t change, struct response *r)
{
    const size_t last = (size_t)((double)(count - change) * END_SHARE) + 1;
    const double begin = mean_of(signal, 0, change);
    const double rise = mean_of(signal, count - last, count) - begin,
                 sense = rise < 0.0 ? -1.0 : 1.0;
    const double share[] = {0.1, 0.63, 0.9};
    double *const found[] = {&r->t10, &r->t63, &r->t90};

    r->gain = rise / (command[change] - command[0]);
    for (int i = 0; i < 3; i++) {
        *found[i] = find_crossing(time, signal, change, count, begin + share[i] * rise, sense) -
                    time[change];
    }
    r->overshoot = 0.0;
    for (size_t i = change; i < count; i++) {
        r->overshoot = fmax(r->overshoot, (signal[i] - begin) / rise - 1.0);
    }
}

/* Spectrum of a command, and its cross spectrum with a signal, in bands about 1, 2, ... Hz. */
struct spectra {
    double power[RESPONSE_BANDS];
    double complex cross[RESPONSE_BANDS];
};

/* Adds the spectra of the second from `begin`, without its mean and with a Hann window. Between
 * rows the command is held and the signal linear. With this window the mean affects only the first
 * band, which therefore subtracts it. */
static void add_second(const double *time, const double *command, const double *signal,
                       double begin, size_t samples, struct spectra *spectra)
{
    double complex sum[RESPONSE_BANDS][2] = {{0.0}}, angle[RESPONSE_BANDS], turn[RESPONSE_BANDS];
    size_t row = 0;

    for (int b = 0; b < RESPONSE_BANDS; b++) {
        angle[b] = 1.0;
        turn[b] = cexp(-2.0 * M_PI * (b + 1) / (double)samples * (double complex)I);
    }
    for (size_t i = 0; i < samples; i++) {
        const double at = (double)i / (double)samples, window = 1.0 - cos(2.0 * M_PI * at);

        while (time[row + 1] <= begin + at) {
            row++;
        }
        const double input = command[row], output = signal[row] + (signal[row + 1] - signal[row]) *
                                                                      (begin + at - time[row]) /
                                                                      (time[row + 1] - time[row]);

        sum[0][0] += 0.5 * input;
        sum[0][1] += 0.5 * output;
        for (int b = 0; b < RESPONSE_BANDS; b++) {
            sum[b][0] += window * input * angle[b];
            sum[b][1] += window * output * angle[b];
            angle[b] *= turn[b];
        }
    }
    for (int b = 0; b < RESPONSE_BANDS; b++) {
        spectra->power[b] += creal(sum[b][0] * conj(sum[b][0]));
        spectra->cross[b] += sum[b][1] * conj(sum[b][0]);
    }
}

/* Computes the response to a sweep from seconds that overlap by half. */
static void compute_sweep(const double *time, const double *command, const double *signal,
                          size_t count, struct response *r)
{
    const double length = time[count - 1] - time[0], rate = (double)(count - 1) / length;
    const int bands = (int)fmin(RESPONSE_BANDS, 0.5 * rate - 0.5);
    struct spectra spectra = {.power = {0.0}};
    double most = 0.0;

    for (int half = 0; 0.5 * half + 1.0 <= length; half++) {
        add_second(time, command, signal, time[0] + 0.5 * half, (size_t)rate, &spectra);
    }
    for (int b = 0; b < bands; b++) {
        most = fmax(most, spectra.power[b]);
    }
    for (int b = 0; b < bands; b++) {
        if (spectra.power[b] > EXCITED * most) {
            r->band[r->nband] = b + 1.0;
            r->magnitude[r->nband++] = cabs(spectra.cross[b]) / spectra.power[b];
        }
    }

    /* Find gain, peak and bandwidth of the excited bands */
    r->gain = r->nband > 0 ? r->magnitude[0] : (double)NAN;
    for (size_t i = 0; i < r->nband; i++) {
        const double limit = r->gain * M_SQRT1_2;

        if (!(r->magnitude[i] <= r->peak)) {
            r->peak = r->magnitude[i];
            r->peak_hz = r->band[i];
        }
        if (isnan(r->bandwidth) && r->magnitude[i] < limit) {
            r->bandwidth = r->band[i - 1] + (r->band[i] - r->band[i - 1]) *
                                                (r->magnitude[i - 1] - limit) /
                                                (r->magnitude[i - 1] - r->magnitude[i]);
        }
    }
}

void response_compute(const double *time, const double *command, const double *signal, size_t count,
                      struct response *r)
{
    size_t change = 0, changes = 0;

    *r = (struct response){NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, .nband = 0};
    for (size_t i = 1; i < count; i++) {
        change = command[i] != command[i - 1] && changes++ == 0 ? i : change;
    }
    if (changes == 1) {
        compute_step(time, command, signal, count, change, r);
    } else if (changes > 1) {
        compute_sweep(time, command, signal, count, r);
    }
}

void response_of(const struct bench_law *law, const struct recording *r, const double *signal,
                 struct response *response)
{
    response_compute(r->time, law->duty_per_rad > 0.0 ? r->goal : r->voltage, signal, r->count,
                     response);
}

/* ---- limits ---- */

/* The RMS error (-1), and quantities of a response by their offset in struct response. */
const struct word limit_words[] = {{"share", -1},
                                   {"t10", offsetof(struct response, t10)},
                                   {"t63", offsetof(struct response, t63)},
                                   {"t90", offsetof(struct response, t90)},
                                   {"gain", offsetof(struct response, gain)},
                                   {"bandwidth", offsetof(struct response, bandwidth)},
                                   {"peak", offsetof(struct response, peak)},
                                   {NULL, 0}};

double limit_error(const struct validation *v, const struct bench_limit *limit, size_t i)
{
    const struct recording *r = &v->bench.recording[i];
    const enum signal first = recording_first(r);
    const double *measured = r->signal[first], *simulated = v->simulated[i].signal[first];
    struct response of[2];
    double value[2];

    if (!v->judges[i] ||
        (limit->of && strcmp(limit->of, r->group) != 0 && strcmp(limit->of, r->name) != 0)) {
        return (double)NAN;
    }
    if (limit->what < 0) {
        return 100.0 * simulation_compare(measured, simulated, r->count).share;
    }
    for (int k = 0; k < 2; k++) {
        response_of(&v->bench.bench.law, r, k == 0 ? measured : simulated, &of[k]);
        memcpy(&value[k], (const char *)&of[k] + limit->what, sizeof value[k]);
    }
    return isnan(value[1]) && !isnan(value[0]) ? (double)INFINITY
                                               : 100.0 * (value[1] / value[0] - 1.0);
}

const char *limit_verdict(const struct bench_limit *limit, double error)
{
    return fabs(error) > limit->percent          ? "limit missed"
           : fabs(error) > limit->wanted_percent ? "wish missed"
                                                 : "held";
}
