/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Functions common to commands with a rig or a robot: memory and errors, stopping by signals,
 * warnings about real time. Not RT-safe.
 */
#ifndef APP_CLI_RIG_COMMAND_H
#define APP_CLI_RIG_COMMAND_H

#include "rig/rig.h"
#include "rt/realtime.h"

/* Reserved address space for a rig or a robot and its run, bytes; unused pages cost nothing. */
#define RIG_COMMAND_ARENA ((size_t)1 << 30)

/* Loads a rig into a new arena and calls body. Returns body's exit status. On an error, prints it
 * and returns its exit status. name: name of the command. */
int rig_command(const char *name, const char *path, void *options,
                int (*body)(void *options, const struct rig *rig, struct arena *arena));

/* Loads a robot in the same way; variant may be NULL. body returns an error code; its error is
 * printed here. */
int robot_command(const char *name, const char *path, const char *variant, const void *options,
                  enum error_code (*body)(const void *options, const struct robot *robot,
                                          struct arena *arena, struct error *error));

/* Warns on stderr if periodic traffic exceeds the capacity of its bus. */
void rig_command_warn_load(const char *name, const struct rig *rig);

/* Sets the function for stop signals. The first SIGINT or SIGTERM calls stop(context), which must
 * be async-signal-safe. A second one within half a second counts as the same stop; a later one
 * kills the process. Each SIGHUP and SIGPIPE (stderr has no reader) calls it too, unless the
 * signal was ignored or handled before. After rig_command_ignore_stop, SIGINT and SIGTERM kill
 * (except for such a second signal), and the other two do nothing. Another call replaces the
 * function. */
void rig_command_on_stop(void (*stop)(void *context), void *context);
void rig_command_ignore_stop(void);

/* Checks whether any of these signals has arrived. */
bool rig_command_stop_requested(void);

/* Prints a line on stderr for each warning. clear: sequence that removes a status line from the
 * terminal, or "". */
void rig_command_warn(const struct realtime_report *report, const char *clear);

#endif
