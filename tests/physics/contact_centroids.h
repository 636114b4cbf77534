/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Kernels that make the native engine give Simbody's numbers on the same patch: springs at the
 * centroids of triangles, as Simbody's elastic foundation has them with all that is its own
 * (contact/contact.h), whole triangles in or out, and for two meshes areas scaled so that both
 * patches have the same. All else is the native engine's: frames, law, friction, Hertz's law,
 * distances, tangents. So the engines check each other. Not continuous in the pose; RT-safe.
 */
#ifndef TESTS_PHYSICS_CONTACT_CENTROIDS_H
#define TESTS_PHYSICS_CONTACT_CENTROIDS_H

#include "contact/native_kernels.h"

extern const struct native_kernels contact_centroids;

#if defined(NATIVE_VARIANTS)

extern const struct native_kernels contact_centroids_avx2, contact_centroids_avx512;

/* Those of each variant that this machine can run, NULL after the last. */
static inline const struct native_kernels *contact_centroids_variant(int i)
{
    const struct native_kernels *all[3] = {&contact_centroids};
    int n = 1;

    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2")) {
        all[n++] = &contact_centroids_avx2;
    }
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
        __builtin_cpu_supports("avx512dq")) {
        all[n++] = &contact_centroids_avx512;
    }
    return i < n ? all[i] : NULL;
}

#else

static inline const struct native_kernels *contact_centroids_variant(int i)
{
    return i == 0 ? &contact_centroids : NULL;
}

#endif

#endif
