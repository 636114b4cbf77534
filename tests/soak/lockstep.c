/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COMAN for an hour of its own time in lockstep, at full traffic, while everything that can break
 * breaks at random: soak_lockstep [SECONDS [SEED [RECORD-DIRECTORY]]].
 *
 * The time is cut into parts of some minutes, each a simulator of its own: COMAN hung up in a
 * harness with every kind of board, on buses with and without wire time, moved by a controller that
 * never gives up (player.h); and, standing on its feet, in front of a box, or as a hydraulic leg,
 * the tasks of the product, which end when something breaks badly enough. A listener judges what
 * passes on the buses (listener.h), an intruder talks on them (intruder.h). In the harness every
 * half minute ends with eight seconds in which nothing is broken: in them every motor must come on
 * again and tell where it is.
 *
 * Prints a line for each part and one for all; two runs with the same arguments agree in their
 * hash, whatever else the machine does. Exit status 1: a rule was broken, and stderr says which.
 */
#include "base/hash.h"
#include "tests/soak/part.h"

#include <dirent.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

static const struct part programme[] = {
    {"icub", "coman.yaml", NULL, false, 0},
    {"squat", "coman.yaml", "squat", false, 0},
    {"sensors on wires", "coman-sensors.yaml", NULL, true, 0},
    {"foc", "coman-foc.yaml", NULL, false, 0},
    {"hydraulic leg", "hyq-leg.yaml", "hold", false, 60},
    {"grasp", "grasp.yaml", "grasp", false, 0},
    {"compact on wires", "coman-compact.yaml", NULL, true, 0},
    {"fd", "coman-fd.yaml", NULL, false, 0},
    {"squat on wires", "coman-sensors.yaml", "squat", true, 0},
};

enum { PARTS = sizeof programme / sizeof programme[0] };

static int entries(const char *path)
{
    DIR *directory = opendir(path);
    int count = 0;

    while (directory && readdir(directory)) {
        count++;
    }
    if (directory) {
        closedir(directory);
    }
    return count;
}

/* ---- all parts ---- */

/* Nothing is left of a part: not a page, not a descriptor, not a thread. */
static bool check_leaks(struct totals *totals)
{
    int descriptors = entries("/proc/self/fd"), threads = entries("/proc/self/task");

    totals->pages_last = rules_resident_pages();
    if (totals->parts == 0) {
        totals->descriptors = descriptors;
        totals->threads = threads;
    }
    if (!totals->pages_minute_2 && totals->ticks >= 120000) {
        totals->pages_minute_2 = totals->pages_last;
    }
    if (!totals->pages_first && totals->parts >= PARTS) {
        totals->pages_first = totals->pages_last; /* every part was there once */
    }
    if (descriptors != totals->descriptors || threads != totals->threads) {
        fprintf(stderr, "soak: %d descriptors and %d threads, expected %d and %d\n", descriptors,
                threads, totals->descriptors, totals->threads);
        return false;
    }
    if (PAGES_ARE_COUNTED && totals->pages_first && totals->pages_last - totals->pages_first > 32) {
        fprintf(stderr, "soak: resident memory grew from %ld to %ld pages\n", totals->pages_first,
                totals->pages_last);
        return false;
    }
    return true;
}

/* Every kind of fault had its turn. */
static bool check_kinds(const struct totals *totals)
{
    char help[256];

    for (size_t k = 0; k < faults_help(0, NULL, 0); k++) {
        if (totals->of_kind[k] == 0) {
            faults_help(k, help, sizeof help);
            fprintf(stderr, "soak: no fault of the kind %s\n", help);
            return false;
        }
    }
    return true;
}

static uint64_t part_ticks(const struct totals *totals, uint64_t wanted)
{
    const struct part *part = &programme[totals->parts % PARTS];
    /* Rounds of half a minute: an hour has a dozen of long parts, five minutes have short ones */
    uint64_t rounds = wanted >= 1800000 ? 4 : 1;
    uint64_t ticks = part->task ? TASK_S * 1000 : rounds * ROUND_S * 1000;

    return ticks < wanted - totals->ticks ? ticks : wanted - totals->ticks;
}

static void print_totals(const struct totals *totals)
{
    const long kb = sysconf(_SC_PAGESIZE) / 1024;

    printf("soak: %" PRIu64 " ticks, %" PRIu64 " frames, %" PRIu64 " faults, %" PRIu64
           " frames of the intruder, %" PRIu64 " STEP refused, %" PRIu64 " events, %" PRIu64
           " motors switched on again, %" PRIu64
           " controllers started; RSS %ld kB after 2 min, %ld "
           "kB at the end; hash %016" PRIx64 "\n",
           totals->ticks, totals->frames, totals->faults, totals->intruder, totals->refused,
           totals->events, totals->switched_on, totals->starts, totals->pages_minute_2 * kb,
           totals->pages_last * kb, totals->hash);
}

int main(int argc, char **argv)
{
    double seconds = argc > 1 ? strtod(argv[1], NULL) : 300.0;
    uint64_t seed = argc > 2 ? strtoull(argv[2], NULL, 10) : 1, wanted;
    const char *record = argc > 3 ? argv[3] : NULL;
    struct totals totals = {.hash = HASH_START};
    struct random_stream seeds = random_named(seed, "parts");

    if (!(seconds >= 1.0 && seconds <= 1e6)) {
        fprintf(stderr, "usage: soak_lockstep [SECONDS [SEED [RECORD-DIRECTORY]]]\n");
        return 2;
    }
    wanted = (uint64_t)(seconds * 1000.0);
    while (totals.ticks < wanted) {
        if (!check_leaks(&totals) ||
            !part_run(&programme[totals.parts % PARTS], &totals, random_bits(&seeds) >> 16,
                      part_ticks(&totals, wanted), totals.parts == 0 ? record : NULL)) {
            return 1;
        }
        totals.parts++;
    }
    if (!check_leaks(&totals) || (totals.parts >= PARTS && !check_kinds(&totals))) {
        return 1;
    }
    print_totals(&totals);
    return 0;
}
