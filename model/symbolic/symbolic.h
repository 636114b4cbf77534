/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The symbolic generator: C code for the dynamics of one robot (model/symbolic/module.h), and the
 * generated code as an implementation of struct dynamics. Not RT-safe; what it makes is.
 */
#ifndef MODEL_SYMBOLIC_SYMBOLIC_H
#define MODEL_SYMBOLIC_SYMBOLIC_H

#include "model/dynamics.h"
#include "model/symbolic/module.h"

#include <stdio.h>

enum { SYMBOLIC_FUNCTIONS = 8, SYMBOLIC_SYMBOL = 64 };

/* The cost of a function. Lanes count each; sines and cosines are counted apart. */
struct symbolic_count {
    const char *function;
    size_t add, multiply, divide;
    size_t operations; /* sum of the three */
    size_t sincos;     /* angles */
    size_t statements; /* vector and scalar instructions before contraction, without moves */
};

struct symbolic_report {
    size_t groups; /* of bodies side by side; the base is one */
    struct symbolic_count count[SYMBOLIC_FUNCTIONS];
};

struct symbolic_options {
    int lanes;           /* at most so many limbs side by side: 1, 2 or 4; 4 is the fastest */
    bool inertia_inputs; /* mass properties are inputs: for all robots that differ in them alone */
};

/* Writes the module's C file: the same bytes for the same robot and options. report may be NULL. */
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
 * benchmarks and tests: the simulator itself starts no compiler. ERROR_UNSUPPORTED where cc fails
 * or there is none. */
enum error_code symbolic_compile(const struct robot *robot, const struct symbolic_options *options,
                                 const char *level, struct symbolic_library *library,
                                 struct error *error);

/* Unloads; nothing of the module may be in use. Safe on a zeroed library. */
void symbolic_close(struct symbolic_library *library);

/* Returns the built-in module for a robot of config/robots with any masses, else NULL. Defined in
 * the library symbolic_builtin. RT-safe. */
const struct dynamics_module *symbolic_builtin(const struct robot *robot);

/* Creates the dynamics of a robot: a built-in module, else or if numeric is set the numeric
 * algorithms. The two differ in the last bits; the notice says in a sentence what was taken and
 * why. Memory from arena. */
enum error_code dynamics_choose(const struct robot *robot, bool numeric, struct arena *arena,
                                struct dynamics *out, struct error *notice, struct error *error);

/* Returns the widest of a module's variants that instruction_set_used() allows. */
const struct dynamics_module *dynamics_module_used(const struct dynamics_module *module);

/* Returns whether a module computes the dynamics of robot: it was made from it, or takes its
 * mass properties as inputs and was made from one that differs in nothing else. RT-safe. */
bool dynamics_module_fits(const struct dynamics_module *module, const struct robot *robot);

/* Makes the module an implementation of robot's dynamics; refuses one that was made from another
 * robot. Memory from arena; the module must outlive it. */
enum error_code dynamics_generated(const struct robot *robot, const struct dynamics_module *module,
                                   struct arena *arena, struct dynamics *out, struct error *error);

#endif
