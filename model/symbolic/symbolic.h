/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The symbolic generator: writes C code for the dynamics of one robot (model/symbolic/module.h),
 * and wraps generated code as struct dynamics. The generator is not RT-safe; the generated dynamics
 * are.
 */
#ifndef MODEL_SYMBOLIC_SYMBOLIC_H
#define MODEL_SYMBOLIC_SYMBOLIC_H

#include "model/dynamics.h"
#include "model/symbolic/module.h"

#include <stdio.h>

enum { SYMBOLIC_FUNCTIONS = 8, SYMBOLIC_SYMBOL = 64 };

/* Cost of a function. Each lane counts as one operation. Sines and cosines are counted
 * separately. */
struct symbolic_count {
    const char *function;
    size_t add, multiply, divide;
    size_t operations; /* sum of the three counts */
    size_t sincos;     /* number of angles */
    size_t statements; /* vector and scalar instructions before contraction, without moves */
};

struct symbolic_report {
    size_t groups; /* groups of bodies in lanes; the base is one group */
    struct symbolic_count count[SYMBOLIC_FUNCTIONS];
};

struct symbolic_options {
    int lanes; /* maximum number of lanes: 1, 2 or 4; 4 is the fastest */
    /* mass properties are inputs, so the module fits all robots that differ only in mass
     * properties */
    bool inertia_inputs;
};

/* Writes the module's C file. The same robot and options give the same bytes. report may be
 * NULL. */
enum error_code symbolic_generate(const struct robot *robot, const struct symbolic_options *options,
                                  FILE *file, struct symbolic_report *report, struct error *error);

/* Writes the name of the module's external function. */
void symbolic_symbol(const struct robot *robot, char symbol[SYMBOLIC_SYMBOL]);

/* A module compiled by symbolic_compile. */
struct symbolic_library {
    void *handle;
    const struct dynamics_module *module;
};

/* Generates robot's module, compiles it with cc at a level such as "-O2", and loads it. For
 * benchmarks and tests; the simulator itself starts no compiler. Returns ERROR_UNSUPPORTED if cc
 * fails or does not exist. */
enum error_code symbolic_compile(const struct robot *robot, const struct symbolic_options *options,
                                 const char *level, struct symbolic_library *library,
                                 struct error *error);

/* Unloads the module, which must not be in use. Safe on a zeroed library. */
void symbolic_close(struct symbolic_library *library);

/* Returns the built-in module for a robot of config/robots with any masses, or NULL if there is
 * none. The library symbolic_builtin defines this function. RT-safe. */
const struct dynamics_module *symbolic_builtin(const struct robot *robot);

/* Creates the dynamics of a robot from a built-in module. Uses the numeric algorithms if no module
 * fits or if `numeric` is set. Results of both differ in the last bits. notice receives a sentence
 * with the choice and its reason. Memory from arena. */
enum error_code dynamics_choose(const struct robot *robot, bool numeric, struct arena *arena,
                                struct dynamics *out, struct error *notice, struct error *error);

/* Returns the variant of a module with the widest vectors that instruction_set_used() allows. */
const struct dynamics_module *dynamics_module_used(const struct dynamics_module *module);

/* Returns whether a module computes the dynamics of robot. The module must have been generated from
 * this robot. A module with mass properties as inputs may be from a robot that differs only in mass
 * properties. RT-safe. */
bool dynamics_module_fits(const struct dynamics_module *module, const struct robot *robot);

/* Makes a struct dynamics of robot from the module. Refuses a module of another robot. Memory from
 * arena. The module must outlive the result. */
enum error_code dynamics_generated(const struct robot *robot, const struct dynamics_module *module,
                                   struct arena *arena, struct dynamics *out, struct error *error);

#endif
