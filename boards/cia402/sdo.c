/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The SDO server (CiA 301, 7.2.4): expedited and segmented transfers in both directions, one at a
 * time; a new one ends the one before. Block transfers are those of sdo_block.c.
 */
#include "boards/cia402/private.h"

#include "canbus/frame.h"

#include <string.h>

enum { EXPEDITED_MAX = 4, SEGMENT_MAX = 7 };

void cia402_sdo_answer(struct cia402_node *node, const uint8_t *data)
{
    board_queue(&node->board, (uint32_t)node->sdo_reply, CIA402_SDO_LENGTH, data);
}

/* Ends a transfer with a reason, which it returns. */
static enum cia402_abort cia402_sdo_abort(struct cia402_node *node, unsigned index, unsigned sub,
                                          enum cia402_abort reason)
{
    uint8_t data[CIA402_SDO_LENGTH] = {CIA402_ABORT};

    node->transfer.kind = CIA402_NO_TRANSFER;
    put_u16_le(data + 1, (uint16_t)index);
    data[3] = (uint8_t)sub;
    put_u32_le(data + 4, reason);
    cia402_sdo_answer(node, data);
    return reason;
}

enum cia402_abort cia402_sdo_abort_transfer(struct cia402_node *node, enum cia402_abort reason)
{
    return cia402_sdo_abort(node, node->transfer.index, node->transfer.sub, reason);
}

/* Answers an initiation with the request's index and sub-index. */
static void cia402_sdo_confirm(struct cia402_node *node, const uint8_t *request, unsigned command,
                               const uint8_t *value, size_t size)
{
    uint8_t data[CIA402_SDO_LENGTH] = {(uint8_t)command, request[1], request[2], request[3]};

    memcpy(data + 4, value, size);
    cia402_sdo_answer(node, data);
}

/* ---- uploads: the host reads ---- */

enum cia402_abort cia402_sdo_load(struct cia402_node *node)
{
    struct cia402_transfer *transfer = &node->transfer;
    const struct cia402_entry *entry = &transfer->entry;

    /* Empty places of the history have no data */
    if (entry->object && entry->object->index == 0x1003 && transfer->sub > node->history_count) {
        return CIA402_ABORT_NO_DATA;
    }
    /* Copies a text, a domain or a number */
    if (entry->type == CIA402_TEXT) {
        const char *text = cia402_text(node, entry);

        transfer->size = (uint32_t)strlen(text);
        memcpy(transfer->data, text, transfer->size);
    } else if (entry->type == CIA402_DOMAIN) {
        const struct cia402_domain *domain = cia402_domain(node, entry);

        transfer->size = domain->size;
        memcpy(transfer->data, domain->data, transfer->size);
    } else {
        transfer->size = cia402_type_bits(entry->type) / 8;
        cia402_put(entry->type, cia402_value(node, entry), transfer->data);
    }
    return CIA402_DONE;
}

enum cia402_abort cia402_sdo_upload_loaded(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    uint8_t size[4];

    /* At once, where it fits */
    if (transfer->size > 0 && transfer->size <= EXPEDITED_MAX) {
        unsigned unused = EXPEDITED_MAX - transfer->size;

        transfer->kind = CIA402_NO_TRANSFER;
        cia402_sdo_confirm(node, request,
                           CIA402_UPLOAD_REPLY | unused << 2 | CIA402_EXPEDITED | CIA402_SIZED,
                           transfer->data, transfer->size);
        return CIA402_DONE;
    }
    transfer->kind = CIA402_UPLOADS;
    put_u32_le(size, transfer->size);
    cia402_sdo_confirm(node, request, CIA402_UPLOAD_REPLY | CIA402_SIZED, size, sizeof size);
    return CIA402_DONE;
}

/* Begins an upload. */
static enum cia402_abort cia402_sdo_upload(struct cia402_node *node, const uint8_t *request)
{
    enum cia402_abort reason = cia402_sdo_load(node);

    return reason ? cia402_sdo_abort_transfer(node, reason)
                  : cia402_sdo_upload_loaded(node, request);
}

/* Answers with the next segment of an upload. */
static enum cia402_abort cia402_sdo_upload_segment(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    uint32_t size = transfer->size - transfer->done;
    uint8_t data[CIA402_SDO_LENGTH] = {CIA402_UPLOAD_SEGMENT_REPLY};

    size = size < SEGMENT_MAX ? size : SEGMENT_MAX;
    memcpy(data + 1, transfer->data + transfer->done, size);
    transfer->done += size;
    data[0] |= (uint8_t)((request[0] & CIA402_TOGGLE) | (SEGMENT_MAX - size) << 1);
    if (transfer->done == transfer->size) {
        data[0] |= CIA402_LAST;
        transfer->kind = CIA402_NO_TRANSFER;
    }
    cia402_sdo_answer(node, data);
    return CIA402_DONE;
}

/* ---- downloads: the host writes ---- */

bool cia402_sdo_is_writable(const struct cia402_entry *entry)
{
    return entry->object && (entry->object->access & CIA402_ACCESS_MASK) >= CIA402_RW;
}

enum cia402_abort cia402_sdo_check_size(const struct cia402_entry *entry, uint32_t size)
{
    uint32_t right = cia402_type_bits(entry->type) / 8;

    if (entry->type == CIA402_TEXT) {
        return size > CIA402_TEXT_MAX ? CIA402_ABORT_TOO_LONG : CIA402_DONE;
    }
    if (entry->type == CIA402_DOMAIN) {
        return size > CIA402_DOMAIN_MAX ? CIA402_ABORT_TOO_LONG : CIA402_DONE;
    }
    return size > right   ? CIA402_ABORT_TOO_LONG
           : size < right ? CIA402_ABORT_TOO_SHORT
                          : CIA402_DONE;
}

enum cia402_abort cia402_sdo_store(struct cia402_node *node, const struct cia402_entry *entry,
                                   const uint8_t *data, uint32_t size)
{
    enum cia402_abort reason = cia402_sdo_check_size(entry, size);

    if (reason) {
        return reason;
    }
    /* Writes a text, a domain or a number */
    if (entry->type == CIA402_TEXT) {
        char *text = cia402_text(node, entry);

        memset(text, 0, CIA402_TEXT_MAX + 1);
        memcpy(text, data, size);
        return CIA402_DONE;
    }
    if (entry->type == CIA402_DOMAIN) {
        struct cia402_domain *domain = cia402_domain(node, entry);

        memset(domain, 0, sizeof *domain);
        domain->size = size;
        memcpy(domain->data, data, size);
        return CIA402_DONE;
    }
    return cia402_write(node, entry, cia402_get(entry->type, data));
}

/* Begins a download, or stores the data where the request carries them. */
static enum cia402_abort cia402_sdo_download(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    enum cia402_abort reason = CIA402_DONE;
    bool sized = request[0] & CIA402_SIZED;

    if (!cia402_sdo_is_writable(&transfer->entry)) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_READ_ONLY);
    }

    /* At once; without a size it is as long as the object */
    if (request[0] & CIA402_EXPEDITED) {
        uint32_t right = cia402_type_bits(transfer->entry.type) / 8;
        uint32_t size = sized   ? EXPEDITED_MAX - (request[0] >> 2 & 3u)
                        : right ? right
                                : EXPEDITED_MAX;

        reason = cia402_sdo_store(node, &transfer->entry, request + 4, size);
        transfer->kind = CIA402_NO_TRANSFER;
    } else {
        transfer->kind = CIA402_DOWNLOADS;
        transfer->size = sized ? get_u32_le(request + 4) : CIA402_SIZE_UNKNOWN;
        reason = sized ? cia402_sdo_check_size(&transfer->entry, transfer->size) : CIA402_DONE;
    }
    if (reason) {
        return cia402_sdo_abort_transfer(node, reason);
    }
    cia402_sdo_confirm(node, request, CIA402_DOWNLOAD_REPLY, request + 4, 0);
    return CIA402_DONE;
}

/* Takes a segment of a download; the last one stores the data. */
static enum cia402_abort cia402_sdo_download_segment(struct cia402_node *node,
                                                     const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    uint32_t size = SEGMENT_MAX - (request[0] >> 1 & 7u);
    uint8_t data[CIA402_SDO_LENGTH] = {CIA402_DOWNLOAD_SEGMENT_REPLY};

    if (transfer->done + size > sizeof transfer->data) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_TOO_LONG);
    }
    memcpy(transfer->data + transfer->done, request + 1, size);
    transfer->done += size;
    if (request[0] & CIA402_LAST) {
        bool whole = transfer->size == CIA402_SIZE_UNKNOWN || transfer->size == transfer->done;
        enum cia402_abort reason =
            whole ? cia402_sdo_store(node, &transfer->entry, transfer->data, transfer->done)
                  : CIA402_ABORT_LENGTH;

        if (reason) {
            return cia402_sdo_abort_transfer(node, reason);
        }
        transfer->kind = CIA402_NO_TRANSFER;
    }
    data[0] |= request[0] & CIA402_TOGGLE;
    cia402_sdo_answer(node, data);
    return CIA402_DONE;
}

/* ---- requests ---- */

enum cia402_abort cia402_sdo_find(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;

    memset(transfer, 0, sizeof *transfer);
    transfer->index = get_u16_le(request + 1);
    transfer->sub = request[3];
    return cia402_find(node, transfer->index, transfer->sub, &transfer->entry);
}

/* Finds the object of a request and begins a transfer. */
static enum cia402_abort cia402_sdo_initiate(struct cia402_node *node, const uint8_t *request,
                                             bool upload)
{
    enum cia402_abort reason = cia402_sdo_find(node, request);

    if (reason) {
        return cia402_sdo_abort_transfer(node, reason);
    }
    return upload ? cia402_sdo_upload(node, request) : cia402_sdo_download(node, request);
}

/* Checks the toggle bit of a segment, which alternates from 0 on, and passes it on. */
static enum cia402_abort cia402_sdo_segment(struct cia402_node *node, const uint8_t *request,
                                            bool upload)
{
    struct cia402_transfer *transfer = &node->transfer;

    if (transfer->kind != (upload ? CIA402_UPLOADS : CIA402_DOWNLOADS)) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_COMMAND);
    }
    if (transfer->toggle != (bool)(request[0] & CIA402_TOGGLE)) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_TOGGLE);
    }
    transfer->toggle = !transfer->toggle;
    return upload ? cia402_sdo_upload_segment(node, request)
                  : cia402_sdo_download_segment(node, request);
}

enum cia402_abort cia402_sdo_receive(struct cia402_node *node, const uint8_t *data)
{
    /* Byte 0 of a segment of a block may be anything but this, which would be its number 0 */
    if (data[0] != CIA402_ABORT && cia402_block_takes_all(node)) {
        return cia402_block_receive_download(node, data);
    }
    switch (data[0] & CIA402_COMMAND_MASK) {
    case CIA402_DOWNLOAD:
        return cia402_sdo_initiate(node, data, false);
    case CIA402_UPLOAD:
        return cia402_sdo_initiate(node, data, true);
    case CIA402_DOWNLOAD_SEGMENT:
        return cia402_sdo_segment(node, data, false);
    case CIA402_UPLOAD_SEGMENT:
        return cia402_sdo_segment(node, data, true);
    case CIA402_BLOCK_DOWNLOAD:
        return cia402_block_receive_download(node, data);
    case CIA402_BLOCK_UPLOAD:
        return cia402_block_receive_upload(node, data);
    case CIA402_ABORT:
        node->transfer.kind = CIA402_NO_TRANSFER;
        return CIA402_DONE;
    default:
        return cia402_sdo_abort(node, get_u16_le(data + 1), data[3], CIA402_ABORT_COMMAND);
    }
}
