/* SPDX-License-Identifier: Apache-2.0 */
/* Sizes of arrays and members of structs: constant or pure expressions. RT-safe. */
#ifndef BASE_ARRAY_H
#define BASE_ARRAY_H

#include <stddef.h>
#include <stdint.h>

/* The number of elements. The argument must be an array, not a pointer to its first element. */
#define ARRAY_COUNT(array) (sizeof(array) / sizeof(array)[0])

/* From an embedded structure to the one that it is a member of, as the Linux kernel's macro of this
 * name. As with strchr the const of the pointer is not passed on: a caller with a pointer to const
 * must treat the result as const. */
#define container_of(pointer, type, member) ((type *)((uintptr_t)(pointer)-offsetof(type, member)))

#endif
