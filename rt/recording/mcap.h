/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes an MCAP file (mcap.dev/spec, version 0): messages on channels, in chunks that are
 * compressed with zstd, each with a checksum and an index; a summary at the end. Schemas and
 * channels stand at the beginning, so that of a file that lacks its end everything up to the last
 * whole chunk can be read, and the rest made anew. One thread; not RT-safe. Times in ns.
 */
#ifndef RT_RECORDING_MCAP_H
#define RT_RECORDING_MCAP_H

#include "base/arena.h"
#include "base/error.h"

#include <stddef.h>
#include <stdint.h>

enum {
    MCAP_SCHEMAS_MAX = 16,
    MCAP_CHANNELS_MAX = 64,
    MCAP_CHUNK = 1 << 20, /* bytes of messages, before compression, that end a chunk */
};

struct mcap_config {
    const char *library; /* name of the program that writes the file */
    size_t longest;      /* bytes of a message's content, at most */
    /* Takes the next piece of the file: the head, a chunk with its indexes, or the end. */
    void (*put)(void *context, const void *bytes, size_t size);
    void *context;
};

struct mcap;

/* Creates a writer in memory from arena, except that of compressor and summary. ERROR_MEMORY. */
enum error_code mcap_create(const struct mcap_config *config, struct arena *arena,
                            struct mcap **mcap, struct error *error);

/* Add a schema or a channel, before mcap_prepare. Messages are JSON, schemas JSON Schema;
 * strings are borrowed. Both are numbered from 1; 0 = there is no room. */
uint16_t mcap_add_schema(struct mcap *mcap, const char *name, const char *text);
uint16_t mcap_add_channel(struct mcap *mcap, uint16_t schema, const char *topic);

/* Takes the rest of the memory, when schemas and channels are complete. ERROR_MEMORY. */
enum error_code mcap_prepare(struct mcap *mcap, struct arena *arena);

/* Returns the greatest size of a piece in bytes. */
size_t mcap_longest_piece(const struct mcap *mcap);

/* Writes the head. */
void mcap_start(struct mcap *mcap);

/* Begins a message: returns where its content goes, config.longest bytes at most;
 * mcap_end_message hands it over with its size. */
char *mcap_begin_message(struct mcap *mcap);
void mcap_end_message(struct mcap *mcap, uint16_t channel, int64_t time_ns, size_t size);

/* Ends the chunk, if it holds anything. */
void mcap_flush(struct mcap *mcap);

/* Ends the file. Without memory for the summary its index is left out: readers then scan it. */
void mcap_finish(struct mcap *mcap);

/* Frees the compressor and the summary. NULL is allowed. */
void mcap_destroy(struct mcap *mcap);

#endif
