/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What an import writes into its folder, a configuration tree of its own: robots/NAME.yaml,
 * rigs/NAME.yaml (and rigs/NAME-standing.yaml of a robot that floats and has a pose to stand in),
 * NAME-import.txt, drives/ with copies of the drives' files that are the user's own. Every file is
 * complete or not there. Not RT-safe.
 */
#ifndef APP_IMPORT_WRITE_H
#define APP_IMPORT_WRITE_H

#include "app/import/drive.h"
#include "app/import/plan.h"
#include "app/import/reduce.h"

#include <stdio.h>

/* The robot file. */
enum error_code import_write_robot(const struct import_robot *from, const char *path,
                                   struct error *error);

/* Copies a drive's file of the user's own. */
enum error_code import_copy_drive(const char *from, const char *path, struct error *error);

/* What the rig files are made of; robot is the one that was read back. */
struct import_rig {
    const struct robot *robot;
    const struct import_plan *plan;
    const struct import_gains *gains;
    double supply_v;
    const char *pose;     /* that it starts in */
    double height_m;      /* of a floating base that hangs */
    const char *standing; /* name of a pose to stand in, or NULL */
    double standing_height_m;
};

enum error_code import_write_rig(const struct import_rig *rig, const char *path,
                                 struct error *error);
enum error_code import_write_standing(const struct import_rig *rig, const char *path,
                                      struct error *error);

/* The report: every note, by what became of it and in the order of the file. */
enum error_code import_write_report(const struct import_notes *notes, const char *source,
                                    const char *path, struct error *error);

/* How many notes there are of a fate, and its word ("dropped"). */
size_t import_count_notes(const struct import_notes *notes, enum import_fate fate);
const char *import_fate_word(enum import_fate fate);

#endif
