/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Does what the commands that take a rig or a robot have in common: its memory and its errors, how
 * a run is stopped from outside, the warnings about real time. Not RT-safe.
 */
#ifndef APP_CLI_RIG_COMMAND_H
#define APP_CLI_RIG_COMMAND_H

#include "rig/rig.h"
#include "rt/realtime.h"

/* Address space for a rig or a robot with what runs it, bytes; pages cost nothing until they are
 * touched. */
#define RIG_COMMAND_ARENA ((size_t)1 << 30)

/* Loads a rig into an arena of its own and calls body; returns body's exit status, or that of an
 * error, which has been printed. name: the command's. */
int rig_command(const char *name, const char *path, void *options,
                int (*body)(void *options, const struct rig *rig, struct arena *arena));

/* Loads a robot in the same way; variant may be NULL. body returns an error code, whose error is
 * printed here. */
int robot_command(const char *name, const char *path, const char *variant, const void *options,
                  enum error_code (*body)(const void *options, const struct robot *robot,
                                          struct arena *arena, struct error *error));

/* Warns on stderr of periodic traffic that does not fit on its bus. */
void rig_command_warn_load(const char *name, const struct rig *rig);

/* Sets what a stop from outside calls. The first SIGINT or SIGTERM calls stop(context), which must
 * be async-signal-safe; a second one within half a second is taken for its twin, a later one kills.
 * Every SIGHUP and SIGPIPE (nobody reads stderr any more) calls it too, unless it was ignored or
 * handled before. This holds until rig_command_ignore_stop, after which SIGINT and SIGTERM kill
 * (but for such a twin), and the other two do nothing. Another call replaces the function. */
void rig_command_on_stop(void (*stop)(void *context), void *context);
void rig_command_ignore_stop(void);

/* Checks whether any of these signals has come. */
bool rig_command_stop_requested(void);

/* Prints a line on stderr for each warning; clear takes a status line off the terminal, or is
 * "". */
void rig_command_warn(const struct realtime_report *report, const char *clear);

#endif
