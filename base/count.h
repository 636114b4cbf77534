/* SPDX-License-Identifier: Apache-2.0 */
/* The number of elements of an array. A constant expression. RT-safe. */
#ifndef BASE_COUNT_H
#define BASE_COUNT_H

/* The argument must be an array, not a pointer to its first element. */
#define ARRAY_COUNT(array) (sizeof(array) / sizeof(array)[0])

#endif
