/* SPDX-License-Identifier: Apache-2.0 */
/* The generated modules that are part of the program, for the robots of config/rigs. */
#ifndef MODEL_SYMBOLIC_BUILTIN_H
#define MODEL_SYMBOLIC_BUILTIN_H

#include "model/symbolic/symbolic.h"

/* Returns the built-in module for robot: made from it, else one that takes mass properties as
 * inputs and was made from a robot that differs in nothing else, else NULL. RT-safe. */
const struct dynamics_module *symbolic_builtin(const struct robot *robot);

/* Returns only a module that was made from robot, which has up to one in a hundred fewer
 * operations. RT-safe. */
const struct dynamics_module *symbolic_builtin_exact(const struct robot *robot);

#endif
