/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The commands of coman-hil. argv[0] is the command's name; the return value is an enum exit_status
 * (rt/options.h). Each prints its own manual for --help.
 */
#ifndef RT_COMMANDS_H
#define RT_COMMANDS_H

int cmd_accel(int argc, char **argv);
int cmd_bench(int argc, char **argv);
int cmd_check(int argc, char **argv);
int cmd_ctl(int argc, char **argv);
int cmd_dbc(int argc, char **argv);
int cmd_doctor(int argc, char **argv);
int cmd_generate(int argc, char **argv);
int cmd_plot(int argc, char **argv);
int cmd_run(int argc, char **argv);
int cmd_task(int argc, char **argv);
int cmd_test(int argc, char **argv);

/* The benchmarks of cmd_bench; argv[0] is the benchmark's name. */
int bench_contact(int argc, char **argv);
int bench_dynamics(int argc, char **argv);
int bench_paper(int argc, char **argv);
int bench_pendulum(int argc, char **argv);

#endif
