/* SPDX-License-Identifier: Apache-2.0 */
/* The kernels of the native engine for each instruction set, and which of them this machine runs.
 * */
#ifndef TESTS_PHYSICS_CONTACT_VARIANTS_H
#define TESTS_PHYSICS_CONTACT_VARIANTS_H

#include "contact/native_kernels.h"

#include <stdbool.h>
#include <string.h>

struct contact_variant {
    const char *name, *needs;
    const struct native_kernels *kernels; /* NULL: not built for this machine */
    bool runs;
};

enum { CONTACT_VARIANTS = 3 };

/* The variant by its number, the plainest first. */
static inline struct contact_variant contact_variant_at(size_t n)
{
    struct contact_variant variant[CONTACT_VARIANTS] = {{"plain", "nothing", &native_kernels, true},
                                                        {"avx2", "AVX2", NULL, false},
                                                        {"avx512", "AVX-512", NULL, false}};

#if defined(NATIVE_VARIANTS)
    __builtin_cpu_init();
    variant[1].kernels = &native_kernels_avx2;
    variant[1].runs = __builtin_cpu_supports("avx2");
    variant[2].kernels = &native_kernels_avx512;
    variant[2].runs = variant[1].runs && __builtin_cpu_supports("avx512f") &&
                      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq");
#endif
    return variant[n];
}

#endif
