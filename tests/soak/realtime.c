/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How late the loop wakes up in real time, beside cyclictest: two tools for realtime.sh.
 *
 *   soak_realtime run SECONDS PRIORITY CPU FILE
 *       COMAN squats in real time on local buses; the histogram of its wake-ups goes to FILE.
 *       PRIORITY 0: no SCHED_FIFO
 *   soak_realtime compare DIRECTORY
 *       reads NAME-N.ours and NAME-N.cyclictest of the runs made alternating and together, prints
 *       both side by side, writes histogram.csv and NAME.svg
 *
 * Both latencies are from the absolute deadline to the first look at the clock after the sleep.
 * cyclictest cuts them off to microseconds; ours are rounded up by at most 1/64 (rt/histogram.h),
 * then cut off to half a microsecond.
 */
#include "sim/simulator.h"
#include "app/report/svg.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MEMORY ((size_t)1 << 30)

enum { BINS = 400000 }; /* of 0.5 us */

/* Merged from several runs; a bin ends at half a microsecond's multiple. */
struct latencies {
    uint64_t bin[BINS + 1]; /* the last: all above */
    uint64_t count;
    double max_us;
};

/* ---- run ---- */

static bool consistent(const struct loop_stats *stats)
{
    const struct histogram *h = &stats->wakeup;
    uint64_t count = 0, overruns = 0;

    for (unsigned i = 0; i < HISTOGRAM_BUCKETS; i++) {
        count += h->bucket[i];
    }
    for (int p = 0; p < PHASE_COUNT; p++) {
        overruns += stats->overruns[p];
        if (stats->phase[p].count != stats->ticks) {
            return false;
        }
    }
    /* A tick that begins late has not slept */
    return count == h->count && h->count <= stats->ticks && stats->work.count == stats->ticks &&
           overruns == stats->overrun_total && stats->time_ns == (int64_t)stats->ticks * CLOCK_MS &&
           h->sum >= (int64_t)h->count * h->min && h->sum <= (int64_t)h->count * h->max &&
           histogram_percentile(h, 0.5) <= histogram_percentile(h, 0.99) &&
           histogram_percentile(h, 0.99) <= h->max;
}

static void write_run(const struct loop_stats *stats, FILE *out)
{
    fprintf(out, "# ticks %" PRIu64 "\n# overruns %" PRIu64 "\n", stats->ticks,
            stats->overrun_total);
    for (int p = 0; p < PHASE_COUNT; p++) {
        fprintf(out, "# overruns_%s %" PRIu64 "\n", loop_phase_name((enum loop_phase)p),
                stats->overruns[p]);
    }
    fprintf(out,
            "# late_ticks %" PRIu64 "\n# lost_ticks %" PRIu64 "\n# pauses %" PRIu64
            "\n# page_faults %" PRIu64 "\n# work_p99_ns %" PRId64 "\n# max_ns %" PRId64 "\n",
            stats->late_ticks, stats->lost_ticks, stats->pauses, stats->page_faults,
            histogram_percentile(&stats->work, 0.99), stats->wakeup.max);
    for (unsigned i = 0; i < HISTOGRAM_BUCKETS; i++) {
        if (stats->wakeup.bucket[i]) {
            fprintf(out, "%" PRId64 " %" PRIu64 "\n", histogram_edge(i), stats->wakeup.bucket[i]);
        }
    }
}

static int finish(const struct simulator *simulator, enum loop_end end, const char *path)
{
    const struct loop_stats *stats = simulator_stats(simulator);
    FILE *out = fopen(path, "we");

    if (!out) {
        fprintf(stderr, "soak_realtime: cannot open %s\n", path);
        return 3;
    }
    write_run(stats, out);
    if (fclose(out) || end != LOOP_END_LENGTH || !consistent(stats)) {
        fprintf(stderr, "soak_realtime: end %d after %" PRIu64 " ticks, or counts that disagree\n",
                (int)end, stats->ticks);
        return 1;
    }
    return 0;
}

static int run(int64_t seconds, int priority, int cpu, const char *path)
{
    static struct rig changed;
    struct simulator_config config = {
        .rig = &changed,
        .clock = LOOP_CLOCK_REAL,
        .transport = TRANSPORT_LOCAL,
        .task = "squat",
        .ticks = (uint64_t)seconds * 1000,
    };
    struct simulator *simulator;
    struct realtime_report report;
    const struct rig *rig;
    struct arena arena;
    struct error error;
    char notice[256];
    int status = 3;

    if (arena_init(&arena, MEMORY, &error) ||
        rig_load(HIL_SOURCE_DIR "/config/rigs/coman.yaml", &arena, &rig, &error)) {
        fprintf(stderr, "soak_realtime: %s\n", error.text);
        return 3;
    }
    changed = *rig;
    changed.squat.cycles = 1000000; /* it squats as long as it may */
    changed.realtime.priority = priority;
    changed.realtime.cpu = cpu;
    config.hold = rig->hold;
    config.overrun = rig->realtime.overrun;
    if (simulator_create(&config, &arena, &simulator, notice, &error)) {
        fprintf(stderr, "soak_realtime: %s\n", error.text);
    } else {
        if (simulator_start(simulator, &report, &error)) {
            fprintf(stderr, "soak_realtime: %s\n", error.text);
        } else {
            status = finish(simulator, simulator_run(simulator), path);
        }
        simulator_destroy(simulator);
    }
    arena_fini(&arena);
    return status;
}

/* ---- compare ---- */

static void add(struct latencies *to, double us, uint64_t count)
{
    double bin = 2.0 * us;

    to->bin[bin < BINS ? (size_t)bin : BINS] += count;
    to->count += count;
}

/* Nearest rank: the upper end of the bin in which it lies. */
static double percentile(const struct latencies *from, double fraction)
{
    double seen = 0.0;

    for (size_t i = 0; i < BINS; i++) {
        seen += (double)from->bin[i];
        if (seen > 0.0 && seen >= fraction * (double)from->count) {
            return 0.5 * (double)i;
        }
    }
    return from->max_us;
}

struct tally {
    struct latencies ours, theirs;
    uint64_t ticks, overruns, by_wait, lost_ticks, page_faults;
    int runs;
};

/* "# name value" lines, then "upper edge in ns, count" */
static void read_ours(FILE *in, struct tally *tally)
{
    char line[256], name[64];
    uint64_t value, count;

    while (fgets(line, sizeof line, in)) {
        if (sscanf(line, "# %63s %" SCNu64, name, &value) == 2) {
            tally->ticks += strcmp(name, "ticks") ? 0 : value;
            tally->overruns += strcmp(name, "overruns") ? 0 : value;
            tally->by_wait += strcmp(name, "overruns_wait") ? 0 : value;
            tally->lost_ticks += strcmp(name, "lost_ticks") ? 0 : value;
            tally->page_faults += strcmp(name, "page_faults") ? 0 : value;
            if (!strcmp(name, "max_ns") && (double)value * 1e-3 > tally->ours.max_us) {
                tally->ours.max_us = (double)value * 1e-3;
            }
        } else if (sscanf(line, "%" SCNu64 " %" SCNu64, &value, &count) == 2) {
            add(&tally->ours, (double)value * 1e-3, count);
        }
    }
}

/* Cyclictest -h: "us count" lines and comments; false when its counts disagree */
static bool read_theirs(FILE *in, struct tally *tally)
{
    unsigned long long us, count, total = 0, sum = 0, overflows = 0, max = 0;
    char line[65536];

    while (fgets(line, sizeof line, in)) {
        if (sscanf(line, "%llu %llu", &us, &count) == 2) {
            sum += count;
            add(&tally->theirs, (double)us, count);
        } else {
            sscanf(line, "# Total: %llu", &total);
            sscanf(line, "# Max Latencies: %llu", &max);
            sscanf(line, "# Histogram Overflows: %llu", &overflows);
        }
    }
    tally->theirs.bin[BINS] += overflows;
    tally->theirs.count += overflows;
    if ((double)max > tally->theirs.max_us) {
        tally->theirs.max_us = (double)max;
    }
    return sum == total && sum > 0;
}

/* All runs of a name, until there is no next one */
static bool read_runs(const char *directory, const char *name, struct tally *tally)
{
    for (;; tally->runs++) {
        char path[2][4096];
        FILE *ours, *theirs;
        bool good;

        snprintf(path[0], sizeof path[0], "%s/%s-%d.ours", directory, name, tally->runs);
        snprintf(path[1], sizeof path[1], "%s/%s-%d.cyclictest", directory, name, tally->runs);
        ours = fopen(path[0], "re");
        theirs = ours ? fopen(path[1], "re") : NULL;
        good = ours && theirs;
        if (good) {
            read_ours(ours, tally);
            good = read_theirs(theirs, tally);
        }
        if (ours) {
            fclose(ours);
        }
        if (theirs) {
            fclose(theirs);
        }
        if (!good) {
            return !ours && tally->runs > 0;
        }
    }
}

/* Share of the wake-ups that are later than x */
static size_t later(const struct latencies *from, double *x, double *y)
{
    uint64_t left = from->count;
    size_t n = 0;

    for (size_t i = 0; i < BINS && left; i++) {
        if (from->bin[i]) {
            left -= from->bin[i];
            x[n] = 0.5 * (double)(i + 1);
            y[n++] = (double)left / (double)from->count;
        }
    }
    return n;
}

static bool draw(const char *directory, const char *name, const struct tally *tally)
{
    static double x[2][BINS], y[2][BINS];
    const struct svg_series series[2] = {
        {"coman-hil", x[0], y[0], later(&tally->ours, x[0], y[0]), SVG_LINE},
        {"cyclictest", x[1], y[1], later(&tally->theirs, x[1], y[1]), SVG_DASHED},
    };
    const struct svg_plot plot = {
        .title = "Wake-ups later than x",
        .x = {.label = "latency (us)", .logarithmic = true},
        .y = {.label = "share of wake-ups", .logarithmic = true},
        .series = series,
        .nseries = 2,
    };
    struct error error = {0};
    char path[4096];
    FILE *out;

    snprintf(path, sizeof path, "%s/%s.svg", directory, name);
    out = fopen(path, "we");
    if (!out || svg_write(&plot, out, &error)) {
        fprintf(stderr, "soak_realtime: cannot write %s: %s\n", path, error.text);
    }
    return out && !fclose(out) && !error.code;
}

static void print_row(const char *what, const struct latencies *of)
{
    printf("  %-22s %9" PRIu64 " %9.1f %9.1f %9.1f %9.1f\n", what, of->count, percentile(of, 0.5),
           percentile(of, 0.99), percentile(of, 0.999), of->max_us);
}

static void write_bins(const char *name, const struct tally *tally, FILE *out)
{
    for (size_t i = 0; i < BINS; i++) {
        if (tally->ours.bin[i] || tally->theirs.bin[i]) {
            fprintf(out, "%s,%.1f,%" PRIu64 ",%" PRIu64 "\n", name, 0.5 * (double)i,
                    tally->ours.bin[i], tally->theirs.bin[i]);
        }
    }
}

static double ratio(const struct tally *tally)
{
    double theirs = percentile(&tally->theirs, 0.99);

    return theirs > 0.0 ? percentile(&tally->ours, 0.99) / theirs : 0.0;
}

static bool compare_runs(const char *directory, const char *name, struct tally *tally, FILE *csv)
{
    if (!read_runs(directory, name, tally)) {
        fprintf(stderr, "soak_realtime: run %d %s is missing, or its counts disagree\n",
                tally->runs, name);
        return false;
    }
    printf("%s, %d runs\n  %-22s %9s %9s %9s %9s %9s\n", name, tally->runs, "wake-up latency, us",
           "count", "p50", "p99", "p99.9", "max");
    print_row("coman-hil", &tally->ours);
    print_row("cyclictest", &tally->theirs);
    printf("  ratio of p99 %.2f; %" PRIu64 " ticks, %" PRIu64 " overruns, %" PRIu64
           " of them by a late wake-up, %" PRIu64 " deadlines dropped, %" PRIu64 " page faults\n",
           ratio(tally), tally->ticks, tally->overruns, tally->by_wait, tally->lost_ticks,
           tally->page_faults);
    write_bins(name, tally, csv);
    return draw(directory, name, tally);
}

static int compare(const char *directory)
{
    static struct tally together, alternating;
    char path[4096];
    FILE *csv;
    bool good;

    snprintf(path, sizeof path, "%s/histogram.csv", directory);
    csv = fopen(path, "we");
    if (!csv) {
        fprintf(stderr, "soak_realtime: cannot open %s\n", path);
        return 3;
    }
    fprintf(csv, "runs,latency_us,coman_hil,cyclictest\n");
    good = compare_runs(directory, "together", &together, csv);
    good = compare_runs(directory, "alternating", &alternating, csv) && good;
    if (fclose(csv) || !good) {
        return 1;
    }
    printf("soak: wake-up p99 %.1f us, cyclictest's in the same run %.1f us: ratio %.2f (%.2f when "
           "alternating), wanted at most 1.30; %" PRIu64 " overruns in %" PRIu64 " ticks\n",
           percentile(&together.ours, 0.99), percentile(&together.theirs, 0.99), ratio(&together),
           ratio(&alternating), together.overruns + alternating.overruns,
           together.ticks + alternating.ticks);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc == 6 && !strcmp(argv[1], "run")) {
        return run(strtoll(argv[2], NULL, 10), atoi(argv[3]), atoi(argv[4]), argv[5]);
    }
    if (argc == 3 && !strcmp(argv[1], "compare")) {
        return compare(argv[2]);
    }
    fprintf(stderr, "usage: soak_realtime run SECONDS PRIORITY CPU FILE | compare DIRECTORY\n");
    return 2;
}
