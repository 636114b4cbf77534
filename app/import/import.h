/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A foreign robot file as a robot and a bench of ours: what `coman-hil import` does. Reads the file
 * (URDF, with an SRDF for poses, or MJCF), makes a robot of it (reduce.h), assumes drives
 * (drive.h), plans buses (plan.h), writes the files (write.h), and reads them back, so that what
 * was written loads. Not RT-safe.
 */
#ifndef APP_IMPORT_IMPORT_H
#define APP_IMPORT_IMPORT_H

#include "app/import/mesh.h"
#include "app/import/plan.h"
#include "app/import/reduce.h"

#include <limits.h>

struct import_request {
    const char *file, *srdf; /* srdf may be NULL */
    const char *folder;      /* made when it is not there; its parent is */
    const char *pose;        /* to start in, by name; NULL: chosen */
    struct import_boards boards;
    bool force; /* writes over the robot and the rigs of an import before */
    struct import_options options;
    struct import_packages packages;
};

struct import_result {
    char robot[PATH_MAX], rig[PATH_MAX], standing[PATH_MAX], report[PATH_MAX]; /* "" = none */
    const struct robot *loaded; /* as robots/NAME.yaml has it */
    struct import_notes notes;
    size_t meshes; /* of what touches, that were written */
    size_t nbus;
    double worst_load; /* of a bus, of 1 */
};

enum error_code import_run(const struct import_request *request, struct arena *arena,
                           struct import_result *result, struct error *error);

/* The first half, from the text of a URDF or MJCF file to a robot: for tests and for fuzzing. The
 * robot is finished (robot_finish) and has drives but no capsules. */
enum error_code import_model_text(const char *name, const char *text, size_t size,
                                  const struct import_options *options, struct arena *arena,
                                  struct import_model *model, struct import_notes *notes,
                                  struct import_robot *robot, double *supply_v,
                                  struct error *error);

#endif
