/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes an MCAP file (mcap.dev/spec, version 0): messages on channels, in chunks compressed with
 * zstd, and a summary at the end. Each chunk has a checksum and an index. Schemas and channels
 * stand at the beginning. A file without its end is therefore readable up to the last whole chunk,
 * and tools can rebuild the summary. One thread; not RT-safe. Times in ns.
 */
#ifndef RT_RECORDING_MCAP_H
#define RT_RECORDING_MCAP_H

#include "base/arena.h"
#include "base/error.h"

#include <stdint.h>

enum {
    MCAP_SCHEMAS_MAX = 16,
    MCAP_CHANNELS_MAX = 64,
    MCAP_CHUNK = 1 << 20, /* bytes of messages, uncompressed, after which a chunk ends */
};

struct mcap_config {
    const char *library; /* name of the program that writes the file */
    size_t longest;      /* most bytes of one message */
    /* Receives the next piece of the file: the head, a chunk with its indexes, or the end. */
    void (*put)(void *context, const void *bytes, size_t size);
    void *context;
};

struct mcap;

/* Creates a writer. Memory from arena, except for the compressor and the summary. ERROR_MEMORY. */
enum error_code mcap_create(const struct mcap_config *config, struct arena *arena,
                            struct mcap **mcap, struct error *error);

/* Add a schema or a channel; call before mcap_prepare. Messages are JSON, schemas JSON Schema;
 * strings are borrowed. Return an identifier of 1 or more; 0 = no room. */
uint16_t mcap_add_schema(struct mcap *mcap, const char *name, const char *text);
uint16_t mcap_add_channel(struct mcap *mcap, uint16_t schema, const char *topic);

/* Allocates the remaining buffers. Call it after the last schema and channel. ERROR_MEMORY. */
enum error_code mcap_prepare(struct mcap *mcap, struct arena *arena);

/* Returns the size of the longest piece in bytes. */
size_t mcap_longest_piece(const struct mcap *mcap);

/* Writes the head of the file. */
void mcap_start(struct mcap *mcap);

/* mcap_begin_message returns a buffer of config.longest bytes. After the caller has written a
 * message into it, mcap_end_message adds the message. */
char *mcap_begin_message(struct mcap *mcap);
void mcap_end_message(struct mcap *mcap, uint16_t channel, int64_t time_ns, size_t size);

/* Ends the present chunk, unless it is empty. */
void mcap_flush(struct mcap *mcap);

/* Writes the end of the file. When memory for the summary ran out the index is omitted; readers
 * then scan the file. */
void mcap_finish(struct mcap *mcap);

/* Frees the compressor and the summary. NULL is allowed. */
void mcap_destroy(struct mcap *mcap);

#endif
