/* SPDX-License-Identifier: Apache-2.0 */
/* A 64-bit FNV-1a hash, for the contents of robots and for states that must repeat. RT-safe. */
#ifndef BASE_HASH_H
#define BASE_HASH_H

#include <stddef.h>
#include <stdint.h>

#define HASH_START UINT64_C(0xcbf29ce484222325)

/* Continues hash over size bytes of data. Doubles are hashed by their bits. */
uint64_t hash_bytes(uint64_t hash, const void *data, size_t size);

#endif
