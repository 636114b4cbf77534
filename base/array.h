/* SPDX-License-Identifier: Apache-2.0 */
/* Macros for the size of an array, and for the structure that contains a member. They are constant
 * or pure expressions. RT-safe. */
#ifndef BASE_ARRAY_H
#define BASE_ARRAY_H

#include <stddef.h>
#include <stdint.h>

/* Gives the number of elements. The argument must be an array, not a pointer to its first
 * element. */
#define ARRAY_COUNT(array) (sizeof(array) / sizeof(array)[0])

/* Returns the structure that contains an embedded member, like container_of in the Linux kernel. It
 * drops const, as strchr does. A caller with a pointer to const must not write to the result. */
#define container_of(pointer, type, member) ((type *)((uintptr_t)(pointer)-offsetof(type, member)))

#endif
