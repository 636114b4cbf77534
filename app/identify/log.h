/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Recordings that are logs of candump (canbus/candump.h), read with the rig's own table of messages
 * (rig/dbc.h). Not RT-safe.
 */
#ifndef APP_IDENTIFY_LOG_H
#define APP_IDENTIFY_LOG_H

#include "app/identify/bench.h"
#include "rig/rig.h"

/* Returns whether a file begins as a log does: with the time of a frame. */
bool recording_is_log(const char *path);

/* Reads a log: a row for each frame that tells the joint's angle, with the mean of the commands
 * since the last. The columns position, and voltage or torque, name signals of coman-hil dbc;
 * without such names, or with those of other columns, they are found by joint and unit. Frames of
 * other interfaces are skipped. ERROR_INPUT says what is missing. */
enum error_code recording_read_log(const struct rig *rig, const char *joint,
                                   const struct bench_columns *columns, const char *path,
                                   struct arena *arena, struct recording *recording,
                                   struct error *error);

#endif
