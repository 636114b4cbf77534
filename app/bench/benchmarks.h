/* SPDX-License-Identifier: Apache-2.0 */
/* The benchmarks of coman-hil-bench. argv[0] is the benchmark's name; each returns an enum
 * exit_status (base/options.h), and prints its own manual for --help. Not RT-safe. */
#ifndef APP_BENCH_BENCHMARKS_H
#define APP_BENCH_BENCHMARKS_H

int bench_contact(int argc, char **argv);
int bench_dynamics(int argc, char **argv);
int bench_latency(int argc, char **argv);
int bench_paper(int argc, char **argv);
int bench_throughput(int argc, char **argv);
int bench_ticks(int argc, char **argv);

#endif
