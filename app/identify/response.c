/* SPDX-License-Identifier: Apache-2.0 */
/* Computes responses to steps and to sweeps. */

#include "app/identify/identify.h"

#include <complex.h>
#include <math.h>

/* Frequencies at which a band of 1 Hz is evaluated; consecutive weak bands that end a sweep. */
enum { LINES = 20, WEAK_BANDS = 5 };

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

/* Computes the spectrum of the command, and its cross spectrum with the signal, in the band of 1 Hz
 * about a frequency. Between rows the command is held and the signal linear: both are sampled at
 * equal times. */
static void add_band(const double *time, const double *command, const double *signal, size_t count,
                     double hz, double *power, double complex *cross)
{
    const double step = (time[count - 1] - time[0]) / (double)(count - 1);

    *power = 0.0;
    *cross = 0.0;
    for (int line = 0; line < LINES; line++) {
        const double w = 2.0 * M_PI * (hz - 0.5 + ((double)line + 0.5) / LINES);
        const double complex turn = cexp(-w * step * (double complex)I);
        double complex input = 0.0, output = 0.0, angle = 1.0;
        size_t row = 0;

        for (size_t i = 0; i < count; i++, angle *= turn) {
            const double t = time[0] + (double)i * step;

            while (row + 2 < count && time[row + 1] <= t) {
                row++;
            }
            input += command[row] * angle;
            output += (signal[row] + (signal[row + 1] - signal[row]) * (t - time[row]) /
                                         (time[row + 1] - time[row])) *
                      angle;
        }
        *power += creal(input * conj(input));
        *cross += output * conj(input);
    }
}

/* Finds gain, peak and bandwidth of the excited bands. */
static void judge_bands(struct response *r)
{
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
    const double rate = (double)(count - 1) / (time[count - 1] - time[0]);
    double power[RESPONSE_BANDS], most = 0.0;
    double complex cross[RESPONSE_BANDS];
    size_t change = 0, changes = 0, nband = 0, weak = 0;

    *r = (struct response){.t10 = NAN,
                           .t63 = NAN,
                           .t90 = NAN,
                           .overshoot = NAN,
                           .gain = NAN,
                           .bandwidth = NAN,
                           .peak = NAN,
                           .peak_hz = NAN};
    for (size_t i = 1; i < count; i++) {
        change = command[i] != command[i - 1] && changes++ == 0 ? i : change;
    }
    if (changes <= 1) {
        if (changes == 1) {
            compute_step(time, command, signal, count, change, r);
        }
        return;
    }
    for (; nband < RESPONSE_BANDS && (double)nband + 1.5 < 0.5 * rate && weak < WEAK_BANDS;
         nband++) {
        add_band(time, command, signal, count, (double)nband + 1.0, &power[nband], &cross[nband]);
        most = fmax(most, power[nband]);
        weak = power[nband] < EXCITED * most ? weak + 1 : 0;
    }
    for (size_t i = 0; i < nband; i++) {
        if (power[i] >= EXCITED * most) {
            r->band[r->nband] = (double)i + 1.0;
            r->magnitude[r->nband++] = cabs(cross[i]) / power[i];
        }
    }
    judge_bands(r);
}
