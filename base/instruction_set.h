/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Which instruction set the kernels are run for. They are compiled once for each of these, and all
 * give the same bits; the widest that the machine has is the fastest. A process may be held to a
 * narrower one, to see that the bits are the same or to find out what a machine costs.
 */
#ifndef BASE_INSTRUCTION_SET_H
#define BASE_INSTRUCTION_SET_H

#include "base/error.h"

enum instruction_set {
    INSTRUCTIONS_PLAIN, /* what every machine of the architecture has */
    INSTRUCTIONS_AVX2,
    INSTRUCTIONS_AVX512, /* F, VL and DQ */
    INSTRUCTION_SETS
};

/* "plain", "avx2", "avx512" */
extern const char *const instruction_set_names[INSTRUCTION_SETS];

/* The architecture that this program is compiled for: "x86_64", "aarch64"; "other". */
extern const char instruction_set_architecture[];

/* What a processor may have. */
enum instruction_feature {
    INSTRUCTIONS_HAVE_AVX2 = 1,
    INSTRUCTIONS_HAVE_AVX512F = 2,
    INSTRUCTIONS_HAVE_AVX512VL = 4,
    INSTRUCTIONS_HAVE_AVX512DQ = 8
};

/* Return the widest set of a processor with these features, and of this machine. */
enum instruction_set instruction_set_with(unsigned features);
enum instruction_set instruction_set_of_machine(void);

/* Returns the set to run: the machine's, or the one that the process is held to. RT-safe. */
enum instruction_set instruction_set_used(void);

/* Holds the process to the set of a name. Before threads are started and before the first
 * kernels are chosen. ERROR_INPUT: there is no such name, or the machine does not have it. */
enum error_code instruction_set_hold(const char *name, struct error *error);

#endif
