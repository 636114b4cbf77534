/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the records, chunks and summary of an MCAP file (mcap.dev/spec). */
#include "rt/recording/mcap.h"

#include "base/crc32.h"

#include <stdlib.h>
#include <string.h>
#include <zstd.h>

enum mcap_opcode {
    MCAP_HEADER = 1,
    MCAP_FOOTER = 2,
    MCAP_SCHEMA = 3,
    MCAP_CHANNEL = 4,
    MCAP_MESSAGE = 5,
    MCAP_CHUNK_RECORD = 6,
    MCAP_MESSAGE_INDEX = 7,
    MCAP_CHUNK_INDEX = 8,
    MCAP_STATISTICS = 11,
    MCAP_SUMMARY_OFFSET = 14,
    MCAP_DATA_END = 15,
};

enum {
    RECORD_HEAD = 9,   /* opcode and length */
    MESSAGE_HEAD = 22, /* channel, sequence, two times */
    CHUNK_HEAD = 44,   /* bytes of a chunk before the compressed data, "zstd" included */
    ENTRIES = 32768,   /* most messages in a chunk */
    ENTRY_SIZE = 16,   /* time and offset in an index */
    TEXT_SIZE = 4,     /* length of a string */
    SPARE = 4096,      /* most bytes at the end of the file, without the groups of the summary */
    LEVEL = 3,         /* compression level: zstd's default */
};

static const char mcap_magic[8] = "\x89MCAP0\r\n";
static const char mcap_zstd[] = "zstd";

struct mcap_schema {
    const char *name, *text;
};

struct mcap_channel {
    const char *topic;
    uint16_t schema;
    uint32_t sequence; /* number of the next message */
    uint64_t messages;
    uint32_t in_chunk; /* number of messages in the present chunk */
};

/* A message of the present chunk. */
struct mcap_entry {
    uint16_t channel;
    uint64_t time, offset;
};

struct mcap {
    struct mcap_config config;
    struct mcap_schema schema[MCAP_SCHEMAS_MAX];
    struct mcap_channel channel[MCAP_CHANNELS_MAX];
    uint16_t nschema, nchannel;
    uint64_t offset; /* bytes of the file so far */
    uint32_t crc;    /* CRC-32 of these bytes */

    /* The present chunk */
    uint8_t *records;
    size_t used;
    struct mcap_entry *entry;
    size_t nentry;
    uint8_t *piece; /* buffer for the next piece */
    size_t piece_size;
    ZSTD_CCtx *compressor;

    /* The file */
    uint64_t messages, first_time, last_time;
    uint32_t chunks;
    uint8_t *index; /* index of chunks, as records */
    size_t index_size, index_capacity;
    bool index_lost; /* out of memory for the index */
};

/* ---- numbers and records ---- */

/* Writes a number as `bytes` bytes, little-endian. Returns the end. */
static uint8_t *mcap_put_number(uint8_t *at, uint64_t value, int bytes)
{
    for (int i = 0; i < bytes; i++) {
        *at++ = (uint8_t)(value >> 8 * i);
    }
    return at;
}

/* Writes a string after its length. Returns the end. */
static uint8_t *mcap_put_text(uint8_t *at, const char *text)
{
    size_t size = strlen(text);

    at = mcap_put_number(at, size, TEXT_SIZE);
    memcpy(at, text, size);
    return at + size;
}

/* Writes a record's opcode and leaves room for its length, which mcap_end_record fills in. Returns
 * where the content begins. */
static uint8_t *mcap_begin_record(uint8_t *record, enum mcap_opcode opcode)
{
    *record = (uint8_t)opcode;
    return record + RECORD_HEAD;
}

/* Fills in the length of a record that ends at `end`. Returns end. */
static uint8_t *mcap_end_record(uint8_t *record, uint8_t *end)
{
    mcap_put_number(record + 1, (uint64_t)(end - record) - RECORD_HEAD, 8);
    return end;
}

/* Hands over the piece up to `end` and updates the checksum of the file. */
static void mcap_put_piece(struct mcap *mcap, const uint8_t *end)
{
    size_t size = (size_t)(end - mcap->piece);

    mcap->crc = crc32_update(mcap->crc, mcap->piece, size);
    mcap->offset += size;
    mcap->config.put(mcap->config.context, mcap->piece, size);
}

/* Writes all schemas as records. Returns the end. */
static uint8_t *mcap_put_schemas(const struct mcap *mcap, uint8_t *at)
{
    for (uint16_t i = 0; i < mcap->nschema; i++) {
        uint8_t *record = at;

        at = mcap_put_number(mcap_begin_record(record, MCAP_SCHEMA), i + 1u, 2);
        at = mcap_put_text(at, mcap->schema[i].name);
        at = mcap_put_text(at, "jsonschema");
        at = mcap_end_record(record, mcap_put_text(at, mcap->schema[i].text));
    }
    return at;
}

/* Writes all channels as records, without metadata. Returns the end. */
static uint8_t *mcap_put_channels(const struct mcap *mcap, uint8_t *at)
{
    for (uint16_t i = 0; i < mcap->nchannel; i++) {
        uint8_t *record = at;

        at = mcap_put_number(mcap_begin_record(record, MCAP_CHANNEL), i + 1u, 2);
        at = mcap_put_number(at, mcap->channel[i].schema, 2);
        at = mcap_put_text(at, mcap->channel[i].topic);
        at = mcap_put_text(at, "json");
        at = mcap_end_record(record, mcap_put_number(at, 0, TEXT_SIZE));
    }
    return at;
}

/* ---- the head ---- */

enum error_code mcap_create(const struct mcap_config *config, struct arena *arena,
                            struct mcap **mcap, struct error *error)
{
    struct mcap *made = arena_alloc(arena, 1, sizeof *made);

    if (made) {
        made->config = *config;
        made->records =
            arena_alloc(arena, MCAP_CHUNK + RECORD_HEAD + MESSAGE_HEAD + config->longest, 1);
        made->entry = arena_alloc(arena, ENTRIES, sizeof *made->entry);
        made->compressor = ZSTD_createCCtx();
    }
    if (!made || !made->records || !made->entry || !made->compressor) {
        mcap_destroy(made);
        return error_set(error, ERROR_MEMORY, "no memory left for the MCAP file");
    }
    *mcap = made;
    return ERROR_NONE;
}

uint16_t mcap_add_schema(struct mcap *mcap, const char *name, const char *text)
{
    if (mcap->nschema == MCAP_SCHEMAS_MAX) {
        return 0;
    }
    mcap->schema[mcap->nschema++] = (struct mcap_schema){name, text};
    return mcap->nschema;
}

uint16_t mcap_add_channel(struct mcap *mcap, uint16_t schema, const char *topic)
{
    if (mcap->nchannel == MCAP_CHANNELS_MAX) {
        return 0;
    }
    mcap->channel[mcap->nchannel++] = (struct mcap_channel){.topic = topic, .schema = schema};
    return mcap->nchannel;
}

size_t mcap_longest_piece(const struct mcap *mcap)
{
    return mcap->piece_size;
}

enum error_code mcap_prepare(struct mcap *mcap, struct arena *arena)
{
    size_t groups = SPARE, chunk;

    /* Allocate for the longest piece: a chunk, or the head and the end, which hold the schemas */
    for (uint16_t i = 0; i < mcap->nschema; i++) {
        groups += 64 + strlen(mcap->schema[i].name) + strlen(mcap->schema[i].text);
    }
    for (uint16_t i = 0; i < mcap->nchannel; i++) {
        groups += 64 + strlen(mcap->channel[i].topic);
    }
    chunk = ZSTD_compressBound(MCAP_CHUNK + RECORD_HEAD + MESSAGE_HEAD + mcap->config.longest) +
            ENTRIES * ENTRY_SIZE + (size_t)mcap->nchannel * 32 + SPARE;
    mcap->piece_size = groups + strlen(mcap->config.library) + chunk;
    mcap->piece = arena_alloc(arena, mcap->piece_size, 1);
    return mcap->piece ? ERROR_NONE : ERROR_MEMORY;
}

void mcap_start(struct mcap *mcap)
{
    uint8_t *record = mcap->piece + sizeof mcap_magic, *at;

    memcpy(mcap->piece, mcap_magic, sizeof mcap_magic);
    at = mcap_put_text(mcap_begin_record(record, MCAP_HEADER), ""); /* no profile */
    at = mcap_end_record(record, mcap_put_text(at, mcap->config.library));
    mcap_put_piece(mcap, mcap_put_channels(mcap, mcap_put_schemas(mcap, at)));
}

/* ---- chunks ---- */

char *mcap_begin_message(struct mcap *mcap)
{
    if (mcap->used >= MCAP_CHUNK || mcap->nentry == ENTRIES) {
        mcap_flush(mcap);
    }
    return (char *)mcap->records + mcap->used + RECORD_HEAD + MESSAGE_HEAD;
}

void mcap_end_message(struct mcap *mcap, uint16_t channel, int64_t time_ns, size_t size)
{
    struct mcap_channel *of = &mcap->channel[channel - 1];
    uint64_t time = time_ns > 0 ? (uint64_t)time_ns : 0;
    uint8_t *record = mcap->records + mcap->used, *at;

    mcap->entry[mcap->nentry++] = (struct mcap_entry){channel, time, mcap->used};
    at = mcap_put_number(mcap_begin_record(record, MCAP_MESSAGE), channel, 2);
    at = mcap_put_number(at, of->sequence++, 4);
    at = mcap_put_number(at, time, 8);
    at = mcap_put_number(at, time, 8);
    mcap->used = (size_t)(mcap_end_record(record, at + size) - mcap->records);

    /* Count for the indexes and the statistics */
    of->messages++;
    of->in_chunk++;
    mcap->first_time = mcap->messages && mcap->first_time < time ? mcap->first_time : time;
    mcap->last_time = mcap->last_time > time ? mcap->last_time : time;
    mcap->messages++;
}

/* Writes the record of the chunk, and its compressed size into *compressed. span: times of the
 * first and last message. NULL = compression failed. */
static uint8_t *mcap_put_chunk(struct mcap *mcap, const uint64_t span[2], size_t *compressed)
{
    uint8_t *at = mcap_begin_record(mcap->piece, MCAP_CHUNK_RECORD);
    uint8_t *bytes = at + CHUNK_HEAD;

    *compressed = ZSTD_compressCCtx(mcap->compressor, bytes, ZSTD_compressBound(mcap->used),
                                    mcap->records, mcap->used, LEVEL);
    if (ZSTD_isError(*compressed)) {
        return NULL;
    }
    at = mcap_put_number(at, span[0], 8);
    at = mcap_put_number(at, span[1], 8);
    at = mcap_put_number(at, mcap->used, 8);
    at = mcap_put_number(at, crc32_update(0, mcap->records, mcap->used), 4);
    at = mcap_put_text(at, mcap_zstd);
    mcap_put_number(at, *compressed, 8);
    return mcap_end_record(mcap->piece, bytes + *compressed);
}

/* Writes the index of a channel's messages in the chunk: time and offset of each message. */
static uint8_t *mcap_put_message_index(const struct mcap *mcap, uint16_t channel, uint8_t *record)
{
    uint8_t *at = mcap_put_number(mcap_begin_record(record, MCAP_MESSAGE_INDEX), channel, 2);

    at = mcap_put_number(at, (uint64_t)mcap->channel[channel - 1].in_chunk * ENTRY_SIZE, TEXT_SIZE);
    for (size_t i = 0; i < mcap->nentry; i++) {
        if (mcap->entry[i].channel == channel) {
            at = mcap_put_number(at, mcap->entry[i].time, 8);
            at = mcap_put_number(at, mcap->entry[i].offset, 8);
        }
    }
    return mcap_end_record(record, at);
}

/* Adds a chunk with a record of `chunk` bytes to the index of chunks. where[i] is the file offset
 * of the message index of channel i + 1; 0 = no index. */
static void mcap_index_chunk(struct mcap *mcap, const uint64_t span[2], const uint64_t *where,
                             size_t chunk, size_t indexes, size_t compressed)
{
    size_t need = mcap->index_size + SPARE;
    uint8_t *record, *at, *count;

    /* Make room for one more record; without memory the file has no index */
    if (need > mcap->index_capacity && !mcap->index_lost) {
        uint8_t *grown = realloc(mcap->index, 2 * need);

        mcap->index_lost = grown == NULL;
        mcap->index = grown ? grown : mcap->index;
        mcap->index_capacity = grown ? 2 * need : mcap->index_capacity;
    }
    if (mcap->index_lost) {
        return;
    }
    record = mcap->index + mcap->index_size;
    at = mcap_put_number(mcap_begin_record(record, MCAP_CHUNK_INDEX), span[0], 8);
    at = mcap_put_number(at, span[1], 8);
    at = mcap_put_number(at, mcap->offset, 8);
    at = mcap_put_number(at, chunk, 8);
    /* Leave room for the length of the list of message indexes; it is written after the list */
    count = at;
    at += TEXT_SIZE;
    for (uint16_t i = 0; i < mcap->nchannel; i++) {
        if (where[i]) {
            at = mcap_put_number(at, i + 1u, 2);
            at = mcap_put_number(at, where[i], 8);
        }
    }
    mcap_put_number(count, (uint64_t)(at - count) - TEXT_SIZE, TEXT_SIZE);
    at = mcap_put_number(at, indexes, 8);
    at = mcap_put_text(at, mcap_zstd);
    at = mcap_put_number(at, compressed, 8);
    at = mcap_put_number(at, mcap->used, 8);
    mcap->index_size = (size_t)(mcap_end_record(record, at) - mcap->index);
}

void mcap_flush(struct mcap *mcap)
{
    uint64_t where[MCAP_CHANNELS_MAX] = {0}, span[2] = {UINT64_MAX, 0};
    uint8_t *end, *chunk_end;
    size_t compressed;

    if (mcap->nentry == 0) {
        return;
    }
    /* Find the time span of the chunk */
    for (size_t i = 0; i < mcap->nentry; i++) {
        span[0] = mcap->entry[i].time < span[0] ? mcap->entry[i].time : span[0];
        span[1] = mcap->entry[i].time > span[1] ? mcap->entry[i].time : span[1];
    }

    /* Write the chunk, then an index for each channel that has messages in it */
    chunk_end = end = mcap_put_chunk(mcap, span, &compressed);
    for (uint16_t i = 0; end && i < mcap->nchannel; i++) {
        if (mcap->channel[i].in_chunk) {
            where[i] = mcap->offset + (uint64_t)(end - mcap->piece);
            end = mcap_put_message_index(mcap, i + 1u, end);
        }
        mcap->channel[i].in_chunk = 0;
    }
    if (end) {
        mcap_index_chunk(mcap, span, where, (size_t)(chunk_end - mcap->piece),
                         (size_t)(end - chunk_end), compressed);
        mcap_put_piece(mcap, end);
        mcap->chunks++;
    }
    mcap->used = mcap->nentry = 0;
}

/* ---- the end ---- */

/* Writes the statistics record. Returns the end. */
static uint8_t *mcap_put_statistics(const struct mcap *mcap, uint8_t *record)
{
    uint8_t *at = mcap_put_number(mcap_begin_record(record, MCAP_STATISTICS), mcap->messages, 8);

    at = mcap_put_number(at, mcap->nschema, 2);
    at = mcap_put_number(at, mcap->nchannel, 4);
    at = mcap_put_number(at, 0, 4); /* number of attachments */
    at = mcap_put_number(at, 0, 4); /* number of metadata records */
    at = mcap_put_number(at, mcap->chunks, 4);
    at = mcap_put_number(at, mcap->first_time, 8);
    at = mcap_put_number(at, mcap->last_time, 8);
    at = mcap_put_number(at, (uint64_t)mcap->nchannel * 10, TEXT_SIZE);
    for (uint16_t i = 0; i < mcap->nchannel; i++) {
        at = mcap_put_number(at, i + 1u, 2);
        at = mcap_put_number(at, mcap->channel[i].messages, 8);
    }
    return mcap_end_record(record, at);
}

/* A group of equal records in the summary; mcap_put_footer writes its place. */
struct mcap_group {
    enum mcap_opcode opcode;
    uint64_t start, size;
};

/* Writes the place of each group, the footer and the magic bytes. The footer's checksum continues
 * the checksum of the summary. */
static uint8_t *mcap_put_footer(const struct mcap *mcap, uint64_t summary,
                                const struct mcap_group *group, size_t count, uint32_t crc)
{
    uint8_t *record = mcap->piece, *at = record;

    for (size_t i = 0; i < count; i++) {
        record = at;
        at = mcap_put_number(mcap_begin_record(record, MCAP_SUMMARY_OFFSET), group[i].opcode, 1);
        at = mcap_put_number(at, group[i].start, 8);
        at = mcap_end_record(record, mcap_put_number(at, group[i].size, 8));
    }
    record = at;
    at = mcap_put_number(mcap_begin_record(record, MCAP_FOOTER), summary, 8);
    at = mcap_put_number(at, mcap->offset, 8);
    mcap_end_record(record, at + 4);
    crc = crc32_update(crc, mcap->piece, (size_t)(at - mcap->piece));
    at = mcap_put_number(at, crc, 4);
    memcpy(at, mcap_magic, sizeof mcap_magic);
    return at + sizeof mcap_magic;
}

/* Hands over a group of the summary and updates the summary's checksum. */
static void mcap_put_group(struct mcap *mcap, struct mcap_group *group, enum mcap_opcode opcode,
                           const void *bytes, size_t size, uint32_t *crc)
{
    *group = (struct mcap_group){opcode, mcap->offset, size};
    *crc = crc32_update(*crc, bytes, size);
    mcap->offset += size;
    for (size_t at = 0; at < size; at += mcap->piece_size) {
        size_t rest = size - at;

        mcap->config.put(mcap->config.context, (const uint8_t *)bytes + at,
                         rest < mcap->piece_size ? rest : mcap->piece_size);
    }
}

void mcap_finish(struct mcap *mcap)
{
    struct mcap_group group[4];
    uint8_t *piece = mcap->piece, *at;
    uint64_t summary;
    uint32_t crc = 0;
    size_t count = 0;

    /* End the data, with a checksum of all bytes before */
    mcap_flush(mcap);
    at = mcap_put_number(mcap_begin_record(piece, MCAP_DATA_END), mcap->crc, 4);
    mcap_put_piece(mcap, mcap_end_record(piece, at));

    /* Write the summary: schemas, channels, the index of chunks, statistics */
    summary = mcap->offset;
    at = mcap_put_schemas(mcap, piece);
    mcap_put_group(mcap, &group[count++], MCAP_SCHEMA, piece, (size_t)(at - piece), &crc);
    at = mcap_put_channels(mcap, piece);
    mcap_put_group(mcap, &group[count++], MCAP_CHANNEL, piece, (size_t)(at - piece), &crc);
    if (mcap->index_size && !mcap->index_lost) {
        mcap_put_group(mcap, &group[count++], MCAP_CHUNK_INDEX, mcap->index, mcap->index_size,
                       &crc);
    }
    at = mcap_put_statistics(mcap, piece);
    mcap_put_group(mcap, &group[count++], MCAP_STATISTICS, piece, (size_t)(at - piece), &crc);
    mcap_put_piece(mcap, mcap_put_footer(mcap, summary, group, count, crc));
}

void mcap_destroy(struct mcap *mcap)
{
    if (mcap) {
        ZSTD_freeCCtx(mcap->compressor);
        free(mcap->index);
        mcap->compressor = NULL;
        mcap->index = NULL;
    }
}
