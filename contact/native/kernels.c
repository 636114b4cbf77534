/* SPDX-License-Identifier: Apache-2.0 */
/* The table of the kernels; compiled once for each instruction set. */
#include "contact/native/private.h"

#define STRING(x) #x
#define EXPANDED_STRING(x) STRING(x)

const struct native_kernels native_kernels = {
#ifdef NATIVE_VARIANT
    .name = EXPANDED_STRING(NATIVE_VARIANT),
#else
    .name = "plain",
#endif
    .ops = &native_ops,
    .half_space = native_overlap_half_space,
    .sphere = native_overlap_sphere,
    .meshes = native_overlap_meshes,
    .fields = native_overlap_fields,
    .hertz = native_hertz,
    .capsule_half_space = native_capsule_half_space,
    .capsules = native_capsules,
    .sum = native_law_sum,
    .find_near = broad_phase_find,
};
