/* SPDX-License-Identifier: Apache-2.0 */
/* Derives figures from measured cases, and writes them as tables and as JSON. */
#include "app/bench/throughput.h"

#include "app/bench/timing.h"
#include "base/json_text.h"

#include <math.h>

static const double HOUR_S = 3600.0;

/* Names of the rates in the JSON, by way. */
static const char *const way_names[THROUGHPUT_WAYS] = {
    [WAY_BODIES] = "bodies_s_per_core_hour",
    [WAY_BODIES_EULER] = "mujoco_s_per_core_hour",
    [WAY_BODIES_IMPLICIT] = "mujoco_implicit_s_per_core_hour",
    [WAY_STANDING] = "standing_s_per_core_hour",
    [WAY_STANDING_EULER] = "mujoco_standing_s_per_core_hour",
};

/* Returns median and ends of count values, at least 1, which it sorts; NAN when one of them is. */
static struct throughput_spread throughput_spread(double *value, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        if (isnan(value[i])) {
            return (struct throughput_spread){NAN, NAN, NAN};
        }
    }
    bench_sort(value, count);
    return (struct throughput_spread){bench_median(value, count), value[0], value[count - 1]};
}

/* A figure that is derived from a round. */
enum throughput_figure {
    FIGURE_RATE,
    FIGURE_HOURLY,
    FIGURE_START_MS,
    FIGURE_RANGE_MS,
    FIGURE_WHOLE_MS,
    FIGURE_START_MB,
    FIGURE_WHOLE_MB,
    FIGURE_START_INSTRUCTIONS,
    FIGURE_TICK_INSTRUCTIONS,
    FIGURE_WAY, /* and the others behind it */
};

/* Derives a figure from a round; seconds is the simulated time of a case. NAN where the ticks cost
 * nothing, by noise. */
static double throughput_figure(const struct throughput_sample *sample, double seconds,
                                double tick_s, unsigned figure)
{
    /* Ticks alone: a whole case less one of a single tick */
    double ticks_s = sample->whole.cpu_s - sample->start.cpu_s;
    double range_s = sample->range.cpu_s / THROUGHPUT_RANGE;

    ticks_s = ticks_s > 0.0 ? ticks_s : (double)NAN;
    switch (figure) {
    case FIGURE_RATE:
        return HOUR_S * seconds / ticks_s;
    case FIGURE_HOURLY:
        return HOUR_S / (range_s + ticks_s);
    case FIGURE_START_MS:
        return 1e3 * sample->start.cpu_s;
    case FIGURE_RANGE_MS:
        return 1e3 * range_s;
    case FIGURE_WHOLE_MS:
        return 1e3 * sample->whole.cpu_s;
    case FIGURE_START_MB:
        return sample->start.resident_mb;
    case FIGURE_WHOLE_MB:
        return sample->whole.resident_mb;
    case FIGURE_START_INSTRUCTIONS:
        return sample->start.instructions;
    case FIGURE_TICK_INSTRUCTIONS:
        return (sample->whole.instructions - sample->start.instructions) * tick_s / seconds;
    default:
        return HOUR_S * seconds / sample->way_s[figure - FIGURE_WAY];
    }
}

/* Returns the spread of a figure over all rounds. */
static struct throughput_spread throughput_of_rounds(const struct throughput *all,
                                                     const struct throughput_rig *rig,
                                                     unsigned figure)
{
    double value[THROUGHPUT_ROUNDS];

    for (size_t round = 0; round < all->rounds; round++) {
        value[round] = throughput_figure(&rig->sample[round], all->seconds, rig->tick_s, figure);
    }
    return throughput_spread(value, all->rounds);
}

void throughput_derive(const struct throughput *all, const struct throughput_rig *rig,
                       struct throughput_figures *figures)
{
    *figures = (struct throughput_figures){
        .rate = throughput_of_rounds(all, rig, FIGURE_RATE),
        .hourly = throughput_of_rounds(all, rig, FIGURE_HOURLY),
        .start_ms = throughput_of_rounds(all, rig, FIGURE_START_MS),
        .range_ms = throughput_of_rounds(all, rig, FIGURE_RANGE_MS),
        .whole_ms = throughput_of_rounds(all, rig, FIGURE_WHOLE_MS),
        .start_mb = throughput_of_rounds(all, rig, FIGURE_START_MB),
        .whole_mb = throughput_of_rounds(all, rig, FIGURE_WHOLE_MB),
        .start_instructions = throughput_of_rounds(all, rig, FIGURE_START_INSTRUCTIONS),
        .tick_instructions = throughput_of_rounds(all, rig, FIGURE_TICK_INSTRUCTIONS),
    };
    for (unsigned way = 0; way < THROUGHPUT_WAYS; way++) {
        figures->way[way] = throughput_of_rounds(all, rig, FIGURE_WAY + way);
    }
}

/* ---- tables ---- */

/* Prints a spread as "12345 (12000 .. 13000)", or "-". */
static void throughput_put_spread(const struct throughput_spread *spread, FILE *out)
{
    char text[64] = "-";

    if (isfinite(spread->median)) {
        snprintf(text, sizeof text, "%.0f (%.0f .. %.0f)", spread->median, spread->low,
                 spread->high);
    }
    fprintf(out, " %26s", text);
}

/* Prints a scaled number with so many digits, or "-". */
static void throughput_put_number(double value, double scale, int digits, FILE *out)
{
    if (isfinite(value)) {
        fprintf(out, " %9.*f", digits, scale * value);
    } else {
        fprintf(out, " %9s", "-");
    }
}

/* Prints what the robot alone makes, each time with the ratio to MuJoCo's default. */
static void throughput_print_ways(const struct throughput *all, FILE *out)
{
    struct throughput_figures figures;

    fprintf(out, "\n%-21s %26s %26s %26s %9s\n", "bodies alone", "ours, implicit",
            "MuJoCo, implicit", "MuJoCo, Euler", "ratio");
    for (size_t i = 0; i < all->nrig; i++) {
        throughput_derive(all, &all->rig[i], &figures);
        fprintf(out, "%-21s", all->rig[i].rig);
        throughput_put_spread(&figures.way[WAY_BODIES], out);
        throughput_put_spread(&figures.way[WAY_BODIES_IMPLICIT], out);
        throughput_put_spread(&figures.way[WAY_BODIES_EULER], out);
        throughput_put_number(figures.way[WAY_BODIES].median / figures.way[WAY_BODIES_EULER].median,
                              1.0, 2, out);
        fputc('\n', out);
    }
    fprintf(out, "\n%-21s %26s %26s %9s\n", "standing on its feet", "ours, implicit",
            "MuJoCo, Euler", "ratio");
    for (size_t i = 0; i < all->nrig; i++) {
        throughput_derive(all, &all->rig[i], &figures);
        fprintf(out, "%-21s", all->rig[i].rig);
        throughput_put_spread(&figures.way[WAY_STANDING], out);
        throughput_put_spread(&figures.way[WAY_STANDING_EULER], out);
        throughput_put_number(
            figures.way[WAY_STANDING].median / figures.way[WAY_STANDING_EULER].median, 1.0, 2, out);
        fputc('\n', out);
    }
}

void throughput_print(const struct throughput *all, FILE *out)
{
    struct throughput_figures figures;

    fprintf(out, "cases of %g s; CPU time, median of %zu rounds (least .. most)\n\n", all->seconds,
            all->rounds);
    fprintf(out, "%-20s %-6s %5s %5s %26s\n", "simulated s/core-hour", "task", "buses", "axes",
            "with boards and task");

    /* First what a processor simulates in an hour, all of it, then the bodies alone */
    for (size_t i = 0; i < all->nrig; i++) {
        const struct throughput_rig *rig = &all->rig[i];

        throughput_derive(all, rig, &figures);
        fprintf(out, "%-21s %-6s %5zu %5zu", rig->rig, rig->task, rig->nbus, rig->naxis);
        throughput_put_spread(&figures.rate, out);
        fputc('\n', out);
    }
    throughput_print_ways(all, out);

    /* Then what a case costs in its parts */
    fprintf(out, "\n%-21s %9s %9s %9s %9s %9s %9s %9s\n", "a case", "start ms", "in range",
            "whole ms", "MB", "an hour", "start M", "tick k");
    for (size_t i = 0; i < all->nrig; i++) {
        throughput_derive(all, &all->rig[i], &figures);
        fprintf(out, "%-21s", all->rig[i].rig);
        throughput_put_number(figures.start_ms.median, 1.0, 1, out);
        throughput_put_number(figures.range_ms.median, 1.0, 1, out);
        throughput_put_number(figures.whole_ms.median, 1.0, 1, out);
        throughput_put_number(figures.whole_mb.median, 1.0, 1, out);
        throughput_put_number(figures.hourly.median, 1.0, 0, out);
        throughput_put_number(figures.start_instructions.median, 1e-6, 1, out);
        throughput_put_number(figures.tick_instructions.median, 1e-3, 1, out);
        fputc('\n', out);
    }
    fprintf(out, "an hour: whole cases in a range, on one processor; M, k: millions and thousands "
                 "of instructions\n");
    fprintf(out,
            all->mujoco ? "bodies alone: at the rig's step, without contact, joint limits, drives, "
                          "boards or controller; standing: the same on the ground, with springs in "
                          "the joints; MuJoCo %s; ratio of ours to its default, Euler\n"
                        : "no MuJoCo was found\n",
            all->mujoco);
}

/* ---- JSON ---- */

/* Writes a spread as a member of a JSON object, null where there is none. */
static void throughput_put_json(const char *name, const struct throughput_spread *spread, FILE *out)
{
    fprintf(out, ",\n     \"%s\": ", name);
    if (isfinite(spread->median)) {
        fprintf(out, "{\"median\": %.9g, \"low\": %.9g, \"high\": %.9g}", spread->median,
                spread->low, spread->high);
    } else {
        fputs("null", out);
    }
}

void throughput_write_json(const struct throughput *all, FILE *out)
{
    /* How it was measured, then an object for each rig */
    fprintf(out, "{\"format_version\": %d, \"version\": ", THROUGHPUT_FORMAT_VERSION);
    json_text_put(HIL_VERSION, out);
    fprintf(out, ", \"case_s\": %.9g, \"rounds\": %zu, \"range\": %d, \"mujoco\": ", all->seconds,
            all->rounds, THROUGHPUT_RANGE);
    if (all->mujoco) {
        json_text_put(all->mujoco, out);
    } else {
        fputs("null", out);
    }
    fputs(",\n \"rigs\": [", out);
    for (size_t i = 0; i < all->nrig; i++) {
        const struct throughput_rig *rig = &all->rig[i];
        struct throughput_figures figures;

        throughput_derive(all, rig, &figures);
        fprintf(out, "%s\n    {\"rig\": ", i ? "," : "");
        json_text_put(rig->rig, out);
        fputs(", \"task\": ", out);
        json_text_put(rig->task, out);
        fprintf(out, ", \"buses\": %zu, \"boards\": %zu, \"axes\": %zu, \"freedoms\": %zu",
                rig->nbus, rig->nboard, rig->naxis, rig->nv);
        fprintf(out, ", \"tick_s\": %.9g, \"step_s\": %.9g", rig->tick_s, rig->step_s);
        throughput_put_json("simulated_s_per_core_hour", &figures.rate, out);
        for (int way = 0; way < THROUGHPUT_WAYS; way++) {
            throughput_put_json(way_names[way], &figures.way[way], out);
        }
        throughput_put_json("cases_per_core_hour", &figures.hourly, out);
        throughput_put_json("start_ms", &figures.start_ms, out);
        throughput_put_json("start_in_range_ms", &figures.range_ms, out);
        throughput_put_json("case_ms", &figures.whole_ms, out);
        throughput_put_json("start_mb", &figures.start_mb, out);
        throughput_put_json("case_mb", &figures.whole_mb, out);
        throughput_put_json("start_instructions", &figures.start_instructions, out);
        throughput_put_json("tick_instructions", &figures.tick_instructions, out);
        fputc('}', out);
    }
    fputs("\n]}\n", out);
}
