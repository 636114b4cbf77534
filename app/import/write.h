/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes the files of an import to its folder, which is a configuration tree: robots/NAME.yaml,
 * rigs/NAME.yaml, NAME-import.txt, and drives/ with copies of the user's own drive files. A
 * floating robot with a standing pose also gets rigs/NAME-standing.yaml. Each file is complete or
 * missing. Not RT-safe.
 */
#ifndef APP_IMPORT_WRITE_H
#define APP_IMPORT_WRITE_H

#include "app/import/drive.h"
#include "app/import/board_layout.h"
#include "app/import/tree_simplify.h"

/* Writes the robot file. */
enum error_code import_write_robot(const struct import_robot *from, const char *path,
                                   struct error *error);

/* Copies a user's own drive or protocol file. */
enum error_code import_copy_file(const char *from, const char *path, struct error *error);

/* Contents of the rig files. robot is the robot as read back. */
struct import_rig {
    const struct robot *robot;
    const struct import_plan *plan;
    const struct import_gains *gains;
    double supply_v;
    const char *const *drive_file; /* by joint: name of its catalogue drive, or NULL */
    const char *pose;              /* initial pose */
    double height_m;               /* height of a hanging floating base above the ground */
    const char *standing;          /* name of the pose for standing, or NULL */
    double standing_height_m;
    bool rolls; /* the robot stands on wheels */
};

/* Write the rig with a hanging or fixed base, and the rig with the standing robot. */
enum error_code import_write_rig(const struct import_rig *rig, const char *path,
                                 struct error *error);
enum error_code import_write_standing(const struct import_rig *rig, const char *path,
                                      struct error *error);

/* Writes the report: all notes, grouped by fate, in file order. */
enum error_code import_write_report(const struct import_notes *notes, const char *source,
                                    const char *path, struct error *error);

/* import_count_notes counts the notes with a fate; import_fate_word returns the fate's word
 * ("dropped"). */
size_t import_count_notes(const struct import_notes *notes, enum import_fate fate);
const char *import_fate_word(enum import_fate fate);

#endif
