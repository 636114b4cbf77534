/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil-bench: the table of benchmarks. */
#include "app/bench/benchmarks.h"
#include "base/options.h"
#include "base/text.h"

#include <stdio.h>
#include <string.h>

/* argv[0] of run is the benchmark's name. */
static const struct bench {
    const char *name, *summary;
    int (*run)(int argc, char **argv);
} benches[] = {
    {"contact", "time of one evaluation of contact forces, the native engine beside Simbody",
     bench_contact},
    {"dynamics", "time of one evaluation of a robot's accelerations, the paper's Fig. 4",
     bench_dynamics},
    {"paper", "a report with every table and figure of the paper that can be reproduced",
     bench_paper},
    {"pendulum", "pendulums in relative and absolute coordinates, the paper's Table 1 and Fig. 3",
     bench_pendulum},
};

enum { NBENCH = sizeof benches / sizeof benches[0] };

static void print_usage(FILE *out)
{
    fprintf(out, "usage: coman-hil-bench NAME [OPTIONS] [ARGUMENTS]\n\n"
                 "Repeat the paper's measurements on this machine, beside its numbers.\n\n");
    for (size_t i = 0; i < NBENCH; i++) {
        fprintf(out, "  %-10s", benches[i].name);
        options_wrap(benches[i].summary, 12, 12, out);
    }
    fprintf(out, "\ncoman-hil-bench NAME --help prints the manual of a benchmark.\n");
}

static int unknown_bench(const char *name)
{
    const char *names[NBENCH], *nearest;

    for (size_t i = 0; i < NBENCH; i++) {
        names[i] = benches[i].name;
    }
    nearest = text_nearest(name, names, NBENCH);
    fprintf(stderr, "coman-hil-bench: found unknown benchmark \"%.100s\", expected %s%s%s\n", name,
            nearest ? "\"" : "one that is listed by --help", nearest ? nearest : "",
            nearest ? "\"" : "");
    return STATUS_INPUT;
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        print_usage(stderr);
        return STATUS_INPUT;
    }
    if (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h")) {
        print_usage(stdout);
        return options_flush_output(STATUS_OK);
    }
    for (size_t i = 0; i < NBENCH; i++) {
        if (!strcmp(benches[i].name, argv[1])) {
            return options_flush_output(benches[i].run(argc - 1, argv + 1));
        }
    }
    return unknown_bench(argv[1]);
}
