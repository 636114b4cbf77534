/* SPDX-License-Identifier: Apache-2.0 */
/* MCAP files read back by a reader of the specification's words (mcap.dev/spec), with checksums
 * computed bit by bit: what was written, where the indexes say it is. */
#include "rt/recording/mcap.h"
#include "tests/test.h"

#include <zstd.h>

enum { LONGEST = 4096, CHANNELS = 2 };

/* ---- a file in memory ---- */

struct file {
    uint8_t *bytes;
    size_t size;
    size_t longest; /* piece */
    struct arena arena;
    struct mcap *mcap;
};

static void file_put(void *context, const void *bytes, size_t size)
{
    struct file *file = context;

    file->bytes = realloc(file->bytes, file->size + size);
    assert_non_null(file->bytes);
    memcpy(file->bytes + file->size, bytes, size);
    file->size += size;
    file->longest = size > file->longest ? size : file->longest;
}

static void file_open(struct file *file)
{
    const struct mcap_config config = {
        .library = "test", .longest = LONGEST, .put = file_put, .context = file};
    struct error error;
    uint16_t schema;

    *file = (struct file){.size = 0};
    assert_ok(arena_init(&file->arena, (size_t)1 << 26, &error));
    assert_ok(mcap_create(&config, &file->arena, &file->mcap, &error));
    schema = mcap_add_schema(file->mcap, "number", "{\"type\":\"object\"}");
    assert_int_equal(mcap_add_channel(file->mcap, schema, "/one"), 1);
    assert_int_equal(mcap_add_channel(file->mcap, schema, "/two"), 2);
    assert_ok(mcap_prepare(file->mcap, &file->arena));
    mcap_start(file->mcap);
}

static void file_close(struct file *file)
{
    assert_true(file->longest <= mcap_longest_piece(file->mcap));
    mcap_destroy(file->mcap);
    arena_fini(&file->arena);
    free(file->bytes);
}

/* Writes a message of so many bytes that begins with its number. */
static void file_write(struct file *file, uint16_t channel, uint32_t number, size_t size)
{
    char *at = mcap_begin_message(file->mcap);

    memset(at, 'x', size);
    at[sprintf(at, "{\"n\":%u}", number)] = ' ';
    mcap_end_message(file->mcap, channel, (int64_t)number * 1000, size);
}

/* ---- the reader ---- */

static uint64_t number_at(const uint8_t *at, int bytes)
{
    uint64_t value = 0;

    for (int i = bytes - 1; i >= 0; i--) {
        value = value << 8 | at[i];
    }
    return value;
}

/* CRC-32 of ISO 3309, a bit at a time. */
static uint32_t crc_of(const uint8_t *bytes, size_t size)
{
    uint32_t crc = 0xffffffff;

    for (size_t i = 0; i < size; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = crc >> 1 ^ (crc & 1 ? 0xedb88320 : 0);
        }
    }
    return ~crc;
}

/* What was found in a file. */
struct found {
    size_t messages, chunks, indexed, chunk_indexes;
    uint64_t summary; /* offset of its first record */
    bool ended;
    uint64_t counted; /* by the statistics */
};

/* Reads the messages of a chunk: numbers go up, and each begins with its own. */
static void read_messages(const uint8_t *records, size_t size, struct found *found)
{
    for (const uint8_t *at = records; at < records + size; at += 9 + number_at(at + 1, 8)) {
        char expected[32];

        assert_int_equal(at[0], 5);
        sprintf(expected, "{\"n\":%zu}", found->messages);
        assert_int_equal(number_at(at + 15, 8), found->messages * 1000);
        assert_int_equal(number_at(at + 23, 8), found->messages * 1000);
        assert_memory_equal(at + 31, expected, strlen(expected));
        found->messages++;
    }
}

/* Unpacks a chunk's record; the caller frees what is returned. */
static uint8_t *read_chunk(const uint8_t *content, struct found *found, size_t *size)
{
    uint8_t *records;
    size_t packed = number_at(content + 36, 8), first = found->messages;

    *size = number_at(content + 16, 8);
    records = malloc(*size);
    assert_non_null(records);
    assert_int_equal(number_at(content + 28, 4), 4);
    assert_memory_equal(content + 32, "zstd", 4);
    assert_int_equal(ZSTD_decompress(records, *size, content + 44, packed), *size);
    assert_int_equal(crc_of(records, *size), number_at(content + 24, 4));
    read_messages(records, *size, found);
    assert_int_equal(number_at(content, 8), first * 1000);
    assert_int_equal(number_at(content + 8, 8), (found->messages - 1) * 1000);
    found->chunks++;
    return records;
}

/* Each entry of a channel's index is where a message of that channel and that time begins. */
static void read_index(const uint8_t *content, const uint8_t *records, size_t size,
                       struct found *found)
{
    size_t count = number_at(content + 2, 4) / 16;

    for (size_t i = 0; i < count; i++) {
        uint64_t time = number_at(content + 6 + 16 * i, 8);
        uint64_t offset = number_at(content + 14 + 16 * i, 8);

        assert_true(offset < size);
        assert_int_equal(records[offset], 5);
        assert_int_equal(number_at(records + offset + 9, 2), number_at(content, 2));
        assert_int_equal(number_at(records + offset + 15, 8), time);
    }
    found->indexed += count;
}

/* Reads a whole file, or one that lacks its end. */
static struct found read_file(const struct file *file)
{
    static const char magic[8] = "\x89MCAP0\r\n";
    struct found found = {.messages = 0};
    uint8_t *records = NULL;
    size_t size = 0, at = sizeof magic;

    assert_memory_equal(file->bytes, magic, sizeof magic);
    while (at < file->size && !found.ended) {
        const uint8_t *record = file->bytes + at, *content = record + 9;

        switch (record[0]) {
        case 6:
            free(records);
            records = read_chunk(content, &found, &size);
            break;
        case 7:
            read_index(content, records, size, &found);
            break;
        case 8: /* says where a chunk is */
            assert_int_equal(file->bytes[number_at(content + 16, 8)], 6);
            found.chunk_indexes++;
            break;
        case 11:
            found.counted = number_at(content, 8);
            break;
        case 15:
            assert_int_equal(number_at(content, 4), crc_of(file->bytes, at));
            found.summary = at + 13;
            break;
        case 2: /* the footer */
            assert_int_equal(number_at(content, 8), found.summary);
            assert_int_equal(number_at(content + 16, 4),
                             crc_of(file->bytes + found.summary,
                                    (size_t)(content + 16 - file->bytes) - found.summary));
            assert_memory_equal(content + 20, magic, sizeof magic);
            assert_int_equal(at + 29 + sizeof magic, file->size);
            found.ended = true;
            break;
        default:
            break;
        }
        at += 9 + number_at(record + 1, 8);
        assert_true(at <= file->size);
    }
    free(records);
    return found;
}

/* ---- tests ---- */

BENCH(file_open, struct file, file_close)

TEST_ON(messages_are_where_the_indexes_say, file_open, file)
{
    struct found found;

    for (uint32_t i = 0; i < 10; i++) {
        file_write(file, 1 + i % CHANNELS, i, 16 + i);
    }
    mcap_finish(file->mcap);
    found = read_file(file);
    assert_true(found.ended);
    assert_int_equal(found.chunks, 1);
    assert_int_equal(found.messages, 10);
    assert_int_equal(found.indexed, 10);
    assert_int_equal(found.chunk_indexes, 1);
    assert_int_equal(found.counted, 10);
}

/* A chunk ends when it has MCAP_CHUNK bytes, when it is flushed, and with the file; one that is
 * empty is none. */
TEST_ON(chunks_end_when_they_are_full, file_open, file)
{
    const uint32_t record = 31 + LONGEST, count = 3 * ((MCAP_CHUNK + record - 1) / record);
    struct found found;

    for (uint32_t i = 0; i < count; i++) {
        file_write(file, 1, i, LONGEST);
    }
    mcap_flush(file->mcap);
    mcap_flush(file->mcap);
    file_write(file, 2, count, 16);
    mcap_finish(file->mcap);
    found = read_file(file);
    assert_int_equal(found.messages, count + 1);
    assert_int_equal(found.chunks, 4);
    assert_int_equal(found.chunk_indexes, 4);
}

/* Many small messages fill a chunk's index before its bytes. */
TEST_ON(chunks_end_when_their_index_is_full, file_open, file)
{
    const uint32_t count = 33000;
    struct found found;

    for (uint32_t i = 0; i < count; i++) {
        file_write(file, 1, i, 16);
    }
    mcap_finish(file->mcap);
    found = read_file(file);
    assert_int_equal(found.messages, count);
    assert_int_equal(found.indexed, count);
    assert_true(found.chunks >= 2);
}

TEST_ON(a_file_without_its_end_has_its_whole_chunks, file_open, file)
{
    struct found found;

    file_write(file, 1, 0, 16);
    mcap_flush(file->mcap);
    file_write(file, 1, 1, 16);
    found = read_file(file);
    assert_false(found.ended);
    assert_int_equal(found.messages, 1);
    mcap_finish(file->mcap);
}

TEST_ON(an_empty_file_is_whole, file_open, file)
{
    struct found found;

    mcap_finish(file->mcap);
    found = read_file(file);
    assert_true(found.ended);
    assert_int_equal(found.chunks, 0);
}
