/* SPDX-License-Identifier: Apache-2.0 */
/* The CRC-32 of zlib, Ethernet and MCAP (polynomial 0x04c11db7, reflected). RT-safe. */
#ifndef BASE_CRC32_H
#define BASE_CRC32_H

#include <stddef.h>
#include <stdint.h>

/* Returns `crc` continued over `size` bytes of data. The initial `crc` is 0. */
uint32_t crc32_update(uint32_t crc, const void *data, size_t size);

#endif
