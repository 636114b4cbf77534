/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The table of what the native engine calls in its kernels, one for each instruction set that they
 * are compiled for (contact/variant.h), and an engine on a table of one's choice. What is in
 * a table is RT-safe.
 */
#ifndef CONTACT_NATIVE_KERNELS_H
#define CONTACT_NATIVE_KERNELS_H

#include "contact/broad_phase.h"
#include "contact/native/pairs.h"

/* Kernels: the engine's operations, functions of contact/native/pairs.h, native_law_sum (sum) and
 * broad_phase_find (find_near). */
struct native_kernels {
    const char *name;
    const struct contact_ops *ops; /* of an engine on them */
    void (*half_space)(const struct solid *solid, const struct native_law *law,
                       const struct native_relative *relative, struct native_scratch *scratch,
                       struct native_sum *sum);
    void (*sphere)(const struct solid *solid, double radius, const struct native_law *law,
                   const struct native_relative *relative, struct native_scratch *scratch,
                   struct native_sum *sum);
    void (*meshes)(const struct solid *first, const struct solid *second,
                   const struct native_law *law, const struct native_relative *relative,
                   struct native_scratch *scratch, struct native_sum *sum);
    void (*fields)(const struct field *first, const struct solid *second,
                   const struct field *second_field, const struct native_law *law,
                   const struct native_relative *relative, struct native_scratch *scratch,
                   struct native_sum *sum);
    void (*hertz)(const double radius[2], const struct native_law *law,
                  const struct native_relative *relative, struct native_scratch *scratch,
                  struct native_sum *sum);
    void (*capsule_half_space)(const struct native_capsule *capsule, const struct native_law *law,
                               const struct native_relative *relative,
                               struct native_scratch *scratch, struct native_sum *sum);
    void (*capsules)(const struct native_capsule *first, const struct native_capsule *second,
                     const struct native_law *law, const struct native_relative *relative,
                     struct native_scratch *scratch, struct native_sum *sum);
    void (*sum)(struct native_batch *batch, const struct native_law *law,
                const struct native_relative *relative, struct native_sum *sum);
    void (*find_near)(struct broad_phase *broad, uint64_t *near);
};

extern const struct native_kernels native_kernels;
#if defined(NATIVE_VARIANTS)
extern const struct native_kernels native_kernels_avx2, native_kernels_avx512;
#endif

/* Returns the kernels for instruction_set_used(). All give the same bits. RT-safe. */
const struct native_kernels *native_kernels_used(void);

/* Does what contact_native_create does, with these kernels, which this machine has to be able to
 * run and which outlive the world; NULL: native_kernels_used(). Not RT-safe. */
enum error_code native_create_with_kernels(const struct contact_config *config,
                                           const struct native_kernels *kernels,
                                           struct arena *arena, struct contact_world **world,
                                           struct error *error);

#endif
