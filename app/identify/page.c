/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the pages on identifications and validations. */

#include "app/identify/identify.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Number of frequencies in a residual's spectrum, up to SPECTRUM_HZ. */
enum { SPECTRUM_LINES = 100 };
#define SPECTRUM_HZ 10.0

/* Smallest correlation of two parameters that the page lists. */
#define CORRELATED 0.8

/* Adds a plot of steady states to a page: the losses over the load. */
static void plot_steady(struct report *report, const char *id, const struct recording *r,
                        const double *loss)
{
    const struct svg_series series[] = {
        svg_line("computed", r->goal, loss, r->count, SVG_MARKERS),
        svg_line("measured", r->goal, r->signal[SIGNAL_LOSS], r->count, SVG_MARKERS)};
    const struct svg_plot panel = svg_panel("", "load, N m", "losses / measured", series, 2);
    char caption[256];

    snprintf(caption, sizeof caption,
             "%.120s: losses as shares of those measured, median error %.1f %%; mean error of the "
             "efficiency %.1f points",
             r->name, 100.0 * point_loss_error(r, loss), 100.0 * point_efficiency_error(r, loss));
    report_figure(report, id, caption, &panel, 1);
}

/* Adds plots of a signal of a recording to a page: measured and simulated, the residual, its
 * spectrum, and the gain of the response to a sweep. */
static void identify_plot(struct report *report, const char *id, const struct recording *r,
                          const struct bench_law *law, enum signal signal, const double *simulated)
{
    const double *measured = r->signal[signal];
    const char *unit = signal_kinds[signal].unit, *name = signal_kinds[signal].key;
    double frequency[SPECTRUM_LINES], amplitude[SPECTRUM_LINES];
    double *residual;
    const struct simulation_error found = simulation_compare(measured, simulated, r->count);

    if (signal == SIGNAL_LOSS) {
        plot_steady(report, id, r, simulated);
        return;
    }
    residual = calloc(r->count, sizeof *residual);
    if (!residual) {
        report_text(report, "There was no memory for the plots of this recording.");
        return;
    }
    for (size_t i = 0; i < r->count; i++) {
        residual[i] = simulated[i] - measured[i];
    }

    /* Compute the spectrum of a residual: its amplitudes at the centers of equal frequency
     * bands, Hz. Use a Fourier sum at the residual's own times, with a Hann window. */
    const double length = r->time[r->count - 1] - r->time[0];

    for (size_t k = 0; k < SPECTRUM_LINES; k++) {
        const double w = 2.0 * M_PI * SPECTRUM_HZ * ((double)k + 1.0) / SPECTRUM_LINES;
        double real = 0.0, imaginary = 0.0;

        for (size_t i = 0; i < r->count; i++) {
            const double t = r->time[i] - r->time[0];
            const double x = residual[i] * (1.0 - cos(2.0 * M_PI * t / length));

            real += x * cos(w * t);
            imaginary += x * sin(w * t);
        }
        frequency[k] = w / (2.0 * M_PI);
        amplitude[k] = 2.0 * hypot(real, imaginary) / (double)r->count;
    }

    char axis[3][64];

    snprintf(axis[0], sizeof axis[0], "%s, %s", name, unit);
    snprintf(axis[1], sizeof axis[1], "simulated - measured, %s", unit);
    snprintf(axis[2], sizeof axis[2], "amplitude, %s", unit);

    const struct svg_series both[] = {
        svg_line("measured", r->time, measured, r->count, SVG_LINE),
        svg_line("simulated", r->time, simulated, r->count, SVG_LINE)};
    const struct svg_series off = svg_line("", r->time, residual, r->count, SVG_LINE);
    const struct svg_series lines = svg_line("", frequency, amplitude, SPECTRUM_LINES, SVG_LINE);
    struct response of[2];

    response_of(law, r, measured, &of[0]);
    response_of(law, r, simulated, &of[1]);

    const struct svg_series gain[] = {
        svg_line("measured", of[0].band, of[0].magnitude, of[0].nband, SVG_LINE),
        svg_line("simulated", of[1].band, of[1].magnitude, of[1].nband, SVG_LINE)};
    const struct svg_plot panel[] = {
        svg_panel("", "time, s", axis[0], both, 2),
        svg_panel("", "time, s", axis[1], &off, 1),
        svg_panel("", "frequency, Hz", axis[2], &lines, 1),
        svg_panel("", "frequency, Hz", "gain of the response", gain, 2),
    };
    char caption[256];

    snprintf(caption, sizeof caption,
             "%.100s, %s: mean error %.4f %s, RMS %.4f %s (%.1f %%), at worst %.3f %s; the "
             "residual and its spectrum",
             r->name, name, found.mean, unit, found.rms, unit, 100.0 * found.share, found.worst,
             unit);
    report_figure(report, id, caption, panel, of[0].nband > 1 ? 4 : 3);
    free(residual);
}

/* Formats a number by the conversion 'f' or 'g'; "-" if there is none. Below 1e-9 is rounding. */
static const char *number_text(double value, char conversion, char text[32])
{
    snprintf(text, 32, conversion == 'f' ? "%.4f" : "%.4g", fabs(value) < 1e-9 ? 0.0 : value);
    return isfinite(value) ? text : "-";
}

/* Adds a row of a response to the table. */
static void add_response(struct report *report, const char *what, const struct recording *r,
                         const struct bench_law *law, const double *value)
{
    struct response of;
    char text[8][32];

    response_of(law, r, value, &of);
    report_row(report, "%s|%s|%s|%s|%s|%s|%s|%s|%s|%s", r->name, what,
               number_text(1e3 * of.t10, 'g', text[0]), number_text(1e3 * of.t63, 'g', text[1]),
               number_text(1e3 * of.t90, 'g', text[2]),
               number_text(100.0 * of.overshoot, 'g', text[3]), number_text(of.gain, 'g', text[4]),
               number_text(of.bandwidth, 'g', text[5]), number_text(of.peak, 'g', text[6]),
               number_text(of.peak_hz, 'g', text[7]));
}

/* Adds the errors of all signals, the table of responses, and the plots. `simulated` has an entry
 * for each recording. */
static void add_recordings(struct report *report, const struct identify_bench *bench,
                           const struct simulated *simulated)
{
    const struct bench_law *law = &bench->bench.law;
    char id[64];

    snprintf(id, sizeof id, "%.20s-signals", bench->bench.name);
    report_table(report, id, "Errors of the signals, in their units and as shares of their RMS",
                 "recording|signal|unit|mean error|RMS error|RMS error, %|largest error|");
    for (size_t i = 0; i < bench->nrecording; i++) {
        const struct recording *r = &bench->recording[i];

        for (size_t s = 0; s < SIGNALS; s++) {
            if (r->signal[s]) {
                const struct simulation_error off =
                    simulation_compare(r->signal[s], simulated[i].signal[s], r->count);

                report_row(report, "%s|%s|%s|%.4g|%.4g|%.2f|%.4g|%s", r->name, signal_kinds[s].key,
                           signal_kinds[s].unit, off.mean, off.rms, 100.0 * off.share, off.worst,
                           r->judge ? "judged" : "");
            }
        }
    }
    for (size_t i = 0; i < bench->bench.npublished; i++) {
        report_row(report, "%s||rad|%.4f||||published", bench->bench.published[i].what,
                   bench->bench.published[i].error[0]);
    }
    if (!bench->bench.columns.title[SIGNAL_LOSS]) {
        snprintf(id, sizeof id, "%.20s-responses", bench->bench.name);
        report_table(
            report, id,
            "Responses of the first signals to the command. Steps: times to 10, 63 and 90 % of the "
            "change. Sweeps: cross spectra of seconds in bands of 1 Hz; bandwidth at -3 dB of the "
            "lowest band",
            "recording||t10, ms|t63, ms|t90, ms|overshoot, %|gain|bandwidth, Hz|largest gain|"
            "at, Hz");
        for (size_t i = 0; i < bench->nrecording; i++) {
            const struct recording *r = &bench->recording[i];
            const enum signal first = recording_first(r);

            add_response(report, "measured", r, law, r->signal[first]);
            add_response(report, "simulated", r, law, simulated[i].signal[first]);
        }
    }
    for (size_t i = 0; i < bench->nrecording; i++) {
        for (size_t s = 0; s < SIGNALS; s++) {
            if (bench->recording[i].signal[s]) {
                snprintf(id, sizeof id, "%.20s-%zu-%s", bench->bench.name, i + 1,
                         signal_kinds[s].key);
                identify_plot(report, id, &bench->recording[i], law, (enum signal)s,
                              simulated[i].signal[s]);
            }
        }
    }
}

/* Adds the table of parameters, and a list of those that the data do not determine. */
static void add_numbers(struct report *report, const struct fit_problem *problem,
                        const struct identify_result *result)
{
    const struct fit_result *fit = &result->fit;

    report_section(report, "numbers", "The numbers");
    report_text(report,
                "Sigma counts %.0f rows of a recording as one measurement, for that long the "
                "residual is correlated with itself.",
                fit->coherence);
    report_table(report, "identified", "Numbers that were free",
                 "key|what|start|found|sigma|sigma, %|bounds|prior|verdict");
    for (size_t i = 0; i < problem->nfree; i++) {
        const struct bench_free *free = &problem->free[i];
        char prior[64] = "-";

        if (free->sigma > 0.0) {
            snprintf(prior, sizeof prior, "%.4g +- %.2g", free->expected, free->sigma);
        }
        report_row(report, "%s|%s|%.4g|%.5g|%.2g|%.1f|%.3g to %.3g|%s|%s", free->name,
                   parameter_of(free->parameter)->meaning, free->start, fit->value[i],
                   fit->sigma[i], 100.0 * fit->sigma[i] / fmax(fabs(fit->value[i]), 1e-300),
                   free->lower, free->upper, prior,
                   word_of(fit_verdict_words, (int)fit->verdict[i]));
    }
    report_table(report, "correlated", "Numbers that the recordings hardly tell apart",
                 "one|other|correlation");
    for (size_t i = 0; i < problem->nfree; i++) {
        for (size_t k = 0; k < i; k++) {
            if (fabs(fit->correlation[i][k]) > CORRELATED) {
                report_row(report, "%s|%s|%.3f", problem->free[k].name, problem->free[i].name,
                           fit->correlation[i][k]);
            }
        }
    }
}

enum error_code identify_write_page(const struct fit_problem *problem,
                                    const struct identify_result *result, const char *folder,
                                    struct error *error)
{
    const struct identify_bench *bench = problem->bench;
    static struct report report;
    char text[3][32];
    enum error_code code = report_open(&report, folder, "A drive identified", error);

    if (code) {
        return code;
    }
    report_section(&report, "errors", "Errors of free-running simulations");
    report_text(&report,
                "%s. %zu recordings; %d simulations. Cross-validated: each group was simulated "
                "with numbers that were fitted to the others.",
                bench->bench.description ? bench->bench.description : bench->bench.name,
                bench->nrecording, result->fit.simulations);
    report_table(&report, "recordings", "Mean of |simulated - measured| of the first signal",
                 "recording|group|at the start|fitted|cross-validated|");
    for (size_t i = 0; i < bench->nrecording; i++) {
        report_row(&report, "%s|%s|%.4f|%.4f|%s|%s", bench->recording[i].name,
                   bench->recording[i].group, result->start[i], result->fitted[i],
                   number_text(result->crossed[i], 'f', text[0]),
                   bench->recording[i].judge ? "not fitted to" : "");
    }
    report_row(&report, "mean||%s|%s|%s|",
               number_text(identify_mean(result->start, bench->nrecording), 'f', text[0]),
               number_text(identify_mean(result->fitted, bench->nrecording), 'f', text[1]),
               number_text(identify_mean(result->crossed, bench->nrecording), 'f', text[2]));
    add_numbers(&report, problem, result);
    report_section(&report, "plots", "Measured and simulated");
    add_recordings(&report, bench, result->simulated);
    return report_close(&report, error);
}

/* ---- validation ---- */

/* Adds the points of a bench, and its diagram. */
static void add_points(struct report *report, const struct validation *v)
{
    const struct bench *bench = &v->bench.bench;
    char id[64];

    snprintf(id, sizeof id, "%.20s-points", bench->name);
    report_table(report, id, "Steady states", "state|quantity|theirs|ours|error, %");
    for (size_t i = 0; i < bench->npoint; i++) {
        const struct bench_point *point = &bench->point[i];

        report_row(report, "%s|%s|%.4g|%.4g|%+.1f", point->what, word_of(point_words, point->find),
                   point->value, v->ours[i], 100.0 * (v->ours[i] / point->value - 1.0));
    }
    report_row(report, "mean of the absolute errors||||%.1f", 100.0 * v->mean);
    for (size_t i = 0; i < bench->npublished; i++) {
        report_row(report, "%s||||%.1f", bench->published[i].what,
                   100.0 * bench->published[i].error[1]);
    }
    if (bench->diagram_nm > 0.0) {
        const struct robot_sea sea = trial_drive(&v->bench.trial);

        snprintf(id, sizeof id, "%.20s-diagram", bench->name);
        point_diagram(report, id, &sea, bench);
    }
}

/* Adds a table of the errors of the validation recordings for each limit of a bench. */
static void add_limits(struct report *report, const struct validation *v)
{
    const struct bench *bench = &v->bench.bench;
    char id[64], text[32];

    snprintf(id, sizeof id, "%.20s-limits", bench->name);
    report_table(report, id, "Limits that are judged apart",
                 "quantity|recording|error, %|limit, %|wanted, %|");
    for (size_t k = 0; k < bench->nlimit; k++) {
        const struct bench_limit *one = &bench->limits[k];

        for (size_t i = 0; i < v->bench.nrecording; i++) {
            const double error = limit_error(v, one, i);

            if (!isnan(error)) {
                report_row(report, "%s|%s|%+.1f|%.4g|%s|%s", word_of(limit_words, one->what),
                           v->bench.recording[i].name, error, one->percent,
                           number_text(one->wanted_percent, 'g', text), limit_verdict(one, error));
            }
        }
    }
}

/* Adds the section of a bench. */
static void add_bench(struct report *report, const struct validation *v)
{
    const struct bench *bench = &v->bench.bench;
    char id[64];

    snprintf(id, sizeof id, "%.31s", bench->name);
    report_section(report, id, bench->name);
    report_text(report, "%s. Source: %s (%s). Supports: %s.",
                bench->description ? bench->description : "", bench->source, bench->license,
                bench->supports ? bench->supports : "nothing said");
    if (bench->npoint > 0) {
        add_points(report, v);
        return;
    }
    if (v->bench.missing) {
        report_text(report, "The recordings are not here. %s", bench->obtain);
        return;
    }
    if (bench->nlimit > 0) {
        add_limits(report, v);
    }
    add_recordings(report, &v->bench, v->simulated);
}

enum error_code validation_write_page(const struct validation *validation, size_t count,
                                      const char *folder, struct error *error)
{
    static struct report report;
    enum error_code code = report_open(&report, folder, "Held against the world", error);

    if (code) {
        return code;
    }
    report_section(&report, "benches", "Measured benches");
    report_text(
        &report,
        "Simulations run free from the first row of a recording: they are never set back to what "
        "was measured. Points are steady states: errors are shares of what was measured.");
    report_table(&report, "summary", "Mean errors",
                 "bench|what|unit|ours|best published|limit|verdict");
    for (size_t i = 0; i < count; i++) {
        const struct bench *bench = &validation[i].bench.bench;
        const bool share = validation[i].is_share;
        const double scale = share ? 100.0 : 1.0;
        double best = NAN;
        char text[32];

        /* Add a bench to the summary, with its errors in rad, or in % for points */
        for (size_t k = 0; k < bench->npublished; k++) {
            best = fmin(best, bench->published[k].error[share]);
        }
        report_row(&report, "%s|%s|%s|%.4f|%s|%.4f|%s", bench->name,
                   bench->description ? bench->description : "", validation_unit(&validation[i]),
                   scale * validation[i].mean, number_text(scale * best, 'f', text),
                   scale * bench->limit[share], validation_verdict(&validation[i]));
    }
    for (size_t i = 0; i < count; i++) {
        add_bench(&report, &validation[i]);
    }
    return report_close(&report, error);
}
