/* SPDX-License-Identifier: Apache-2.0 */
/* Pseudo-random numbers of the contact tests (xorshift64*): the same on every machine. */
#ifndef TESTS_UNIT_CONTACT_RANDOM_NUMBER_H
#define TESTS_UNIT_CONTACT_RANDOM_NUMBER_H

#include <stdint.h>

/* -1 to 1; the seed is not zero. */
static inline double random_number(uint64_t *seed)
{
    *seed ^= *seed >> 12;
    *seed ^= *seed << 25;
    *seed ^= *seed >> 27;
    return (double)((*seed * 2685821657736338717u) >> 11) / 4503599627370496.0 - 1;
}

#endif
