/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The commands of coman-hil. argv[0] is the command's name; the return value is an enum exit_status
 * (base/options.h). Each prints its own manual for --help. Not RT-safe.
 */
#ifndef APP_CLI_COMMANDS_H
#define APP_CLI_COMMANDS_H

#include <stdio.h>

int cmd_accel(int argc, char **argv);
int cmd_bench(int argc, char **argv);
int cmd_check(int argc, char **argv);
int cmd_ctl(int argc, char **argv);
int cmd_dbc(int argc, char **argv);
int cmd_doctor(int argc, char **argv);
int cmd_eds(int argc, char **argv);
int cmd_generate(int argc, char **argv);
int cmd_identify(int argc, char **argv);
int cmd_import(int argc, char **argv);
int cmd_list(int argc, char **argv);
int cmd_plot(int argc, char **argv);
int cmd_protocol(int argc, char **argv);
int cmd_replay(int argc, char **argv);
int cmd_run(int argc, char **argv);
int cmd_task(int argc, char **argv);
int cmd_test(int argc, char **argv);
int cmd_validate(int argc, char **argv);

/* ---- topics of the manual that belong to no command: coman-hil help TOPIC prints one ---- */

void topic_board(FILE *out);
void topic_bus(FILE *out);
void topic_fault(FILE *out);
void topic_rig(FILE *out);
void topic_robot(FILE *out);
void topic_rt(FILE *out);
void topic_scenario(FILE *out);
void topic_signal(FILE *out);

#endif
