/* SPDX-License-Identifier: Apache-2.0 */
/*
 * From an embedded structure to the one that it is a member of, as the Linux kernel's macro of this
 * name. A pure expression; RT-safe. As with strchr the const of the pointer is not passed on: who
 * was given a pointer to const must treat the result so.
 */
#ifndef BASE_CONTAINER_OF_H
#define BASE_CONTAINER_OF_H

#include <stddef.h>
#include <stdint.h>

#define container_of(pointer, type, member) ((type *)((uintptr_t)(pointer)-offsetof(type, member)))

#endif
