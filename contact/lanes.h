/* SPDX-License-Identifier: Apache-2.0 */
/*
 * SIMD for the native engine's kernels: vectors of four numbers, by the compiler's vector
 * extension. The number is four for each instruction set (contact/variant.h), because it decides
 * the order of sums, and results must be equal on all machines. Eight would fill a register of
 * AVX-512, but with AVX2 GCC splits them through memory, which takes twice the time. All is
 * RT-safe.
 */
#ifndef CONTACT_LANES_H
#define CONTACT_LANES_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(__AVX2__)
#include <immintrin.h>
#endif

#define LANES 4
#define LANES_INLINE static inline __attribute__((always_inline))

typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef long long lanes_mask __attribute__((vector_size(LANES * sizeof(long long))));

/* Stores all lanes at p, aligned to the size of lanes. */
LANES_INLINE void lanes_store(lanes x, double *p)
{
    *(lanes *)p = x;
}

/* Loads lanes from p, aligned to the size of lanes. */
LANES_INLINE lanes lanes_load(const double *p)
{
    return *(const lanes *)p;
}

/* Loads lanes from p, aligned to a double. */
LANES_INLINE lanes lanes_load_any(const double *p)
{
    lanes x;

    memcpy(&x, p, sizeof x);
    return x;
}

/* Returns yes where the mask is set, no elsewhere. */
LANES_INLINE lanes lanes_pick(lanes_mask m, lanes yes, lanes no)
{
    return (lanes)((m & (lanes_mask)yes) | (~m & (lanes_mask)no));
}

/* Returns the square root of each lane. */
LANES_INLINE lanes lanes_root(lanes x)
{
#if defined(__AVX2__)
    return (lanes)_mm256_sqrt_pd((__m256d)x);
#else
    lanes r;

    for (int i = 0; i < LANES; i++) {
        r[i] = sqrt(x[i]);
    }
    return r;
#endif
}

/* Returns the sum of all lanes. Adds the two halves first, as folding a register does. */
LANES_INLINE double lanes_sum(lanes x)
{
#if defined(__AVX2__)
    __m128d two = _mm256_castpd256_pd128((__m256d)x) + _mm256_extractf128_pd((__m256d)x, 1);

    return two[0] + two[1];
#else
    return (x[0] + x[2]) + (x[1] + x[3]);
#endif
}

/* Returns a mask that is set where a < b. */
LANES_INLINE lanes_mask lanes_less(lanes a, lanes b)
{
    return a < b;
}

/* Returns the mask as bits, lane 0 the lowest. */
LANES_INLINE uint64_t lanes_bits(lanes_mask m)
{
#if defined(__AVX2__)
    return (uint64_t)_mm256_movemask_pd((__m256d)m);
#else
    return (uint64_t)(m[0] & 1) | (uint64_t)(m[1] & 2) | (uint64_t)(m[2] & 4) |
           (uint64_t)(m[3] & 8);
#endif
}

/* Returns the smallest of all lanes. */
LANES_INLINE double lanes_least(lanes x)
{
    double least = x[0];

    for (int i = 1; i < LANES; i++) {
        least = x[i] < least ? x[i] : least;
    }
    return least;
}

#endif
