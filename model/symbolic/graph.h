/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The expression graph of the symbolic generator. Nodes are hash-consed: equal expressions are one
 * node, so there are no duplicate subexpressions. The sign of an operand is part of the reference,
 * not of the node. So negation is free, and a - b, b - a and -(b - a) share one node. Expressions
 * are simplified when they are built.
 *
 * A node has 1, 2 or 4 lanes: the same expression for different limbs. An operand with one lane
 * fits any width.
 *
 * Memory: graph_init, graph_fini. After a failed allocation graph.failed is set and each new
 * expression is zero; the caller checks it once at the end. Not RT-safe.
 */
#ifndef MODEL_SYMBOLIC_GRAPH_H
#define MODEL_SYMBOLIC_GRAPH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { GRAPH_LANES = 4 };

/* Reference to a node with a sign: node << 1 | negative. */
typedef uint32_t expr;

enum graph_op {
    GRAPH_CONST,  /* value[lane] */
    GRAPH_INPUT,  /* element index[lane] of argument array */
    GRAPH_ADD,    /* a + b */
    GRAPH_SUB,    /* a - b */
    GRAPH_MUL,    /* a * b */
    GRAPH_INVERT, /* 1 / a */
    GRAPH_SIN,    /* sin a */
    GRAPH_COS,    /* cos a */
    GRAPH_LANE,   /* lane index[0] of a, as one lane */
    GRAPH_PACK,   /* one-lane expressions operand[lane] side by side */
};

struct graph_node {
    enum graph_op op;
    int width;
    expr operand[GRAPH_LANES];
    int array;
    int index[GRAPH_LANES];
    double value[GRAPH_LANES];
    uint32_t next; /* next node in the hash bucket, 0 = end */
};

struct graph {
    struct graph_node *node;
    size_t count, capacity;
    uint32_t *bucket;
    size_t nbucket;
    bool failed;
};

/* Node 0 is the constant zero, of any width. */
#define EXPR_ZERO ((expr)0)

static inline uint32_t expr_node(expr e)
{
    return e >> 1;
}

static inline bool expr_negative(expr e)
{
    return e & 1;
}

static inline expr expr_neg(expr e)
{
    return e == EXPR_ZERO ? e : e ^ 1;
}

void graph_init(struct graph *graph);
void graph_fini(struct graph *graph);

const struct graph_node *graph_get(const struct graph *graph, expr e);
int graph_width(const struct graph *graph, expr e);

expr graph_const(struct graph *graph, double value);

/* Returns constants for `width` lanes; one lane if all are equal. */
expr graph_const_lanes(struct graph *graph, int width, const double *value);

/* Returns elements index[0..width-1] of the argument array with number array. */
expr graph_input(struct graph *graph, int array, int width, const int *index);

expr graph_add(struct graph *graph, expr a, expr b);
expr graph_mul(struct graph *graph, expr a, expr b);
expr graph_invert(struct graph *graph, expr a);
expr graph_sin(struct graph *graph, expr a);
expr graph_cos(struct graph *graph, expr a);

/* Returns one lane of a. */
expr graph_lane(struct graph *graph, expr a, int lane);

/* Packs `width` one-lane expressions; returns one lane if all are equal. */
expr graph_pack(struct graph *graph, int width, const expr *lane);

#endif
