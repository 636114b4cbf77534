/* SPDX-License-Identifier: Apache-2.0 */
/* The generated modules that are part of the program (for the robots of config/rigs), and
 * the choice among what computes a robot's dynamics. */
#ifndef MODEL_SYMBOLIC_BUILTIN_H
#define MODEL_SYMBOLIC_BUILTIN_H

#include "model/symbolic/background.h"

/* The built-in module made from the robot with this hash, or NULL. RT-safe. */
const struct dynamics_module *symbolic_builtin(uint64_t robot_hash);

/* What is done where a module is neither built in nor in the cache. Numeric and generated code
 * differ in the last bits: a run keeps what it has begun with. */
enum dynamics_compile {
    DYNAMICS_COMPILE_WAIT,       /* compiled first, which takes seconds */
    DYNAMICS_COMPILE_BACKGROUND, /* numeric now, compiled for the next start (background.h) */
    DYNAMICS_COMPILE_NEVER,      /* numeric; the cache is not looked at: the same bits each time */
};

struct dynamics_compiling {
    enum dynamics_compile when;
    struct symbolic_progress progress; /* while it is waited for */
    int loop_cpu;                      /* which the background leaves alone; -1 = none */
};

/* The fastest dynamics that can be had for robot: the built-in module; else one that is built in,
 * or found in, the cache folder (NULL = none); else the numeric algorithms. library holds a built
 * module and is to be closed after the last use; notice says in a sentence what was taken and why.
 * Memory from arena. Not RT-safe; where it compiles in the background before the process has
 * threads. */
enum error_code dynamics_fastest(const struct robot *robot, const char *folder,
                                 const struct dynamics_compiling *compiling, struct arena *arena,
                                 struct dynamics *out, struct symbolic_library *library,
                                 struct error *notice, struct error *error);

/* How it is with the module that dynamics_fastest looks for in folder (symbolic_state). */
enum symbolic_state dynamics_fastest_state(const struct robot *robot, const char *folder,
                                           struct error *reason);

#endif
