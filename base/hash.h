/* SPDX-License-Identifier: Apache-2.0 */
/* A 64-bit FNV-1a hash. It identifies the content of robots, and it compares the states of repeated
 * runs. RT-safe. */
#ifndef BASE_HASH_H
#define BASE_HASH_H

#include <stddef.h>
#include <stdint.h>

#define HASH_START UINT64_C(0xcbf29ce484222325)

/* Returns `hash` continued over `size` bytes of data. Doubles are hashed by their bits. */
uint64_t hash_bytes(uint64_t hash, const void *data, size_t size);

#endif
