/* SPDX-License-Identifier: Apache-2.0 */
/* The generated modules that are part of the program (for the robots of config/rigs), and
 * the choice among what computes a robot's dynamics. */
#ifndef MODEL_SYMBOLIC_BUILTIN_H
#define MODEL_SYMBOLIC_BUILTIN_H

#include "model/symbolic/symbolic.h"

/* The built-in module made from the robot with this hash, or NULL. RT-safe. */
const struct dynamics_module *symbolic_builtin(uint64_t robot_hash);

/* The fastest dynamics that can be had for robot: the built-in module; else one that is built in,
 * or found in, the cache folder (NULL = none), which takes seconds the first time; else the numeric
 * algorithms. library holds a built module and is to be closed after the last use; notice says in a
 * sentence what was taken and why. Memory from arena. Not RT-safe. */
enum error_code dynamics_fastest(const struct robot *robot, const char *folder,
                                 struct symbolic_progress progress, struct arena *arena,
                                 struct dynamics *out, struct symbolic_library *library,
                                 struct error *notice, struct error *error);

#endif
