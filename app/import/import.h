/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Converts a foreign robot file to a robot file and rig files, for `coman-hil import`. It reads the
 * file (URDF, with an SRDF for poses, or MJCF) and makes a robot (tree_simplify.h). It assumes
 * drives (drive.h), plans buses (board_layout.h) and writes the files (write.h). Finally it reads
 * them back as a check. Not RT-safe.
 */
#ifndef APP_IMPORT_IMPORT_H
#define APP_IMPORT_IMPORT_H

#include "app/import/mesh.h"
#include "app/import/board_layout.h"
#include "app/import/tree_simplify.h"

struct import_request {
    const char *file, *srdf;    /* srdf may be NULL */
    const char *folder;         /* output folder, created if missing; its parent must exist */
    const char *pose;           /* name of the initial pose; NULL = the import chooses it */
    const char *protocol;       /* protocol of the boards, as in --protocol; NULL = default */
    const char *const *address; /* --address options: JOINT=NUMBER */
    size_t naddress;
    double bus_load; /* largest planned load of a bus, percent; 0 = IMPORT_BUS_LOAD */
    bool force;      /* overwrite the files of an earlier import */
    struct import_options options;
    struct import_packages packages;
};

/* Paths of the written files, and data that the command prints. */
struct import_result {
    char robot[PATH_MAX], rig[PATH_MAX], standing[PATH_MAX], report[PATH_MAX]; /* "" = none */
    const struct robot *loaded; /* the robot, read back from robots/NAME.yaml */
    struct import_notes notes;
    size_t meshes; /* number of written contact meshes */
    size_t nbus;
    double worst_load; /* load of the fullest bus, 0 to 1 */
};

/* Runs an import. Memory is from the arena. On an error without force, it removes the files that it
 * has written. */
enum error_code import_run(const struct import_request *request, struct arena *arena,
                           struct import_result *result, struct error *error);

/* Reads the text of a URDF or MJCF file and makes a robot: the first half of an import, for tests
 * and fuzzing. The robot is finished (robot_finish), and has drives but no capsules. */
enum error_code import_model_text(const char *name, const char *text, size_t size,
                                  const struct import_options *options, struct arena *arena,
                                  struct import_model *model, struct import_notes *notes,
                                  struct import_robot *robot, double *supply_v,
                                  struct error *error);

#endif
