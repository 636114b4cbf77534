/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the commands that take a rig or a robot have in common: its memory and its errors, how a run
 * is stopped from outside, the warnings about real time. Not RT-safe.
 */
#ifndef APP_CLI_RIG_COMMAND_H
#define APP_CLI_RIG_COMMAND_H

#include "rig/rig.h"
#include "rt/realtime.h"

/* Address space of a rig or a robot with what runs it; pages cost nothing until they are
 * touched. */
#define RIG_COMMAND_ARENA ((size_t)1 << 30)

/* Loads the rig into an arena of its own and calls body; returns body's exit status, or that of
 * what went wrong, of which a line has been printed. name: the command's. */
int rig_command(const char *name, const char *path, void *options,
                int (*body)(void *options, const struct rig *rig, struct arena *arena));

/* The same for a robot; variant may be NULL. What body returns is an error code, and its error is
 * printed here. */
int robot_command(const char *name, const char *path, const char *variant, const void *options,
                  enum error_code (*body)(const void *options, const struct robot *robot,
                                          struct arena *arena, struct error *error));

/* Periodic traffic that does not fit on its bus is an error or a warning (a line on stderr), as the
 * rig says. */
enum error_code rig_command_budget(const char *name, const struct rig *rig, struct error *error);

/* The first SIGINT or SIGTERM calls stop(context), which must be async-signal-safe; a second one
 * kills. So does every SIGHUP and SIGPIPE (nobody reads stderr any more), unless it was ignored or
 * handled before. Until rig_command_ignore_stop, after which SIGINT and SIGTERM kill, and the other
 * two do nothing. Another call replaces what is called. */
void rig_command_on_stop(void (*stop)(void *context), void *context);
void rig_command_ignore_stop(void);

/* Whether any of them has come. */
bool rig_command_stop_requested(void);

/* A line on stderr for each warning; clear is what takes a status line off the terminal, or "". */
void rig_command_warn(const struct realtime_report *report, const char *clear);

#endif
