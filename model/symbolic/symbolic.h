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

/* The cost of a function. Each lane counts; sines and cosines are counted separately. */
struct symbolic_count {
    const char *function;
    size_t add, multiply, divide;
    size_t operations; /* sum of the three */
    size_t sincos;     /* angles */
    size_t statements; /* vector and scalar instructions before contraction, without moves */
};

struct symbolic_report {
    size_t groups; /* groups of bodies in lanes; the base is one group */
    struct symbolic_count count[SYMBOLIC_FUNCTIONS];
};

struct symbolic_options {
    int lanes; /* maximum number of lanes: 1, 2 or 4; 4 is the fastest */
    /* mass properties are inputs: the module fits all robots that differ only in them */
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

/* Returns the built-in module for a robot of config/robots with any masses; NULL if there is none.
 * Defined in the library symbolic_builtin. RT-safe. */
const struct dynamics_module *symbolic_builtin(const struct robot *robot);

/* Creates the dynamics of a robot: a built-in module; if there is none, or numeric is set, the
 * numeric algorithms. The two differ in the last bits. notice receives a sentence on the choice
 * and its reason. Memory from arena. */
enum error_code dynamics_choose(const struct robot *robot, bool numeric, struct arena *arena,
                                struct dynamics *out, struct error *notice, struct error *error);

/* Returns the widest of a module's variants that instruction_set_used() allows. */
const struct dynamics_module *dynamics_module_used(const struct dynamics_module *module);

/* Returns whether a module computes the dynamics of robot: it was generated from it, or from a
 * robot that differs only in mass properties and takes these as inputs. RT-safe. */
bool dynamics_module_fits(const struct dynamics_module *module, const struct robot *robot);

/* Makes a struct dynamics of robot from the module; refuses a module of another robot. Memory from
 * arena; the module must outlive it. */
enum error_code dynamics_generated(const struct robot *robot, const struct dynamics_module *module,
                                   struct arena *arena, struct dynamics *out, struct error *error);

#endif
