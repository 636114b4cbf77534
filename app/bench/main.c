/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil-bench: lists the benchmarks and runs one. */
#include "app/bench/bench.h"

#include "base/array.h"
#include "base/program.h"

static const struct program_command benchmarks[] = {
    {"contact", "time of one evaluation of contact forces, the native engine beside Simbody",
     bench_contact},
    {"dynamics", "time of one evaluation of a robot's accelerations, the paper's Fig. 4",
     bench_dynamics},
    {"latency", "from a command on a CAN interface to the frame that answers it", bench_latency},
    {"paper", "a report with every table and figure of the paper that can be reproduced",
     bench_paper},
    {"throughput", "simulated seconds that a sweep gets out of a processor in an hour",
     bench_throughput},
    {"ticks", "CPU time of each tick, by percentiles: what rate a processor can hold", bench_ticks},
};

static const struct program coman_hil_bench = {
    .name = "coman-hil-bench",
    .noun = "benchmark",
    .about = "Repeat the paper's measurements on this machine, beside its numbers.",
    .command = benchmarks,
    .ncommand = ARRAY_COUNT(benchmarks),
};

int main(int argc, char **argv)
{
    return program_main(&coman_hil_bench, argc, argv);
}
