/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How late the loop wakes up in real time, for realtime.sh:
 *
 *   soak_realtime SECONDS PRIORITY CPU FILE
 *
 * COMAN squats in real time on local buses; the histogram of its wake-ups goes to FILE, as
 * realtime.py reads it. PRIORITY 0: no SCHED_FIFO.
 */
#include "sim/simulator.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#define MEMORY ((size_t)1 << 30)

static bool consistent(const struct loop_stats *stats)
{
    const struct histogram *h = &stats->wakeup;
    uint64_t count = 0, overruns = 0;

    for (unsigned i = 0; i < HISTOGRAM_BUCKETS; i++) {
        count += h->bucket[i];
    }
    for (int p = 0; p < PHASE_COUNT; p++) {
        overruns += stats->overruns[p];
        /* No tick has to receive frames before it begins */
        if (stats->phase[p].count != stats->ticks && p != PHASE_ARRIVALS) {
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

int main(int argc, char **argv)
{
    if (argc != 5) {
        fprintf(stderr, "usage: soak_realtime SECONDS PRIORITY CPU FILE\n");
        return 2;
    }
    return run(strtoll(argv[1], NULL, 10), atoi(argv[2]), atoi(argv[3]), argv[4]);
}
