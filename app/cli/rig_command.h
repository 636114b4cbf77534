/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the commands that take a rig (check, run, task) have in common: its memory, how it is stopped from
 * outside, the warnings about real time. Not RT-safe.
 */
#ifndef APP_CLI_RIG_COMMAND_H
#define APP_CLI_RIG_COMMAND_H

#include "rt/realtime.h"
#include "rig/rig.h"

/* Of address space; pages cost nothing until they are touched. */
#define RIG_COMMAND_ARENA ((size_t)512 << 20)

/* Loads the rig into an arena of its own and calls body; returns body's exit status, or that of what
 * went wrong, of which a line has been printed. name: the command's. */
int rig_command(const char *name, const char *path, void *options,
                int (*body)(void *options, const struct rig *rig, struct arena *arena));

/* Periodic traffic that cannot fit on its bus is refused or warned of, a line on stderr, as the rig
 * says. */
enum error_code rig_command_budget(const char *name, const struct rig *rig, struct error *error);

/* The first SIGINT or SIGTERM calls stop(context), which must be async-signal-safe; a second one
 * kills. Until rig_command_ignore_stop, after which signals do what they do by default. */
void rig_command_on_stop(void (*stop)(void *context), void *context);
void rig_command_ignore_stop(void);

/* A line on stderr for each warning; clear is what takes a status line off the terminal, or "". */
void rig_command_warn(const struct realtime_report *report, const char *clear);

#endif
