/* SPDX-License-Identifier: Apache-2.0 */
/* Lists what a rig has that options name: joints for --joint, faults for --fault. Not RT-safe. */
#ifndef APP_CLI_LIST_RIG_H
#define APP_CLI_LIST_RIG_H

#include "base/error.h"

/* Takes a name and a line of text about it. */
typedef void (*list_put)(const char *name, const char *text);

/* Lists the driven joints of a rig, given by its file or name. */
enum error_code list_rig_joints(const char *rig, list_put put, struct error *error);

/* Lists the beginnings of all fault lines that a rig can have. */
enum error_code list_rig_faults(const char *rig, list_put put, struct error *error);

#endif
