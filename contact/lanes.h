/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Eight numbers at a time. They are vectors of the compiler's, which it maps to whatever registers
 * there are; a function marked FOR_EACH_ISA is compiled for several instruction sets, of which the
 * loader takes the widest that the machine has. All do the same operations in the same order (and
 * none may fuse a multiplication with an addition), so results do not depend on it.
 */
#ifndef CONTACT_LANES_H
#define CONTACT_LANES_H

#include <math.h>
#include <stddef.h>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) &&                             \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define FOR_EACH_ISA __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define FOR_EACH_ISA /* the loader would call the choice before a sanitizer is ready */
#endif

#define LANES 8
#define LANES_INLINE static inline __attribute__((always_inline))

typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef long long lanes_mask __attribute__((vector_size(LANES * sizeof(long long))));

/* p is aligned to 64. */
LANES_INLINE lanes lanes_load(const double *p)
{
    return *(const lanes *)p;
}

LANES_INLINE lanes lanes_pick(lanes_mask m, lanes yes, lanes no)
{
    return (lanes)((m & (lanes_mask)yes) | (~m & (lanes_mask)no));
}

LANES_INLINE lanes lanes_root(lanes x)
{
    lanes r;

    for (int i = 0; i < LANES; ++i) {
        r[i] = sqrt(x[i]);
    }
    return r;
}

LANES_INLINE double lanes_sum(lanes x)
{
    return ((x[0] + x[4]) + (x[2] + x[6])) + ((x[1] + x[5]) + (x[3] + x[7]));
}

LANES_INLINE double lanes_least(lanes x)
{
    double least = x[0];

    for (int i = 1; i < LANES; ++i) {
        least = x[i] < least ? x[i] : least;
    }
    return least;
}

#endif
