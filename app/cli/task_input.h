/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Functions common to commands that start a task: the options of sweep and follow, and the reports
 * of these tasks. Not RT-safe.
 */
#ifndef APP_CLI_TASK_INPUT_H
#define APP_CLI_TASK_INPUT_H

#include "base/options.h"
#include "rig/rig.h"
#include "tasks/trajectory.h"

/* Options of the tasks sweep and follow. */
struct task_options {
    const char *joint, *trajectory, *report; /* NULL: not given */
    int interpolation;                       /* enum trajectory_interpolation */
};

extern const struct word task_interpolation_words[];

/* Rows of an option table that fill a struct task_options. */
#define TASK_OPTION_ROWS(o)                                                                        \
    {"--joint",           OPTION_STRING,   "JOINT", "the joint that the task sweep identifies",    \
     .value = &(o).joint, .noun = "joints"},                                                       \
        {"--trajectory", OPTION_STRING, "FILE",                                                    \
         "the trajectory of the task follow: CSV with the titles time_s and JOINT_rad or "         \
         "JOINT_deg",                                                                              \
         .value = &(o).trajectory},                                                                \
        {"--interpolation",                                                                        \
         OPTION_ENUM,                                                                              \
         "HOW",                                                                                    \
         "cubic, the default, or linear between the rows of the trajectory",                       \
         .value = &(o).interpolation,                                                              \
         .words = task_interpolation_words},                                                       \
    {                                                                                              \
        "--report", OPTION_STRING, "DIR",                                                          \
            "when sweep or follow ends, write its results into this folder: tables as CSV, plots " \
            "as "                                                                                  \
            "SVG, and a page with all of it",                                                      \
            .value = &(o).report                                                                   \
    }

/* Reads the input of the task with this name, and refuses options that it does not have; NULL:
 * no task. The input points into the options and the arena. ERROR_INPUT, ERROR_SYSTEM,
 * ERROR_MEMORY. */
enum error_code task_input_read(const struct task_options *options, const char *task,
                                const struct rig *rig, struct arena *arena,
                                struct task_input *input, struct error *error);

/* Writes the report of a task after any end; does nothing without a folder. */
enum error_code task_report_write(const struct task *task, const char *folder, struct error *error);

#endif
