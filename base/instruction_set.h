/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Selects the instruction set of the kernels. Each kernel is compiled once for each set, and all
 * sets give bit-identical results. The widest set of the machine is the fastest. A process can be
 * limited to a narrower set, to compare results or speed.
 */
#ifndef BASE_INSTRUCTION_SET_H
#define BASE_INSTRUCTION_SET_H

#include "base/error.h"

enum instruction_set {
    INSTRUCTIONS_PLAIN, /* available on every machine of the architecture */
    INSTRUCTIONS_AVX2,
    INSTRUCTIONS_AVX512, /* AVX-512 F, VL and DQ */
    INSTRUCTION_SETS
};

/* "plain", "avx2", "avx512" */
extern const char *const instruction_set_names[INSTRUCTION_SETS];

/* Architecture of this program: "x86_64", "aarch64" or "other". */
extern const char instruction_set_architecture[];

/* Features that a processor may have. */
enum instruction_feature {
    INSTRUCTIONS_HAVE_AVX2 = 1,
    INSTRUCTIONS_HAVE_AVX512F = 2,
    INSTRUCTIONS_HAVE_AVX512VL = 4,
    INSTRUCTIONS_HAVE_AVX512DQ = 8
};

/* Return the widest instruction set: for the given features, or for this machine. */
enum instruction_set instruction_set_with(unsigned features);
enum instruction_set instruction_set_of_machine(void);

/* Returns the instruction set in use: the widest of the machine, or the limit of the process.
 * RT-safe. */
enum instruction_set instruction_set_used(void);

/* Limits the process to the named set. Call it before threads start and before kernels are
 * selected. Returns ERROR_INPUT if the name is unknown or the machine lacks the set. */
enum error_code instruction_set_hold(const char *name, struct error *error);

#endif
