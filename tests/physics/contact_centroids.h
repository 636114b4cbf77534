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

#include "tests/physics/contact_variants.h"

extern const struct native_kernels contact_centroids;

#if defined(NATIVE_VARIANTS)
extern const struct native_kernels contact_centroids_avx2, contact_centroids_avx512;
#endif

/* Those of a variant by its number (contact_variant_at), NULL when this machine does not run it. */
static inline const struct native_kernels *contact_centroids_at(size_t n)
{
#if defined(NATIVE_VARIANTS)
    const struct native_kernels *const all[CONTACT_VARIANTS] = {
        &contact_centroids, &contact_centroids_avx2, &contact_centroids_avx512};
#else
    const struct native_kernels *const all[CONTACT_VARIANTS] = {&contact_centroids};
#endif

    return contact_variant_at(n).runs ? all[n] : NULL;
}

#endif
