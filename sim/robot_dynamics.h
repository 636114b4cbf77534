/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What computes a robot's dynamics: a module that is built in, else one that was made beforehand
 * (coman-hil generate --module), else the numeric algorithms. No compiler is started. Modules and
 * the numeric algorithms differ in the last bits. Not RT-safe.
 */
#ifndef SIM_ROBOT_DYNAMICS_H
#define SIM_ROBOT_DYNAMICS_H

#include "model/symbolic/symbolic.h"
#include "rig/rig.h"

/* Options of the modules that are found here: they take mass properties as inputs, so that one
 * serves whatever masses a rig adds. */
extern const struct symbolic_options robot_dynamics_module;

/* Finds the folder in which a user makes modules, which need not exist: coman-hil below
 * $XDG_CACHE_HOME or $HOME/.cache; of root without $XDG_CACHE_HOME that of the machine,
 * /var/cache/coman-hil, in which every user's modules are looked for after his own. False =
 * there is none. */
bool robot_dynamics_folder(char *path, size_t size);

/* Creates the fastest dynamics that a robot can have. library holds a module that is not built
 * in and is to be closed after the last use; notice says in a sentence what was taken and why.
 * Memory from arena. */
enum error_code robot_dynamics_fastest(const struct robot *robot, struct arena *arena,
                                       struct dynamics *out, struct symbolic_library *library,
                                       struct error *notice, struct error *error);

/* Creates the dynamics that a rig asks for. When they are numeric because there is no module, the
 * notice contains the command that makes one. */
enum error_code robot_dynamics_create(const struct rig *rig, struct arena *arena,
                                      struct dynamics *out, struct symbolic_library *library,
                                      struct error *notice, struct error *error);

#endif
