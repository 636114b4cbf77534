/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Tables of the native engine's kernels, one for each instruction set that they are compiled for
 * (contact/variant.h), and a way to create an engine on a chosen table. The functions in a table
 * are RT-safe.
 */
#ifndef CONTACT_NATIVE_ISA_TABLE_H
#define CONTACT_NATIVE_ISA_TABLE_H

#include "contact/broad_phase.h"
#include "contact/native/narrow_phase.h"

/* Kernels: the engine's operations, native_overlap, native_law_sum and broad_phase_find. */
struct native_kernels {
    const char *name;
    const struct contact_ops *ops; /* operations of an engine that uses these kernels */
    void (*overlap)(enum native_pair_kind kind, const struct native_overlap *o);
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

/* Creates an engine like contact_native_create, with the given kernels. This machine must support
 * them, and they must outlive the world. NULL: native_kernels_used(). Not RT-safe. */
enum error_code native_create_with_kernels(const struct contact_config *config,
                                           const struct native_kernels *kernels,
                                           struct arena *arena, struct contact_world **world,
                                           struct error *error);

#endif
