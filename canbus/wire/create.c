/* SPDX-License-Identifier: Apache-2.0 */
/* Creates a wire: checks its configuration and lays out its memory in one piece. */
#include "canbus/wire/private.h"

enum { QUEUE_MAX = 4096, FOREIGN_QUEUE = 1 };

/* Window over which the load is measured, ns. */
#define WINDOW_DEFAULT_NS 100000000

/* Checks the ranges of a wire's configuration. */
static enum error_code wire_check_config(const struct wire_config *config, struct error *error)
{
    if (config->nodes < 1 || config->nodes > WIRE_NODES_MAX) {
        return error_set(error, ERROR_INPUT, "found %zu nodes on a wire, expected 1 to %d",
                         config->nodes, WIRE_NODES_MAX);
    }
    if (config->queue < 1 || config->queue > QUEUE_MAX) {
        return error_set(error, ERROR_INPUT,
                         "found a transmit queue of %zu frames, expected 1 to %d", config->queue,
                         QUEUE_MAX);
    }
    if (config->bitrate < 1000 || config->bitrate > 1000000) {
        return error_set(error, ERROR_INPUT, "found a bit rate of %lld bit/s, expected 1000 to 1e6",
                         (long long)config->bitrate);
    }
    if (config->data_bitrate &&
        (config->data_bitrate < config->bitrate || config->data_bitrate > 20000000)) {
        return error_set(error, ERROR_INPUT,
                         "found a data bit rate of %lld bit/s, expected the nominal %lld to 20e6",
                         (long long)config->data_bitrate, (long long)config->bitrate);
    }
    if (config->window_ns < 0) {
        return error_set(error, ERROR_INPUT, "found a negative window of the load");
    }
    return ERROR_NONE;
}

/* Allocates the transmit queue of a node, all slots free; false = no memory. */
static bool wire_create_node(struct wire_node *node, size_t queue, struct arena *arena)
{
    node->slot = arena_alloc(arena, queue, sizeof *node->slot);
    node->heap = arena_alloc(arena, queue, sizeof *node->heap);
    node->spare = arena_alloc(arena, queue, sizeof *node->spare);
    if (!node->slot || !node->heap || !node->spare) {
        return false;
    }
    while (node->nspare < queue) {
        node->spare[node->nspare] = (uint16_t)(queue - 1 - node->nspare);
        node->nspare++;
    }
    return true;
}

enum error_code wire_create(const struct wire_config *config, struct arena *arena,
                            struct wire **out, struct error *error)
{
    struct wire *wire;
    enum error_code code = wire_check_config(config, error);
    bool good;

    if (code) {
        return code;
    }

    /* The wire, its nodes and the foreign one of collisions, one behind the other: wire_memory */
    wire = arena_alloc(arena, 1, sizeof *wire);
    good = wire && (wire->node = arena_alloc(arena, config->nodes + 1, sizeof *wire->node));
    for (size_t i = 0; good && i <= config->nodes; i++) {
        good = wire_create_node(&wire->node[i], i < config->nodes ? config->queue : FOREIGN_QUEUE,
                                arena);
    }
    if (!good) {
        return error_set(error, ERROR_MEMORY, "no memory for a wire of %zu nodes", config->nodes);
    }

    /* The configuration with its defaults */
    wire->config = *config;
    if (!config->data_bitrate) {
        wire->config.data_bitrate = config->bitrate;
    }
    if (!config->window_ns) {
        wire->config.window_ns = WINDOW_DEFAULT_NS;
    }
    if (!config->events) {
        wire->config.events = UINT32_MAX;
    }

    /* What follows from it */
    wire_tables_make(&wire->tables);
    wire->all = WIRE_BIT(config->nodes) - 1;
    wire->delimiter_ns = wire_bits_ns(wire, WIRE_DELIMITER_BITS);
    wire->random = random_named(config->seed, "wire");
    wire->size = (size_t)(arena->memory + arena->used - (unsigned char *)wire);
    *out = wire;
    return ERROR_NONE;
}
