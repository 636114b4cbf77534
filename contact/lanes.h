/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Four numbers at a time. They are vectors of the compiler's, which it maps to whatever registers
 * there are; a function marked FOR_EACH_ISA is compiled for several instruction sets, of which the
 * loader takes the widest that the machine has. All do the same operations in the same order (and
 * none may fuse a multiplication with an addition), so results do not depend on it.
 *
 * Not eight: what is wider than the machine's registers GCC takes apart by way of memory, at twice
 * the time on AVX2, and with AVX-512 the engine gained nothing from it.
 */
#ifndef CONTACT_LANES_H
#define CONTACT_LANES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) &&                             \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define FOR_EACH_ISA __attribute__((target_clones("avx2", "default")))
#else
#define FOR_EACH_ISA /* the loader would call the choice before a sanitizer is ready */
#endif

#define LANES 4
#define LANES_INLINE static inline __attribute__((always_inline))

typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef long long lanes_mask __attribute__((vector_size(LANES * sizeof(long long))));

/* p is aligned to the size of lanes. */
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
    return (x[0] + x[2]) + (x[1] + x[3]);
}

LANES_INLINE lanes_mask lanes_less(lanes a, lanes b)
{
    return a < b;
}

/* One bit a lane, lane 0 the lowest. */
LANES_INLINE uint64_t lanes_bits(lanes_mask m)
{
    return (uint64_t)(m[0] & 1) | (uint64_t)(m[1] & 2) | (uint64_t)(m[2] & 4) |
           (uint64_t)(m[3] & 8);
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
