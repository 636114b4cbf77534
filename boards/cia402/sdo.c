/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The SDO server (CiA 301, 7.2.4): expedited, segmented and block transfers in both directions. A
 * node has one transfer at a time; a new transfer ends the previous one.
 */
#include "boards/cia402/private.h"

enum { EXPEDITED_MAX = 4, SEGMENT_MAX = 7 };

/*
 * Block transfers of the SDO server (CiA 301, 7.2.4.3.8 to 7.2.4.3.17).
 *
 * A block has up to 127 segments of 7 bytes and one acknowledgment. After a loss, the sender
 * repeats all segments from the first gap on. If both sides support it, a checksum over all data
 * ends the transfer. An upload sends one segment per millisecond, to leave the bus to process data.
 *
 * The server aborts a block transfer when the client is silent for a second. Without this time-out,
 * an unfinished block download would take every later frame of the client as a segment.
 */

enum {
    BLOCK_MAX = 127,       /* most segments per block */
    SEQUENCE_MASK = 0x7f,  /* in byte 0 of a segment */
    LAST_SEGMENT = 0x80,   /* in byte 0 of a segment */
    CRC_SUPPORTED = 0x04,  /* byte 0 of initiations */
    SIZE_INDICATED = 0x02, /* byte 0 of initiations */
    SUB_COMMAND_MASK = 0x03,
    CRC_POLYNOMIAL = 0x1021, /* x^16 + x^12 + x^5 + 1; initial value 0; highest bit first */
    CRC_TOP = 0x8000,
};

/* Sub-commands in byte 0, from either side */
enum { INITIATE = 0, END = 1, ACKNOWLEDGE = 2, START = 3 };

#define TIMEOUT_NS (INT64_C(1000) * MS)

static void cia402_sdo_answer(struct cia402_node *node, const uint8_t *data)
{
    board_queue(&node->board, (uint32_t)node->sdo_reply, CIA402_SDO_LENGTH, data);
}

/* Sends an abort message and returns its reason. */
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

static enum cia402_abort cia402_sdo_abort_transfer(struct cia402_node *node,
                                                   enum cia402_abort reason)
{
    return cia402_sdo_abort(node, node->transfer.index, node->transfer.sub, reason);
}

/* Answers a request that starts a transfer, with its index and sub-index. */
static void cia402_sdo_confirm(struct cia402_node *node, const uint8_t *request, unsigned command,
                               const uint8_t *value, size_t size)
{
    uint8_t data[CIA402_SDO_LENGTH] = {(uint8_t)command, request[1], request[2], request[3]};

    memcpy(data + 4, value, size);
    cia402_sdo_answer(node, data);
}

/* ---- uploads: the host reads ---- */

static enum cia402_abort cia402_sdo_load(struct cia402_node *node)
{
    struct cia402_transfer *transfer = &node->transfer;
    const struct cia402_entry *entry = &transfer->entry;

    /* Empty entries of the history have no data */
    if (entry->object && entry->object->index == 0x1003 && transfer->sub > node->history_count) {
        return CIA402_ABORT_NO_DATA;
    }
    /* Copies a text, a domain or a number */
    if (entry->type == CIA402_TEXT) {
        const char *text = cia402_place(node, entry);

        transfer->size = (uint32_t)strlen(text);
        memcpy(transfer->data, text, transfer->size);
    } else if (entry->type == CIA402_DOMAIN) {
        const struct cia402_domain *domain = cia402_place(node, entry);

        transfer->size = domain->size;
        memcpy(transfer->data, domain->data, transfer->size);
    } else {
        transfer->size = cia402_type_bits(entry->type) / 8;
        cia402_put(entry->type, cia402_value(node, entry), transfer->data);
    }
    return CIA402_DONE;
}

static enum cia402_abort cia402_sdo_upload_loaded(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    uint8_t size[4];

    /* Send the data in the answer if they fit into 4 bytes */
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

static enum cia402_abort cia402_sdo_check_size(const struct cia402_entry *entry, uint32_t size)
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

static enum cia402_abort cia402_sdo_store(struct cia402_node *node,
                                          const struct cia402_entry *entry, const uint8_t *data,
                                          uint32_t size)
{
    enum cia402_abort reason = cia402_sdo_check_size(entry, size);

    if (reason) {
        return reason;
    }
    /* Writes a text, a domain or a number */
    if (entry->type == CIA402_TEXT) {
        char *text = cia402_place(node, entry);

        memset(text, 0, CIA402_TEXT_MAX + 1);
        memcpy(text, data, size);
        return CIA402_DONE;
    }
    if (entry->type == CIA402_DOMAIN) {
        struct cia402_domain *domain = cia402_place(node, entry);

        memset(domain, 0, sizeof *domain);
        domain->size = size;
        memcpy(domain->data, data, size);
        return CIA402_DONE;
    }
    return cia402_write(node, entry, cia402_get(entry->type, data));
}

/* Begins a download. If the request contains the data, stores them. */
static enum cia402_abort cia402_sdo_download(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    enum cia402_abort reason = CIA402_DONE;
    bool sized = request[0] & CIA402_SIZED;

    /* Expedited transfer; if the size is not given, assume the object's length */
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

/* Receives a segment of a download; the last one stores the data. */
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

/* Checks the toggle bit of a segment request, and passes the request to the transfer. The toggle
 * bit starts at 0 and alternates. */
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

/* Restarts the time-out of a block transfer. */
static void cia402_block_refresh(struct cia402_node *node)
{
    node->transfer.heard_ns = node->board.boards->now_ns;
}

/* Receives a segment of a block download. Acknowledges the block after its last segment. */
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

    /* After a gap, drop the rest of the block; the client sends it again */
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

/* Returns the CRC of CiA 301, 7.2.4.3.16. The CRC of "123456789" is 0x31c3. */
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

/* Ends a block download: checks size and checksum, and stores the data. */
static enum cia402_abort cia402_block_end_download(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    uint8_t data[CIA402_SDO_LENGTH] = {CIA402_BLOCK_DOWNLOAD_REPLY | END};
    enum cia402_abort reason = CIA402_DONE;

    if ((request[0] & (CIA402_COMMAND_MASK | SUB_COMMAND_MASK)) != (CIA402_BLOCK_DOWNLOAD | END)) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_COMMAND);
    }
    transfer->done -= request[0] >> 2 & 7u; /* subtract the unused bytes of the last segment */
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

/* Begins a block download. */
static enum cia402_abort cia402_block_download(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    uint8_t data[CIA402_SDO_LENGTH] = {CIA402_BLOCK_DOWNLOAD_REPLY | CRC_SUPPORTED | INITIATE,
                                       request[1], request[2], request[3], BLOCK_MAX};
    bool sized = request[0] & SIZE_INDICATED;
    enum cia402_abort reason = CIA402_DONE;

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

/* Returns whether a number of segments per block is allowed. */
static bool cia402_block_size_is_right(unsigned segments)
{
    return segments >= 1 && segments <= BLOCK_MAX;
}

/* Begins a block upload. If the data are not longer than the client's threshold, sends them without
 * blocks. */
static enum cia402_abort cia402_block_upload(struct cia402_node *node, const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;
    uint8_t data[CIA402_SDO_LENGTH] = {CIA402_BLOCK_UPLOAD_REPLY | CRC_SUPPORTED | SIZE_INDICATED |
                                           INITIATE,
                                       request[1], request[2], request[3]};

    if (!cia402_block_size_is_right(request[4])) {
        return cia402_sdo_abort_transfer(node, CIA402_ABORT_BLOCK_SIZE);
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

/* Finds the object of a request and starts a transfer. block: as a block transfer. */
static enum cia402_abort cia402_sdo_initiate(struct cia402_node *node, const uint8_t *request,
                                             bool upload, bool block)
{
    struct cia402_transfer *transfer = &node->transfer;
    enum cia402_abort reason;

    memset(transfer, 0, sizeof *transfer);
    transfer->index = get_u16_le(request + 1);
    transfer->sub = request[3];
    reason = cia402_find(node, transfer->index, transfer->sub, &transfer->entry);
    if (!reason && upload) {
        reason = cia402_sdo_load(node);
    } else if (!reason && (!transfer->entry.object ||
                           (transfer->entry.object->access & CIA402_ACCESS_MASK) < CIA402_RW)) {
        reason = CIA402_ABORT_READ_ONLY;
    }
    if (reason) {
        return cia402_sdo_abort_transfer(node, reason);
    }
    if (block) {
        return upload ? cia402_block_upload(node, request) : cia402_block_download(node, request);
    }
    return upload ? cia402_sdo_upload_loaded(node, request) : cia402_sdo_download(node, request);
}

/* Handles an acknowledgment of the client: sends the next block, or ends the upload. */
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

    /* Continue after the last acknowledged segment. An upload without data still has one empty
     * segment to acknowledge */
    if (taken < left || request[1] == 0) {
        transfer->done += taken;
        transfer->sequence = 0;
        transfer->block = request[2];
        transfer->kind = CIA402_BLOCK_UPLOADS;
        return CIA402_DONE;
    }
    /* Report the number of unused bytes in the last segment */
    data[0] |=
        (uint8_t)((transfer->size == 0 ? SEGMENT_MAX
                                       : (SEGMENT_MAX - transfer->size % SEGMENT_MAX) % SEGMENT_MAX)
                  << 2);
    if (transfer->checked) {
        put_u16_le(data + 1, cia402_block_crc(transfer->data, transfer->size));
    }
    transfer->kind = CIA402_BLOCK_UPLOAD_ENDS;
    cia402_sdo_answer(node, data);
    return CIA402_DONE;
}

static enum cia402_abort cia402_block_receive_upload(struct cia402_node *node,
                                                     const uint8_t *request)
{
    struct cia402_transfer *transfer = &node->transfer;

    /* Each sub-command is valid in one state of the transfer */
    switch (request[0] & SUB_COMMAND_MASK) {
    case INITIATE:
        return cia402_sdo_initiate(node, request, true, true);
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

enum cia402_abort cia402_sdo_receive(struct cia402_node *node, const uint8_t *data)
{
    /* During a block download, treat every request except an abort as a segment. The byte 0 of an
     * abort cannot begin a segment: it would mean segment number 0 */
    if (data[0] != CIA402_ABORT && node->transfer.kind == CIA402_BLOCK_DOWNLOADS) {
        return cia402_block_take_segment(node, data);
    }
    if (data[0] != CIA402_ABORT && node->transfer.kind == CIA402_BLOCK_DOWNLOAD_ENDS) {
        return cia402_block_end_download(node, data);
    }
    switch (data[0] & CIA402_COMMAND_MASK) {
    case CIA402_DOWNLOAD:
        return cia402_sdo_initiate(node, data, false, false);
    case CIA402_UPLOAD:
        return cia402_sdo_initiate(node, data, true, false);
    case CIA402_DOWNLOAD_SEGMENT:
        return cia402_sdo_segment(node, data, false);
    case CIA402_UPLOAD_SEGMENT:
        return cia402_sdo_segment(node, data, true);
    case CIA402_BLOCK_DOWNLOAD:
        return (data[0] & 1) == INITIATE ? cia402_sdo_initiate(node, data, false, true)
                                         : cia402_sdo_abort_transfer(node, CIA402_ABORT_COMMAND);
    case CIA402_BLOCK_UPLOAD:
        return cia402_block_receive_upload(node, data);
    case CIA402_ABORT:
        node->transfer.kind = CIA402_NO_TRANSFER;
        return CIA402_DONE;
    default:
        return cia402_sdo_abort(node, get_u16_le(data + 1), data[3], CIA402_ABORT_COMMAND);
    }
}

void cia402_block_step(struct cia402_node *node, struct ms_span span)
{
    struct cia402_transfer *transfer = &node->transfer;

    if (transfer->kind < CIA402_BLOCK_DOWNLOADS || node->state == CIA402_STOPPED) {
        return;
    }
    for (int64_t ms = span.from; ms < span.to && transfer->kind == CIA402_BLOCK_UPLOADS; ms++) {
        /* Send the next segment of a block upload */
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
    if (transfer->kind != CIA402_BLOCK_UPLOADS &&
        node->board.boards->now_ns - transfer->heard_ns > TIMEOUT_NS) {
        cia402_sdo_abort_transfer(node, CIA402_ABORT_TIME_OUT);
    }
}
