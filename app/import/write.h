/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes the files of an import into its folder, a configuration tree of its own: robots/NAME.yaml,
 * rigs/NAME.yaml (and rigs/NAME-standing.yaml of a robot that floats and has a pose to stand in),
 * NAME-import.txt, drives/ with copies of the user's own drive files. Every file is complete or not
 * there. Not RT-safe.
 */
#ifndef APP_IMPORT_WRITE_H
#define APP_IMPORT_WRITE_H

#include "app/import/drive.h"
#include "app/import/board_layout.h"
#include "app/import/tree_simplify.h"

#include <stdio.h>

/* Writes the robot file. */
enum error_code import_write_robot(const struct import_robot *from, const char *path,
                                   struct error *error);

/* Copies a drive file of the user's own. */
enum error_code import_copy_drive(const char *from, const char *path, struct error *error);

/* Contents of the rig files; robot is the one that was read back. */
struct import_rig {
    const struct robot *robot;
    const struct import_plan *plan;
    const struct import_gains *gains;
    double supply_v;
    const char *pose;     /* to start in */
    double height_m;      /* of a floating base that hangs, above the ground */
    const char *standing; /* name of a pose to stand in, or NULL */
    double standing_height_m;
};

/* Write the rig that hangs or is fixed, and the one that stands. */
enum error_code import_write_rig(const struct import_rig *rig, const char *path,
                                 struct error *error);
enum error_code import_write_standing(const struct import_rig *rig, const char *path,
                                      struct error *error);

/* Writes the report: every note, grouped by fate, in the order of the file. */
enum error_code import_write_report(const struct import_notes *notes, const char *source,
                                    const char *path, struct error *error);

/* Count the notes of a fate, and return its word ("dropped"). */
size_t import_count_notes(const struct import_notes *notes, enum import_fate fate);
const char *import_fate_word(enum import_fate fate);

#endif
