/* SPDX-License-Identifier: Apache-2.0 */
/* Macros for the size of an array and the structure around a member: constant or pure expressions.
 * RT-safe. */
#ifndef BASE_ARRAY_H
#define BASE_ARRAY_H

#include <stddef.h>
#include <stdint.h>

/* The number of elements. The argument must be an array, not a pointer to its first element. */
#define ARRAY_COUNT(array) (sizeof(array) / sizeof(array)[0])

/* Returns the structure that contains an embedded member, as the Linux kernel's macro of this name.
 * Like strchr it drops const: a caller with a pointer to const must treat the result as const. */
#define container_of(pointer, type, member) ((type *)((uintptr_t)(pointer)-offsetof(type, member)))

#endif
