/* SPDX-License-Identifier: Apache-2.0 */
/* The expression graph: hash-consing and simplification. */
#include "model/symbolic/graph.h"

#include "base/hash.h"
#include "base/portable_math.h"

#include <stdlib.h>
#include <string.h>

void graph_init(struct graph *graph)
{
    struct graph_node zero = {.op = GRAPH_CONST, .width = 1};

    memset(graph, 0, sizeof *graph);
    graph->capacity = 4096;
    graph->nbucket = 16384;
    graph->node = calloc(graph->capacity, sizeof *graph->node);
    graph->bucket = calloc(graph->nbucket, sizeof *graph->bucket);
    if (!graph->node || !graph->bucket) {
        graph->failed = true;
        return;
    }
    graph->node[0] = zero;
    graph->count = 1;
}

void graph_fini(struct graph *graph)
{
    free(graph->node);
    free(graph->bucket);
    memset(graph, 0, sizeof *graph);
}

const struct graph_node *graph_get(const struct graph *graph, expr e)
{
    return &graph->node[expr_node(e)];
}

int graph_width(const struct graph *graph, expr e)
{
    return graph->failed ? 1 : graph_get(graph, e)->width;
}

static bool graph_is_const(const struct graph *graph, expr e)
{
    return graph->failed || graph_get(graph, e)->op == GRAPH_CONST;
}

/* Returns the hash of the members that identify a node. */
static uint64_t node_hash(const struct graph_node *node)
{
    uint64_t hash = HASH_START;

    hash = hash_bytes(hash, &node->op, sizeof node->op);
    hash = hash_bytes(hash, &node->width, sizeof node->width);
    hash = hash_bytes(hash, node->operand, sizeof node->operand);
    hash = hash_bytes(hash, &node->array, sizeof node->array);
    hash = hash_bytes(hash, node->index, sizeof node->index);
    return hash_bytes(hash, node->value, sizeof node->value);
}

/* Doubles the capacity for nodes and the hash table. Returns false without memory. */
static bool grow_graph(struct graph *graph)
{
    size_t capacity = 2 * graph->capacity, nbucket = 2 * graph->nbucket;
    struct graph_node *node = realloc(graph->node, capacity * sizeof *node);
    uint32_t *bucket;

    if (!node) {
        return false;
    }
    graph->node = node;
    graph->capacity = capacity;
    /* Build a new table and hash all nodes again */
    bucket = calloc(nbucket, sizeof *bucket);
    if (!bucket) {
        return false;
    }
    free(graph->bucket);
    graph->bucket = bucket;
    graph->nbucket = nbucket;
    for (size_t i = 1; i < graph->count; i++) {
        size_t slot = node_hash(&node[i]) % nbucket;

        node[i].next = bucket[slot];
        bucket[slot] = (uint32_t)i;
    }
    return true;
}

/* Returns the existing node that equals *wanted, or adds a new node (hash-consing). */
static expr intern_node(struct graph *graph, const struct graph_node *wanted)
{
    size_t slot;

    if (graph->failed) {
        return EXPR_ZERO;
    }
    slot = node_hash(wanted) % graph->nbucket;
    /* Reuse an equal node */
    for (uint32_t i = graph->bucket[slot]; i; i = graph->node[i].next) {
        if (graph->node[i].op == wanted->op && graph->node[i].width == wanted->width &&
            graph->node[i].array == wanted->array &&
            memcmp(graph->node[i].operand, wanted->operand, sizeof graph->node[i].operand) == 0 &&
            memcmp(graph->node[i].index, wanted->index, sizeof graph->node[i].index) == 0 &&
            memcmp(graph->node[i].value, wanted->value, sizeof graph->node[i].value) == 0) {
            return (expr)i << 1;
        }
    }
    /* Otherwise append a new node */
    if (graph->count == graph->capacity) {
        if (!grow_graph(graph)) {
            graph->failed = true;
            return EXPR_ZERO;
        }
        slot = node_hash(wanted) % graph->nbucket;
    }
    graph->node[graph->count] = *wanted;
    graph->node[graph->count].next = graph->bucket[slot];
    graph->bucket[slot] = (uint32_t)graph->count;
    return (expr)graph->count++ << 1;
}

/* Returns the node of a op b, with the width of the wider operand. */
static expr intern_binary(struct graph *graph, enum graph_op op, expr a, expr b)
{
    int wa = graph_width(graph, a), wb = graph_width(graph, b);
    struct graph_node node = {.op = op, .width = wa > wb ? wa : wb, .operand = {a, b}};

    return intern_node(graph, &node);
}

expr graph_const_lanes(struct graph *graph, int width, const double *value)
{
    struct graph_node node = {.op = GRAPH_CONST};
    bool uniform = true, zero = true, negative = false;

    for (int l = width - 1; l >= 0; l--) {
        uniform = uniform && value[l] == value[0];
        if (value[l] != 0.0) {
            zero = false;
            negative = value[l] < 0.0;
        }
    }
    if (zero) {
        return EXPR_ZERO;
    }
    node.width = uniform ? 1 : width;
    for (int l = 0; l < node.width; l++) {
        /* Adding zero turns -0 into 0, so equal constants have equal bits */
        node.value[l] = (negative ? -value[l] : value[l]) + 0.0;
    }
    return intern_node(graph, &node) ^ (negative ? 1U : 0U);
}

expr graph_const(struct graph *graph, double value)
{
    return graph_const_lanes(graph, 1, &value);
}

/* Returns lane l of a constant, with its sign. */
static double const_value(const struct graph *graph, expr e, int l)
{
    const struct graph_node *node = graph_get(graph, e);
    double value = node->value[node->width == 1 ? 0 : l];

    return expr_negative(e) ? -value : value;
}

/* Returns the constant a op b, lane by lane. */
static expr fold_constants(struct graph *graph, enum graph_op op, expr a, expr b)
{
    int wa = graph_width(graph, a), wb = graph_width(graph, b), width = wa > wb ? wa : wb;
    double value[GRAPH_LANES];

    for (int l = 0; l < width; l++) {
        double x = const_value(graph, a, l), y = const_value(graph, b, l);

        value[l] = op == GRAPH_MUL ? x * y : x + y;
    }
    return graph_const_lanes(graph, width, value);
}

/* Returns whether an expression is a one-lane constant with this value. */
static bool is_uniform_const(const struct graph *graph, expr e, double value)
{
    const struct graph_node *node = graph_get(graph, e);

    return node->op == GRAPH_CONST && node->width == 1 && const_value(graph, e, 0) == value;
}

expr graph_input(struct graph *graph, int array, int width, const int *index)
{
    struct graph_node node = {.op = GRAPH_INPUT, .width = width, .array = array};

    memcpy(node.index, index, (size_t)width * sizeof *index);
    return intern_node(graph, &node);
}

/* Splits e into constant * rest; the constant is 1 if there is none. */
static void split_const(struct graph *graph, expr e, expr *constant, expr *rest)
{
    const struct graph_node *node = graph_get(graph, e);

    if (node->op == GRAPH_MUL && graph_is_const(graph, node->operand[0])) {
        *constant = expr_negative(e) ? expr_neg(node->operand[0]) : node->operand[0];
        *rest = node->operand[1];
    } else {
        *constant = graph_const(graph, expr_negative(e) ? -1.0 : 1.0);
        *rest = e & ~1U;
    }
}

/* Returns whether e is the square of a sine or cosine. *angle receives the angle. */
static bool is_square_of(const struct graph *graph, expr e, enum graph_op op, expr *angle)
{
    const struct graph_node *node = graph_get(graph, e);

    if (node->op != GRAPH_MUL || node->operand[0] != node->operand[1] || expr_negative(e) ||
        graph_get(graph, node->operand[0])->op != op) {
        return false;
    }
    *angle = graph_get(graph, node->operand[0])->operand[0];
    return true;
}

/* Returns whether the sum is sin^2 + cos^2 of one angle. */
static bool is_pythagoras(const struct graph *graph, expr a, expr b)
{
    expr x, y;

    return ((is_square_of(graph, a, GRAPH_SIN, &x) && is_square_of(graph, b, GRAPH_COS, &y)) ||
            (is_square_of(graph, a, GRAPH_COS, &x) && is_square_of(graph, b, GRAPH_SIN, &y))) &&
           x == y;
}

expr graph_add(struct graph *graph, expr a, expr b)
{
    expr ca, cb, ra, rb;

    if (graph->failed) {
        return EXPR_ZERO;
    }

    /* Simplify sums: x + 0, x - x, constants, sin^2 + cos^2, c x + d x */
    if (a == EXPR_ZERO || b == EXPR_ZERO) {
        return a == EXPR_ZERO ? b : a;
    }
    if (a == expr_neg(b)) {
        return EXPR_ZERO;
    }
    if (graph_is_const(graph, a) && graph_is_const(graph, b)) {
        return fold_constants(graph, GRAPH_ADD, a, b);
    }
    if (is_pythagoras(graph, a, b)) {
        return graph_const(graph, 1.0);
    }
    split_const(graph, a, &ca, &ra);
    split_const(graph, b, &cb, &rb);
    if (ra == rb) {
        return graph_mul(graph, fold_constants(graph, GRAPH_ADD, ca, cb), ra);
    }

    /* Choose a fixed order and sign, so that equal sums share one node */
    if (expr_node(a) > expr_node(b)) {
        expr swap = a;

        a = b;
        b = swap;
    }
    if (expr_negative(a) == expr_negative(b)) {
        return intern_binary(graph, GRAPH_ADD, a & ~1U, b & ~1U) ^ (a & 1U);
    }
    return intern_binary(graph, GRAPH_SUB, a & ~1U, b & ~1U) ^ (a & 1U);
}

expr graph_mul(struct graph *graph, expr a, expr b)
{
    uint32_t sign = (a ^ b) & 1U;
    expr c, rest;

    if (graph->failed || a == EXPR_ZERO || b == EXPR_ZERO) {
        return EXPR_ZERO;
    }

    /* Keep signs outside. Order the operands: constants first, then the lower number */
    a &= ~1U;
    b &= ~1U;
    if (graph_is_const(graph, a) && graph_is_const(graph, b)) {
        c = fold_constants(graph, GRAPH_MUL, a, b);
        return c ^ sign;
    }
    if (graph_is_const(graph, b) || (!graph_is_const(graph, a) && expr_node(a) > expr_node(b))) {
        expr swap = a;

        a = b;
        b = swap;
    }

    /* Simplify products: 1 x, c (d x) */
    if (is_uniform_const(graph, a, 1.0)) {
        return b ^ sign;
    }
    if (graph_is_const(graph, a)) {
        split_const(graph, b, &c, &rest);
        if (rest != b) {
            return graph_mul(graph, fold_constants(graph, GRAPH_MUL, a, c), rest) ^ sign;
        }
    }
    return intern_binary(graph, GRAPH_MUL, a, b) ^ sign;
}

/* Returns the node of an operation with one operand. */
static expr intern_unary(struct graph *graph, enum graph_op op, expr a)
{
    struct graph_node node = {.op = op, .width = graph_width(graph, a), .operand = {a}};

    return intern_node(graph, &node);
}

expr graph_invert(struct graph *graph, expr a)
{
    if (graph->failed) {
        return EXPR_ZERO;
    }
    if (graph_is_const(graph, a)) {
        double value[GRAPH_LANES];
        int width = graph_width(graph, a);

        for (int l = 0; l < width; l++) {
            value[l] = 1.0 / const_value(graph, a, l);
        }
        return graph_const_lanes(graph, width, value);
    }
    if (graph_get(graph, a)->op == GRAPH_INVERT) {
        return graph_get(graph, a)->operand[0] ^ (a & 1U);
    }
    return intern_unary(graph, GRAPH_INVERT, a & ~1U) ^ (a & 1U);
}

/* Returns the sine or cosine of a constant, lane by lane. */
static expr fold_trig(struct graph *graph, enum graph_op op, expr a)
{
    double value[GRAPH_LANES];
    int width = graph_width(graph, a);

    for (int l = 0; l < width; l++) {
        double x = const_value(graph, a, l);

        value[l] = op == GRAPH_SIN ? portable_sin(x) : portable_cos(x);
    }
    return graph_const_lanes(graph, width, value);
}

expr graph_sin(struct graph *graph, expr a)
{
    if (graph->failed || graph_is_const(graph, a)) {
        return graph->failed ? EXPR_ZERO : fold_trig(graph, GRAPH_SIN, a);
    }
    return intern_unary(graph, GRAPH_SIN, a & ~1U) ^ (a & 1U);
}

expr graph_cos(struct graph *graph, expr a)
{
    if (graph->failed || graph_is_const(graph, a)) {
        return graph->failed ? EXPR_ZERO : fold_trig(graph, GRAPH_COS, a);
    }
    return intern_unary(graph, GRAPH_COS, a & ~1U);
}

expr graph_lane(struct graph *graph, expr a, int lane)
{
    const struct graph_node *node;
    struct graph_node wanted = {.op = GRAPH_LANE, .width = 1};

    if (graph->failed) {
        return EXPR_ZERO;
    }
    node = graph_get(graph, a);
    if (node->width == 1) {
        return a;
    }
    /* Handle lanes that need no new node */
    if (node->op == GRAPH_CONST) {
        return graph_const(graph, const_value(graph, a, lane));
    }
    if (node->op == GRAPH_PACK) {
        expr e = node->operand[lane];

        return expr_negative(a) ? expr_neg(e) : e;
    }
    if (node->op == GRAPH_INPUT) {
        return graph_input(graph, node->array, 1, &node->index[lane]) ^ (a & 1U);
    }
    wanted.operand[0] = a & ~1U;
    wanted.index[0] = lane;
    return intern_node(graph, &wanted) ^ (a & 1U);
}

/* Returns whether the lanes are all lanes of one expression, in order and with equal signs. */
static bool is_unpacked(const struct graph *graph, int width, const expr *lane, expr *whole)
{
    for (int l = 0; l < width; l++) {
        const struct graph_node *node = graph_get(graph, lane[l]);

        if (node->op != GRAPH_LANE || node->index[0] != l || (lane[l] & 1U) != (lane[0] & 1U) ||
            node->operand[0] != graph_get(graph, lane[0])->operand[0]) {
            return false;
        }
    }
    *whole = graph_get(graph, lane[0])->operand[0] ^ (lane[0] & 1U);
    return graph_width(graph, *whole) == width;
}

expr graph_pack(struct graph *graph, int width, const expr *lane)
{
    struct graph_node node = {.op = GRAPH_PACK, .width = width};
    bool same = true, constant = true, input = true;
    double value[GRAPH_LANES];
    int index[GRAPH_LANES];
    expr whole;

    if (graph->failed) {
        return EXPR_ZERO;
    }

    /* Find whether all lanes are equal, all are constants, or all are inputs of one array */
    for (int l = 0; l < width; l++) {
        const struct graph_node *source = graph_get(graph, lane[l]);

        same = same && lane[l] == lane[0];
        constant = constant && source->op == GRAPH_CONST;
        input = input && source->op == GRAPH_INPUT && source->width == 1 &&
                !expr_negative(lane[l]) && source->array == graph_get(graph, lane[0])->array;
        value[l] = constant ? const_value(graph, lane[l], 0) : 0.0;
        index[l] = input ? source->index[0] : 0;
        node.operand[l] = lane[l];
    }

    /* Equal lanes, constants and inputs need no pack */
    if (same) {
        return lane[0];
    }
    if (constant) {
        return graph_const_lanes(graph, width, value);
    }
    if (input) {
        return graph_input(graph, graph_get(graph, lane[0])->array, width, index);
    }
    if (is_unpacked(graph, width, lane, &whole)) {
        return whole;
    }
    return intern_node(graph, &node);
}
