/* SPDX-License-Identifier: Apache-2.0 */
/* The kernels of the native engine for each instruction set, and which of them this machine runs.
 * */
#ifndef TESTS_PHYSICS_CONTACT_VARIANTS_H
#define TESTS_PHYSICS_CONTACT_VARIANTS_H

#include "base/instruction_set.h"
#include "contact/native/isa_table.h"

#include <stdbool.h>
#include <string.h>

struct contact_variant {
    const char *name, *needs;
    const struct native_kernels *kernels; /* NULL: not built for this machine */
    bool runs;
};

enum { CONTACT_VARIANTS = INSTRUCTION_SETS };

/* The variant of an instruction set. */
static inline struct contact_variant contact_variant_at(size_t n)
{
    struct contact_variant variant[CONTACT_VARIANTS] = {{"plain", "nothing", &native_kernels, true},
                                                        {"avx2", "AVX2", NULL, false},
                                                        {"avx512", "AVX-512", NULL, false}};

#if defined(NATIVE_VARIANTS)
    variant[INSTRUCTIONS_AVX2].kernels = &native_kernels_avx2;
    variant[INSTRUCTIONS_AVX512].kernels = &native_kernels_avx512;
    for (size_t i = 0; i < CONTACT_VARIANTS; i++) {
        variant[i].runs = i <= (size_t)instruction_set_of_machine();
    }
#endif
    return variant[n];
}

#endif
