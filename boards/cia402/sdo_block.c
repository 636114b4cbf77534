/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Block transfers of the SDO server (CiA 301, 7.2.4.3.8 to 7.2.4.3.17): up to 127 segments of 7
 * bytes follow each other and are acknowledged together; lost ones are sent again from the first
 * gap on. A checksum over all data ends the transfer where both sides want one.
 *
 * An upload sends a segment a millisecond, so that a drive keeps its bus for process data. A
 * transfer whose client is silent for a second is aborted, for until then every frame of the client
 * in a block download counts as a segment.
 */
#include "boards/cia402/private.h"

#include "canbus/frame.h"

#include <string.h>

enum {
    SEGMENT_MAX = 7,
    BLOCK_MAX = 127,       /* segments */
    SEQUENCE_MASK = 0x7f,  /* of byte 0 of a segment */
    LAST_SEGMENT = 0x80,   /* bit of it */
    CRC_SUPPORTED = 0x04,  /* byte 0 of initiations */
    SIZE_INDICATED = 0x02, /* byte 0 of initiations */
    SUB_COMMAND_MASK = 0x03,
    CRC_POLYNOMIAL = 0x1021, /* x^16 + x^12 + x^5 + 1, from 0, highest bit first */
    CRC_TOP = 0x8000,
};

/* Sub-commands of byte 0, from either side */
enum { INITIATE = 0, END = 1, ACKNOWLEDGE = 2, START = 3 };

#define TIMEOUT_NS (INT64_C(1000) * MS)

/* Returns the CRC of CiA 301, 7.2.4.3.16: "123456789" has 0x31c3. */
static uint16_t cia402_block_crc(const uint8_t *data, uint32_t size)
{
    unsigned crc = 0;

    for (uint32_t i = 0; i < size; i++) {
        crc ^= (unsigned)data[i] << 8;
        for (int bit = 0; bit < 8; bit++) {
            crc = crc & CRC_TOP ? crc << 1 ^ CRC_POLYNOMIAL : crc << 1;
        }
    }
    return (uint16_t)crc;
}

/* Returns whether a number of segments of a block is allowed. */
static bool cia402_block_size_is_right(unsigned segments)
{
    return segments >= 1 && segments <= BLOCK_MAX;
}

/* Restarts the time-out of a transfer. */
static void cia402_block_refresh(struct cia402_node *node)
{
    node->transfer.heard_ns = node->board.boards->now_ns;
}

/* Returns the number of bytes of the last segment that carry no data. */
static unsigned cia402_block_unused(uint32_t size)
{
    return size == 0 ? SEGMENT_MAX : (SEGMENT_MAX - size % SEGMENT_MAX) % SEGMENT_MAX;
}

/* ---- downloads: the host writes ---- */

/* Begins a block download. */
static enum cia402_abort cia402_block_download(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    uint8_t data[CIA402_SDO_LENGTH] = {CIA402_BLOCK_DOWNLOAD_REPLY | CRC_SUPPORTED | INITIATE,
                                       request[1], request[2], request[3], BLOCK_MAX};
    bool sized = request[0] & SIZE_INDICATED;
    enum cia402_abort reason = CIA402_DONE;

    if (!cia402_sdo_is_writable(&transfer->entry)) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_READ_ONLY);
    }
    transfer->size = sized ? get_u32_le(request + 4) : CIA402_SIZE_UNKNOWN;
    reason = sized ? cia402_sdo_check_size(&transfer->entry, transfer->size) : CIA402_DONE;
    if (reason) {
        return cia402_sdo_abort_transfer(node, reason);
    }
    transfer->kind = CIA402_BLOCK_DOWNLOADS;
    transfer->checked = request[0] & CRC_SUPPORTED;
    transfer->block = BLOCK_MAX;
    cia402_block_refresh(node);
    cia402_sdo_answer(node, data);
    return CIA402_DONE;
}

/* Takes a segment of a download, and acknowledges a block at its end. */
static enum cia402_abort cia402_block_take_segment(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    unsigned sequence = request[0] & SEQUENCE_MASK;
    bool last = request[0] & LAST_SEGMENT, whole = false;
    uint8_t data[CIA402_SDO_LENGTH] = {CIA402_BLOCK_DOWNLOAD_REPLY | ACKNOWLEDGE};

    if (sequence == 0) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_SEQUENCE);
    }
    cia402_block_refresh(node);

    /* After a gap the rest of the block is thrown away and comes again */
    if (sequence == transfer->sequence + 1u) {
        if (transfer->done + SEGMENT_MAX > sizeof transfer->data) {
            return cia402_sdo_abort_transfer(node, CIA402_ABORT_TOO_LONG);
        }
        memcpy(transfer->data + transfer->done, request + 1, SEGMENT_MAX);
        transfer->done += SEGMENT_MAX;
        transfer->sequence++;
        whole = last;
    }
    if (!last && sequence < transfer->block) {
        return CIA402_DONE;
    }
    data[1] = transfer->sequence;
    data[2] = transfer->block;
    transfer->sequence = 0;
    transfer->kind = whole ? CIA402_BLOCK_DOWNLOAD_ENDS : CIA402_BLOCK_DOWNLOADS;
    cia402_sdo_answer(node, data);
    return CIA402_DONE;
}

/* Ends a download: checks size and checksum and stores the data. */
static enum cia402_abort cia402_block_end_download(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    uint8_t data[CIA402_SDO_LENGTH] = {CIA402_BLOCK_DOWNLOAD_REPLY | END};
    enum cia402_abort reason = CIA402_DONE;

    if ((request[0] & (CIA402_COMMAND_MASK | SUB_COMMAND_MASK)) != (CIA402_BLOCK_DOWNLOAD | END)) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_COMMAND);
    }
    transfer->done -= request[0] >> 2 & 7u; /* the last segment counted as seven */
    if (transfer->size != CIA402_SIZE_UNKNOWN && transfer->size != transfer->done) {
        reason = CIA402_ABORT_LENGTH;
    } else if (transfer->checked &&
               get_u16_le(request + 1) != cia402_block_crc(transfer->data, transfer->done)) {
        reason = CIA402_ABORT_CRC;
    } else {
        reason = cia402_sdo_store(node, &transfer->entry, transfer->data, transfer->done);
    }
    if (reason) {
        return cia402_sdo_abort_transfer(node, reason);
    }
    transfer->kind = CIA402_NO_TRANSFER;
    cia402_sdo_answer(node, data);
    return CIA402_DONE;
}

/* ---- uploads: the host reads ---- */

/* Begins a block upload; data within the client's threshold go without blocks. */
static enum cia402_abort cia402_block_upload(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    uint8_t data[CIA402_SDO_LENGTH] = {CIA402_BLOCK_UPLOAD_REPLY | CRC_SUPPORTED | SIZE_INDICATED |
                                           INITIATE,
                                       request[1], request[2], request[3]};
    enum cia402_abort reason = cia402_sdo_load(node);

    if (!reason && !cia402_block_size_is_right(request[4])) {
        reason = CIA402_ABORT_BLOCK_SIZE;
    }
    if (reason) {
        return cia402_sdo_abort_transfer(node, reason);
    }
    if (request[5] > 0 && transfer->size <= request[5]) {
        return cia402_sdo_upload_loaded(node, request);
    }
    transfer->kind = CIA402_BLOCK_UPLOAD_STARTS;
    transfer->checked = request[0] & CRC_SUPPORTED;
    transfer->block = request[4];
    cia402_block_refresh(node);
    put_u32_le(data + 4, transfer->size);
    cia402_sdo_answer(node, data);
    return CIA402_DONE;
}

/* Sends the next segment of an upload. */
static void cia402_block_send_segment(struct cia402_node *node)
{
    struct cia402_transfer *transfer = &node->transfer;
    uint32_t from = transfer->done + (uint32_t)transfer->sequence * SEGMENT_MAX;
    uint32_t size = transfer->size - from;
    uint8_t data[CIA402_SDO_LENGTH] = {++transfer->sequence};
    bool last = size <= SEGMENT_MAX;

    size = last ? size : SEGMENT_MAX;
    memcpy(data + 1, transfer->data + from, size);
    if (last) {
        data[0] |= LAST_SEGMENT;
    }
    if (last || transfer->sequence == transfer->block) {
        transfer->kind = CIA402_BLOCK_UPLOAD_WAITS;
        cia402_block_refresh(node);
    }
    cia402_sdo_answer(node, data);
}

/* Obeys an acknowledgment of the client: sends on, or ends the upload. */
static enum cia402_abort cia402_block_acknowledge(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    uint8_t data[CIA402_SDO_LENGTH] = {CIA402_BLOCK_UPLOAD_REPLY | END};
    uint32_t taken = (uint32_t)request[1] * SEGMENT_MAX, left = transfer->size - transfer->done;

    if (transfer->kind != CIA402_BLOCK_UPLOAD_WAITS) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_COMMAND);
    }
    if (request[1] > transfer->sequence) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_SEQUENCE);
    }
    if (!cia402_block_size_is_right(request[2])) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_BLOCK_SIZE);
    }
    cia402_block_refresh(node);

    /* Data that have not been taken follow; an upload without data still has an empty segment */
    if (taken < left || request[1] == 0) {
        transfer->done += taken;
        transfer->sequence = 0;
        transfer->block = request[2];
        transfer->kind = CIA402_BLOCK_UPLOADS;
        return CIA402_DONE;
    }
    data[0] |= (uint8_t)(cia402_block_unused(transfer->size) << 2);
    if (transfer->checked) {
        put_u16_le(data + 1, cia402_block_crc(transfer->data, transfer->size));
    }
    transfer->kind = CIA402_BLOCK_UPLOAD_ENDS;
    cia402_sdo_answer(node, data);
    return CIA402_DONE;
}

enum cia402_abort cia402_block_receive_upload(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    enum cia402_abort reason;

    /* Each sub-command has its state of the transfer */
    switch (request[0] & SUB_COMMAND_MASK) {
    case INITIATE:
        reason = cia402_sdo_find(node, request);
        return reason ? cia402_sdo_abort_transfer(node, reason)
                      : cia402_block_upload(node, request);
    case START:
        if (transfer->kind != CIA402_BLOCK_UPLOAD_STARTS) {
            break;
        }
        transfer->kind = CIA402_BLOCK_UPLOADS;
        return CIA402_DONE;
    case ACKNOWLEDGE:
        return cia402_block_acknowledge(node, request);
    default:
        if (transfer->kind != CIA402_BLOCK_UPLOAD_ENDS) {
            break;
        }
        transfer->kind = CIA402_NO_TRANSFER;
        return CIA402_DONE;
    }
    return cia402_sdo_abort_transfer(node, CIA402_ABORT_COMMAND);
}

/* ---- both ---- */

bool cia402_block_takes_all(const struct cia402_node *node)
{
    return node->transfer.kind == CIA402_BLOCK_DOWNLOADS ||
           node->transfer.kind == CIA402_BLOCK_DOWNLOAD_ENDS;
}

enum cia402_abort cia402_block_receive_download(struct cia402_node *node, const uint8_t *request)
{
    enum cia402_abort reason;

    if (node->transfer.kind == CIA402_BLOCK_DOWNLOADS) {
        return cia402_block_take_segment(node, request);
    }
    if (node->transfer.kind == CIA402_BLOCK_DOWNLOAD_ENDS) {
        return cia402_block_end_download(node, request);
    }
    if ((request[0] & 1) != INITIATE) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_COMMAND);
    }
    reason = cia402_sdo_find(node, request);
    return reason ? cia402_sdo_abort_transfer(node, reason) : cia402_block_download(node, request);
}

void cia402_block_step(struct cia402_node *node, struct ms_span span)
{
    struct cia402_transfer *transfer = &node->transfer;

    if (transfer->kind < CIA402_BLOCK_DOWNLOADS || node->state == CIA402_STOPPED) {
        return;
    }
    for (int64_t ms = span.from; ms < span.to && transfer->kind == CIA402_BLOCK_UPLOADS; ms++) {
        cia402_block_send_segment(node);
    }
    if (transfer->kind != CIA402_BLOCK_UPLOADS &&
        node->board.boards->now_ns - transfer->heard_ns > TIMEOUT_NS) {
        cia402_sdo_abort_transfer(node, CIA402_ABORT_TIME_OUT);
    }
}
