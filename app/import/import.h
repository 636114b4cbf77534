/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Turns a foreign robot file into a robot and a bench of ours: what `coman-hil import` does. Reads
 * the file (URDF, with an SRDF for poses, or MJCF), makes a robot of it (tree_simplify.h), assumes
 * drives (drive.h), plans buses (board_layout.h), writes the files (write.h), and reads them back,
 * so that what was written loads. Not RT-safe.
 */
#ifndef APP_IMPORT_IMPORT_H
#define APP_IMPORT_IMPORT_H

#include "app/import/mesh.h"
#include "app/import/board_layout.h"
#include "app/import/tree_simplify.h"

#include <limits.h>

struct import_request {
    const char *file, *srdf; /* srdf may be NULL */
    const char *folder;      /* output folder, made when it is missing; its parent must exist */
    const char *pose;        /* name of the pose to start in; NULL: the import chooses */
    struct import_boards boards;
    bool force; /* overwrite the files of an earlier import */
    struct import_options options;
    struct import_packages packages;
};

/* Paths of the files that were written, and what the command prints. */
struct import_result {
    char robot[PATH_MAX], rig[PATH_MAX], standing[PATH_MAX], report[PATH_MAX]; /* "" = none */
    const struct robot *loaded; /* the robot as robots/NAME.yaml has it */
    struct import_notes notes;
    size_t meshes; /* number of contact meshes that were written */
    size_t nbus;
    double worst_load; /* share of the fullest bus, 0 to 1 */
};

/* Runs an import. Memory from the arena; on an error without force, removes the files it wrote. */
enum error_code import_run(const struct import_request *request, struct arena *arena,
                           struct import_result *result, struct error *error);

/* Reads the text of a URDF or MJCF file and makes a robot of it, the first half of an import:
 * for tests and for fuzzing. The robot is finished (robot_finish) and has drives but no
 * capsules. */
enum error_code import_model_text(const char *name, const char *text, size_t size,
                                  const struct import_options *options, struct arena *arena,
                                  struct import_model *model, struct import_notes *notes,
                                  struct import_robot *robot, double *supply_v,
                                  struct error *error);

#endif
