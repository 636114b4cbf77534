/* SPDX-License-Identifier: Apache-2.0 */
/* The generated modules that are part of the program (for the robots of config/rigs), and
 * the choice among what computes a robot's dynamics. */
#ifndef MODEL_SYMBOLIC_BUILTIN_H
#define MODEL_SYMBOLIC_BUILTIN_H

#include "model/symbolic/background.h"

/* The built-in module for robot: made from it, else one that takes mass properties as inputs and
 * was made from a robot that differs in nothing else, else NULL. RT-safe. */
const struct dynamics_module *symbolic_builtin(const struct robot *robot);

/* The same, but only a module that was made from robot, of up to one in a hundred fewer operations.
 * RT-safe. */
const struct dynamics_module *symbolic_builtin_exact(const struct robot *robot);

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

/* The fastest dynamics that can be had for robot: a built-in module (symbolic_builtin); else one
 * that is built in, or found in, the cache folder (NULL = none); else the numeric algorithms.
 * library holds a built module and is to be closed after the last use; notice says in a sentence
 * what was taken and why. Memory from arena. Not RT-safe; where it compiles in the background
 * before the process has threads. */
enum error_code dynamics_fastest(const struct robot *robot, const char *folder,
                                 const struct dynamics_compiling *compiling, struct arena *arena,
                                 struct dynamics *out, struct symbolic_library *library,
                                 struct error *notice, struct error *error);

/* How it is with the module that dynamics_fastest looks for in folder (symbolic_state). */
enum symbolic_state dynamics_fastest_state(const struct robot *robot, const char *folder,
                                           struct error *reason);

/* The fastest dynamics that robot can have without a compiler: a built-in module, also one that
 * takes masses as inputs, else the numeric algorithms. notice as above. Memory from arena.
 * Not RT-safe. */
enum error_code dynamics_built_in(const struct robot *robot, struct arena *arena,
                                  struct dynamics *out, struct error *notice, struct error *error);

#endif
