/* SPDX-License-Identifier: Apache-2.0 */
/* A firmware download, line by line; see the header. */
#include "boards/icub/loader.h"

#include <string.h>

/* Returns the CRC-32 of IEEE 802.3 with more bytes, bit by bit: a line is short. */
static uint32_t crc32_add(uint32_t crc, const uint8_t *data, size_t size)
{
    crc = ~crc;
    for (size_t i = 0; i < size; i++) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = crc >> 1 ^ (crc & 1 ? UINT32_C(0xedb88320) : 0);
        }
    }
    return ~crc;
}

void icub_loader_start(struct icub_loader *loader)
{
    loader->downloading = true;
    loader->line_open = false;
    loader->lines = loader->bytes = loader->crc = 0;
    if (loader->image) {
        memset(loader->image, 0xff, sizeof *loader->image * ICUB_MEMORIES * ICUB_MEMORY_WORDS);
    }
}

void icub_loader_open_line(struct icub_loader *loader, uint8_t length, uint16_t address,
                           uint8_t memory)
{
    loader->line_open = true;
    loader->length = length;
    loader->filled = 0;
    loader->address = address;
    loader->memory = memory;
}

/* Adds a complete line to counts, checksum and image. */
static void icub_loader_keep_line(struct icub_loader *loader)
{
    const uint8_t head[] = {(uint8_t)loader->address, (uint8_t)(loader->address >> 8),
                            loader->memory};
    size_t from = loader->memory ? ICUB_MEMORY_WORDS : 0;

    loader->lines++;
    loader->bytes += loader->length;
    loader->crc = crc32_add(loader->crc, head, sizeof head);
    loader->crc = crc32_add(loader->crc, loader->line, loader->length);
    for (size_t i = 0; loader->image && i + 1 < loader->length; i += 2) {
        uint16_t at = (uint16_t)(loader->address + i / 2);

        loader->image[from + at] = (uint16_t)(loader->line[i] | loader->line[i + 1] << 8);
    }
}

enum icub_line icub_loader_put(struct icub_loader *loader, const uint8_t *data, size_t size)
{
    if (!loader->line_open || size > (size_t)(loader->length - loader->filled)) {
        loader->line_open = false;
        return ICUB_LINE_REFUSED;
    }
    memcpy(loader->line + loader->filled, data, size);
    loader->filled = (uint8_t)(loader->filled + size);
    if (loader->filled < loader->length) {
        return ICUB_LINE_GROWS;
    }
    loader->line_open = false;
    icub_loader_keep_line(loader);
    return ICUB_LINE_COMPLETE;
}
