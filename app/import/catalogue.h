/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives that the user picks from the catalogue (config/drives/) for the joints of an import:
 * `--drive NAME` for all that turn, `--drive PATTERN=NAME` for those whose names the pattern
 * matches (*, ? and [...] as in a shell); of several that match the last one counts. NAME may be
 * the path of a drive file, which is copied into the folder drives of the import. Not RT-safe.
 */
#ifndef APP_IMPORT_CATALOGUE_H
#define APP_IMPORT_CATALOGUE_H

#include "app/import/tree_simplify.h"

/* Fills drive, drive_file and drive_copy of the robot. Errors name the option, what is not there
 * and what is nearest: a name of the catalogue, a pattern that no joint matches. Memory from
 * arena. */
enum error_code import_pick_drives(const struct import_options *options, struct arena *arena,
                                   struct import_robot *to, struct error *error);

/* Returns the short-time torque of a drive, N m: its peak or rated torque by the file, else the
 * stall torque at its supply voltage. */
double import_drive_torque(const struct robot_drive *drive);

#endif
