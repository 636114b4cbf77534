/* SPDX-License-Identifier: Apache-2.0 */
/* Comparison of doubles for cmocka 1.1, which only compares floats. */
#ifndef TESTS_PHYSICS_NEAR_H
#define TESTS_PHYSICS_NEAR_H

#include "tests/test.h"

/* Fails unless |actual - expected| <= tolerance; a NaN fails. */
#define assert_near(actual, expected, tolerance)                                                   \
    do {                                                                                           \
        const double near_actual = (actual), near_expected = (expected);                           \
                                                                                                   \
        if (!(fabs(near_actual - near_expected) <= (tolerance))) {                                 \
            fail_msg("%s = %.17g, expected %.17g within %.3g", #actual, near_actual,               \
                     near_expected, (double)(tolerance));                                          \
        }                                                                                          \
    } while (0)

#endif
